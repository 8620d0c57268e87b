// The formulas of a row are the solver's own, in double: geometry, errors and masses come from rows/ over a packed scene that is
// never swept. What is judged, and how, stands in cairn.h beside cairn_evaluation.
#define CAIRN_ISA evaluation // a namespace of its own for the inline functions (math/lane.h)
#define CAIRN_LANES 1
#define CAIRN_REAL double
#include "evaluate.h"

#include "rows/contact.h"
#include "rows/joint.h"
#include "rows/raw.h"
#include "scene/pack.h"
#include "scene/scene.h"
#include "solver.h"
#include "stages/bodies.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace cairn {

namespace {

constexpr DVec kZero{0, 0, 0};

double length(const DVec& a) { return root(dot(a, a)); }

// The rotation vector of q, the shorter way round.
DVec rotation_vector(const DQuat& q) {
    const double sign = q.w < 0 ? -1 : 1, sine = length(vec(q));
    return vec(q) * (sine > 0 ? 2 * sign * atan2_lane(sine, q.w * sign) / sine : 2);
}

// Rows of eight numbers a body, as in frame.h; the last is the world's.
using Rows8 = std::vector<double>;
double* row_of(Rows8& rows, std::size_t body) { return rows.data() + 8 * body; }

// The point of the cone |y_t| <= mu y_n that is nearest to y.
DVec on_cone(const DVec& y, double mu) {
    const double tangential = root(y.y * y.y + y.z * y.z);
    if (tangential <= mu * y.x)
        return y;
    if (mu * tangential <= -y.x)
        return kZero;
    const double normal = (y.x + mu * tangential) / (1 + mu * mu), along = mu * normal / tangential;
    return {normal, y.y * along, y.z * along};
}

// What a row's value at the step's end lacks of its law, as a speed: from the nearest value between low and high.
double speed_beyond(double value, double low, double high, double h) { return (value - clamp(value, low, high)) / h; }

// A quantity of which the worst element counts, and the field with that element's index.
struct Worst {
    double cairn_evaluation::*value;
    std::int32_t cairn_evaluation::*index;
};
using E = cairn_evaluation;
constexpr Worst kPenetration{&E::penetration, &E::penetration_contact}, kContactResidual{&E::contact_residual, &E::residual_contact};
constexpr Worst kGap{&E::joint_gap, &E::gap_joint}, kAngle{&E::joint_angle, &E::angle_joint};
constexpr Worst kJointResidual{&E::joint_residual, &E::residual_joint},
    kAngularResidual{&E::joint_angular_residual, &E::angular_residual_joint};
constexpr Worst kRowResidual{&E::row_residual, &E::residual_row};
constexpr Worst kMomentum{&E::momentum, &E::momentum_body}, kAngularMomentum{&E::angular_momentum, &E::angular_momentum_body};
constexpr std::array kWorst = {kPenetration,     kContactResidual, kGap,      kAngle,          kJointResidual,
                               kAngularResidual, kRowResidual,     kMomentum, kAngularMomentum};

// Sums of an island, or of all.
struct Tally {
    cairn_evaluation e{};
    double depth = 0, gap = 0, angle = 0; // of all contacts and joints
    double error = 0, impulse = 0;        // |r|^2 / D; D |lambda|^2 and h^2 |M^-1 external force|^2 in the metric of M
    DVec momentum = kZero, moment = kZero, mass_moment = kZero;
    double mass = 0;

    Tally() {
        for (const Worst& worst : kWorst)
            e.*worst.index = -1;
    }
};

class Evaluator {
  public:
    Evaluator(const Input& input, const Outcome& outcome) : in_(input), out_(outcome), scene_(Hooks{}) {
        Params params = preset(Method::tj, Preset::best);
        params.iterations = params.substeps = 1000; // as many as there can be: kinematic bodies then turn freely
        params.friction_model = Friction::cone;
        params.residual_trace = false;
        params.contact_warm_start = params.joint_warm_start = 0;
        scene_.pack(input, params, WarmStartCache{});
        islands_.resize(scene_.frame.island_count);
    }

