// Nothing outside acts, so linear and angular momentum stay, whatever the joints and contacts do.
#include "dense.h"
#include "methods.h"

#include <gtest/gtest.h>

namespace cairn_test {
namespace {

// Free bodies, random joints among them with anchors apart, and contacts that push and rub.
Scene tangle(std::uint64_t seed, bool contacts) {
    Random random(seed);
    Scene scene = random_bodies(random, 6);
    scene.gravity.setZero();
    add_random_joints(random, scene, 0.02);
    scene.joints.erase(scene.joints.begin()); // the one to the world
    if (contacts) {
        add_random_contacts(random, scene, 12, 0.5);
        std::erase_if(scene.contacts, [](const Contact& c) { return c.a < 0; });
        for (Contact& c : scene.contacts)
            c.restitution = 0.5;
    }
    for (Body& body : scene.bodies) {
        body.flags = 0;
        body.force = body.torque = Vec3::Zero();
    }
    return scene;
}

struct Drift {
    double linear, angular; // relative to the sizes of the bodies' own momenta
};
Drift drift_of(Scene scene, const Solver& solver, int frames) {
    const Vec3 p = scene.linear_momentum(), l = scene.angular_momentum();
    double linear_scale = 0, angular_scale = 0;
    for (const Body& b : scene.bodies) {
        linear_scale += b.linear.norm() / b.inverse_mass;
        angular_scale += b.position.cross(b.linear).norm() / b.inverse_mass + (inertia_world(b) * b.angular).norm();
    }
    const double energy = scene.kinetic_energy();
    for (int i = 0; i < frames; ++i)
        scene.step(solver);
    EXPECT_GT(std::abs(scene.kinetic_energy() - energy), 1e-3 * energy) << "nothing happened";
    return {(scene.linear_momentum() - p).norm() / linear_scale, (scene.angular_momentum() - l).norm() / angular_scale};
}

class Momentum : public EachMethod {};
CAIRN_EACH_METHOD(Momentum);

TEST_P(Momentum, OfJointsIsConservedToRounding) {
    for (const std::uint32_t precision : {32u, 64u}) {
        for (const std::uint32_t which : {CAIRN_PRESET_DEFAULT, CAIRN_PRESET_PAPER}) {
            const Solver solver(precision);
            cairn_params params = preset(GetParam(), which);
            params.iterations = 10 * params.substeps;
            params.position_iterations = 0; // they move bodies without moving mass's momentum with them
            check(cairn_solver_set_params(solver.get(), &params));
            for (std::uint64_t seed = 1; seed <= 5; ++seed) {
                const Drift drift = drift_of(tangle(seed, false), solver, 10);
                EXPECT_LT(drift.linear, precision == 64 ? 1e-12 : 1e-5) << "seed " << seed;
                EXPECT_LT(drift.angular, precision == 64 ? 1e-11 : 2e-5) << "seed " << seed;
            }
        }
    }
}

// Two sweeps a substep solve little, and a warm start goes on from what they left: the energy must stay bounded all the same.
TEST_P(Momentum, FewSweepsDoNotExplode) {
    const Solver solver;
    cairn_params params = preset(GetParam());
    params.iterations = 2 * params.substeps;
    check(cairn_solver_set_params(solver.get(), &params));
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        Scene scene = tangle(seed, false);
        const double energy = scene.kinetic_energy();
        for (int frame = 0; frame < 100; ++frame) {
            scene.step(solver);
            ASSERT_LT(scene.kinetic_energy(), 5 * energy) << "seed " << seed << ", frame " << frame;
        }
    }
}

// A contact's arms stay those of the step's start, so with one substep it conserves angular momentum exactly.
TEST_P(Momentum, OfContactsIsConservedInOneSubstep) {
    for (const std::uint32_t precision : {32u, 64u}) {
        for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD}) {
            const Solver solver(precision);
            cairn_params params = preset(GetParam());
            params.substeps = 1;
            params.iterations = 20;
            params.position_iterations = 0;
            params.relax_share = 0; // those and restitution work after the poses have moved
            params.restitution_iterations = 0;
            params.splitting = splitting;
            check(cairn_solver_set_params(solver.get(), &params));
            for (std::uint64_t seed = 1; seed <= 5; ++seed) {
                const Drift drift = drift_of(tangle(seed, true), solver, 1);
                EXPECT_LT(drift.linear, precision == 64 ? 1e-13 : 1e-6) << "seed " << seed;
                EXPECT_LT(drift.angular, precision == 64 ? 1e-12 : 2e-6) << "seed " << seed;
            }
        }
    }
}

// Over substeps, restitution and relaxation linear momentum is conserved still.
TEST_P(Momentum, LinearMomentumIsAlwaysConserved) {
    for (const std::uint32_t precision : {32u, 64u}) {
        const Solver solver(precision);
        cairn_params params = preset(GetParam());
        params.iterations = std::max(40u, params.substeps);
        params.relax_share = 0.3;
        params.restitution_iterations = 5;
        check(cairn_solver_set_params(solver.get(), &params));
        for (std::uint64_t seed = 1; seed <= 5; ++seed) {
            EXPECT_LT(drift_of(tangle(seed, true), solver, 1).linear, precision == 64 ? 1e-12 : 5e-6) << "seed " << seed;
        }
    }
}

} // namespace
} // namespace cairn_test
