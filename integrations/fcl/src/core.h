// A convex shape in a pose, as what the search for a contact needs of it: a core (the hull of some points, or a curved solid) and the
// radius of a ball rolled over it. A sphere is a point with a radius, a capsule a segment with one.
#pragma once
#include <fcl/geometry/collision_geometry.h>

#include <array>
#include <vector>

namespace cairn {
namespace fcl {

using Geometry = ::fcl::CollisionGeometryd;
using Matrix3 = ::fcl::Matrix3d;
using Transform = ::fcl::Transform3d;
using Vector3 = ::fcl::Vector3d;

enum class Solid { hull, cylinder, cone, ellipsoid, halfSpace };

// All vectors are in world axes, from an origin near the pair, so that precision does not fade far from the world's.
struct Core {
    Solid solid = Solid::hull;
    Vector3 center = Vector3::Zero();
    Matrix3 axes = Matrix3::Identity();
    double radius = 0; // m, of the ball
    double size = 0;   // m, of the whole shape: no point is further from the centre; infinite for a half space

    // A hull's.
    std::vector<Vector3> vertices;
    std::vector<Vector3> normals;          // unit, outwards, of its faces; none of a point or a segment
    std::vector<std::array<int, 2>> edges; // indices of vertices, each once
    // Half sizes: cylinder and cone (radius, radius, half length), ellipsoid.
    Vector3 half = Vector3::Zero();
    // A half space's: planeNormal . x <= planeOffset is solid.
    Vector3 planeNormal = Vector3::Zero();
    double planeOffset = 0;

    bool isPoint() const { return solid == Solid::ellipsoid || (solid == Solid::hull && vertices.size() == 1); }
    bool isSphere() const { return solid == Solid::hull && vertices.size() == 1; }
    bool isSegment() const { return solid == Solid::hull && vertices.size() == 2; }
};

// A core of `geometry`, which is a convex shape, a half space or a plane, at `pose`. A plane is the half space on the far side of it
// from `other`, the centre of what it meets; other's and the core's coordinates are from `origin`.
Core makeCore(const Geometry& geometry, const Transform& pose, const Vector3& origin, const Vector3& other);
// A triangle, given from the core's origin.
Core makeTriangle(const Vector3& a, const Vector3& b, const Vector3& c);

// The point of the whole shape that lies furthest in a direction (unit); not for half spaces.
Vector3 furthest(const Core& core, const Vector3& direction);

// The face, side line or point of the core that looks in a direction, as a convex polygon, a segment or a point, counter-clockwise
// seen from outside; `normal` becomes a face's normal, and the direction otherwise. Not for half spaces.
std::vector<Vector3> featureTowards(const Core& core, const Vector3& direction, Vector3& normal);

} // namespace fcl
} // namespace cairn
