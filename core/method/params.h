// The parameters of a step, and the table of the paper's five methods (section 3.6, Figure 2), with the one that chooses (choose.h).
#pragma once
#include <cstdint>

namespace cairn {

enum class Method : std::uint32_t { pj, pjnj, pjsoft, tj, tjsoft, automatic };
enum class Preset : std::uint32_t { best, paper };
enum class Splitting : std::uint32_t { point, manifold };
enum class Friction : std::uint32_t { none, cone, pyramid };
enum class Acceleration : std::uint32_t { none, nesterov };
// Where the position error of a velocity sweep goes.
enum class Bias : std::uint32_t { baumgarte, none, soft };

constexpr std::uint32_t kSameAsSweeps = 0xffffffffu;
constexpr std::uint32_t kMethodCount = 6;

struct MethodRow {
    const char* name;
    bool substeps; // may a step have several
    Bias bias;
    bool position_sweeps;
};

constexpr MethodRow kMethods[kMethodCount] = {
    {"pj", false, Bias::baumgarte, false}, {"pjnj", false, Bias::none, true},   {"pjsoft", false, Bias::soft, false},
    {"tj", true, Bias::baumgarte, false},  {"tjsoft", true, Bias::soft, false}, {"auto", true, Bias::soft, false},
};
constexpr const MethodRow& row_of(Method method) { return kMethods[static_cast<std::uint32_t>(method)]; }

// Field by field cairn_params, whose comments say what each means.
struct Params {
    Method method;
    std::uint32_t iterations, substeps, position_iterations, restitution_iterations;
    Splitting splitting;
    Friction friction_model;
    Acceleration acceleration;
    bool residual_trace;
    double contact_warm_start, joint_warm_start, relax_share;
    double contact_baumgarte, joint_baumgarte;
    double contact_hertz, contact_damping_ratio, joint_hertz, joint_damping_ratio, hertz_limit, static_hertz_scale;
    double max_push_speed, restitution_threshold, residual_tolerance, contact_hertz_floor, tolerance;
};

Params preset(Method method, Preset preset);

} // namespace cairn
