// Stages over bodies: forces, gathering the impulses of a sweep, integration (paper eq. 2). One body at a time, in Real.
#pragma once
#include "../math/vec.h"
#include "../scene/frame.h"

namespace cairn {
inline namespace CAIRN_ISA {

using BodyVec = Vec3<Real>;
constexpr Real kQuarterTurn = Real(0.78539816339744831); // a body turns by at most pi/4 in a substep

CAIRN_HD inline BodyVec at(const Real* row) { return {row[0], row[1], row[2]}; }
CAIRN_HD inline void put(const BodyVec& a, Real* row) {
    row[0] = a.x;
    row[1] = a.y;
    row[2] = a.z;
}
CAIRN_HD inline Quat<Real> turn_at(const Real* displacement) {
    return {displacement[4], displacement[5], displacement[6], displacement[7]};
}
CAIRN_HD inline Quat<Real> orientation_of(const BodyConstants<Real>& body, const Real* displacement) {
    return turn_at(displacement) * Quat<Real>{body.orientation[0], body.orientation[1], body.orientation[2], body.orientation[3]};
}

// F R diag R^T F into the body's mass rows
CAIRN_HD inline void refresh_inertia(const Frame<Real>& f, std::uint32_t b) {
    const BodyConstants<Real>& body = f.body[b];
    const Axes<Real> axes = axes_of(orientation_of(body, f.displacement + 8 * static_cast<std::size_t>(b)));
    const Sym3<Real> i = rotated_diagonal(axes, at(body.inverse_inertia));
    Real* mass = f.mass + 8 * static_cast<std::size_t>(b);
    Real* cross = f.mass_cross + 8 * static_cast<std::size_t>(b);
    const BodyVec k = at(body.angular_factor);
    mass[4] = i.xx * k.x * k.x;
    mass[5] = i.yy * k.y * k.y;
    mass[6] = i.zz * k.z * k.z;
    cross[0] = i.xy * k.x * k.y;
    cross[1] = i.xz * k.x * k.z;
    cross[2] = i.yz * k.y * k.z;
}
CAIRN_HD inline Sym3<Real> inertia_at(const Frame<Real>& f, std::uint32_t b) {
    const Real* mass = f.mass + 8 * static_cast<std::size_t>(b);
    const Real* cross = f.mass_cross + 8 * static_cast<std::size_t>(b);
    return {mass[4], mass[5], mass[6], cross[0], cross[1], cross[2]};
}

// Turn by `angle` (rad, world axes), cut to pi/4: true if it was.
CAIRN_HD inline bool turn_body(Real* displacement, BodyVec angle) {
    const Real square = dot(angle, angle);
    const bool cut = square > kQuarterTurn * kQuarterTurn;
    if (cut)
        angle = angle * (kQuarterTurn / root(square));
    const Quat<Real> q = normalized(exp_small(angle) * turn_at(displacement));
    displacement[4] = q.x;
    displacement[5] = q.y;
    displacement[6] = q.z;
    displacement[7] = q.w;
    return cut;
}

CAIRN_HD inline void apply_forces(const Frame<Real>& f, std::uint32_t b) {
    const BodyConstants<Real>& body = f.body[b];
    Real* v = f.velocity + 8 * static_cast<std::size_t>(b);
    put(at(v) + at(body.acceleration) * f.h, v);
    put(at(v + 4) + inertia_at(f, b) * (at(body.torque) * f.h), v + 4);
}

// Sum of a body's slots: in order up to 32, then 32 at a time, so that the order does not depend on who adds.
struct Slots {
    Real sum[8];
};
CAIRN_HD inline Slots sum_slots(const Real* slots, std::uint32_t begin, std::uint32_t end) {
    Slots total{};
    for (std::uint32_t chunk = begin; chunk < end; chunk += 32) {
        const std::uint32_t last = chunk + 32 < end ? chunk + 32 : end;
        Slots part{};
        for (std::uint32_t s = chunk; s < last; ++s)
            for (int c = 0; c < 8; ++c)
                part.sum[c] += slots[8 * static_cast<std::size_t>(s) + static_cast<std::size_t>(c)];
        if (chunk == begin)
            total = part;
        else
            for (int c = 0; c < 8; ++c)
                total.sum[c] += part.sum[c];
    }
    return total;
}
CAIRN_HD inline Slots impulse_on(const Frame<Real>& f, std::uint32_t b) { return sum_slots(f.slots, f.slot_begin[b], f.slot_begin[b + 1]); }

// The sweeps start: warm-start impulses, momentum at rest.
CAIRN_HD inline void apply_start(const Frame<Real>& f, std::uint32_t b) {
    Real* v = f.velocity + 8 * static_cast<std::size_t>(b);
    Real* x = f.iterate + 8 * static_cast<std::size_t>(b);
    if (f.warm && f.phase == Phase::substep) {
        const Slots p = impulse_on(f, b);
        put(at(v) + times(at(f.mass + 8 * static_cast<std::size_t>(b)), at(p.sum)), v);
        put(at(v + 4) + inertia_at(f, b) * at(p.sum + 4), v + 4);
    }
    v[3] = 0;
    v[7] = f.control[f.body_island[b]].active;
    for (int c = 0; c < 8; ++c)
        x[c] = v[c];
}

// v+ = v + M^-1 J^T (lambda+ - lambda); the next sweep looks at v+ + beta (v+ - v), which is never added to: rounding errors
// would otherwise follow the momentum's own double integrator.
CAIRN_HD inline void apply_sweep(const Frame<Real>& f, std::uint32_t b) {
    Real* y = f.velocity + 8 * static_cast<std::size_t>(b);
    if (f.reduces && !(y[7] > 0)) // its island rests: not a bit changes, however often the others sweep
        return;
    const Slots p = impulse_on(f, b);
    const Real* from = f.reduces ? f.iterate + 8 * static_cast<std::size_t>(b) : y;
    const BodyVec v = at(from) + times(at(f.mass + 8 * static_cast<std::size_t>(b)), at(p.sum));
    const BodyVec w = at(from + 4) + inertia_at(f, b) * at(p.sum + 4);
    if (!f.reduces) {
        put(v, y);
        put(w, y + 4);
        return;
    }
    Real* x = f.iterate + 8 * static_cast<std::size_t>(b);
    const Control<Real>& c = f.control[f.body_island[b]];
    const Real beta = f.last_sweep ? Real(0) : c.beta;
    put(v + (v - at(x)) * beta, y);
    put(w + (w - at(x + 4)) * beta, y + 4);
    put(v, x);
    put(w, x + 4);
    y[3] = beta;
    y[7] = c.active;
}

// Poses. The angular momentum L = I w is kept, not w: w_mid = I(q_mid)^-1 L by three fixed-point steps, q+ = exp(h w_mid) q,
// w+ = I(q+)^-1 L.
CAIRN_HD inline void integrate_pose(const Frame<Real>& f, std::uint32_t b) {
    const BodyConstants<Real>& body = f.body[b];
    Real* v = f.velocity + 8 * static_cast<std::size_t>(b);
    Real* d = f.displacement + 8 * static_cast<std::size_t>(b);
    put(at(d) + at(v) * f.h, d);
    BodyVec w = at(v + 4);
    if (body.gyroscopic) {
        const BodyVec inverse = at(body.inverse_inertia);
        const auto spin_at = [&](const Quat<Real>& q, const BodyVec& momentum) {
            const Axes<Real> r = axes_of(q);
            return r.x * (inverse.x * dot(r.x, momentum)) + r.y * (inverse.y * dot(r.y, momentum)) + r.z * (inverse.z * dot(r.z, momentum));
        };
        const Quat<Real> q = orientation_of(body, d);
        const Axes<Real> r = axes_of(q);
        const BodyVec l = r.x * (dot(r.x, w) / inverse.x) + r.y * (dot(r.y, w) / inverse.y) + r.z * (dot(r.z, w) / inverse.z);
        const Real half = f.h * Real(0.5);
        for (int step = 0; step < 3; ++step) {
            BodyVec angle = w * half;
            const Real square = dot(angle, angle);
            if (square > kQuarterTurn * kQuarterTurn)
                angle = angle * (kQuarterTurn / root(square));
            w = spin_at(exp_small(angle) * q, l);
        }
        if (turn_body(d, w * f.h))
            ++f.rotation_clamped[b];
        // as a difference, so that the rounding of R(q) in L = R I R^T w and back does not add up
        put(at(v + 4) + (spin_at(orientation_of(body, d), l) - spin_at(q, l)), v + 4);
    } else if (turn_body(d, w * f.h)) {
        ++f.rotation_clamped[b];
    }
    refresh_inertia(f, b);
}

// 1/2 m v^2 + 1/2 w . I w, in the body's axes and in double: differences of it are what is wanted.
CAIRN_HD inline double kinetic_energy(const Frame<Real>& f, std::uint32_t b) {
    const BodyConstants<Real>& body = f.body[b];
    const auto wide = [](const Real* row) {
        return Vec3<double>{static_cast<double>(row[0]), static_cast<double>(row[1]), static_cast<double>(row[2])};
    };
    const auto wide4 = [](const Real* row) {
        return Quat<double>{static_cast<double>(row[0]), static_cast<double>(row[1]), static_cast<double>(row[2]),
                            static_cast<double>(row[3])};
    };
    const Real* row = f.velocity + 8 * static_cast<std::size_t>(b);
    const Vec3<double> v = wide(row), w = wide(row + 4);
    const Axes<double> r = axes_of(wide4(f.displacement + 8 * static_cast<std::size_t>(b) + 4) * wide4(body.orientation));
    const auto about = [&](const Vec3<double>& axis, Real inverse) {
        const double spin = dot(axis, w);
        return inverse > 0 ? spin * spin / static_cast<double>(inverse) : 0.0;
    };
    return 0.5 * (static_cast<double>(body.mass) * dot(v, v) +
                  (about(r.x, body.inverse_inertia[0]) + about(r.y, body.inverse_inertia[1]) + about(r.z, body.inverse_inertia[2])));
}

// A position sweep's displacement M^-1 J^T dlambda.
CAIRN_HD inline void apply_position(const Frame<Real>& f, std::uint32_t b) {
    const Slots p = impulse_on(f, b);
    Real* d = f.displacement + 8 * static_cast<std::size_t>(b);
    put(at(d) + times(at(f.mass + 8 * static_cast<std::size_t>(b)), at(p.sum)), d);
    if (turn_body(d, inertia_at(f, b) * at(p.sum + 4)))
        ++f.rotation_clamped[b];
    refresh_inertia(f, b);
}

} // namespace CAIRN_ISA
} // namespace cairn
