// Coulomb friction: exact fixed points, stopping distance, stick and slip in every direction of the plane.
#include "dense.h"
#include "methods.h"
#include "shapes.h"

#include <gtest/gtest.h>

namespace cairn_test {
namespace {

constexpr double kGravity = 9.81;

// A plane that falls at `angle` towards the direction `heading` about the vertical.
Plane slope(double angle, double heading) {
    return {Vec3(std::sin(angle) * std::cos(heading), std::sin(angle) * std::sin(heading), std::cos(angle))};
}

class Friction : public EachMethod {};
CAIRN_EACH_METHOD(Friction);

// A contact whose arm is not below the centre of mass couples normal and tangent. In the plane of the arm the answer is one
// linear equation: lambda_n (A_nn - mu A_nt s) = -(w_n + bias) with s the sense of the slip.
TEST(Coulomb, OffCentreSlidingContactIsExact) {
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD}) {
        for (const double mu : {0.1, 0.3, 0.6}) {
            Scene scene;
            scene.gravity = Vec3(0, 0, -kGravity);
            Body body = Body::box(2, {0.5, 0.4, 0.3}, {0, 0, 0.3});
            body.linear = Vec3(4, 0, -0.5);
            body.flags = CAIRN_BODY_NO_GYROSCOPIC;
            scene.add(body);
            Contact c;
            c.b = 0;
            c.arm_b = Vec3(0.45, 0, -0.3);
            c.arm_a = Vec3(0.45, 0, 0);
            c.friction = mu;
            scene.contacts.push_back(c);
            const BiasRule rule = BiasRule::of(plain(CAIRN_METHOD_PJ, 1), scene.dt);
            Dense dense(scene, scene.dt);
            dense.add_contact(scene, c, rule, false, 0);
            const Mat row = dense.j;
            Mat along = Mat::Zero(1, 6);
            along << 1, 0, 0, c.arm_b.cross(Vec3::UnitX()).transpose();
            const double ann = (row * dense.w * row.transpose())(0, 0), ant = (row * dense.w * along.transpose())(0, 0);
            const double expected = -dense.q()[0] / (ann - mu * ant); // slip is towards +x, friction towards -x

            const Solver solver(64);
            cairn_params params = plain(CAIRN_METHOD_PJ, 5000);
            params.splitting = splitting;
            check(cairn_solver_set_params(solver.get(), &params));
            const Impulses out = scene.step(solver);
            const Vec3 slip = scene.bodies[0].linear + scene.bodies[0].angular.cross(c.arm_b);
            ASSERT_GT(slip.x(), 0.5);
            EXPECT_NEAR(out.contact[0], expected, 1e-9 * expected);
            EXPECT_NEAR(out.friction_of(0).x(), -mu * expected, 1e-9 * expected);
            EXPECT_NEAR(out.friction_of(0).y(), 0, 1e-9);
            EXPECT_NEAR(slip.z(), 0, 1e-9);
        }
    }
}

