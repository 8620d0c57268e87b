#include "mesh.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/bv/AABB.h>
#include <fcl/math/bv/OBB.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/math/bv/RSS.h>
#include <fcl/math/bv/kDOP.h>
#include <fcl/math/bv/kIOS.h>

#include <algorithm>
#include <cmath>

namespace cairn {
namespace fcl {
namespace {

template <class Volume> std::array<Vector3, 3> cornersIn(const Geometry& geometry, intptr_t triangle) {
    const ::fcl::BVHModel<Volume>& model = static_cast<const ::fcl::BVHModel<Volume>&>(geometry);
    const ::fcl::Triangle& indices = model.tri_indices[triangle];
    return {{model.vertices[indices[0]], model.vertices[indices[1]], model.vertices[indices[2]]}};
}

std::array<Vector3, 3> cornersOf(const Geometry& mesh, intptr_t triangle) {
    switch (mesh.getNodeType()) {
    case ::fcl::BV_AABB:
        return cornersIn<::fcl::AABBd>(mesh, triangle);
    case ::fcl::BV_OBB:
        return cornersIn<::fcl::OBBd>(mesh, triangle);
    case ::fcl::BV_RSS:
        return cornersIn<::fcl::RSSd>(mesh, triangle);
    case ::fcl::BV_kIOS:
        return cornersIn<::fcl::kIOSd>(mesh, triangle);
    case ::fcl::BV_OBBRSS:
        return cornersIn<::fcl::OBBRSSd>(mesh, triangle);
    case ::fcl::BV_KDOP16:
        return cornersIn<::fcl::KDOP<double, 16>>(mesh, triangle);
    case ::fcl::BV_KDOP18:
        return cornersIn<::fcl::KDOP<double, 18>>(mesh, triangle);
    default:
        return cornersIn<::fcl::KDOP<double, 24>>(mesh, triangle);
    }
}

bool sameWay(const Point& point, const Vector3& normal) { return point.normal.dot(normal) > 0.99; }

} // namespace

bool isMesh(const Geometry& geometry) { return geometry.getObjectType() == ::fcl::OT_BVH; }

std::vector<Point> meshPoints(const Geometry& a, const Transform& poseA, const Geometry& b, const Transform& poseB, const Vector3& origin,
                              const ::fcl::CollisionResultd& result, bool hasPoints, double margin) {
    const bool aIsMesh = isMesh(a), bIsMesh = isMesh(b);
    const bool swapped = bIsMesh && !aIsMesh; // FCL puts the mesh first, whichever came first in the call
    const Geometry& mesh = swapped ? b : a;
    const Transform& meshPose = swapped ? poseB : poseA;
    Core shape;
    if (!(aIsMesh && bIsMesh))
        shape = makeCore(swapped ? a : b, swapped ? poseA : poseB, origin, meshPose.translation() - origin);
    const bool clips = shape.size > 0 && shape.solid != Solid::halfSpace;
    std::vector<Point> points;
    for (std::size_t i = 0; i < result.numContacts(); ++i) {
        const ::fcl::Contactd& contact = result.getContact(i);
        const Vector3 normal = swapped ? Vector3(-contact.normal) : contact.normal;
        if (clips) {
            std::array<Vector3, 3> corners = cornersOf(mesh, contact.b1);
            for (Vector3& corner : corners)
                corner = meshPose.linear() * corner + (meshPose.translation() - origin);
            const Core triangle = makeTriangle(corners[0], corners[1], corners[2]);
            if (triangle.normals.empty())
                continue;
            const bool front = triangle.normals[0].dot(shape.center - corners[0]) >= 0;
            std::vector<Point> over = overTriangle(triangle, shape, triangle.normals[front ? 0 : 1], margin);
            for (Point& point : over)
                points.push_back(swapped ? Point{point.onA + point.separation * point.normal, -point.normal, point.separation} : point);
            if (!over.empty())
                continue;
        }
        if (hasPoints && std::abs(normal.squaredNorm() - 1) < 1e-6 && std::isfinite(contact.penetration_depth)) {
            const Vector3 middle = contact.pos - origin;
            points.push_back(Point{middle + normal * (contact.penetration_depth / 2), normal, -contact.penetration_depth});
        }
    }
    // Manifolds follow each other by direction: the floor's points, then the wall's.
    std::vector<Point> ordered;
    while (!points.empty()) {
        const Vector3 normal = points.front().normal;
        std::vector<Point> together, rest;
        for (const Point& point : points)
            (sameWay(point, normal) ? together : rest).push_back(point);
        reduceToFour(together, clips ? shape.size : std::min(a.aabb_radius, b.aabb_radius));
        ordered.insert(ordered.end(), together.begin(), together.end());
        points.swap(rest);
    }
    return ordered;
}

} // namespace fcl
} // namespace cairn
