// Where a step ends: exactly where the substeps did, although Bullet integrates once more after the solver.
#include "world.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace {

struct BodyState {
    double position[3], orientation[4], linear[3], angular[3];
};

// The same free body in libcairn itself, with the parameters of the adapter's solver.
BodyState stepAlone(const cairn_params& params, BodyState body, const double (&inverseInertia)[3], double dt) {
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.threads = 1;
    cairn_solver* solver = nullptr;
    EXPECT_EQ(cairn_solver_create(&config, &solver), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_solver_set_params(solver, &params), CAIRN_OK) << cairn_last_error();
    double inverseMass = 1, inertia[3] = {inverseInertia[0], inverseInertia[1], inverseInertia[2]}, force[3] = {0, -9.81, 0};
    const auto view = [](double* data) { return cairn_view{data, 0, CAIRN_F64, CAIRN_HOST}; };
    cairn_bodies bodies = {};
    bodies.struct_size = sizeof bodies;
    bodies.count = 1;
    bodies.position = view(body.position);
    bodies.orientation = view(body.orientation);
    bodies.linear_velocity = view(body.linear);
    bodies.angular_velocity = view(body.angular);
    bodies.inverse_mass = view(&inverseMass);
    bodies.inverse_inertia = view(inertia);
    bodies.force = view(force);
    cairn_step step = {};
    step.struct_size = sizeof step;
    step.dt = dt;
    step.bodies = &bodies;
    cairn_results results = {};
    results.struct_size = sizeof results;
    results.position = bodies.position;
    results.orientation = bodies.orientation;
    results.linear_velocity = bodies.linear_velocity;
    results.angular_velocity = bodies.angular_velocity;
    EXPECT_EQ(cairn_solver_step(solver, &step, &results), CAIRN_OK) << cairn_last_error();
    cairn_solver_destroy(solver);
    return body;
}

const char* nameOf(Landing landing) {
    return landing == Landing::preImage ? "pre-image" : (landing == Landing::action ? "attach()" : "LandingWorld");
}

// The pre-image lands within rounding of Bullet's last integration, the other two on the solver's very numbers.
TEST(Landing, PoseAfterTheStepIsTheSolvers) {
    for (const Landing landing : kLandings) {
        // The last spins turn by more than Bullet's clamp of 45 degrees in a step.
        for (const double spin : {0.0, 1e-4, 3.0, 30.0, 60.0}) {
            SCOPED_TRACE(std::string(nameOf(landing)) + ", spin " + std::to_string(spin));
            TestWorld w(Behind::cairn, btVector3(0, btScalar(-9.81), 0), landing);
            btRigidBody& body = w.add(std::make_unique<btBoxShape>(btVector3(btScalar(0.5), btScalar(0.3), btScalar(0.2))), 1,
                                      btTransform(btQuaternion(btVector3(1, 2, 3).normalized(), btScalar(0.7)), btVector3(3, -2, 5)));
            body.setLinearVelocity(btVector3(4, -3, 2));
            body.setAngularVelocity(btVector3(btScalar(spin), btScalar(spin / 3), btScalar(-spin / 5)));
            const btTransform start = body.getWorldTransform();
            const btQuaternion q = start.getRotation();
            BodyState before = {};
            for (int i = 0; i < 3; ++i) {
                before.position[i] = static_cast<double>(start.getOrigin()[i]);
                before.linear[i] = static_cast<double>(body.getLinearVelocity()[i]);
                before.angular[i] = static_cast<double>(body.getAngularVelocity()[i]);
            }
            const btScalar components[4] = {q.x(), q.y(), q.z(), q.w()};
            for (int i = 0; i < 4; ++i)
                before.orientation[i] = static_cast<double>(components[i]);
            const btVector3 inertia = body.getInvInertiaDiagLocal();
            const double inverseInertia[3] = {static_cast<double>(inertia[0]), static_cast<double>(inertia[1]),
                                              static_cast<double>(inertia[2])};
            const BodyState expected = stepAlone(w.cairn->params(), before, inverseInertia, static_cast<double>(kDt));
            w.step();
            ASSERT_EQ(w.cairn->lastStatus(), CAIRN_OK) << w.cairn->lastError();
            const btTransform& end = body.getWorldTransform();
            const double ulp = landing == Landing::preImage ? static_cast<double>(std::numeric_limits<btScalar>::epsilon()) : 0;
            for (int i = 0; i < 3; ++i) {
                EXPECT_NEAR(end.getOrigin()[i], static_cast<btScalar>(expected.position[i]), 2 * 5 * ulp);
                EXPECT_EQ(body.getLinearVelocity()[i], static_cast<btScalar>(expected.linear[i]));
                EXPECT_EQ(body.getAngularVelocity()[i], static_cast<btScalar>(expected.angular[i]));
            }
            const btMatrix3x3 turned(
                btQuaternion(static_cast<btScalar>(expected.orientation[0]), static_cast<btScalar>(expected.orientation[1]),
                             static_cast<btScalar>(expected.orientation[2]), static_cast<btScalar>(expected.orientation[3])));
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    EXPECT_NEAR(end.getBasis()[i][j], turned[i][j], 8 * ulp);
            EXPECT_EQ(body.getInterpolationWorldTransform().getOrigin(), end.getOrigin());
            const btMatrix3x3 inertiaWorld = end.getBasis().scaled(body.getInvInertiaDiagLocal()) * end.getBasis().transpose();
            for (int i = 0; i < 3; ++i)
                EXPECT_EQ(body.getInvInertiaTensorWorld()[i], inertiaWorld[i]) << "the world inertia is that of the end's pose";
        }
    }
}