// Any converged scene: w = J v+ + bias obeys Signorini and Coulomb, and v+ is v_free + M^-1 J^T lambda.
TEST(Coulomb, ConvergedScenesObeyTheLaw) {
    int sliding = 0, sticking = 0, open = 0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
            Random random(seed);
            Scene scene = random_bodies(random, 5);
            add_random_contacts(random, scene, 7, seed % 2 != 0 ? 0.3 : 2);
            const Scene start = scene;
            const Solver solver(64);
            cairn_params params = plain(CAIRN_METHOD_PJ, 10000);
            params.acceleration = acceleration;
            params.residual_trace = 1;
            check(cairn_solver_set_params(solver.get(), &params));
            const Impulses out = scene.step(solver);
            if (solver.residual_trace().back() > 1e-11)
                continue; // not converged: nothing is claimed
            Dense dense(start, start.dt);
            const BiasRule rule = BiasRule::of(params, start.dt);
            Vec lambda(static_cast<Eigen::Index>(3 * start.contacts.size()));
            for (std::size_t i = 0; i < start.contacts.size(); ++i) {
                dense.add_contact(start, start.contacts[i], rule, true, static_cast<int>(i));
                Vec3 t1, t2;
                tangents_of(start.contacts[i].normal, t1, t2);
                const Vec3 friction = out.friction_of(i);
                EXPECT_NEAR(friction.dot(start.contacts[i].normal), 0, 1e-9);
                lambda.segment<3>(static_cast<Eigen::Index>(3 * i)) = Vec3(out.contact[i], friction.dot(t1), friction.dot(t2));
            }
            EXPECT_LT((velocities(scene) - dense.velocity(lambda)).cwiseAbs().maxCoeff(), 1e-8) << "seed " << seed;
            const Vec w = dense.a() * lambda + dense.q();
            for (std::size_t i = 0; i < start.contacts.size(); ++i) {
                const Vec3 p = lambda.segment<3>(static_cast<Eigen::Index>(3 * i)), u = w.segment<3>(static_cast<Eigen::Index>(3 * i));
                const double bound = start.contacts[i].friction * p.x(), size = p.tail<2>().norm(), slip = u.tail<2>().norm();
                EXPECT_GE(p.x(), 0);
                EXPECT_GT(u.x(), -1e-8);
                EXPECT_NEAR(p.x() * u.x(), 0, 1e-8);
                EXPECT_LE(size, bound + 1e-9);
                if (p.x() < 1e-6) {
                    ++open;
                } else if (size < bound - 1e-6) {
                    EXPECT_LT(slip, 1e-7) << "sticks, yet slips";
                    ++sticking;
                } else if (slip > 1e-6) {
                    EXPECT_NEAR(p.tail<2>().dot(u.tail<2>()), -size * slip, 1e-7) << "friction does not oppose slip";
                    ++sliding;
                }
            }
        }
    }
    EXPECT_GT(sliding, 10);
    EXPECT_GT(sticking, 5);
    EXPECT_GT(open, 5);
}

// A box sliding at v stops after v^2 / (2 mu g).
TEST_P(Friction, SlidingBoxStopsWhereItShould) {
    const double mu = 0.5, speed = 3;
    const Vec3 half(0.5, 0.4, 0.2);
    Scene scene;
    scene.gravity = Vec3(0, 0, -kGravity);
    scene.dt = 1.0 / 240;
    Body box = Body::box(3, half, {0, 0, half.z()});
    box.linear = Vec3(speed, 0, 0);
    scene.add(box);
    const Solver solver;
    cairn_params params = preset(GetParam());
    params.substeps = std::min(params.substeps, 4u);
    params.iterations = 80;
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 240; ++frame) {
        scene.contacts.clear();
        touch_box(scene, 0, half, Plane{}, mu);
        scene.step(solver);
    }
    EXPECT_LT(scene.bodies[0].linear.norm(), 1e-3);
    // speed falls by mu g h each (sub)step, so the sum of the steps lags the integral by at most half a step
    EXPECT_NEAR(scene.bodies[0].position.x(), speed * speed / (2 * mu * kGravity), speed * scene.dt * 0.5 + 0.005);
    EXPECT_NEAR(scene.bodies[0].position.y(), 0, 1e-3);
    EXPECT_NEAR(scene.bodies[0].position.z(), half.z(), 2e-3);
}

// Speed of a flat box along the slope after `frames` frames, and how far it has gone across.
Vec3 slide(std::uint32_t method, std::uint32_t friction_model, double mu, double angle, double heading, double turn, int frames) {
    const Vec3 half(0.4, 0.4, 0.05);
    const Plane plane = slope(angle, heading);
    Scene scene;
    scene.gravity = Vec3(0, 0, -kGravity);
    scene.dt = 0.01;
    Body box = Body::box(2, half, half.z() * plane.normal);
    box.orientation = Quat::FromTwoVectors(Vec3::UnitZ(), plane.normal) * Quat(Eigen::AngleAxisd(turn, Vec3::UnitZ()));
    scene.add(box);
    const Solver solver;
    cairn_params params = preset(method);
    params.iterations = 200;
    params.friction_model = friction_model;
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < frames; ++frame) {
        scene.contacts.clear();
        touch_box(scene, 0, half, plane, mu);
        scene.step(solver);
    }
    return scene.bodies[0].linear;
}

