// Contacts of boxes and spheres with planes and each other: the collision detection that the tests' scenes need.
#pragma once
#include "scene.h"

#include <algorithm>
#include <cmath>

namespace cairn_test {

// Through the origin, its normal up and out.
struct Plane {
    Vec3 normal = Vec3::UnitZ();
    double distance(const Vec3& point) const { return normal.dot(point); }
};

// The corners of a box that are nearer to the plane than `margin`, at most four: a manifold with the world.
inline void touch_box(Scene& scene, int box, const Vec3& half, const Plane& plane, double friction, double restitution = 0,
                      double margin = 0.02) {
    const Body& body = scene.bodies[static_cast<std::size_t>(box)];
    struct Corner {
        double distance;
        std::uint64_t number;
        Vec3 arm;
    };
    std::vector<Corner> corners;
    for (std::uint64_t i = 0; i < 8; ++i) {
        const Vec3 sign(i & 1u ? 1 : -1, i & 2u ? 1 : -1, i & 4u ? 1 : -1);
        const Vec3 arm = body.orientation * half.cwiseProduct(sign);
        const double distance = plane.distance(body.position + arm);
        if (distance < margin)
            corners.push_back({distance, i, arm});
    }
    std::sort(corners.begin(), corners.end(),
              [](const Corner& a, const Corner& b) { return a.distance != b.distance ? a.distance < b.distance : a.number < b.number; });
    if (corners.size() > 4)
        corners.resize(4);
    std::sort(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) { return a.number < b.number; });
    for (const Corner& corner : corners) {
        Contact c;
        c.b = box;
        c.normal = plane.normal;
        c.arm_b = corner.arm;
        c.arm_a = body.position + corner.arm - corner.distance * plane.normal;
        c.separation = corner.distance;
        c.friction = friction;
        c.restitution = restitution;
        c.key = static_cast<std::uint64_t>(box) * 8 + corner.number + 1;
        scene.contacts.push_back(c);
    }
}

inline void touch_sphere(Scene& scene, int sphere, double radius, const Plane& plane, double friction, double restitution = 0,
                         double margin = 0.02) {
    const Body& body = scene.bodies[static_cast<std::size_t>(sphere)];
    Contact c;
    c.b = sphere;
    c.normal = plane.normal;
    c.arm_b = -radius * plane.normal;
    c.separation = plane.distance(body.position) - radius;
    c.arm_a = body.position - (radius + c.separation) * plane.normal;
    c.friction = friction;
    c.restitution = restitution;
    c.key = static_cast<std::uint64_t>(sphere) * 8 + 1;
    c.flags = CAIRN_CONTACT_ROUND_B;
    if (c.separation < margin)
        scene.contacts.push_back(c);
}

inline void touch_spheres(Scene& scene, int a, int b, double radius_a, double radius_b, double friction, double margin = 0.02) {
    const Body &first = scene.bodies[static_cast<std::size_t>(a)], &second = scene.bodies[static_cast<std::size_t>(b)];
    const Vec3 between = second.position - first.position;
    const double separation = between.norm() - radius_a - radius_b;
    if (separation > margin)
        return;
    Contact c;
    c.a = a;
    c.b = b;
    c.normal = between.normalized();
    c.arm_a = radius_a * c.normal;
    c.arm_b = -radius_b * c.normal;
    c.separation = separation;
    c.friction = friction;
    c.key = (static_cast<std::uint64_t>(a + 1) << 32) | (static_cast<std::uint64_t>(b) << 4) | 2u;
    c.flags = CAIRN_CONTACT_ROUND_A | CAIRN_CONTACT_ROUND_B;
    scene.contacts.push_back(c);
}

// Gives contacts what few have, by their key: some nothing, some one thing, some several.
inline void vary_contacts(Scene& scene) {
    for (Contact& c : scene.contacts) {
        const std::uint64_t choice = (c.key * 0x9e3779b97f4a7c15u) >> 32;
        if (choice % 2 == 0)
            continue;
        c.tangent = Vec3(1, 2, 3);
        if (choice & 2u)
            c.friction_scale = Eigen::Vector2d(1.5, choice & 64u ? 0 : 0.5);
        if (choice & 4u)
            c.surface_velocity = Vec3(0.3, -0.2, 0.1);
        if (choice & 8u)
            c.rolling_friction = 0.01;
        if (choice & 16u)
            c.spinning_friction = 0.02;
        if (choice & 32u) {
            c.stiffness = choice & 128u ? 0 : 2000;
            c.damping = 30;
        }
    }
}

} // namespace cairn_test
