// Every kind of world that can call a btConstraintSolver, and every landing: two towers, a pendulum and a sleeping box.
#include "conformance.h"
#include "scenes.h"

#include <BulletCollision/CollisionDispatch/btSimulationIslandManager.h>
#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolverMt.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorldMt.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace {

using cairn::bullet::ConstraintSolver;
using cairn::bullet::LandingWorld;
using conformance::Reference;

struct Seen {
    double sway = 0;    // of the towers' boxes from their places, m
    double gap = 0;     // of the pendulum's hinge, m
    double weight = 0;  // of the towers, that their lowest points do not carry in the last step; a part of it
    double asleep = 0;  // how far the sleeping box has moved, m
    int companions = 0; // ids that are not -1 after a step
    std::vector<btVector3> bobs, state;
};

// Two seconds of a world of any kind, each step in `parts`.
Seen watch(btDiscreteDynamicsWorld& world, int parts = 1) {
    world.setGravity(vec(0, -kGravity, 0));
    btBoxShape ground(btVector3(50, 1, 50)), cube(btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5)));
    btVector3 inertia;
    cube.calculateLocalInertia(1, inertia);
    btRigidBody floor(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &ground));
    floor.setWorldTransform(at(0, -1, 0));
    world.addRigidBody(&floor);
    std::vector<std::unique_ptr<btRigidBody>> boxes;
    for (int i = 0; i < 12; ++i) {
        boxes.push_back(std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &cube, inertia)));
        boxes.back()->setActivationState(DISABLE_DEACTIVATION);
        boxes.back()->setWorldTransform(at(btScalar(i % 2 * 5), btScalar(0.5) + btScalar(i / 2), 0));
    }
    btRigidBody &bob = *boxes[10], &sleeper = *boxes[11];
    bob.setWorldTransform(at(-5, 10, 0));
    sleeper.setWorldTransform(at(10, btScalar(0.505), 0)); // awake, it would fall
    sleeper.forceActivationState(ISLAND_SLEEPING);
    for (const std::unique_ptr<btRigidBody>& box : boxes)
        world.addRigidBody(box.get());
    const btVector3 arm(-2, 0, 0);
    btHingeConstraint hinge(bob, arm, btVector3(0, 0, 1));
    world.addConstraint(&hinge);
    const btVector3 anchor = bob.getWorldTransform() * arm, before = sleeper.getWorldTransform().getOrigin();

    Seen seen;
    for (int i = 0; i < 120; ++i) {
        for (int k = 0; k < parts; ++k)
            world.stepSimulation(kDt / static_cast<btScalar>(parts), 0);
        seen.bobs.push_back(bob.getWorldTransform().getOrigin());
        seen.gap = std::max(seen.gap, real((bob.getWorldTransform() * arm - anchor).length()));
        for (const std::unique_ptr<btRigidBody>& box : boxes)
            seen.companions += box->getCompanionId() != -1;
    }
    for (int i = 0; i < 10; ++i) {
        const btVector3 place = vec(i % 2 * 5, 0.5 + i / 2, 0);
        seen.sway = std::max(seen.sway, real((boxes[static_cast<std::size_t>(i)]->getWorldTransform().getOrigin() - place).length()));
    }
    double carried = 0;
    for (int m = 0; m < world.getDispatcher()->getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *world.getDispatcher()->getManifoldByIndexInternal(m);
        if (manifold.getBody0() == &floor || manifold.getBody1() == &floor)
            if (manifold.getBody0() != &sleeper && manifold.getBody1() != &sleeper)
                for (int i = 0; i < manifold.getNumContacts(); ++i)
                    carried += real(manifold.getContactPoint(i).m_appliedImpulse);
    }
    seen.weight = std::abs(carried / (10 * kGravity * real(kDt)) - 1);
    seen.asleep = real((sleeper.getWorldTransform().getOrigin() - before).length());
    for (const std::unique_ptr<btRigidBody>& box : boxes) {
        seen.state.push_back(box->getWorldTransform().getOrigin());
        seen.state.push_back(box->getAngularVelocity());
    }
    world.removeConstraint(&hinge);
    for (const std::unique_ptr<btRigidBody>& box : boxes)
        world.removeRigidBody(box.get());
    world.removeRigidBody(&floor);
    return seen;
}

std::unique_ptr<ConstraintSolver> oneThread() {
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.threads = 1;
    return std::make_unique<ConstraintSolver>(CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, &config);
}

// A plain world, all of whose islands are one batch.
std::function<Seen()> plain(Landing landing, bool split, int batch) {
    return [=] {
        TestWorld w(Behind::cairn, btVector3(0, 0, 0), landing);
        w.world->getSimulationIslandManager()->setSplitIslands(split);
        w.world->getSolverInfo().m_minimumSolverBatchSize = batch;
        const Seen seen = watch(*w.world);
        EXPECT_EQ(w.cairn->lastStatus(), CAIRN_OK) << w.cairn->lastError();
        EXPECT_GE(w.cairn->statistics().islands, 3u) << "one batch";
        return seen;
    };
}

