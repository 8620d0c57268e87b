#include "traffic.h"

#include "core/scene/traffic.h"

namespace cairn_bench {
namespace {

cairn::ContactKind kindOf(const cairn_params& params) {
    return params.friction_model == CAIRN_FRICTION_NONE ? cairn::ContactKind::smooth : cairn::ContactKind::frictional;
}

cairn::Traffic trafficOf(const cairn_params& params) {
    cairn::Traffic traffic;
    traffic.pyramid = params.friction_model == CAIRN_FRICTION_PYRAMID;
    traffic.manifold_blocks = params.splitting == CAIRN_SPLIT_MANIFOLD;
    // core/scene/settings.h
    traffic.reduces = params.acceleration != CAIRN_ACCELERATION_NONE || params.residual_tolerance > 0;
    return traffic;
}

} // namespace

double pointBytes(const cairn_params& params) {
    const cairn::Traffic traffic = trafficOf(params);
    return sizeof(float) * cairn::point_numbers(kindOf(params), traffic.pyramid, traffic.reduces);
}

double jointBytes(const cairn_params& params) { return sizeof(float) * cairn::joint_numbers(trafficOf(params).reduces); }

double sweepBytes(const Load& load, const cairn_params& params, bool device) {
    cairn::Traffic traffic = trafficOf(params);
    traffic.points[static_cast<unsigned>(kindOf(params))] = load.points;
    traffic.manifolds = load.manifolds;
    traffic.joints = load.joints;
    traffic.bodies = load.bodies;
    traffic.movable_sides = load.movableSides;
    return cairn::sweep_bytes(traffic, device);
}

} // namespace cairn_bench
