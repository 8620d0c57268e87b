// A step's parameters as the stages see them, for every executor.
#pragma once
#include "../method/params.h"
#include "frame.h"

#include <algorithm>
#include <numbers>

namespace cairn {

template <class S> void set_parameters(Frame<S>& frame, const Params& params, double dt) {
    const double pi2 = 2 * std::numbers::pi, limit = params.hertz_limit / (dt / params.substeps);
    const auto omega = [&](double hertz) { return static_cast<S>(pi2 * std::min(hertz, limit)); };
    const MethodRow& method = row_of(params.method);
    frame.current = 0;
    frame.sweep = 0;
    frame.phase = Phase::substep;
    frame.momentum = params.acceleration == Acceleration::nesterov;
    frame.reduces = frame.momentum || params.residual_trace || params.residual_tolerance > 0;
    frame.last_sweep = frame.too_few = frame.enough = false;
    frame.dt = static_cast<S>(dt);
    frame.h = static_cast<S>(dt / params.substeps);
    frame.warm = params.contact_warm_start > 0 || params.joint_warm_start > 0;
    frame.manifold_blocks = params.splitting == Splitting::manifold;
    frame.pyramid = params.friction_model == Friction::pyramid;
    frame.soft = method.bias == Bias::soft;
    frame.unbiased = method.bias == Bias::none;
    frame.contact_warm = static_cast<S>(params.contact_warm_start);
    frame.joint_warm = static_cast<S>(params.joint_warm_start);
    frame.contact_baumgarte = static_cast<S>(params.contact_baumgarte);
    frame.joint_baumgarte = static_cast<S>(params.joint_baumgarte);
    const double stiffer = std::max(params.contact_hertz_floor / (dt / params.substeps) / params.contact_hertz, 1.0);
    frame.contact_omega = omega(params.contact_hertz * stiffer);
    frame.contact_omega_static = omega(params.contact_hertz * stiffer * params.static_hertz_scale);
    frame.contact_zeta = static_cast<S>(params.contact_damping_ratio * stiffer);
    frame.joint_omega = omega(params.joint_hertz);
    frame.joint_zeta = static_cast<S>(params.joint_damping_ratio);
    frame.push_speed = static_cast<S>(std::min(params.max_push_speed, 1e30));
    frame.restitution_threshold = static_cast<S>(params.restitution_threshold);
    frame.tolerance = static_cast<S>(params.residual_tolerance);
}

} // namespace cairn