// A pool forwards neither prepareSolve() nor allSolved(): each group is solved when it comes.
std::function<Seen()> pool(Landing landing) {
    return [=] {
        TestWorld parts; // its collision parts
        std::vector<ConstraintSolver*> made;
        btAlignedObjectArray<btConstraintSolver*> solvers;
        for (int i = 0; i < 3; ++i) {
            made.push_back(oneThread().release());
            solvers.push_back(made.back());
        }
        btConstraintSolverPoolMt pooled(&solvers[0], solvers.size()); // deletes them
        LandingWorld<btDiscreteDynamicsWorldMt> world(&parts.dispatcher, &parts.broadphase, &pooled, nullptr, &parts.configuration);
        for (ConstraintSolver* solver : made)
            if (landing == Landing::mixin)
                world.land(*solver);
            else if (landing == Landing::action)
                solver->attach(world);
        const Seen seen = watch(world);
        for (ConstraintSolver* solver : made) {
            EXPECT_EQ(solver->lastStatus(), CAIRN_OK) << solver->lastError();
            solver->detach();
        }
        return seen;
    };
}

Seen largeIslands() {
    const int before = btSequentialImpulseConstraintSolverMt::s_minimumContactManifoldsForBatching;
    btSequentialImpulseConstraintSolverMt::s_minimumContactManifoldsForBatching = 4; // a tower is large
    TestWorld parts;
    const std::unique_ptr<ConstraintSolver> large = oneThread();
    btConstraintSolver* small[] = {oneThread().release()};
    btConstraintSolverPoolMt pooled(small, 1);
    btDiscreteDynamicsWorldMt world(&parts.dispatcher, &parts.broadphase, &pooled, large.get(), &parts.configuration);
    const Seen seen = watch(world);
    EXPECT_GE(large->statistics().manifolds, 5u);
    btSequentialImpulseConstraintSolverMt::s_minimumContactManifoldsForBatching = before;
    return seen;
}

Seen softRigid() {
    btSoftBodyRigidBodyCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    const std::unique_ptr<ConstraintSolver> solver = oneThread();
    btSoftRigidDynamicsWorld world(&dispatcher, &broadphase, solver.get(), &configuration);
    const Seen seen = watch(world);
    EXPECT_EQ(solver->lastStatus(), CAIRN_OK) << solver->lastError();
    return seen;
}

TEST(Worlds, OfEveryKind) {
    TestWorld stock(Behind::stock);
    const Seen reference = watch(*stock.world, kSmall);
    const struct {
        const char* name;
        std::function<Seen()> run;
    } kinds[] = {
        {"btDiscreteDynamicsWorld, islands split", plain(Landing::preImage, true, 128)},
        {"the same, each island a batch of Bullet's", plain(Landing::preImage, true, 1)},
        {"the same, islands not split", plain(Landing::preImage, false, 128)},
        {"attach()", plain(Landing::action, true, 128)},
        {"attach(), islands not split", plain(Landing::action, false, 128)},
        {"LandingWorld", plain(Landing::mixin, true, 128)},
        {"LandingWorld, islands not split", plain(Landing::mixin, false, 128)},
        {"btDiscreteDynamicsWorldMt, a pool", pool(Landing::preImage)},
        {"the same, attach()", pool(Landing::action)},
        {"the same, LandingWorld", pool(Landing::mixin)},
        {"btDiscreteDynamicsWorldMt, the solver of large islands", largeIslands},
        {"btSoftRigidDynamicsWorld", softRigid},
    };
    for (const auto& kind : kinds) {
        const Seen seen = kind.run(), again = kind.run();
        const auto cell = [&kind](const char* column) { return conformance::Cell{"Worlds", kind.name, column}; };
        double behind = 0;
        for (std::size_t i = 0; i < seen.bobs.size(); ++i)
            behind = std::max(behind, real((seen.bobs[i] - reference.bobs[i]).length()));
        conformance::report(cell("pendulum"), behind, 0.03, "m", Reference::stock);
        conformance::report(cell("its hinge"), seen.gap, 2e-3, "m", Reference::formula);
        conformance::report(cell("towers stand"), seen.sway, 0.01, "m", Reference::formula);
        conformance::report(cell("their weight"), seen.weight, 0.01, "of it", Reference::formula);
        conformance::report(cell("a sleeping box moves"), seen.asleep, 0, "m", Reference::formula);
        conformance::report(cell("companion ids not -1"), seen.companions, 0, "of 1440", Reference::formula);
        double differ = 0;
        for (std::size_t i = 0; i < seen.state.size(); ++i)
            differ += !(seen.state[i] == again.state[i]);
        conformance::report(cell("states that differ in another run"), differ, 0, "of 24", Reference::formula);
    }
}

} // namespace
