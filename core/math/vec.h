// Small vectors, symmetric matrices and quaternions over a lane type.
#pragma once
#include "lane.h"

namespace cairn {
inline namespace CAIRN_ISA {

template <class F> struct Vec3 { F x, y, z; };
template <class F> CAIRN_HD Vec3<F> operator+(const Vec3<F>& a, const Vec3<F>& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class F> CAIRN_HD Vec3<F> operator-(const Vec3<F>& a, const Vec3<F>& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class F> CAIRN_HD Vec3<F> operator-(const Vec3<F>& a) { return {-a.x, -a.y, -a.z}; }
template <class F> CAIRN_HD Vec3<F> operator*(const Vec3<F>& a, const F& s) { return {a.x * s, a.y * s, a.z * s}; }
template <class F> CAIRN_HD Vec3<F> times(const Vec3<F>& a, const Vec3<F>& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
template <class F> CAIRN_HD F dot(const Vec3<F>& a, const Vec3<F>& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class F> CAIRN_HD Vec3<F> cross(const Vec3<F>& a, const Vec3<F>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class F> CAIRN_HD Vec3<F> select(decltype(F() < F()) m, const Vec3<F>& a, const Vec3<F>& b) {
    return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}
template <class F> CAIRN_HD Vec3<F> normalized(const Vec3<F>& a) { return a * inverse_or_zero(root(dot(a, a))); }

// Symmetric 3x3: xx yy zz xy xz yz.
template <class F> struct Sym3 { F xx, yy, zz, xy, xz, yz; };
template <class F> CAIRN_HD Sym3<F> operator+(const Sym3<F>& a, const Sym3<F>& b) {
    return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
}
template <class F> CAIRN_HD Vec3<F> operator*(const Sym3<F>& m, const Vec3<F>& a) {
    return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z, m.xz * a.x + m.yz * a.y + m.zz * a.z};
}

// The larger eigenvalue of m on the plane across the unit vector n: the roots' sum is the trace left there, their product
// n . adj(m) n.
template <class F> CAIRN_HD F largest_across(const Sym3<F>& m, const Vec3<F>& n) {
    const F half = (m.xx + m.yy + m.zz - dot(n, m * n)) * of<F>(0.5);
    const Sym3<F> adjugate{m.yy * m.zz - m.yz * m.yz, m.zz * m.xx - m.xz * m.xz, m.xx * m.yy - m.xy * m.xy,
                           m.xz * m.yz - m.xy * m.zz, m.xy * m.yz - m.xz * m.yy, m.xy * m.xz - m.yz * m.xx};
    return half + root(maximum(half * half - dot(n, adjugate * n), F(0)));
}

// Rows of a rotation matrix are never needed whole: its columns are the rotated axes.
template <class F> struct Axes { Vec3<F> x, y, z; };

template <class F> struct Quat { F x, y, z, w; };
template <class F> CAIRN_HD Vec3<F> vec(const Quat<F>& q) { return {q.x, q.y, q.z}; }
template <class F> CAIRN_HD Quat<F> conjugate(const Quat<F>& q) { return {-q.x, -q.y, -q.z, q.w}; }
template <class F> CAIRN_HD Quat<F> operator*(const Quat<F>& p, const Quat<F>& q) {
    return {p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y, p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
            p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w, p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z};
}
template <class F> CAIRN_HD Quat<F> normalized(const Quat<F>& q) {
    const F s = F(1) / root(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return {q.x * s, q.y * s, q.z * s, q.w * s};
}
// (R(q) - 1) a, exact for small turns: nothing cancels.
template <class F> CAIRN_HD Vec3<F> turned_by(const Quat<F>& q, const Vec3<F>& a) {
    const Vec3<F> t = cross(vec(q), a) * F(2);
    return t * q.w + cross(vec(q), t);
}
template <class F> CAIRN_HD Vec3<F> rotate(const Quat<F>& q, const Vec3<F>& a) { return a + turned_by(q, a); }
// Divides by |q|^2, so that a rounding error of the norm, which would add up over thousands of steps, leaves them unit.
template <class F> CAIRN_HD Axes<F> axes_of(const Quat<F>& q) {
    const F twice = F(2) / (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    const F x2 = q.x * twice, y2 = q.y * twice, z2 = q.z * twice;
    const F xx = q.x * x2, yy = q.y * y2, zz = q.z * z2, xy = q.x * y2, xz = q.x * z2, yz = q.y * z2;
    const F wx = q.w * x2, wy = q.w * y2, wz = q.w * z2, one = F(1);
    return {{one - (yy + zz), xy + wz, xz - wy}, {xy - wz, one - (xx + zz), yz + wx}, {xz + wy, yz - wx, one - (xx + yy)}};
}
// R diag(d) R^T
template <class F> CAIRN_HD Sym3<F> rotated_diagonal(const Axes<F>& r, const Vec3<F>& d) {
    const Vec3<F> a = r.x * d.x, b = r.y * d.y, c = r.z * d.z;
    return {a.x * r.x.x + b.x * r.y.x + c.x * r.z.x, a.y * r.x.y + b.y * r.y.y + c.y * r.z.y, a.z * r.x.z + b.z * r.y.z + c.z * r.z.z,
            a.x * r.x.y + b.x * r.y.y + c.x * r.z.y, a.x * r.x.z + b.x * r.y.z + c.x * r.z.z, a.y * r.x.z + b.y * r.y.z + c.y * r.z.z};
}

// exp of a rotation vector no longer than pi/4, by the series of sin(x)/x and cos(x) in x = |r|/2 (error below 1e-16).
template <class F> CAIRN_HD Quat<F> exp_small(const Vec3<F>& r) {
    const F u = dot(r, r) * of<F>(0.25);
    const F s = of<F>(1) + u * (of<F>(-1.0 / 6) +
                                u * (of<F>(1.0 / 120) + u * (of<F>(-1.0 / 5040) + u * (of<F>(1.0 / 362880) + u * of<F>(-1.0 / 39916800)))));
    const F c = of<F>(1) + u * (of<F>(-1.0 / 2) +
                                u * (of<F>(1.0 / 24) + u * (of<F>(-1.0 / 720) + u * (of<F>(1.0 / 40320) + u * of<F>(-1.0 / 3628800)))));
    const Vec3<F> v = r * (of<F>(0.5) * s);
    return {v.x, v.y, v.z, c};
}

// exp of any rotation vector: halved until the series holds, then squared as often.
template <class F> CAIRN_HD Quat<F> exp_any(Vec3<F> r) {
    int halvings = 0;
    for (; dot(r, r) > of<F>(0.6); ++halvings)
        r = r * of<F>(0.5);
    Quat<F> q = exp_small(r);
    for (; halvings > 0; --halvings)
        q = q * q;
    return q;
}

// atan2 by the half-angle formula, applied twice, and the series of atan below tan(pi/16) (error below 1e-13); 0 at the origin.
template <class F> CAIRN_HD F atan2_lane(const F& y, const F& x) {
    const F length = root(x * x + y * y);
    // tan of half the angle, |.| <= 1 in the right half plane; the left one is mirrored
    const auto left = x < of<F>(0);
    const F px = select(left, -x, x);
    const F t1 = y * inverse_or_zero(length + px);
    const F t2 = t1 / (of<F>(1) + root(of<F>(1) + t1 * t1));
    const F t3 = t2 / (of<F>(1) + root(of<F>(1) + t2 * t2));
    const F u = t3 * t3;
    const F series =
        of<F>(1) + u * (of<F>(-1.0 / 3) +
                        u * (of<F>(1.0 / 5) +
                             u * (of<F>(-1.0 / 7) +
                                  u * (of<F>(1.0 / 9) +
                                       u * (of<F>(-1.0 / 11) + u * (of<F>(1.0 / 13) + u * (of<F>(-1.0 / 15) + u * of<F>(1.0 / 17))))))));
    const F angle = of<F>(8) * t3 * series;
    const F pi = of<F>(3.14159265358979323846);
    return select(left, select(y < of<F>(0), -pi, pi) - angle, angle);
}

} // namespace CAIRN_ISA
} // namespace cairn