    Evaluated run() {
        move_bodies();
        for (const Block& block : scene_.contact_blocks())
            for (std::uint32_t p = 0; p < block.count; ++p)
                judge_contact(block, p);
        for (const Block& block : scene_.joint_blocks())
            joint_starts_.push_back(joint_at(block));
        for (const Block& block : scene_.raw_blocks())
            judge_rows(block);
        // The poses at the end; the masses stay the start's.
        std::copy(end_.begin(), end_.end(), scene_.frame.displacement);
        for (const Block& block : scene_.contact_blocks())
            for (std::uint32_t p = 0; p < block.count; ++p)
                measure_depth(block, p);
        std::size_t joint = 0;
        for (const Block& block : scene_.joint_blocks())
            judge_joint(block, joint_starts_[joint++]);
        for (std::uint32_t b = 0; b < scene_.frame.body_count; ++b)
            if (scene_.frame.body[b].movable)
                judge_body(b);
        return finish();
    }

  private:
    const Frame<double>& frame() const { return scene_.frame; }

    // Mean twists, poses at the end, masses and energies at the start.
    void move_bodies() {
        const std::size_t count = frame().body_count;
        const double h = in_.dt;
        twist_.assign(8 * (count + 1), 0);
        end_.assign(frame().displacement, frame().displacement + 8 * (count + 1));
        energy_.assign(count, 0);
        push_.assign(count, kZero);
        turn_.assign(count, kZero);
        for (std::uint32_t b = 0; b < count; ++b) {
            double *twist = row_of(twist_, b), *end = row_of(end_, b);
            if (frame().body[b].movable) {
                refresh_inertia(frame(), b);
                energy_[b] = kinetic_energy(frame(), b);
                const DVec shift = real3(out_.position, b) - real3(in_.bodies.position, b);
                const DQuat turn = normalized(quaternion(out_.orientation, b) * conjugate(quaternion(in_.bodies.orientation, b)));
                put(shift * (1 / h), twist);
                put(rotation_vector(turn) * (1 / h), twist + 4);
                put_pose(shift, turn, end);
                continue;
            }
            const double* v = frame().velocity + 8 * std::size_t{b};
            std::copy(v, v + 8, twist);
            const bool arrives = (flags_of(in_.bodies.flags, b) & CAIRN_BODY_AT_END_POSE) != 0;
            put_pose(arrives ? kZero : at(v) * h, arrives ? DQuat{0, 0, 0, 1} : exp_any(at(v + 4) * h), end);
        }
    }
    static void put_pose(const DVec& shift, const DQuat& turn, double* row) {
        put(shift, row);
        put(vec(turn), row + 4);
        row[7] = turn.w;
    }

    // A quantity of element i.
    static void raise(Tally& tally, const Worst& worst, double value, std::size_t i) {
        if (value > tally.e.*worst.value) {
            tally.e.*worst.value = value;
            tally.e.*worst.index = static_cast<std::int32_t>(i);
        }
    }
    static void add_residual(Tally& tally, double square, double d, double impulse_square) {
        tally.error += square / d;
        tally.impulse += impulse_square * d;
    }
    void push(std::int32_t body, const DVec& linear, const DVec& angular) {
        if (body < 0)
            return;
        const auto b = static_cast<std::size_t>(body);
        push_[b] = push_[b] + linear;
        turn_[b] = turn_[b] + angular;
    }

    // ---- Contacts ----

    double separation(const Block& block, std::uint32_t p) const {
        const std::size_t lane = block.lane;
        return separation_of(scene_.contact_cold_at(block, p), load3(scene_.contact_at(block, p)),
                             gather_pose(frame().displacement, frame().lane_a + lane),
                             gather_pose(frame().displacement, frame().lane_b + lane));
    }

