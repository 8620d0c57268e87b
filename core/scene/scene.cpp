#include "scene.h"

#include "../math/vec.h"

#include <cmath>
#include <numbers>

namespace cairn {

namespace {

using V = Vec3<double>;
using Q = Quat<double>;

V real3(const Column& column, std::size_t i, const V& absent = {0, 0, 0}) {
    if (!column.present())
        return absent;
    return {column.real(i, 0), column.real(i, 1), column.real(i, 2)};
}
Q quaternion(const Column& column, std::size_t i) {
    if (!column.present())
        return {0, 0, 0, 1};
    return normalized(Q{column.real(i, 0), column.real(i, 1), column.real(i, 2), column.real(i, 3)});
}
double real_or(const Column& column, std::size_t i, double absent) { return column.present() ? column.real(i) : absent; }
std::uint64_t key_of(const Column& column, std::size_t i) { return column.present() ? column.key(i) : 0; }

template <class S> void put3(S* to, std::size_t stride, const V& a) {
    to[0] = static_cast<S>(a.x);
    to[stride] = static_cast<S>(a.y);
    to[2 * stride] = static_cast<S>(a.z);
}
template <class S> V get3(const S* from, std::size_t stride) {
    return {static_cast<double>(from[0]), static_cast<double>(from[stride]), static_cast<double>(from[2 * stride])};
}

// Duff et al. 2017, "Building an orthonormal basis, revisited"
V perpendicular(const V& n) {
    const double sign = std::copysign(1.0, n.z), a = -1.0 / (sign + n.z), b = n.x * n.y * a;
    return {1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x};
}

} // namespace

template <class S>
Scene<S>::Scene(const Hooks& hooks)
    : constants_(hooks), velocity_(hooks), iterate_(hooks), displacement_(hooks), mass_(hooks), mass_cross_(hooks), slots_(hooks),
      contact_(hooks), contact_cold_(hooks), joint_(hooks), joint_cold_(hooks), raw_(hooks), lane_static_(hooks), partial_restart_(hooks),
      partial_residual_(hooks), lane_a_(hooks), lane_b_(hooks), slot_a_(hooks), slot_b_(hooks), lane_partial_(hooks), moving_(hooks),
      body_island_(hooks), slot_begin_(hooks), clamped_(hooks), island_begin_(hooks), island_bounces_(hooks), control_(hooks) {}

template <class S> void Scene<S>::pack_bodies(const Input& input, std::uint32_t substeps) {
    const BodyColumns& in = input.bodies;
    const std::size_t count = in.count;
    frame.body_count = static_cast<std::uint32_t>(count);
    constants_.resize(count);
    clamped_.resize_filled(count, 0);
    velocity_.resize_filled(8 * (count + 1), 0);
    iterate_.resize_filled(8 * (count + 1), 0);
    displacement_.resize_filled(8 * (count + 1), 0);
    mass_.resize_filled(8 * (count + 1), 0);
    mass_cross_.resize_filled(8 * (count + 1), 0);
    moving_.resize(count);
    displacement_[8 * count + 7] = 1;
    const V one{1, 1, 1};
    for (std::size_t i = 0; i < count; ++i) {
        BodyConstants<S>& body = constants_[i];
        const Q q = quaternion(in.orientation, i);
        const double inverse_mass = in.inverse_mass.real(i);
        const V inertia = real3(in.inverse_inertia, i), linear = real3(in.linear_factor, i, one),
                angular = real3(in.angular_factor, i, one);
        const V factored = times(times(linear, linear), V{inverse_mass, inverse_mass, inverse_mass});
        const std::uint32_t flags = in.flags.present() ? static_cast<std::uint32_t>(in.flags.integer(i)) : 0;
        body.orientation[0] = static_cast<S>(q.x);
        body.orientation[1] = static_cast<S>(q.y);
        body.orientation[2] = static_cast<S>(q.z);
        body.orientation[3] = static_cast<S>(q.w);
        put3(body.inverse_inertia, 1, inertia);
        put3(body.inverse_mass, 1, factored);
        put3(body.angular_factor, 1, angular);
        const V gravity =
            inverse_mass > 0 ? times(times(linear, linear), V{input.gravity[0], input.gravity[1], input.gravity[2]}) : V{0, 0, 0};
        put3(body.acceleration, 1, gravity + times(factored, real3(in.force, i)));
        put3(body.torque, 1, real3(in.torque, i));
        body.mass = static_cast<S>(inverse_mass > 0 ? 1 / inverse_mass : 0);
        const bool turns = (inertia.x > 0 || inertia.y > 0 || inertia.z > 0) && (angular.x != 0 || angular.y != 0 || angular.z != 0);
        body.movable = factored.x > 0 || factored.y > 0 || factored.z > 0 || turns;
        const bool full_turn = angular.x == 1 && angular.y == 1 && angular.z == 1;
        const bool even = inertia.x == inertia.y && inertia.y == inertia.z;
        body.gyroscopic = body.movable && full_turn && !even && inertia.x > 0 && inertia.y > 0 && inertia.z > 0 && !(flags & 1u);

        const V v = real3(in.linear_velocity, i), w = real3(in.angular_velocity, i);
        S* row = velocity_.data() + 8 * i;
        put3(row, 1, v);
        put3(row + 4, 1, w);
        S* mass = mass_.data() + 8 * i;
        if (body.movable)
            put3(mass, 1, factored);
        S* displacement = displacement_.data() + 8 * i;
        displacement[7] = 1;
        if (!body.movable && (flags & 2u)) { // it stands where the step ends: at the start it was not there yet
            put3(displacement, 1, v * -input.dt);
            const double speed = std::sqrt(dot(w, w)),
                         angle = std::min(speed * input.dt, substeps * std::numbers::pi / 4); // as far as it will turn
            put3(displacement + 4, 1, w * (speed > 0 ? -std::sin(0.5 * angle) / speed : 0));
            displacement[7] = static_cast<S>(std::cos(0.5 * angle));
        }
    }
    std::uint32_t moving = 0;
    for (std::uint32_t i = 0; i < frame.body_count; ++i)
        if (constants_[i].movable)
            moving_[moving++] = i;
    frame.movable_count = moving;
    for (std::uint32_t i = 0; i < frame.body_count; ++i) {
        const S* v = velocity_.data() + 8 * std::size_t{i};
        const bool still = v[0] == 0 && v[1] == 0 && v[2] == 0 && v[4] == 0 && v[5] == 0 && v[6] == 0;
        if (!constants_[i].movable && !still)
            moving_[moving++] = i;
    }
    frame.moving_count = moving;
}

template <class S>
void Scene<S>::pack_contact(const Input& input, std::size_t i, S* hot, S* cold, const Params& params, const WarmStartCache& cache) {
    const ContactColumns& in = input.contacts;
    const auto field = [](S* base, std::uint32_t f) { return base + std::size_t{f} * kGroup; };
    const V n = normalized(real3(in.normal, i)), arm_a = real3(in.arm_a, i), arm_b = real3(in.arm_b, i);
    const double separation = in.separation.real(i);
    const double friction = params.friction_model == Friction::none ? 0 : std::min(real_or(in.friction, i, 0), 1e30);
    const V wish = real3(in.tangent, i), flat = wish - n * dot(wish, n);
    const bool chosen = dot(flat, flat) > 1e-12 * dot(wish, wish) && dot(wish, wish) > 0;
    const V t1 = chosen ? normalized(flat) : perpendicular(n), t2 = cross(n, t1);
    put3(field(hot, kNormal), kGroup, n);
    put3(field(hot, kTangent1), kGroup, t1);
    put3(field(hot, kTangent2), kGroup, t2);
    // the common point, half way between the surfaces
    put3(field(hot, kArmA), kGroup, arm_a + n * (0.5 * separation));
    put3(field(hot, kArmB), kGroup, arm_b - n * (0.5 * separation));
    *field(hot, kFriction) = static_cast<S>(friction);
    *field(cold, kSeparation) = static_cast<S>(separation);
    put3(field(cold, kAnchorA), kGroup, arm_a);
    put3(field(cold, kAnchorB), kGroup, arm_b);
    const std::uint32_t flags = in.flags.present() ? static_cast<std::uint32_t>(in.flags.integer(i)) : 0;
    *field(cold, kTurnsA) = flags & 1u ? S(0) : S(1);
    *field(cold, kTurnsB) = flags & 2u ? S(0) : S(1);
    const double restitution = real_or(in.restitution, i, 0);
    *field(cold, kRestitution) = static_cast<S>(restitution);
    bounces = bounces || restitution > 0;
    const double h = static_cast<double>(frame.h);
    if (const double* last = params.contact_warm_start > 0 ? cache.contacts.find(key_of(in.key, i)) : nullptr) {
        const V tangential{last[1], last[2], last[3]};
        put3(field(hot, kLambda), kGroup, V{last[0] * h, dot(tangential, t1) * h, dot(tangential, t2) * h});
        ++warm_started;
    }
}

template <class S> void Scene<S>::pack_joint(const Input& input, std::size_t i, S* hot, S* cold, const WarmStartCache& cache) {
    const JointColumns& in = input.joints;
    const auto field = [](S* base, std::size_t f) { return base + f * kGroup; };
    struct Side {
        V position, arm;
        Q frame;
    };
    const auto side = [&](const Column& body, const Column& anchor, const Column& frame_column) {
        const std::int64_t b = body.integer(i);
        const V local = real3(anchor, i);
        const Q frame_q = quaternion(frame_column, i);
        if (b < 0)
            return Side{{0, 0, 0}, local, frame_q};
        const Q q = quaternion(input.bodies.orientation, static_cast<std::size_t>(b));
        return Side{real3(input.bodies.position, static_cast<std::size_t>(b)), rotate(q, local), normalized(q * frame_q)};
    };
    const Side a = side(in.body_a, in.anchor_a, in.frame_a), b = side(in.body_b, in.anchor_b, in.frame_b);
    const V gap = (b.position - a.position) + (b.arm - a.arm); // in double: small also far from the origin
    // The world's arm only serves to turn, which the world does not: zero keeps float exact far out.
    put3(field(cold, kStartArmA), kGroup, in.body_a.integer(i) < 0 ? V{0, 0, 0} : a.arm);
    put3(field(cold, kStartArmB), kGroup, in.body_b.integer(i) < 0 ? V{0, 0, 0} : b.arm);
    put3(field(cold, kStartGap), kGroup, gap);
    const auto put4 = [&](std::size_t f, const Q& q) {
        put3(field(cold, f), kGroup, vec(q));
        *field(cold, f + 3) = static_cast<S>(q.w);
    };
    put4(kStartFrameA, a.frame);
    put4(kStartFrameB, b.frame);
    for (std::size_t axis = 0; axis < 6; ++axis) {
        const std::uint32_t given = static_cast<std::uint32_t>(in.axes.integer(i, axis)), flags = axis_flags(input, i, axis);
        constexpr double huge = 1e30; // stands for infinity: 0 * infinity would be NaN
        const double low = given & 2u ? std::max(in.lower.real(i, axis), -huge) : 0;
        const double high = given & 2u ? std::min(in.upper.real(i, axis), huge) : 0;
        *field(cold, kIsLocked + axis) = flags & 1u ? S(1) : S(0);
        *field(cold, kIsLimited + axis) = flags & 2u ? S(1) : S(0);
        *field(cold, kIsDriven + axis) = flags & 4u ? S(1) : S(0);
        *field(cold, kLowerLimit + axis) = static_cast<S>(low);
        *field(cold, kUpperLimit + axis) = static_cast<S>(high);
        *field(cold, kSpeed + axis) = static_cast<S>(flags & 4u ? in.motor_speed.real(i, axis) : 0);
        *field(cold, kForce + axis) = static_cast<S>(flags & 4u ? std::min(in.motor_force.real(i, axis), 1e30) : 0);
    }
    if (const double* last = cache.joints.find(key_of(in.key, i))) {
        const double h = static_cast<double>(frame.h);
        for (std::size_t k = 0; k < 12; ++k)
            *field(hot, kJointLambda + k) = static_cast<S>(last[k] * h);
        ++warm_started;
    }
}

template <class S> void Scene<S>::pack_row(const Input& input, const Block& block, std::uint32_t r, S* hot, const WarmStartCache& cache) {
    const RowColumns& in = input.rows;
    const std::size_t i = block.first + r;
    const auto field = [&](std::uint32_t f) { return hot + std::size_t{f} * kGroup; };
    for (std::uint32_t c = 0; c < 6; ++c) {
        *field(kJacobianA + c) = static_cast<S>(in.jacobian_a.real(i, c));
        *field(kJacobianB + c) = static_cast<S>(in.jacobian_b.real(i, c));
    }
    constexpr double huge = 1e30; // stands for infinity: 0 * infinity would be NaN
    *field(kRhs) = static_cast<S>(real_or(in.rhs, i, 0));
    *field(kRawLow) = static_cast<S>(std::max(real_or(in.lower, i, -huge), -huge));
    *field(kRawHigh) = static_cast<S>(std::min(real_or(in.upper, i, huge), huge));
    *field(kRawGamma) = static_cast<S>(real_or(in.compliance, i, 0));
    *field(kRawFriction) = static_cast<S>(std::min(real_or(in.friction, i, 0), huge));
    const auto source_of = [&](std::size_t row) -> std::int64_t {
        return in.friction_index.present() ? in.friction_index.integer(row) : -1;
    };
    const std::int64_t source = source_of(i);
    *field(kFrictionSource) = static_cast<S>(source < 0 ? -1 : source - static_cast<std::int64_t>(block.first));
    // two adjacent rows with one source share a disc
    const auto pairs_with_next = [&](std::size_t row, std::uint32_t place) {
        return source_of(row) >= 0 && place + 1 < block.count && source_of(row + 1) == source_of(row);
    };
    bool first = false, second = false;
    for (std::uint32_t p = 0; p <= r; ++p) {
        second = first;
        first = !second && pairs_with_next(block.first + p, p);
    }
    *field(kPairFirst) = first ? S(1) : S(0);
    *field(kPairSecond) = second ? S(1) : S(0);
    if (const double* last = cache.rows.find(key_of(in.key, i))) {
        *field(kRawLambda) = static_cast<S>(*last * static_cast<double>(frame.h));
        ++warm_started;
    }
}

template <class S> void Scene<S>::pack(const Input& input, const Params& params, const WarmStartCache& cache) {
    warm_started = 0;
    bounces = false;
    frame.dt = static_cast<S>(input.dt);
    frame.h = static_cast<S>(input.dt / params.substeps);
    frame.current = 0;
    pack_bodies(input, params.substeps);
    find_blocks(input, params);
    find_islands();
    lay_out(input, params);
    assign_slots();

    const auto room = [](const std::vector<Group>& groups, std::size_t fields, std::size_t cold_fields) {
        if (groups.empty())
            return std::pair<std::size_t, std::size_t>{0, 0};
        const Group& last = groups.back();
        return std::pair{last.offset + last.count * fields * kGroup, last.cold_offset + last.count * cold_fields * kGroup};
    };
    const auto [contact_size, contact_cold_size] = room(contact_groups_, kContactFields, kContactColdFields);
    const auto [joint_size, joint_cold_size] = room(joint_groups_, kJointFields, kJointColdFields);
    contact_.resize_filled(contact_size, 0);
    contact_cold_.resize_filled(contact_cold_size, 0);
    joint_.resize_filled(joint_size, 0);
    joint_cold_.resize_filled(joint_cold_size, 0);
    for (const Group& group : joint_groups_) // idle lanes have unit quaternions, too
        for (std::uint32_t lane = 0; lane < kGroup; ++lane)
            for (const std::uint32_t frame_w : {kStartFrameA + 3, kStartFrameB + 3})
                joint_cold_[group.cold_offset + frame_w * kGroup + lane] = 1;
    raw_.resize_filled(room(raw_groups_, kRawFields, 0).first, 0);

    for (const Block& block : contact_blocks_)
        for (std::uint32_t p = 0; p < block.count; ++p)
            pack_contact(
                input, block.first + p, contact_.data() + hot_at(contact_groups_, block.lane) + std::size_t{p} * kContactFields * kGroup,
                contact_cold_.data() + cold_at(contact_groups_, block.lane) + std::size_t{p} * kContactColdFields * kGroup, params, cache);
    const std::uint32_t joint_lanes = frame.contact_groups * kGroup, raw_lanes = joint_lanes + frame.joint_groups * kGroup;
    const WarmStartCache cold_start;
    const WarmStartCache& warm = params.joint_warm_start > 0 ? cache : cold_start;
    for (const Block& block : joint_blocks_)
        pack_joint(input, block.first, joint_.data() + hot_at(joint_groups_, block.lane - joint_lanes),
                   joint_cold_.data() + cold_at(joint_groups_, block.lane - joint_lanes), warm);
    for (const Block& block : raw_blocks_)
        for (std::uint32_t r = 0; r < block.count; ++r)
            pack_row(input, block, r, raw_.data() + hot_at(raw_groups_, block.lane - raw_lanes) + std::size_t{r} * kRawFields * kGroup,
                     warm);

    control_.resize_filled(frame.island_count, Control<S>{});
    island_bounces_.resize_filled(frame.island_count, 0);

    frame.velocity = velocity_.data();
    frame.iterate = iterate_.data();
    frame.displacement = displacement_.data();
    frame.mass = mass_.data();
    frame.mass_cross = mass_cross_.data();
    frame.body = constants_.data();
    frame.moving = moving_.data();
    frame.body_island = body_island_.data();
    frame.slot_begin = slot_begin_.data();
    frame.slots = slots_.data();
    frame.rotation_clamped = clamped_.data();
    frame.contact_group = contact_groups_.data();
    frame.joint_group = joint_groups_.data();
    frame.raw_group = raw_groups_.data();
    frame.contact = contact_.data();
    frame.contact_cold = contact_cold_.data();
    frame.joint = joint_.data();
    frame.joint_cold = joint_cold_.data();
    frame.raw = raw_.data();
    frame.lane_a = lane_a_.data();
    frame.lane_b = lane_b_.data();
    frame.slot_a = slot_a_.data();
    frame.slot_b = slot_b_.data();
    frame.lane_partial = lane_partial_.data();
    frame.lane_static = lane_static_.data();
    frame.partial_restart = partial_restart_.data();
    frame.partial_residual = partial_residual_.data();
    frame.island_begin = island_begin_.data();
    frame.island_bounces = island_bounces_.data();
    frame.control = control_.data();

    const bool momentum = params.acceleration == Acceleration::nesterov;
    const double pi2 = 2 * std::numbers::pi, limit = params.hertz_limit / (input.dt / params.substeps);
    const auto omega = [&](double hertz) { return static_cast<S>(pi2 * std::min(hertz, limit)); };
    const MethodRow& method = row_of(params.method);
    frame.warm = params.contact_warm_start > 0 || params.joint_warm_start > 0;
    frame.momentum = momentum;
    frame.reduces = momentum || params.residual_trace || params.residual_tolerance > 0;
    frame.last_sweep = false;
    frame.phase = Phase::substep;
    frame.manifold_blocks = params.splitting == Splitting::manifold;
    frame.pyramid = params.friction_model == Friction::pyramid;
    frame.soft = method.bias == Bias::soft;
    frame.unbiased = method.bias == Bias::none;
    frame.contact_warm = static_cast<S>(params.contact_warm_start);
    frame.joint_warm = static_cast<S>(params.joint_warm_start);
    frame.contact_baumgarte = static_cast<S>(params.contact_baumgarte);
    frame.joint_baumgarte = static_cast<S>(params.joint_baumgarte);
    frame.contact_omega = omega(params.contact_hertz);
    frame.contact_omega_static = omega(params.contact_hertz * params.static_hertz_scale);
    frame.contact_zeta = static_cast<S>(params.contact_damping_ratio);
    frame.joint_omega = omega(params.joint_hertz);
    frame.joint_zeta = static_cast<S>(params.joint_damping_ratio);
    frame.push_speed = static_cast<S>(std::min(params.max_push_speed, 1e30));
    frame.restitution_threshold = static_cast<S>(params.restitution_threshold);
    frame.tolerance = static_cast<S>(params.residual_tolerance);
}

template <class S> std::string Scene<S>::not_finite() const {
    for (std::uint32_t i = 0; i < frame.body_count; ++i) {
        if (!constants_[i].movable)
            continue;
        S sum = 0; // of differences: 0 unless one is infinite or not a number
        for (std::size_t c = 0; c < 8; ++c) {
            const S v = velocity_[8 * std::size_t{i} + c], d = displacement_[8 * std::size_t{i} + c];
            sum += (v - v) + (d - d);
        }
        if (!(sum == 0))
            return "body " + std::to_string(i) + " is no longer finite";
    }
    return {};
}

template <class S> void Scene<S>::write(const Input& input, const Output& output) const {
    const auto put = [](const MutableColumn& column, std::size_t i, const V& a, std::size_t at = 0) {
        column.set(i, at, a.x);
        column.set(i, at + 1, a.y);
        column.set(i, at + 2, a.z);
    };
    for (std::uint32_t i = 0; i < frame.body_count; ++i) {
        if (!constants_[i].movable)
            continue;
        const S* v = velocity_.data() + 8 * std::size_t{i};
        const S* d = displacement_.data() + 8 * std::size_t{i};
        if (output.linear_velocity.present())
            put(output.linear_velocity, i, get3(v, 1));
        if (output.angular_velocity.present())
            put(output.angular_velocity, i, get3(v + 4, 1));
        if (output.position.present())
            put(output.position, i, real3(input.bodies.position, i) + get3(d, 1));
        if (output.orientation.present()) {
            const V turn = get3(d + 4, 1);
            const Q q = normalized(Q{turn.x, turn.y, turn.z, static_cast<double>(d[7])} * quaternion(input.bodies.orientation, i));
            put(output.orientation, i, vec(q));
            output.orientation.set(i, 3, q.w);
        }
    }
    // elements without effect get zeros
    for (std::size_t i = 0; i < input.contacts.count; ++i) {
        if (output.contact_impulse.present())
            output.contact_impulse.set(i, 0, 0);
        if (output.friction_impulse.present())
            put(output.friction_impulse, i, {0, 0, 0});
    }
    for (const Block& block : contact_blocks_)
        for (std::uint32_t p = 0; p < block.count; ++p) {
            const S* hot = contact_.data() + hot_at(contact_groups_, block.lane) + std::size_t{p} * kContactFields * kGroup;
            const V total =
                get3(contact_cold_.data() + cold_at(contact_groups_, block.lane) + (std::size_t{p} * kContactColdFields + kTotal) * kGroup,
                     kGroup);
            if (output.contact_impulse.present())
                output.contact_impulse.set(block.first + p, 0, total.x);
            if (output.friction_impulse.present())
                put(output.friction_impulse, block.first + p,
                    get3(hot + kTangent1 * kGroup, kGroup) * total.y + get3(hot + kTangent2 * kGroup, kGroup) * total.z);
        }
    const std::uint32_t joint_lanes = frame.contact_groups * kGroup, raw_lanes = joint_lanes + frame.joint_groups * kGroup;
    if (output.joint_impulse.present()) {
        for (std::size_t i = 0; i < input.joints.count; ++i)
            for (std::size_t c = 0; c < 6; ++c)
                output.joint_impulse.set(i, c, 0);
        for (const Block& block : joint_blocks_) {
            const S* total = joint_cold_.data() + cold_at(joint_groups_, block.lane - joint_lanes) + kJointTotal * kGroup;
            for (std::size_t c = 0; c < 6; ++c)
                output.joint_impulse.set(block.first, c,
                                         static_cast<double>(total[c * kGroup]) + static_cast<double>(total[(c + 6) * kGroup]));
        }
    }
    if (output.row_impulse.present()) {
        for (std::size_t i = 0; i < input.rows.count; ++i)
            output.row_impulse.set(i, 0, 0);
        for (const Block& block : raw_blocks_)
            for (std::uint32_t r = 0; r < block.count; ++r)
                output.row_impulse.set(
                    block.first + r, 0,
                    static_cast<double>(
                        raw_[hot_at(raw_groups_, block.lane - raw_lanes) + (std::size_t{r} * kRawFields + kRawTotal) * kGroup]));
    }
}

template <class S> void Scene<S>::remember(const Input& input, WarmStartCache& cache) const {
    const double per_h = 1 / static_cast<double>(frame.h);
    cache.clear();
    if (input.contacts.key.present())
        for (const Block& block : contact_blocks_)
            for (std::uint32_t p = 0; p < block.count; ++p) {
                const S* hot = contact_.data() + hot_at(contact_groups_, block.lane) + std::size_t{p} * kContactFields * kGroup;
                const V lambda = get3(hot + (kLambda + 3 * frame.current) * kGroup, kGroup);
                const V friction = get3(hot + kTangent1 * kGroup, kGroup) * lambda.y + get3(hot + kTangent2 * kGroup, kGroup) * lambda.z;
                const double values[4] = {lambda.x * per_h, friction.x * per_h, friction.y * per_h, friction.z * per_h};
                cache.contacts.insert(input.contacts.key.key(block.first + p), values);
            }
    const std::uint32_t joint_lanes = frame.contact_groups * kGroup, raw_lanes = joint_lanes + frame.joint_groups * kGroup;
    if (input.joints.key.present())
        for (const Block& block : joint_blocks_) {
            const S* lambda =
                joint_.data() + hot_at(joint_groups_, block.lane - joint_lanes) + (kJointLambda + 12 * frame.current) * kGroup;
            double values[12];
            for (std::size_t c = 0; c < 12; ++c)
                values[c] = static_cast<double>(lambda[c * kGroup]) * per_h;
            cache.joints.insert(input.joints.key.key(block.first), values);
        }
    if (input.rows.key.present())
        for (const Block& block : raw_blocks_)
            for (std::uint32_t r = 0; r < block.count; ++r) {
                const std::size_t at =
                    hot_at(raw_groups_, block.lane - raw_lanes) + (std::size_t{r} * kRawFields + kRawLambda + frame.current) * kGroup;
                const double value = static_cast<double>(raw_[at]) * per_h;
                cache.rows.insert(input.rows.key.key(block.first + r), &value);
            }
    cache.contacts.index();
    cache.joints.index();
    cache.rows.index();
}

// 1/2 m v^2 + 1/2 w . I w, in the body's axes
template <class S> double Scene<S>::kinetic_energy(std::uint32_t i) const {
    const BodyConstants<S>& body = constants_[i];
    const S* row = velocity_.data() + 8 * std::size_t{i};
    const S* d = displacement_.data() + 8 * std::size_t{i};
    const V v = get3(row, 1), w = get3(row + 4, 1), turn = get3(d + 4, 1), q = get3(body.orientation, 1);
    const Axes<double> r =
        axes_of(Q{turn.x, turn.y, turn.z, static_cast<double>(d[7])} * Q{q.x, q.y, q.z, static_cast<double>(body.orientation[3])});
    const auto about = [&](const V& axis, S inverse) {
        const double spin = dot(axis, w);
        return inverse > 0 ? spin * spin / static_cast<double>(inverse) : 0.0;
    };
    return 0.5 * (static_cast<double>(body.mass) * dot(v, v) +
                  (about(r.x, body.inverse_inertia[0]) + about(r.y, body.inverse_inertia[1]) + about(r.z, body.inverse_inertia[2])));
}

template class Scene<float>;
template class Scene<double>;

} // namespace cairn