TEST_P(Friction, SticksAndSlipsOnSlopesInEveryDirection) {
    const double angle = std::atan(0.5);
    const int frames = 50;
    const double time = frames * 0.01;
    for (int k = 0; k < 12; ++k) {
        const double heading = k * 0.5236 + 0.1;
        EXPECT_LT(slide(GetParam(), CAIRN_FRICTION_CONE, 0.6, angle, heading, 0.3 * k, frames).norm(), 2e-3) << "creeps at " << heading;
        const Vec3 v = slide(GetParam(), CAIRN_FRICTION_CONE, 0.3, angle, heading, 0.3 * k, frames);
        const double expected = kGravity * (std::sin(angle) - 0.3 * std::cos(angle)) * time;
        EXPECT_NEAR(v.norm(), expected, 1e-3 * expected) << "at " << heading;
        const Vec3 downhill(std::cos(angle) * std::cos(heading), std::cos(angle) * std::sin(heading), -std::sin(angle));
        EXPECT_GT(v.normalized().dot(downhill), 1 - 1e-6) << "does not slide straight down at " << heading;
    }
}

// The pyramid bounds each component by mu lambda_n, so its friction is mu N along a tangent and up to sqrt(2) mu N between.
TEST(Pyramid, IsAnisotropicWithinItsBound) {
    const double angle = std::atan(0.5), mu = 0.3;
    const auto speed_at = [&](double turn) {
        // gravity leans instead of the plane, and the tangents are the plane's x and y: the direction is known exactly
        Scene scene;
        scene.gravity = kGravity * Vec3(std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), -std::cos(angle));
        scene.dt = 0.01;
        const Vec3 half(0.4, 0.4, 0.05);
        scene.add(Body::box(2, half, {0, 0, half.z()}));
        const Solver solver;
        cairn_params params = plain(CAIRN_METHOD_PJ, 300);
        params.friction_model = CAIRN_FRICTION_PYRAMID;
        check(cairn_solver_set_params(solver.get(), &params));
        for (int frame = 0; frame < 50; ++frame) {
            scene.contacts.clear();
            touch_box(scene, 0, half, Plane{}, mu);
            for (Contact& c : scene.contacts)
                c.tangent = Vec3::UnitX();
            const Impulses out = scene.step(solver);
            for (std::size_t i = 0; i < scene.contacts.size(); ++i) {
                const double bound = mu * out.contact[i] * (1 + 1e-5) + 1e-7;
                EXPECT_LE(std::abs(out.friction_of(i).x()), bound);
                EXPECT_LE(std::abs(out.friction_of(i).y()), bound);
            }
        }
        return scene.bodies[0].linear.norm();
    };
    const double along = speed_at(0), between = speed_at(std::acos(-1.0) / 4), time = 0.5;
    EXPECT_NEAR(along, kGravity * (std::sin(angle) - mu * std::cos(angle)) * time, 0.01);
    EXPECT_NEAR(between, kGravity * (std::sin(angle) - std::sqrt(2.0) * mu * std::cos(angle)) * time, 0.01);
}

// Without friction a box keeps its speed for ever.
TEST_P(Friction, NoFrictionModelMeansNoFriction) {
    const Vec3 half(0.4, 0.3, 0.2);
    Scene scene;
    scene.gravity = Vec3(0, 0, -kGravity);
    Body box = Body::box(1, half, {0, 0, half.z()});
    box.linear = Vec3(2, 1, 0);
    scene.add(box);
    const Solver solver;
    cairn_params params = preset(GetParam());
    params.friction_model = CAIRN_FRICTION_NONE;
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 60; ++frame) {
        scene.contacts.clear();
        touch_box(scene, 0, half, Plane{}, 0.8);
        const Impulses out = scene.step(solver);
        for (const double p : out.friction)
            EXPECT_EQ(p, 0);
    }
    EXPECT_NEAR(scene.bodies[0].linear.x(), 2, 1e-5);
    EXPECT_NEAR(scene.bodies[0].linear.y(), 1, 1e-5);
}

} // namespace
} // namespace cairn_test
