// What a step leaves behind: the state that the stock solver would leave, and no other.
#include "world.h"

#include <BulletCollision/CollisionDispatch/btSimulationIslandManager.h>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace {

TEST(State, ReportsItselfAsASequentialImpulseSolver) {
    // 8 would make a multibody world cast the pointer.
    EXPECT_EQ(cairn::bullet::ConstraintSolver().getSolverType(), BT_SEQUENTIAL_IMPULSE_SOLVER);
}

TEST(State, CompanionIdsAreBackAtMinusOne) {
    TestWorld w;
    btRigidBody& body = w.box(1, btVector3(0, 0, 0));
    body.setCompanionId(7); // as a solver that ran before may have left it
    btCollisionObject* bodies[] = {&body};
    w.cairn->solveGroup(bodies, 1, nullptr, 0, nullptr, 0, w.world->getSolverInfo(), nullptr, &w.dispatcher);
    EXPECT_EQ(w.cairn->lastStatus(), CAIRN_OK);
    EXPECT_EQ(body.getCompanionId(), -1);
}

TEST(State, BodiesWithoutContactsFall) {
    TestWorld w;
    btRigidBody& body = w.box(1, btVector3(0, 100, 0));
    w.step(60);
    EXPECT_NEAR(body.getLinearVelocity().y(), -9.81, 1e-3);
    EXPECT_NEAR(body.getWorldTransform().getOrigin().y(), 100 - 9.81 / 2, 0.1);
}

class OfALanding : public testing::TestWithParam<Landing> {};
INSTANTIATE_TEST_SUITE_P(State, OfALanding, testing::ValuesIn(kLandings));

