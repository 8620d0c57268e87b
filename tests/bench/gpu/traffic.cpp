#include "traffic.h"

#include "core/scene/frame.h"

namespace cairn_bench {
namespace {

constexpr double kFloat = sizeof(float), kRow = 8 * sizeof(float), kIndex = sizeof(std::uint32_t);

// core/scene/settings.h: islands then have records, and sweeps keep the iterate before.
bool reduces(const cairn_params& params) { return params.acceleration != CAIRN_ACCELERATION_NONE || params.residual_tolerance > 0; }

} // namespace

double pointBytes(const cairn_params& params) {
    using namespace cairn;
    unsigned fields = kFriction + 1;                     // directions, arms, inverses, bias, gamma, friction
    if (params.friction_model != CAIRN_FRICTION_PYRAMID) // D_12 is the pyramid's
        --fields;
    fields += 3 + 3; // lambda: one buffer read, the other written
    if (reduces(params))
        fields += (kLambda - kDnn) + 3; // the majoriser's diagonal; the other buffer is read, too
    return kFloat * fields;
}

double jointBytes(const cairn_params& params) {
    using namespace cairn;
    unsigned fields = kBlock + 6 + 6; // up to the pivots; lambda as for points
    if (reduces(params))
        fields += 6;
    return kFloat * fields;
}

double sweepBytes(const Load& load, const cairn_params& params, bool device) {
    const double lanes = load.manifolds + load.joints;
    // bodies and slots of both sides; on a device also shape, first and stride, which the CPU knows of 16 lanes at once
    double lane = (4 + (device ? 3 : 0)) * kIndex;
    lane += 2 * kRow;          // both sides' slots are written, ...
    double side = kRow + kRow; // ... those that can move read again, and a velocity for each
    double body = 4 * kRow;    // velocity read and written, mass in two rows
    body += kIndex;            // where its slots begin
    if (params.splitting == CAIRN_SPLIT_MANIFOLD)
        side += 2 * kRow; // the mass (of contacts)
    if (reduces(params)) {
        lane += kIndex + 4 * kFloat; // restart and residual: where they go, written, read
        body += 2 * kRow;            // the iterate
        body += kIndex;              // its island
    }
    return load.points * pointBytes(params) + load.joints * jointBytes(params) + lanes * lane + load.movableSides * side +
           load.bodies * body;
}

} // namespace cairn_bench
