#include "params.h"

#include <limits>

namespace cairn {

Params preset(Method method, Preset preset) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const MethodRow& row = row_of(method);
    Params p{};
    p.method = method;
    p.iterations = 300;
    p.substeps = row.substeps ? 10 : 1;
    p.restitution_iterations = kSameAsSweeps;
    p.friction_model = Friction::cone;
    p.splitting = Splitting::point;
    p.restitution_threshold = 0.5;
    p.tolerance = method == Method::automatic ? 1e-3 : 0;
    if (preset == Preset::paper) {
        p.position_iterations = row.position_sweeps ? 300 : 0; // the paper gives no number; its times fit one to each sweep
        p.contact_baumgarte = p.joint_baumgarte = row.substeps ? 0.6 : 0.2;
        p.contact_hertz = p.joint_hertz = 300;
        p.contact_damping_ratio = p.joint_damping_ratio = 1;
        p.hertz_limit = infinity;
        p.static_hertz_scale = 1;
        p.max_push_speed = infinity;
        return p;
    }
    // Each value is where measuring led: stack-1m, chain-1m and overlap, 3000 frames; CHANGELOG.md has the figures.
    p.acceleration = Acceleration::nesterov;
    p.splitting = Splitting::manifold;
    p.position_iterations = row.position_sweeps ? 30 : 0;
    p.contact_warm_start = 1;
    p.joint_warm_start = 0; // unstable where the sweeps of a substep converge too little for the joint's stiffness
    p.relax_share = method == Method::pj ? 0.05 : row.position_sweeps ? 0 : 1.0 / 3;
    p.contact_baumgarte = row.substeps ? 0.02 : 0.2; // 12.5/s either way: faster, small boxes that land overlapping are thrown
    p.joint_baumgarte = 0.2;
    p.contact_hertz = 30;
    p.contact_damping_ratio = 5;
    p.joint_hertz = 1000; // as stiff as hertz_limit lets it be
    p.joint_damping_ratio = 5;
    p.hertz_limit = 2;
    p.static_hertz_scale = 2;
    p.max_push_speed = 3;
    p.contact_hertz_floor = 0.125; // 75 Hz in 10 substeps of 1/60 s; at 0.24 and 10 sweeps a wall of 1000 boxes shakes
    return p;
}

} // namespace cairn