    void judge_contact(const Block& block, std::uint32_t p) {
        const std::size_t i = block.first + p, lane = block.lane;
        const double* hot = scene_.contact_at(block, p);
        const PointGeometry q = load_point(hot);
        const double mu = *field_at(hot, kFriction), h = in_.dt;
        Tally& tally = islands_[block.island];
        ++tally.e.contacts;

        const double normal = out_.contact_impulse.real(i);
        const DVec friction = real3(out_.friction_impulse, i), torque = real3(out_.torsion_impulse, i);
        const DVec impulse = q.n * normal + friction;
        push(block.a, -impulse, -(cross(q.a, impulse) + torque));
        push(block.b, impulse, cross(q.b, impulse) + torque);

        // tangents of an ellipse are as long as their scales: in them it is a disc
        const DVec lambda{normal, dot(friction, q.t1) * inverse_or_zero(dot(q.t1, q.t1)),
                          dot(friction, q.t2) * inverse_or_zero(dot(q.t2, q.t2))};
        const DVec other = friction - q.n * dot(friction, q.n) - q.t1 * lambda.y - q.t2 * lambda.z; // where the ellipse has no width
        const double excess = root(lambda.y * lambda.y + lambda.z * lambda.z + dot(other, other)) - mu * normal;
        tally.e.coulomb_excess = std::max(tally.e.coulomb_excess, excess);
        if (contact_is_spring(in_.contacts, i))
            return;

        const Mass<double> ma = gather_mass(frame(), frame().lane_a + lane), mb = gather_mass(frame(), frame().lane_b + lane);
        double d = 0;
        for (const DVec& t : {q.n, q.t1, q.t2}) {
            const DVec on_a = cross(q.a, t), on_b = cross(q.b, t);
            d += (ma.between(t, on_a, t, on_a) + mb.between(t, on_b, t, on_b)) / 3;
        }
        if (!(d > 0))
            return;
        const auto relative = [&](const double* rows) {
            return slip(q, gather_motion(rows, frame().lane_a + lane), gather_motion(rows, frame().lane_b + lane));
        };
        const DVec u = relative(twist_.data()), belt = real3(in_.contacts.surface_velocity, i);
        const double start = separation(block, p), approach = dot(q.n, relative(frame().velocity));
        const double rebound = contact_bounces(in_.contacts, i) ? in_.contacts.restitution.real(i) * maximum(-approach, 0.0) : 0;
        DVec w{speed_beyond(start + h * dot(q.n, u), minimum(start, 0.0), h * rebound, h), dot(q.t1, u - belt), dot(q.t2, u - belt)};
        tally.e.complementarity = std::max(tally.e.complementarity, std::abs(normal * w.x));
        w.x += mu * root(w.y * w.y + w.z * w.z);
        const DVec r = lambda * d - on_cone(lambda * d - w, mu);
        raise(tally, kContactResidual, length(r), i);
        add_residual(tally, dot(r, r), d, dot(lambda, lambda));
    }

    void measure_depth(const Block& block, std::uint32_t p) {
        Tally& tally = islands_[block.island];
        const double depth = std::max(0.0, -separation(block, p));
        tally.depth += depth;
        raise(tally, kPenetration, depth, block.first + p);
    }

    // ---- Joints ----

    JointGeometry joint_at(const Block& block) const {
        return measure_joint(frame(), scene_.joint_group(block), block.lane, scene_.joint_cold_at(block));
    }