// After a bounce the pre-image of the end lies behind the wall, so where Bullet sweeps along the path it must not be used.
TEST(Landing, FastBallsWithCcdDoNotTunnel) {
    for (const Landing landing : kLandings) {
        int through = 0, back = 0;
        const int balls = 200;
        for (int k = 0; k < balls; ++k) {
            TestWorld w(Behind::cairn, btVector3(0, 0, 0), landing);
            btRigidBody& wall = w.box(0, btVector3(0, 0, 0), btVector3(btScalar(0.02), 5, 5));
            wall.setRestitution(1);
            btRigidBody& ball = w.add(std::make_unique<btSphereShape>(btScalar(0.1)), 1, at(btScalar(-2 - 0.01 * k), 0, 0));
            ball.setRestitution(btScalar(0.9));
            ball.setCcdMotionThreshold(btScalar(0.1));
            ball.setCcdSweptSphereRadius(btScalar(0.08));
            ball.setDamping(0, 0);
            ball.setLinearVelocity(btVector3(btScalar(20 + 0.4 * k), 0, 0));
            w.step(30);
            if (ball.getWorldTransform().getOrigin().x() > 0)
                ++through;
            if (btFabs(ball.getLinearVelocity().x() / btScalar(20 + 0.4 * k) + btScalar(0.9)) < btScalar(1e-3))
                ++back;
        }
        EXPECT_EQ(through, 0) << "of " << balls << ", " << nameOf(landing);
        EXPECT_EQ(back, balls) << "with 0.9 of their speed, " << nameOf(landing);
    }
}

// Motion states are extrapolated backwards from the end of a step. Along the velocity of the end a bounce would be drawn
// behind the floor; along the step's average it is drawn where the body was.
TEST(Landing, DrawnPosesDoNotJumpAtABounce) {
    for (const Landing landing : {Landing::action, Landing::mixin}) {
        TestWorld w(Behind::cairn, btVector3(0, 0, 0), landing);
        w.floor().setRestitution(1);
        btRigidBody& ball = w.add(std::make_unique<btSphereShape>(btScalar(0.5)), 1, at(0, btScalar(1.52), 0));
        ball.setRestitution(1);
        ball.setDamping(0, 0);
        ball.setLinearVelocity(btVector3(0, -5, 0));
        btDefaultMotionState drawn(ball.getWorldTransform());
        ball.setMotionState(&drawn);
        const btScalar frame = kDt / 8;
        btScalar last = drawn.m_graphicsWorldTrans.getOrigin().y(), jump = 0;
        for (int i = 0; i < 8 * 24; ++i) {
            w.world->stepSimulation(frame, 1, kDt);
            const btScalar now = drawn.m_graphicsWorldTrans.getOrigin().y();
            jump = btMax(jump, btFabs(now - last));
            last = now;
        }
        EXPECT_GT(ball.getLinearVelocity().y(), btScalar(4.5));
        EXPECT_LT(jump, btScalar(1.02) * 5 * frame) << nameOf(landing);
        ball.setMotionState(nullptr);
    }
}

