// The direction in which two convex shapes are apart, or overlap least: the n that maximises
//     s(n) = min over b of n . x  -  max over a of n . x.
// s at its maximum is the signed distance of the shapes. Every s(n) bounds it from below, so a candidate can only improve the answer:
// FCL's search gives a direction to start from, and its neighbours among the directions where s can have a maximum are tried.
#pragma once
#include "core.h"

namespace cairn {
namespace fcl {

struct Direction {
    Vector3 normal;  // unit, from a to b
    double distance; // m, s(normal)
};

// s(n), n unit. One of the two may be a half space; then n must be the opposite of its normal, or the normal.
double distanceAlong(const Core& a, const Core& b, const Vector3& n);

// `start`: unit, or anything if one of the cores is a half space. If s exceeds `margin` somewhere, that may be the answer.
Direction bestDirection(const Core& a, const Core& b, const Vector3& start, double margin);

// Where FCL's own algorithms (closed forms, GJK and EPA) see the direction from 1 to 2; from centre to centre where they give up.
Vector3 startDirection(const Geometry& geometry1, const Transform& pose1, const Geometry& geometry2, const Transform& pose2,
                       const Vector3& centers, double margin);

// The nearest points of two segments.
void nearestPoints(const Vector3& p0, const Vector3& p1, const Vector3& q0, const Vector3& q1, Vector3& p, Vector3& q);

} // namespace fcl
} // namespace cairn