    void judge_joint(const Block& block, const JointGeometry& start) {
        const std::size_t i = block.first, lane = block.lane;
        const double *cold = scene_.joint_cold_at(block), h = in_.dt;
        const JointGeometry end = joint_at(block);
        Tally& tally = islands_[block.island];
        ++tally.e.joints;

        const DVec linear = real3(out_.joint_linear, i), angular = real3(out_.joint_angular, i);
        push(block.a, -linear, -(cross((start.a + end.a) * 0.5, linear) + angular));
        push(block.b, linear, cross((start.b + end.b) * 0.5, linear) + angular);

        const JointRows rows = rows_of(start);
        const Mass<double> ma = gather_mass(frame(), frame().lane_a + lane), mb = gather_mass(frame(), frame().lane_b + lane);
        const double most = *field_at(cold, kMostForce) * h;
        const Motion<double> va = gather_motion(twist_.data(), frame().lane_a + lane),
                             vb = gather_motion(twist_.data(), frame().lane_b + lane);
        double square[2] = {0, 0}; // of the errors, translation and rotation
        for (std::uint32_t axis = 0; axis < 6; ++axis) {
            const bool locked = *field_at(cold, kIsLocked + axis) > 0, limited = *field_at(cold, kIsLimited + axis) > 0;
            const bool driven = *field_at(cold, kIsDriven + axis) > 0, motor = driven && *field_at(cold, kRate + axis) == 0;
            const double low = *field_at(cold, kLowerLimit + axis), high = *field_at(cold, kUpperLimit + axis);
            const double now = end.error[axis], before = start.error[axis];
            if (locked || limited) {
                const double error = locked ? now - low : minimum(now - low, 0.0) + maximum(now - high, 0.0);
                square[axis / 3] += error * error;
            }
            const double d = ma.between(rows.linear[axis], rows.turn_a[axis], rows.linear[axis], rows.turn_a[axis]) +
                             mb.between(rows.linear[axis], rows.turn_b[axis], rows.linear[axis], rows.turn_b[axis]);
            if (!(d > 0) || !(locked || limited || motor) || (limited && driven))
                continue;
            const double lambda = out_.joint_impulse.real(i, axis), x = d * lambda, bound = d * most;
            double r;
            if (locked) {
                const double c0 = before - low;
                const double w = speed_beyond(now - low, minimum(c0, 0.0), maximum(c0, 0.0), h);
                r = x - clamp(x - w, -bound, bound);
            } else if (motor) {
                const double speed =
                    dot(rows.linear[axis], vb.linear - va.linear) + dot(rows.turn_b[axis], vb.angular) - dot(rows.turn_a[axis], va.angular);
                const double reach = minimum(bound, d * h * *field_at(cold, kForce + axis));
                r = x - clamp(x - (speed - *field_at(cold, kSpeed + axis)), -reach, reach);
            } else {
                const double w_low = speed_beyond(now - low, minimum(before - low, 0.0), 0, h);
                const double w_high = speed_beyond(high - now, minimum(high - before, 0.0), 0, h);
                const double x_low = maximum(x, 0.0), x_high = maximum(-x, 0.0);
                r = std::max(std::abs(x_low - clamp(x_low - w_low, 0.0, bound)), std::abs(x_high - clamp(x_high - w_high, 0.0, bound)));
            }
            raise(tally, axis < 3 ? kJointResidual : kAngularResidual, std::abs(r), i);
            add_residual(tally, r * r, d, lambda * lambda);
        }
        const double gap = root(square[0]), angle = root(square[1]);
        tally.gap += gap;
        tally.angle += angle;
        raise(tally, kGap, gap, i);
        raise(tally, kAngle, angle, i);
    }

    // ---- Raw rows ----

