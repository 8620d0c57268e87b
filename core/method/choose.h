// Method `auto`: the schedule of an island, from what it is made of and nothing else, so that an island is solved alike whatever stands
// beside it.
#pragma once
#include "params.h"

#include <algorithm>
#include <cstdint>

namespace cairn {

// Why an island got its schedule; CAIRN_REASON_... of the public header.
enum class Reason : std::uint32_t { alone, contacts, uneven, joints, stiff, slender };
constexpr std::uint32_t kReasonCount = 6;

struct Features {
    std::uint32_t bodies = 0, contacts = 0, joints = 0, rows = 0; // rows: raw ones
    std::uint32_t height = 0;                                     // contacts from what cannot move to the farthest body
    double mass = 0, lightest = 0, heaviest = 0;                  // kg, in all and of its bodies that have a mass; 0: none has
    bool loop = false;                                            // its joints close a ring, over what cannot move as well
};

// A row a reason: what is the same for all islands of that kind.
struct Schedule {
    const char* why;
    Method method;
    std::uint32_t substeps;      // at most params.substeps
    std::uint32_t least, enough; // sweeps of a substep: not fewer; no more unless the island is violent. Half as many without bias
};
constexpr Schedule kSchedules[kReasonCount] = {
    {"no constraints: one substep, nothing to sweep", Method::pjsoft, 1, 1, 1},
    {"contacts between bodies of like mass: a few soft substeps", Method::tjsoft, 4, 6, 8},
    {"contacts between bodies of unlike mass: many soft substeps", Method::tjsoft, 10, 2, 4},
    {"a few joints between bodies of like mass: a few soft substeps", Method::tjsoft, 4, 1, 30},
    {"many joints, a ring of joints, or joints between bodies of unlike mass: many soft substeps", Method::tjsoft, 10, 8, 12},
    {"contacts in a tall and narrow heap: many soft substeps", Method::tjsoft, 10, 4, 6},
};

inline const Schedule& schedule_of(Reason reason) { return kSchedules[static_cast<std::uint32_t>(reason)]; }

constexpr double kUnlikeMass = 10;      // heaviest / lightest
constexpr std::uint32_t kFewJoints = 4; // raw rows count six to a joint
constexpr std::uint32_t kTall = 8;
// m/s. While a sweep changes the speeds by more (as in a chain pulled together from twice its length, and not in one that swings), more
// sweeps pay. Below, what `enough` sweeps leave is better spent on the next substep.
constexpr double kViolent = 1;

inline Reason reason_of(const Features& f) {
    const bool unlike = f.heaviest > kUnlikeMass * f.lightest;
    const std::uint32_t tied = f.joints + (f.rows + 5) / 6;
    if (tied > 0)
        return unlike || f.loop || tied > kFewJoints ? Reason::stiff : Reason::joints;
    if (f.contacts > 0) {
        // A column or a house of cards; a pyramid, a wall and a pile are wider.
        const bool slender = f.height > kTall && 2.0 * f.bodies < 1.0 * f.height * f.height;
        return unlike ? Reason::uneven : slender ? Reason::slender : Reason::contacts;
    }
    return Reason::alone;
}

// The parameters that an island of that kind is solved with.
inline Params params_of(Reason reason, const Params& given) {
    const Schedule& row = schedule_of(reason);
    Params p = given;
    p.method = row.method;
    p.substeps = std::min({row.substeps, given.substeps, given.iterations});
    p.position_iterations = 0;
    return p;
}

// An island stops where its residual r (sqrt(J), squared below) is under the tolerance times the square root of this: a sweep then
// changes the speeds of its n bodies by at most the tolerance, in root mean square, since sum m |dv|^2 <= dlambda' D dlambda = r^2.
// Bodies without mass, which only turn, count as 1 kg m^2.
inline double island_scale(const Features& f) { return f.bodies * (f.lightest > 0 ? f.lightest : 1.0); }
// And it is violent where r is above kViolent times the square root of this: the same mean with each body by its mass.
inline double violent_scale(const Features& f) { return f.mass > 0 ? f.mass : f.bodies; }

} // namespace cairn
