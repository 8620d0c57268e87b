// Bounces reach e^2 of their height, slow ones do not bounce, and the extra sweeps are counted.
#include "methods.h"
#include "shapes.h"

namespace cairn_test {
namespace {

class Restitution : public EachMethod {};
CAIRN_EACH_METHOD(Restitution);

// Drops a body by `height` and gives back the height of its first bounce, of its centre over where it rests.
template <class Touch> double bounce(const cairn_params& params, Body body, double rest, double height, const Touch& touch) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.dt = 1.0 / 500;
    body.position = Vec3(0, 0, rest + height);
    scene.add(body);
    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    double highest = 0;
    bool bounced = false;
    for (int frame = 0; frame < 1000; ++frame) {
        scene.contacts.clear();
        touch(scene);
        scene.step(solver);
        const Body& now = scene.bodies[0];
        if (bounced && now.linear.z() < 0)
            return highest;
        if (now.linear.z() > 0.05)
            bounced = true;
        if (bounced)
            highest = std::max(highest, now.position.z() - rest);
    }
    return highest;
}

cairn_params bouncing(std::uint32_t method) {
    cairn_params params = preset(method);
    params.substeps = std::min(params.substeps, 4u);
    params.iterations = 40 * params.substeps;
    return params;
}

TEST_P(Restitution, SphereBouncesToESquared) {
    for (const double e : {0.3, 0.6, 0.9, 1.0}) {
        const double height = bounce(bouncing(GetParam()), Body::sphere(1, 0.25, Vec3::Zero()), 0.25, 1,
                                     [&](Scene& scene) { touch_sphere(scene, 0, 0.25, Plane{}, 0.3, e); });
        EXPECT_NEAR(height, e * e, 0.02) << "e = " << e;
    }
}

// On four corners one sweep reaches a quarter of e only, so this needs the sweeps that the parameters promise.
TEST_P(Restitution, BoxBouncesToESquared) {
    const Vec3 half(0.3, 0.3, 0.2);
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD}) {
        for (const double e : {0.5, 1.0}) {
            cairn_params params = bouncing(GetParam());
            params.splitting = splitting;
            params.restitution_iterations = 60;
            const double height = bounce(params, Body::box(1, half, Vec3::Zero()), half.z(), 1,
                                         [&](Scene& scene) { touch_box(scene, 0, half, Plane{}, 0.3, e); });
            EXPECT_NEAR(height, e * e, 0.02) << "e = " << e;
        }
    }
}

TEST_P(Restitution, SlowApproachDoesNotBounce) {
    cairn_params params = bouncing(GetParam());
    params.restitution_threshold = 1;
    for (const double speed : {0.9, 1.1}) {
        Scene scene;
        Body ball = Body::sphere(1, 0.25, {0, 0, 0.25});
        ball.linear = Vec3(0, 0, -speed);
        scene.add(ball);
        touch_sphere(scene, 0, 0.25, Plane{}, 0, 1);
        const Solver solver;
        check(cairn_solver_set_params(solver.get(), &params));
        scene.step(solver);
        EXPECT_NEAR(scene.bodies[0].linear.z(), speed > 1 ? speed : 0, 1e-2); // soft contacts leave a little
    }
}

// Gravity's share of the approach is not thrown back: a resting ball does not hop, whatever its e.
TEST_P(Restitution, ARestingBallStaysAtRest) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.add(Body::sphere(1, 0.25, {0, 0, 0.25}));
    cairn_params params = bouncing(GetParam());
    params.restitution_threshold = 0;
    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 100; ++frame) {
        scene.contacts.clear();
        touch_sphere(scene, 0, 0.25, Plane{}, 0, 1);
        scene.step(solver);
        EXPECT_LT(scene.bodies[0].position.z(), 0.2505);
    }
}

// The impulses of a bounce are all reported: m (v+ - v) is their sum.
TEST_P(Restitution, ImpulsesIncludeTheBounce) {
    Scene scene;
    const double mass = 2;
    Body ball = Body::sphere(mass, 0.25, {0, 0, 0.25});
    ball.linear = Vec3(0.5, 0, -3);
    scene.add(ball);
    touch_sphere(scene, 0, 0.25, Plane{}, 0.4, 0.5);
    cairn_params params = bouncing(GetParam());
    params.relax_share = 0.2;
    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    const Vec3 before = scene.bodies[0].linear;
    const Impulses out = scene.step(solver);
    const Vec3 change = mass * (scene.bodies[0].linear - before);
    EXPECT_NEAR(out.contact[0], change.z(), 1e-4);
    EXPECT_NEAR(out.friction_of(0).x(), change.x(), 1e-4);
    EXPECT_NEAR(scene.bodies[0].linear.z(), 1.5, 1e-3);
}

TEST_P(Restitution, ExtraSweepsAreCounted) {
    cairn_params params = plain(GetParam(), 12);
    if (GetParam() == CAIRN_METHOD_TJ || GetParam() == CAIRN_METHOD_TJSOFT)
        params.substeps = 3;
    params.relax_share = 0.5;
    params.restitution_iterations = CAIRN_SAME_AS_SWEEPS;
    if (GetParam() == CAIRN_METHOD_PJNJ)
        params.position_iterations = 7;
    for (const double e : {0.0, 0.8}) {
        Scene scene;
        Body ball = Body::sphere(1, 0.25, {0, 0, 0.25});
        ball.linear = Vec3(0, 0, -3);
        scene.add(ball);
        touch_sphere(scene, 0, 0.25, Plane{}, 0, e);
        const Solver solver;
        check(cairn_solver_set_params(solver.get(), &params));
        scene.step(solver);
        const cairn_statistics s = solver.statistics();
        EXPECT_EQ(s.substeps, params.substeps);
        EXPECT_EQ(s.iterations, 12u);
        EXPECT_EQ(s.relax_iterations, 6u);
        EXPECT_EQ(s.restitution_iterations, e > 0 ? 12 / params.substeps : 0u);
        EXPECT_EQ(s.position_iterations, params.position_iterations);
    }
}

// Relaxation takes out the speed that the bias put in: an overlapping pair parts, yet leaves no speed behind.
TEST_P(Restitution, RelaxationLeavesNoPushOutSpeed) {
    for (const double relax : {0.0, 0.5}) {
        Scene scene;
        scene.add(Body::sphere(1, 0.25, {0, 0, 0.24}));
        touch_sphere(scene, 0, 0.25, Plane{}, 0);
        cairn_params params = plain(GetParam(), 100);
        params.relax_share = relax;
        if (GetParam() == CAIRN_METHOD_PJNJ)
            params.position_iterations = 10;
        const Solver solver;
        check(cairn_solver_set_params(solver.get(), &params));
        scene.step(solver);
        EXPECT_GT(scene.bodies[0].position.z(), 0.2405);
        if (relax != 0 || GetParam() == CAIRN_METHOD_PJNJ) {
            EXPECT_NEAR(scene.bodies[0].linear.z(), 0, 1e-5);
        } else {
            EXPECT_GT(scene.bodies[0].linear.z(), 0.05);
        }
    }
}

} // namespace
} // namespace cairn_test
