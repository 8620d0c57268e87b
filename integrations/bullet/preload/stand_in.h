// Between libcairn_bullet_preload.so, which knows no Bullet, and its two halves, each compiled with Bullet's headers in one
// precision: libcairn_bullet_float.so and libcairn_bullet_double.so. All three are of one build. Bullet's objects pass as void*.
#pragma once
#include <algorithm>
#include <cstdint>

namespace cairn {
namespace preload {

// What a call has solved. A half adds to it; the caller has zeroed it.
struct Record {
    uint64_t solves; // calls to libcairn
    uint64_t failures;
    uint64_t bodies, contacts, joints, rows; // of those solves
    uint32_t method, iterations, substeps;   // of the last solve
    double residual;                         // of its last sweep, sqrt(J); 0 unless asked for
    double deepest;                          // m: penetration, and
    double widest;                           // m: gap of a ball or hinge joint, both as the last step left them
};

inline void add(Record& to, const Record& more) {
    to.solves += more.solves;
    to.failures += more.failures;
    to.bodies += more.bodies;
    to.contacts += more.contacts;
    to.joints += more.joints;
    to.rows += more.rows;
    if (more.solves > 0) {
        to.method = more.method;
        to.iterations = more.iterations;
        to.substeps = more.substeps;
    }
    to.residual = std::max(to.residual, more.residual);
    to.deepest = std::max(to.deepest, more.deepest);
    to.widest = std::max(to.widest, more.widest);
}

struct Group {
    void** bodies;
    int bodyCount;
    void** manifolds;
    int manifoldCount;
    void** constraints;
    int constraintCount;
    const void* info;
    void* drawer;
    void* dispatcher;
};

struct StandIn {
    // A solver with the settings of the environment (settings.h). NULL: `why` says why not, and lives for ever.
    void* (*create)(const char** why);
    void (*destroy)(void* solver);
    void (*solve)(void* solver, const Group& group, Record& record);
    void (*reset)(void* solver);
    // `deepest` and `widest` of a group, whoever solves it.
    void (*measure)(const Group& group, Record& record);
};

constexpr const char* kStandInSymbol = "cairn_bullet_stand_in";
using StandInFunction = const StandIn* (*)();

} // namespace preload
} // namespace cairn
