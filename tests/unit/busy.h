// Scenes and parameters under which a few short steps use everything that the solver has: for tests that compare bits.
#pragma once
#include "dense.h"
#include "shapes.h"

#include <algorithm>

namespace cairn_test {

// Balls in loose blocks of edge x edge x edge, three blocks' widths apart, that fall together on the ground below `origin`: every
// second one fast enough to bounce, every third joined to the next by a hinge, every other of these hinges limited.
struct Heaps : Scene {
    static constexpr double kRadius = 0.1;
    int edge;
    Vec3 origin;

    Heaps(int count, int balls_an_edge, const Vec3& place = Vec3::Zero()) : edge(balls_an_edge), origin(place) {
        Random random(5);
        gravity = Vec3(0, 0, -9.81);
        for (int i = 0; i < count; ++i) {
            const int heap = i / size();
            const Vec3 cell(i % edge + 3 * edge * heap, i / edge % edge, i / (edge * edge) % edge);
            Body ball = Body::sphere(1 + i % 3, kRadius, origin + Vec3(0, 0, kRadius) + 0.199 * cell + random_vec(random, 0.004));
            ball.orientation = random_quat(random);
            ball.linear = random_vec(random, 0.5) - Vec3(0, 0, i % 2 == 0 ? 1 : 0);
            ball.angular = random_vec(random, 1);
            if (i % 4 == 0)
                ball.inverse_inertia = ball.inverse_inertia.cwiseProduct(Vec3(1, 0.8, 0.7));
            add(ball);
        }
        for (int i = 0; i + 1 < count; i += 3) {
            if ((i + 1) % size() == 0)
                continue; // the next is of another heap
            const auto at = static_cast<std::size_t>(i);
            Joint& joint = join(i, i + 1, 0.5 * (bodies[at].position + bodies[at + 1].position), axes_of(CAIRN_JOINT_HINGE));
            joint.key = (std::uint64_t{1} << 62) + at;
            if (i % 2 == 0) {
                joint.axes[5] = CAIRN_AXIS_LIMITED;
                joint.lower[5] = -0.1;
                joint.upper[5] = 0.1;
            }
        }
        touch();
    }

    int size() const { return edge * edge * edge; } // of a heap, in balls

    // Finds the contacts anew. Balls of two heaps are not looked at: they do not meet in the few frames that tests take.
    void touch() {
        contacts.clear();
        const int count = static_cast<int>(bodies.size());
        for (int i = 0; i < count; ++i) {
            Body& body = bodies[static_cast<std::size_t>(i)];
            const Vec3 place = body.position;
            body.position.z() -= origin.z();
            touch_sphere(*this, i, kRadius, Plane{}, 0.4, 0.3);
            body.position = place;
            for (int j = i + 1; j < std::min(count, (i / size() + 1) * size()); ++j)
                touch_spheres(*this, i, j, kRadius, kRadius, 0.4);
        }
        vary_contacts(*this);
    }
};

// A random scene with every kind of constraint, whose numbers do not fill whole SIMD batches or warps.
inline Scene every_kind(std::uint64_t seed) {
    Random random(seed);
    Scene scene = random_bodies(random, 3 + static_cast<int>(seed));
    add_random_joints(random, scene, 0.01);
    scene.joints[0].axes = {CAIRN_AXIS_LOCKED,  CAIRN_AXIS_LOCKED,  CAIRN_AXIS_DRIVEN,
                            CAIRN_AXIS_LIMITED, CAIRN_AXIS_LIMITED, CAIRN_AXIS_FREE};
    scene.joints[0].motor_speed[2] = 1;
    scene.joints[0].motor_force[2] = 5;
    if (scene.joints.size() > 2) {
        Joint &cone = scene.joints[1], &servos = scene.joints[2];
        cone.axes = {CAIRN_AXIS_SPRING, CAIRN_AXIS_LOCKED,  CAIRN_AXIS_SPRING | CAIRN_AXIS_LIMITED,
                     CAIRN_AXIS_SPRING, CAIRN_AXIS_LIMITED, CAIRN_AXIS_LIMITED};
        cone.rotation = CAIRN_ROTATION_CONE;
        cone.stiffness = {50, 0, 20, 5, 0, 0};
        cone.damping = {1, 0, 0, 0.5, 0, 0};
        cone.lower = {0, 0, -0.1, 0, 0, 0};
        cone.upper = {0, 0, 0.1, 0, 0.2, 0.1};
        cone.max_force = 30;
        constexpr std::uint32_t servo = CAIRN_AXIS_DRIVEN | CAIRN_AXIS_SERVO;
        servos.axes = {CAIRN_AXIS_LOCKED, CAIRN_AXIS_LOCKED, servo, servo, servo, servo};
        servos.rotation = CAIRN_ROTATION_VECTOR;
        servos.target = {0, 0, 0.1, 0.3, -0.2, 0.1};
        servos.stiffness = {0, 0, 40, kInfinity, kInfinity, 3};
        servos.rate = {0, 0, 7, 10, kInfinity, 3};
        servos.motor_speed = {0, 0, kInfinity, 2, 1, 1};
        servos.motor_force = {0, 0, 10, 5, kInfinity, 5};
    }
    add_random_contacts(random, scene, 2 + static_cast<int>(seed * 5), 0.5);
    if (seed == 2)
        for (Contact& c : scene.contacts)
            c.rolling_friction = c.stiffness = uniform(random, 0, 0.2);
    for (const int target : {0, 1, 0}) {
        Row row;
        row.b = target;
        row.jacobian_b[2] = 1;
        row.lower = -0.1;
        scene.rows.push_back(row);
    }
    for (Body& body : scene.bodies)
        body.flags = 0;
    return scene;
}

// A preset with few sweeps, but with relaxation and a trace.
inline cairn_params busy(std::uint32_t method, std::uint32_t which = CAIRN_PRESET_DEFAULT) {
    cairn_params params = preset(method, which);
    params.substeps = std::min(params.substeps, 2u);
    params.iterations = 8;
    params.position_iterations = std::min(params.position_iterations, 4u);
    params.relax_share = 0.25;
    params.residual_trace = 1;
    return params;
}

} // namespace cairn_test