TEST_P(OfALanding, StaticAndKinematicBodiesAreNotTouched) {
    TestWorld w(Behind::cairn, btVector3(0, btScalar(-9.81), 0), GetParam());
    btRigidBody& ground = w.floor();
    btRigidBody& platform = w.box(0, btVector3(3, btScalar(0.5), 0));
    platform.setCollisionFlags(platform.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    platform.setActivationState(DISABLE_DEACTIVATION);
    w.box(1, btVector3(0, btScalar(0.5), 0));
    btRigidBody& rider = w.box(1, btVector3(3, btScalar(1.5), 0));
    btTransform pose = platform.getWorldTransform();
    for (int i = 0; i < 60; ++i) {
        pose.setOrigin(pose.getOrigin() + btVector3(btScalar(0.01), 0, 0));
        platform.setWorldTransform(pose);
        w.step();
        EXPECT_EQ(platform.getWorldTransform().getOrigin().x(), pose.getOrigin().x());
    }
    EXPECT_EQ(ground.getWorldTransform().getOrigin(), btVector3(0, -1, 0));
    EXPECT_EQ(ground.getLinearVelocity(), btVector3(0, 0, 0));
    EXPECT_NEAR(rider.getLinearVelocity().x(), 0.6, 0.05) << "friction should carry the rider along at the platform's speed";
    EXPECT_NEAR(rider.getWorldTransform().getOrigin().y(), 1.5, 0.02);
}

TEST(State, SleepingBodiesStayWhereTheyAre) {
    // Without split islands the world hands over sleeping bodies as well.
    for (const bool split : {true, false}) {
        for (const Landing landing : kLandings) {
            TestWorld w(Behind::cairn, btVector3(0, btScalar(-9.81), 0), landing);
            w.world->getSimulationIslandManager()->setSplitIslands(split);
            w.floor();
            // A little above the floor: awake, it would move.
            btRigidBody& asleep = w.add(std::make_unique<btBoxShape>(btVector3(1, 1, 1)), 1, at(0, btScalar(1.5), 0), true);
            btRigidBody& awake = w.box(1, btVector3(9, btScalar(0.5), 0));
            asleep.forceActivationState(ISLAND_SLEEPING);
            const btTransform before = asleep.getWorldTransform();
            w.step(30);
            EXPECT_EQ(asleep.getWorldTransform().getOrigin(), before.getOrigin()) << "split islands: " << split;
            EXPECT_EQ(asleep.getLinearVelocity(), btVector3(0, 0, 0));
            EXPECT_NEAR(awake.getWorldTransform().getOrigin().y(), 0.5, 0.01);
        }
    }
}

// Contacts are found where a kinematic body will stand at the step's end; counting its way twice would lift the box off it.
TEST(State, APistonPushesWithoutAGap) {
    TestWorld w;
    btRigidBody& piston = w.box(0, btVector3(0, 0, 0));
    piston.setCollisionFlags(piston.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    piston.setActivationState(DISABLE_DEACTIVATION);
    btRigidBody& box = w.box(1, btVector3(0, 1, 0));
    btTransform pose = piston.getWorldTransform();
    for (int i = 0; i < 60; ++i) {
        pose.setOrigin(pose.getOrigin() + btVector3(0, kDt, 0)); // 1 m/s
        piston.setWorldTransform(pose);
        w.step();
        if (i > 10) {
            EXPECT_NEAR(box.getWorldTransform().getOrigin().y() - pose.getOrigin().y(), 1, 0.005) << "step " << i;
        }
    }
    EXPECT_NEAR(box.getLinearVelocity().y(), 1, 0.02);
}

TEST(State, BodiesOutOfTheSimulationAreWalls) {
    TestWorld w(Behind::cairn, btVector3(0, 0, 0));
    btRigidBody& frozen = w.box(1, btVector3(0, 0, 0));
    frozen.forceActivationState(DISABLE_SIMULATION);
    btRigidBody& ball = w.add(std::make_unique<btSphereShape>(btScalar(0.5)), 1, at(-2, 0, 0));
    ball.setLinearVelocity(btVector3(3, 0, 0));
    w.step(60);
    EXPECT_EQ(frozen.getWorldTransform().getOrigin(), btVector3(0, 0, 0));
    EXPECT_EQ(frozen.getLinearVelocity(), btVector3(0, 0, 0));
    EXPECT_NEAR(ball.getWorldTransform().getOrigin().x(), -1, 0.02);
    EXPECT_NEAR(ball.getLinearVelocity().x(), 0, 0.02);
}

// An anchor that turned with the ball would rise from the floor by R (1 - cos(w dt)) in each step.
TEST(State, ARollingBallStaysOnTheFloor) {
    TestWorld w;
    w.floor();
    btRigidBody& ball = w.add(std::make_unique<btSphereShape>(btScalar(0.5)), 1, at(-8, btScalar(0.5), 0));
    ball.setLinearVelocity(btVector3(8, 0, 0));
    ball.setAngularVelocity(btVector3(0, 0, -16));
    const double weight = 9.81 * static_cast<double>(kDt);
    for (int i = 0; i < 60; ++i) {
        w.step();
        double sum = 0;
        for (int m = 0; m < w.dispatcher.getNumManifolds(); ++m)
            for (int k = 0; k < w.dispatcher.getManifoldByIndexInternal(m)->getNumContacts(); ++k)
                sum += static_cast<double>(w.dispatcher.getManifoldByIndexInternal(m)->getContactPoint(k).m_appliedImpulse);
        if (i > 10) {
            EXPECT_NEAR(sum, weight, 0.05 * weight) << "step " << i;
        }
    }
    EXPECT_NEAR(ball.getWorldTransform().getOrigin().y(), 0.5, 2e-3);
    EXPECT_NEAR(ball.getLinearVelocity().x(), 8, 0.02);
}

TEST(State, ObjectsWithoutResponseAreFallenThrough) {
    for (const bool split : {true, false}) {
        TestWorld w;
        w.world->getSimulationIslandManager()->setSplitIslands(split);
        btRigidBody& ghost = w.floor();
        ghost.setCollisionFlags(ghost.getCollisionFlags() | btCollisionObject::CF_NO_CONTACT_RESPONSE);
        btRigidBody& body = w.box(1, btVector3(0, btScalar(0.5), 0));
        w.step(60);
        EXPECT_LT(body.getWorldTransform().getOrigin().y(), -3) << "split islands: " << split;
    }
}

TEST(State, AppliedImpulseOfARestingBoxCarriesItsWeight) {
    TestWorld w;
    w.floor();
    w.box(2, btVector3(0, btScalar(0.5), 0));
    w.step(120);
    double sum = 0;
    btVector3 sideways(0, 0, 0); // the points may hold each other in tension; together they push nowhere
    for (int m = 0; m < w.dispatcher.getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *w.dispatcher.getManifoldByIndexInternal(m);
        for (int i = 0; i < manifold.getNumContacts(); ++i) {
            const btManifoldPoint& point = manifold.getContactPoint(i);
            sum += static_cast<double>(point.m_appliedImpulse);
            sideways +=
                point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 + point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2;
        }
    }
    const double weight = 2 * 9.81 * static_cast<double>(kDt);
    EXPECT_NEAR(sum, weight, 1e-3 * weight);
    EXPECT_LT(sideways.length(), 1e-3 * weight);
}

TEST(State, FrictionImpulsesPointAlongTheLateralDirections) {
    TestWorld w;
    w.floor();
    btRigidBody& body = w.box(2, btVector3(0, btScalar(0.5), 0));
    w.step(60);
    body.setLinearVelocity(btVector3(3, 0, 0));
    w.step();
    btVector3 friction(0, 0, 0);
    double normal = 0;
    for (int m = 0; m < w.dispatcher.getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *w.dispatcher.getManifoldByIndexInternal(m);
        const btScalar sign = manifold.getBody0() == &body ? btScalar(1) : btScalar(-1);
        for (int i = 0; i < manifold.getNumContacts(); ++i) {
            const btManifoldPoint& point = manifold.getContactPoint(i);
            friction += sign * (point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                                point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2);
            normal += static_cast<double>(point.m_appliedImpulse);
        }
    }
    EXPECT_NEAR(friction.x(), -0.25 * normal, 0.01 * normal) << "0.5 x 0.5, against the motion";
    EXPECT_NEAR(static_cast<double>(body.getLinearVelocity().x()), 3 + static_cast<double>(friction.x()) / 2, 1e-3);
}

TEST(State, RestitutionThresholdIsTheWorlds) {
    for (const double threshold : {0.5, 2.0}) {
        TestWorld w;
        w.world->getSolverInfo().m_restitutionVelocityThreshold = static_cast<btScalar>(threshold);
        w.floor().setRestitution(1);
        btRigidBody& ball = w.add(std::make_unique<btSphereShape>(btScalar(0.5)), 1, at(0, btScalar(0.55), 0));
        ball.setRestitution(1);
        double fastest = 0;
        for (int i = 0; i < 30; ++i) { // it lands with about 1 m/s
            w.step();
            fastest = std::max(fastest, static_cast<double>(ball.getLinearVelocity().y()));
        }
        if (threshold < 1)
            EXPECT_GT(fastest, 0.8);
        else
            EXPECT_LT(fastest, 0.1);
        EXPECT_EQ(w.cairn->params().method, CAIRN_METHOD_TJSOFT);
    }
}

TEST(State, ARefusedStepIsReportedOnceAndLeavesVelocities) {
    struct Report {
        int count = 0;
        cairn_status status = CAIRN_OK;
        std::string text;
    } report;
    TestWorld w;
    w.cairn->setErrorCallback(
        [](void* user, cairn_status status, const char* text) {
            Report& seen = *static_cast<Report*>(user);
            ++seen.count;
            seen.status = status;
            seen.text = text;
        },
        &report);
    btRigidBody& good = w.box(1, btVector3(0, 10, 0));
    btRigidBody& bad = w.box(1, btVector3(9, 10, 0));
    good.setLinearVelocity(btVector3(1, 2, 3));
    bad.applyCentralForce(btVector3(std::numeric_limits<btScalar>::quiet_NaN(), 0, 0));
    w.step();
    EXPECT_EQ(w.cairn->lastStatus(), CAIRN_ERROR_INVALID_DATA);
    EXPECT_NE(std::string(w.cairn->lastError()).find("force"), std::string::npos) << w.cairn->lastError();
    EXPECT_EQ(report.count, 1);
    EXPECT_EQ(report.status, CAIRN_ERROR_INVALID_DATA);
    EXPECT_EQ(good.getLinearVelocity(), btVector3(1, 2, 3));
    EXPECT_EQ(good.getCompanionId(), -1);

    bad.applyCentralForce(btVector3(std::numeric_limits<btScalar>::quiet_NaN(), 0, 0));
    w.step();
    EXPECT_EQ(report.count, 1) << "the same trouble is reported once";
    w.step(); // Bullet has cleared the force
    EXPECT_EQ(w.cairn->lastStatus(), CAIRN_OK);
    EXPECT_STREQ(w.cairn->lastError(), "");
}

TEST(State, BadParametersAreRefusedAndTheOldOnesStay) {
    TestWorld w;
    w.cairn->setErrorCallback([](void*, cairn_status, const char*) {}, nullptr);
    cairn_params params = w.cairn->params();
    const uint32_t before = params.iterations;
    params.iterations = 0;
    EXPECT_EQ(w.cairn->setParams(params), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(w.cairn->params().iterations, before);
    EXPECT_EQ(w.cairn->setMethod(CAIRN_METHOD_COUNT), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(w.cairn->setMethod(CAIRN_METHOD_PJ), CAIRN_OK);
    EXPECT_EQ(w.cairn->params().method, CAIRN_METHOD_PJ);
}

} // namespace