// Wind, a vehicle: what actions do to velocities is not lost by the landing, whether they run before it or after.
TEST(Landing, ActionsAreKept) {
    struct Push : btActionInterface {
        explicit Push(btRigidBody& pushed) : body(pushed) {}
        void updateAction(btCollisionWorld*, btScalar) override {
            seen = body.getLinearVelocity();
            body.setLinearVelocity(seen + btVector3(0, 0, 1));
        }
        void debugDraw(btIDebugDraw*) override {}
        btRigidBody& body;
        btVector3 seen{0, 0, 0};
    };
    for (const bool first : {true, false}) {
        for (const Landing landing : kLandings) {
            SCOPED_TRACE(std::string(nameOf(landing)) + (first ? ", added first" : ", added later"));
            TestWorld w(Behind::cairn, btVector3(0, 0, 0), landing);
            if (landing == Landing::action && first)
                w.cairn->detach();
            btRigidBody& body = w.box(1, btVector3(0, 0, 0));
            body.setDamping(0, 0);
            Push push(body);
            w.world->addAction(&push);
            if (landing == Landing::action && first)
                w.cairn->attach(*w.world);
            body.applyCentralForce(btVector3(60, 0, 0));
            w.step();
            EXPECT_NEAR(body.getLinearVelocity().x(), 1, 1e-5);
            EXPECT_NEAR(body.getLinearVelocity().z(), 1, 1e-5);
            // The average of ten substeps of a constant force is 0.55 of the whole.
            const bool average = landing == Landing::action && first;
            EXPECT_NEAR(push.seen.x(), average ? 0.55 : 1, 1e-3) << "what the action saw";
            w.world->removeAction(&push);
        }
    }
}

TEST(Landing, SurvivesABodyThatAnActionRemoves) {
    struct Remove : btActionInterface {
        void updateAction(btCollisionWorld* world, btScalar) override {
            if (body)
                static_cast<btDiscreteDynamicsWorld*>(world)->removeRigidBody(body.get());
            body.reset();
        }
        void debugDraw(btIDebugDraw*) override {}
        std::unique_ptr<btRigidBody> body;
    };
    TestWorld w;
    Remove remove;
    w.world->addAction(&remove);
    w.cairn->attach(*w.world);
    btSphereShape shape(1);
    remove.body = std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape, btVector3(1, 1, 1)));
    w.world->addRigidBody(remove.body.get());
    btRigidBody& stays = w.box(1, btVector3(5, 0, 0)); // takes the removed body's place in the world's array
    w.step();
    EXPECT_NEAR(stays.getLinearVelocity().y(), -9.81 / 60, 1e-5);
    w.cairn->detach();
    w.step();
    EXPECT_NEAR(stays.getLinearVelocity().y(), -2 * 9.81 / 60, 1e-5);
    w.world->removeAction(&remove);
}

TEST(Landing, BallBouncesToItsRestitution) {
    TestWorld w;
    w.floor().setRestitution(1);
    btRigidBody& ball = w.add(std::make_unique<btSphereShape>(btScalar(0.5)), 1, at(0, btScalar(2.5), 0));
    ball.setRestitution(btScalar(0.5));
    double top = 0;
    bool up = false;
    for (int i = 0; i < 90; ++i) {
        w.step();
        up = up || ball.getLinearVelocity().y() > btScalar(0.5);
        if (up)
            top = std::max(top, static_cast<double>(ball.getWorldTransform().getOrigin().y()) - 0.5);
    }
    EXPECT_NEAR(top, 2 * 0.25, 0.08) << "falls 2 m, e = 0.5";
}

TEST(Landing, GyroscopicFlagsChooseTheMode) {
    // About the middle axis nothing happens at once either way; off axis the momentum-keeping mode precesses, the other not.
    for (const bool gyroscopic : {true, false}) {
        TestWorld w(Behind::cairn, btVector3(0, 0, 0));
        btRigidBody& body = w.box(1, btVector3(0, 0, 0), btVector3(btScalar(0.5), btScalar(0.3), btScalar(0.1)));
        body.setDamping(0, 0);
        if (!gyroscopic)
            body.setFlags(body.getFlags() & ~(BT_ENABLE_GYROSCOPIC_FORCE_EXPLICIT | BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_WORLD |
                                              BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY));
        const btVector3 spin(3, 3, 3);
        body.setAngularVelocity(spin);
        const auto momentum = [&body] { return body.getInvInertiaTensorWorld().inverse() * body.getAngularVelocity(); };
        const btVector3 before = momentum();
        w.step(60);
        const double kept = static_cast<double>((momentum() - before).length() / before.length());
        const double same = static_cast<double>((body.getAngularVelocity() - spin).length() / spin.length());
        if (gyroscopic) {
            EXPECT_LT(kept, 1e-3);
            EXPECT_GT(same, 0.05);
        } else {
            EXPECT_LT(same, 1e-4);
            EXPECT_GT(kept, 0.05);
        }
    }
}

} // namespace