    void judge_rows(const Block& block) {
        const std::size_t lane = block.lane;
        const Motion<double> va = gather_motion(twist_.data(), frame().lane_a + lane),
                             vb = gather_motion(twist_.data(), frame().lane_b + lane);
        const Mass<double> ma = gather_mass(frame(), frame().lane_a + lane), mb = gather_mass(frame(), frame().lane_b + lane);
        Tally& tally = islands_[block.island];
        double lambda[kRawRows], d[kRawRows], w[kRawRows];
        for (std::uint32_t r = 0; r < block.count; ++r) {
            const double* hot = scene_.raw_at(block, r);
            const RawRow row = load_raw(hot);
            ++tally.e.rows;
            lambda[r] = out_.row_impulse.real(block.first + r);
            w[r] = row.speed(va, vb) - *field_at(hot, kRhs);
            d[r] = ma.between(row.linear_a, row.angular_a, row.linear_a, row.angular_a) +
                   mb.between(row.linear_b, row.angular_b, row.linear_b, row.angular_b);
            push(block.a, row.linear_a * lambda[r], row.angular_a * lambda[r]);
            push(block.b, row.linear_b * lambda[r], row.angular_b * lambda[r]);
        }
        for (std::uint32_t r = 0; r < block.count; ++r) {
            const double* hot = scene_.raw_at(block, r);
            const auto source = static_cast<std::int32_t>(*field_at(hot, kFrictionSource));
            const bool pair = *field_at(hot, kPairFirst) > 0;
            const auto yields = [&](std::uint32_t k) { return *field_at(scene_.raw_at(block, k), kRawGamma) > 0; };
            if (*field_at(hot, kPairSecond) > 0)
                continue; // with its first
            const double metric = pair ? 0.5 * (d[r] + d[r + 1]) : d[r];
            if (yields(r) || (pair && yields(r + 1)) || !(metric > 0))
                continue;
            const double bound = source < 0 ? 0 : metric * *field_at(hot, kRawFriction) * std::abs(lambda[source]);
            const double x = metric * lambda[r], y = x - w[r];
            if (!pair) {
                const double low = source < 0 ? metric * *field_at(hot, kRawLow) : -bound;
                const double high = source < 0 ? metric * *field_at(hot, kRawHigh) : bound;
                judge_row(tally, block.first + r, x - clamp(y, low, high), metric, lambda[r]);
                continue;
            }
            const double x2 = metric * lambda[r + 1], y2 = x2 - w[r + 1], size = root(y * y + y2 * y2);
            const double scale = size > bound ? bound / size : 1;
            const double r1 = x - y * scale, r2 = x2 - y2 * scale;
            judge_row(tally, block.first + r, r1, metric, lambda[r]);
            judge_row(tally, block.first + r + 1, r2, metric, lambda[r + 1]);
        }
    }
    static void judge_row(Tally& tally, std::size_t i, double r, double d, double lambda) {
        raise(tally, kRowResidual, std::abs(r), i);
        add_residual(tally, r * r, d, lambda * lambda);
    }

    // ---- Bodies ----

    void judge_body(std::uint32_t b) {
        const BodyConstants<double>& body = frame().body[b];
        const double h = in_.dt;
        Tally& tally = islands_[frame().body_island[b]];
        ++tally.e.bodies;
        double* velocity = frame().velocity + 8 * std::size_t{b};
        const DVec v0 = at(velocity), w0 = at(velocity + 4);
        const DVec v1 = real3(out_.linear_velocity, b), w1 = real3(out_.angular_velocity, b);

        const DQuat q0{body.orientation[0], body.orientation[1], body.orientation[2], body.orientation[3]};
        const DVec inverse = at(body.inverse_inertia);
        // the angular momentum of w at orientation q; nothing about axes that cannot turn
        const auto spin = [&](const DQuat& q, const DVec& w) {
            const Axes<double> r = axes_of(q);
            return r.x * (dot(r.x, w) * inverse_or_zero(inverse.x)) + r.y * (dot(r.y, w) * inverse_or_zero(inverse.y)) +
                   r.z * (dot(r.z, w) * inverse_or_zero(inverse.z));
        };
        const DVec acceleration = at(body.acceleration), torque = at(body.torque);
        const double* mass_row = frame().mass + 8 * std::size_t{b};
        const DVec pushed = (v1 - v0 - acceleration * h - times(at(mass_row), push_[b])) * body.mass;
        const DVec turned = body.gyroscopic ? spin(orientation_of(body, row_of(end_, b)), w1) - spin(q0, w0) - torque * h - turn_[b]
                                            : spin(q0, w1 - w0 - inertia_at(frame(), b) * (torque * h + turn_[b]));
        raise(tally, kMomentum, length(pushed), b);
        raise(tally, kAngularMomentum, length(turned), b);

        // totals, about the first body: near enough for the sums to be exact, and moved to the centre of mass at the end
        const DVec x = real3(in_.bodies.position, b) - real3(in_.bodies.position, frame().moving[0]);
        tally.momentum = tally.momentum + pushed;
        tally.moment = tally.moment + cross(x, pushed) + turned;
        tally.mass += body.mass;
        tally.mass_moment = tally.mass_moment + x * body.mass;

        put(v1, velocity);
        put(w1, velocity + 4);
        const DVec angular_acceleration = inertia_at(frame(), b) * torque, effective = spin(q0, angular_acceleration);
        tally.impulse += h * h * (body.mass * dot(acceleration, acceleration) + dot(effective, angular_acceleration));
        tally.e.kinetic_energy +=
            kinetic_energy(frame(), b) - energy_[b] - 0.5 * h * (body.mass * dot(acceleration, v0 + v1) + dot(effective, w0 + w1));
    }

