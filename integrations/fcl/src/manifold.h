// The contact points of a pair: where the two features that face each other lie over each other, at most four.
#pragma once
#include "direction.h"

namespace cairn {
namespace fcl {

struct Point {
    Vector3 onA; // on the surface of a; the point on b is onA + separation * normal
    Vector3 normal;
    double separation; // m
};

// Clips the features of two convex shapes (or of one and a half space) against each other. `best` is bestDirection(a, b). Where a face
// does all but as well, its normal is taken instead, so that what lies flat stays flat. Points with separations up to `margin`,
// among them one at the least separation; any number.
std::vector<Point> makeManifold(const Core& a, const Core& b, const Direction& best, double margin);

// The part of a shape's feature that lies over a triangle, along `n`, the triangle's normal on the shape's side; may be empty.
// The triangle is a, the shape b.
std::vector<Point> overTriangle(const Core& triangle, const Core& shape, const Vector3& n, double margin);

// Leaves the four of the points that span the largest area, in their old order; one of the deepest is always among them. Points that
// (nearly) coincide count as one.
void reduceToFour(std::vector<Point>& points, double size);

} // namespace fcl
} // namespace cairn
