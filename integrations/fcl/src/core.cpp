#include "core.h"

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/cone.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/ellipsoid.h>
#include <fcl/geometry/shape/halfspace.h>
#include <fcl/geometry/shape/plane.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/geometry/shape/triangle_p.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace cairn {
namespace fcl {
namespace {

constexpr double kCapSlope = 0.7; // a cylinder or cone turned further than 45 degrees shows its cap
constexpr int kCapPoints = 8;
constexpr double kPi = 3.14159265358979323846;

void addBox(Core& core, const Vector3& half) {
    for (int i = 0; i < 8; ++i) {
        const Vector3 corner((i & 1) ? half.x() : -half.x(), (i & 2) ? half.y() : -half.y(), (i & 4) ? half.z() : -half.z());
        core.vertices.push_back(core.center + core.axes * corner);
        for (int bit = 1; bit < 8; bit *= 2)
            if (!(i & bit))
                core.edges.push_back({{i, i + bit}});
    }
    for (int axis = 0; axis < 3; ++axis) {
        core.normals.push_back(core.axes.col(axis));
        core.normals.push_back(-core.axes.col(axis));
    }
}

void addConvex(Core& core, const ::fcl::Convexd& convex) {
    for (const Vector3& vertex : convex.getVertices())
        core.vertices.push_back(core.center + core.axes * vertex);
    const std::vector<int>& faces = convex.getFaces();
    std::size_t at = 0;
    for (int face = 0; face < convex.getFaceCount(); ++face) {
        const int count = faces[at];
        const int* index = &faces[at + 1];
        Vector3 area = Vector3::Zero(); // twice the face's, along its normal
        for (int i = 0; i < count; ++i) {
            const int from = index[i], to = index[(i + 1) % count];
            const Vector3& base = core.vertices[static_cast<std::size_t>(index[0])];
            area += (core.vertices[static_cast<std::size_t>(from)] - base).cross(core.vertices[static_cast<std::size_t>(to)] - base);
            if (from < to) // its other face goes along it the other way
                core.edges.push_back({{from, to}});
        }
        if (area.norm() > 0)
            core.normals.push_back(area.normalized());
        at += static_cast<std::size_t>(count) + 1;
    }
    // The centre decides on nothing but directions to start from: any point inside serves.
    core.center += core.axes * convex.getInteriorPoint();
}

void setSize(Core& core) {
    double square = 0;
    for (const Vector3& vertex : core.vertices)
        square = std::max(square, (vertex - core.center).squaredNorm());
    core.size = std::sqrt(square) + core.radius;
}

// The corners of the convex hull of points that lie in a plane, counter-clockwise about its normal (Andrew's monotone chain).
std::vector<Vector3> planarHull(std::vector<Vector3> points, const Vector3& normal, double tolerance) {
    const Vector3 u = normal.unitOrthogonal(), v = normal.cross(u);
    std::sort(points.begin(), points.end(), [&](const Vector3& p, const Vector3& q) {
        const double x = u.dot(p), y = u.dot(q);
        return x != y ? x < y : v.dot(p) < v.dot(q);
    });
    std::vector<Vector3> hull;
    for (int side = 0; side < 2; ++side) {
        const std::size_t base = hull.size();
        for (const Vector3& point : points) {
            while (hull.size() >= base + 2) {
                const Vector3 &last = hull.back(), &before = hull[hull.size() - 2];
                const Vector3 along = last - before;
                if (along.cross(point - last).dot(normal) > tolerance * along.norm())
                    break;
                hull.pop_back();
            }
            hull.push_back(point);
        }
        hull.pop_back(); // the other side starts with it
        std::reverse(points.begin(), points.end());
    }
    return hull;
}

std::vector<Vector3> faceTowards(const Core& core, const Vector3& direction, Vector3& normal) {
    double best = -2;
    for (const Vector3& candidate : core.normals) {
        const double slope = candidate.dot(direction);
        if (slope > best + 1e-9) { // of those that are as good, the first
            best = slope;
            normal = candidate;
        }
    }
    // A mesh may cut its faces in triangles: take all that lies in the plane.
    double top = -std::numeric_limits<double>::infinity();
    for (const Vector3& vertex : core.vertices)
        top = std::max(top, normal.dot(vertex));
    std::vector<Vector3> points;
    for (const Vector3& vertex : core.vertices)
        if (normal.dot(vertex) >= top - 1e-6 * core.size)
            points.push_back(vertex);
    return planarHull(std::move(points), normal, 1e-9 * core.size);
}

// The rim of a cylinder's or cone's cap, at `height` along the axis.
std::vector<Vector3> cap(const Core& core, double height, double sign) {
    std::vector<Vector3> points;
    for (int i = 0; i < kCapPoints; ++i) {
        const double angle = sign * 2 * kPi * i / kCapPoints;
        points.push_back(core.center + core.axes * Vector3(core.half.x() * std::cos(angle), core.half.x() * std::sin(angle), height));
    }
    return points;
}

// From the axis of a cylinder or cone to the point of its rim that lies furthest in a direction.
Vector3 towardsRim(const Core& core, const Vector3& direction) {
    const Vector3 axis = core.axes.col(2);
    const Vector3 across = direction - axis.dot(direction) * axis;
    const double norm = across.norm();
    return norm > 1e-12 ? Vector3(across * (core.half.x() / norm)) : Vector3(core.axes.col(0) * core.half.x());
}

} // namespace

Core makeCore(const Geometry& geometry, const Transform& pose, const Vector3& origin, const Vector3& other) {
    Core core;
    core.center = pose.translation() - origin;
    core.axes = pose.linear();
    switch (geometry.getNodeType()) {
    case ::fcl::GEOM_BOX:
        addBox(core, static_cast<const ::fcl::Boxd&>(geometry).side / 2);
        setSize(core);
        break;
    case ::fcl::GEOM_SPHERE:
        core.radius = static_cast<const ::fcl::Sphered&>(geometry).radius;
        core.vertices.push_back(core.center);
        setSize(core);
        break;
    case ::fcl::GEOM_CAPSULE: {
        const ::fcl::Capsuled& capsule = static_cast<const ::fcl::Capsuled&>(geometry);
        const Vector3 along = core.axes.col(2) * (capsule.lz / 2);
        core.radius = capsule.radius;
        core.vertices = {core.center - along, core.center + along};
        core.edges.push_back({{0, 1}});
        setSize(core);
        break;
    }
    case ::fcl::GEOM_CONVEX:
        addConvex(core, static_cast<const ::fcl::Convexd&>(geometry));
        setSize(core);
        break;
    case ::fcl::GEOM_TRIANGLE: {
        const ::fcl::TrianglePd& triangle = static_cast<const ::fcl::TrianglePd&>(geometry);
        const Matrix3 axes = core.axes;
        const Vector3 center = core.center;
        core = makeTriangle(center + axes * triangle.a, center + axes * triangle.b, center + axes * triangle.c);
        break;
    }
    case ::fcl::GEOM_CYLINDER: {
        const ::fcl::Cylinderd& cylinder = static_cast<const ::fcl::Cylinderd&>(geometry);
        core.solid = Solid::cylinder;
        core.half = Vector3(cylinder.radius, cylinder.radius, cylinder.lz / 2);
        core.size = std::hypot(cylinder.radius, cylinder.lz / 2);
        break;
    }
    case ::fcl::GEOM_CONE: {
        const ::fcl::Coned& cone = static_cast<const ::fcl::Coned&>(geometry);
        core.solid = Solid::cone;
        core.half = Vector3(cone.radius, cone.radius, cone.lz / 2);
        core.size = std::hypot(cone.radius, cone.lz / 2);
        break;
    }
    case ::fcl::GEOM_ELLIPSOID:
        core.solid = Solid::ellipsoid;
        core.half = static_cast<const ::fcl::Ellipsoidd&>(geometry).radii;
        core.size = core.half.maxCoeff();
        break;
    case ::fcl::GEOM_HALFSPACE: {
        const ::fcl::Halfspaced& halfSpace = static_cast<const ::fcl::Halfspaced&>(geometry);
        core.solid = Solid::halfSpace;
        core.planeNormal = core.axes * halfSpace.n;
        core.planeOffset = halfSpace.d + core.planeNormal.dot(core.center);
        core.size = std::numeric_limits<double>::infinity();
        break;
    }
    case ::fcl::GEOM_PLANE: {
        const ::fcl::Planed& plane = static_cast<const ::fcl::Planed&>(geometry);
        core.solid = Solid::halfSpace;
        core.planeNormal = core.axes * plane.n;
        core.planeOffset = plane.d + core.planeNormal.dot(core.center);
        core.size = std::numeric_limits<double>::infinity();
        if (core.planeNormal.dot(other) < core.planeOffset) {
            core.planeNormal = -core.planeNormal;
            core.planeOffset = -core.planeOffset;
        }
        break;
    }
    default:
        throw std::invalid_argument("cairn::fcl: an object is neither a convex shape nor a half space nor a plane: FCL's node type " +
                                    std::to_string(geometry.getNodeType()));
    }
    return core;
}

Core makeTriangle(const Vector3& a, const Vector3& b, const Vector3& c) {
    Core core;
    core.center = (a + b + c) / 3;
    core.vertices = {a, b, c};
    core.edges = {{{0, 1}}, {{1, 2}}, {{0, 2}}};
    const Vector3 area = (b - a).cross(c - a);
    if (area.norm() > 0)
        core.normals = {area.normalized(), -area.normalized()};
    setSize(core);
    return core;
}

Vector3 furthest(const Core& core, const Vector3& direction) {
    switch (core.solid) {
    case Solid::cylinder: {
        const Vector3 axis = core.axes.col(2);
        return core.center + axis * (axis.dot(direction) < 0 ? -core.half.z() : core.half.z()) + towardsRim(core, direction);
    }
    case Solid::cone: {
        const Vector3 tip = core.center + core.axes.col(2) * core.half.z();
        const Vector3 rim = core.center - core.axes.col(2) * core.half.z() + towardsRim(core, direction);
        return direction.dot(rim - tip) > 0 ? rim : tip;
    }
    case Solid::ellipsoid: {
        const Vector3 scaled = core.half.cwiseProduct(core.axes.transpose() * direction);
        return core.center + core.axes * core.half.cwiseProduct(scaled.normalized());
    }
    default:
        break;
    }
    const Vector3* best = &core.vertices.front();
    double top = direction.dot(*best - core.center);
    for (const Vector3& vertex : core.vertices) {
        const double height = direction.dot(vertex - core.center);
        if (height > top) {
            top = height;
            best = &vertex;
        }
    }
    return *best + core.radius * direction;
}

std::vector<Vector3> featureTowards(const Core& core, const Vector3& direction, Vector3& normal) {
    normal = direction;
    const Vector3 axis = core.axes.col(2);
    const double slope = axis.dot(direction);
    switch (core.solid) {
    case Solid::cylinder: {
        if (std::abs(slope) > kCapSlope) {
            const double sign = slope < 0 ? -1 : 1;
            normal = sign * axis;
            return cap(core, sign * core.half.z(), sign);
        }
        const Vector3 side = core.center + towardsRim(core, direction);
        return {side - core.half.z() * axis, side + core.half.z() * axis};
    }
    case Solid::cone: {
        if (slope < -kCapSlope) {
            normal = -axis;
            return cap(core, -core.half.z(), -1);
        }
        const Vector3 tip = core.center + core.half.z() * axis;
        if (slope > 0.99)
            return {tip};
        return {core.center - core.half.z() * axis + towardsRim(core, direction), tip};
    }
    case Solid::ellipsoid:
        return {furthest(core, direction)};
    default:
        break;
    }
    if (!core.normals.empty())
        return faceTowards(core, direction, normal);
    if (core.isSegment()) {
        const Vector3 along = core.vertices[1] - core.vertices[0];
        const double rise = along.dot(direction);
        if (std::abs(rise) > 0.99 * along.norm()) // upright: one end touches
            return {core.vertices[rise > 0 ? 1 : 0]};
    }
    return core.vertices;
}

} // namespace fcl
} // namespace cairn