    // ---- Islands and all ----

    static void add(const Tally& island, Tally& all) {
        for (std::uint32_t E::*count : {&E::bodies, &E::contacts, &E::joints, &E::rows})
            all.e.*count += island.e.*count;
        for (const Worst& worst : kWorst) {
            const double value = island.e.*worst.value;
            const std::int32_t i = island.e.*worst.index;
            if (value > all.e.*worst.value || (value == all.e.*worst.value && i >= 0 && i < all.e.*worst.index)) {
                all.e.*worst.value = value;
                all.e.*worst.index = i;
            }
        }
        all.e.complementarity = std::max(all.e.complementarity, island.e.complementarity);
        all.e.coulomb_excess = std::max(all.e.coulomb_excess, island.e.coulomb_excess);
        all.e.kinetic_energy += island.e.kinetic_energy;
        all.depth += island.depth;
        all.gap += island.gap;
        all.angle += island.angle;
        all.error += island.error;
        all.impulse += island.impulse;
        all.momentum = all.momentum + island.momentum;
        all.moment = all.moment + island.moment;
        all.mass += island.mass;
        all.mass_moment = all.mass_moment + island.mass_moment;
    }

    static cairn_evaluation close(const Tally& tally) {
        cairn_evaluation e = tally.e;
        e.struct_size = sizeof e;
        e.penetration_mean = e.contacts > 0 ? tally.depth / e.contacts : 0;
        e.joint_gap_mean = e.joints > 0 ? tally.gap / e.joints : 0;
        e.joint_angle_mean = e.joints > 0 ? tally.angle / e.joints : 0;
        e.relative_residual = tally.error > 0 ? root(tally.error / (tally.error + tally.impulse)) : 0;
        e.momentum_total = length(tally.momentum);
        e.angular_momentum_total = length(tally.moment - cross(tally.mass_moment * inverse_or_zero(tally.mass), tally.momentum));
        // what is no number in a quantity of one element is none in a sum, too
        const double sums = e.penetration_mean + e.joint_gap_mean + e.joint_angle_mean + tally.error + tally.impulse + e.momentum_total +
                            e.angular_momentum_total + e.kinetic_energy + e.complementarity + e.coulomb_excess;
        if (!std::isfinite(sums))
            throw NotFinite("the evaluation left the range of numbers");
        return e;
    }

    Evaluated finish() {
        Evaluated found;
        Tally all;
        for (const Tally& island : islands_) {
            add(island, all);
            found.islands.push_back(close(island));
        }
        found.whole = close(all);
        found.body_island.assign(frame().body_count, -1);
        for (std::uint32_t b = 0; b < frame().body_count; ++b)
            if (frame().body[b].movable)
                found.body_island[b] = static_cast<std::int32_t>(frame().body_island[b]);
        return found;
    }

    const Input& in_;
    const Outcome& out_;
    Scene<double> scene_;
    std::vector<Tally> islands_;
    std::vector<JointGeometry> joint_starts_;
    Rows8 twist_, end_;
    std::vector<double> energy_;    // at the start
    std::vector<DVec> push_, turn_; // the impulses that were reported, a body
};

} // namespace

Evaluated evaluate(const Input& input, const Outcome& outcome) { return Evaluator(input, outcome).run(); }

} // namespace cairn
