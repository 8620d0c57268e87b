// Contacts of a triangle mesh (fcl::BVHModel), which has a surface but no inside.
#pragma once
#include "manifold.h"

#include <fcl/narrowphase/collision_result.h>

namespace cairn {
namespace fcl {

bool isMesh(const Geometry& geometry);

// `result` is FCL's of the pair at these poses. A convex shape gets, from each triangle that FCL found, the part of its own feature that
// lies over the triangle, along the triangle's normal on the shape's side; where there is none (an edge, a corner) FCL's point. Two
// meshes, and a mesh and a half space, get FCL's points. `hasPoints`: whether the result has more than the triangles. Points are from
// `origin`.
std::vector<Point> meshPoints(const Geometry& a, const Transform& poseA, const Geometry& b, const Transform& poseB, const Vector3& origin,
                              const ::fcl::CollisionResultd& result, bool hasPoints, double margin);

} // namespace fcl
} // namespace cairn
