// Bullet's joint types behind Cairn: the same frames, signs, limits and motors as behind Bullet's own solver.
#include "world.h"

#include <BulletDynamics/ConstraintSolver/btFixedConstraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpring2Constraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpringConstraint.h>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

namespace {

const btVector3 kNoGravity(0, 0, 0);

btTransform turned(const btVector3& axis, btScalar angle, const btVector3& origin) {
    return btTransform(btQuaternion(axis.normalized(), angle), origin);
}

// Frames that are nobody's axes, so that a wrong sign or a transposed frame cannot hide.
const btTransform kFrameA = turned(btVector3(1, 2, -1), btScalar(0.8), btVector3(btScalar(0.6), btScalar(0.1), btScalar(-0.2)));
const btTransform kFrameB = turned(btVector3(-1, 1, 3), btScalar(1.3), btVector3(btScalar(-0.5), btScalar(0.2), btScalar(0.1)));

// Two free bodies whose joint frames coincide.
struct TwoBodies : TestWorld {
    explicit TwoBodies(Behind behind) : TestWorld(behind, kNoGravity) {
        const btTransform poseA = turned(btVector3(0, 1, 1), btScalar(0.4), btVector3(1, 2, 3));
        a = &add(std::make_unique<btBoxShape>(btVector3(btScalar(0.3), btScalar(0.4), btScalar(0.2))), 2, poseA);
        b = &add(std::make_unique<btBoxShape>(btVector3(btScalar(0.3), btScalar(0.2), btScalar(0.2))), 1,
                 poseA * kFrameA * kFrameB.inverse());
        for (btRigidBody* body : {a, b})
            body->setFlags(0); // Bullet's gyroscopic modes differ from Cairn's; here only the joint counts
    }
    // B's joint frame in A's.
    btTransform relative() const { return (a->getWorldTransform() * kFrameA).inverse() * (b->getWorldTransform() * kFrameB); }
    btRigidBody* a;
    btRigidBody* b;
};

using Make = std::function<void(TwoBodies&)>;

// Runs both and compares where B's frame ended in A's. The bounds leave room for what stock lets slip on the held axes (3 cm
// here); a wrong sign is ten times as far off.
void expectLikeStock(const Make& make, int steps, double metres, double radians, const char* what) {
    TwoBodies stock(Behind::stock), cairn(Behind::cairn);
    make(stock);
    make(cairn);
    stock.step(steps);
    cairn.step(steps);
    ASSERT_EQ(cairn.cairn->lastStatus(), CAIRN_OK) << cairn.cairn->lastError();
    const btTransform difference = stock.relative().inverse() * cairn.relative();
    EXPECT_LT(difference.getOrigin().length(), metres)
        << what << ": stock " << stock.relative().getOrigin().x() << " " << stock.relative().getOrigin().y() << " "
        << stock.relative().getOrigin().z() << ", Cairn " << cairn.relative().getOrigin().x() << " " << cairn.relative().getOrigin().y()
        << " " << cairn.relative().getOrigin().z();
    const btScalar angle = btFabs(difference.getRotation().getAngleShortestPath());
    EXPECT_LT(angle, radians) << what;
}

TEST(Joints, HingeMotorTurnsAsBehindStock) {
    for (const bool referenceA : {false, true}) {
        expectLikeStock(
            [&](TwoBodies& w) {
                auto& hinge = w.join(std::make_unique<btHingeConstraint>(*w.a, *w.b, kFrameA, kFrameB, referenceA));
                hinge.enableAngularMotor(true, btScalar(1.5), 10);
            },
            60, 0.01, 0.05, referenceA ? "reference frame A" : "reference frame B");
    }
}

TEST(Joints, HingeMotorIsBoundedByItsImpulse) {
    for (const bool referenceA : {false, true}) {
        double applied[2];
        for (const Behind behind : {Behind::stock, Behind::cairn}) {
            TwoBodies w(behind);
            auto& hinge = w.join(std::make_unique<btHingeConstraint>(*w.a, *w.b, kFrameA, kFrameB, referenceA));
            hinge.enableFeedback(true);
            hinge.enableAngularMotor(true, 100, btScalar(1e-4));
            w.step();
            applied[behind == Behind::cairn ? 1 : 0] = static_cast<double>(hinge.getAppliedImpulse());
        }
        EXPECT_NEAR(std::abs(applied[1]), 1e-4, 1e-6);
        EXPECT_NEAR(applied[1], applied[0], 1e-6) << "reference A: " << referenceA;
    }
}

TEST(Joints, HingeStopsAtItsLimitsAsBehindStock) {
    for (const bool referenceA : {false, true}) {
        for (const btScalar speed : {btScalar(-2), btScalar(2)}) {
            TwoBodies w(Behind::cairn);
            auto& hinge = w.join(std::make_unique<btHingeConstraint>(*w.a, *w.b, kFrameA, kFrameB, referenceA));
            hinge.setLimit(btScalar(-0.3), btScalar(0.9));
            hinge.enableAngularMotor(true, speed, btScalar(0.02));
            w.step(240);
            EXPECT_NEAR(hinge.getHingeAngle(), speed > 0 ? 0.9 : -0.3, 0.02) << "reference A: " << referenceA;
        }
    }
}

TEST(Joints, HingeRangesAcrossPiAndBeyond) {
    // Across pi: the angle runs from 0 into the range's nearer end and stays.
    for (const bool referenceA : {false, true}) {
        TwoBodies w(Behind::cairn);
        auto& hinge = w.join(std::make_unique<btHingeConstraint>(*w.a, *w.b, kFrameA, kFrameB, referenceA));
        hinge.setLimit(btScalar(2.5), btScalar(4.5)); // 4.5 - 2 pi = -1.78
        w.b->setWorldTransform(w.a->getWorldTransform() * kFrameA * btTransform(btQuaternion(btVector3(0, 0, 1), btScalar(3))) *
                               kFrameB.inverse());
        const btScalar start = hinge.getHingeAngle();
        hinge.enableAngularMotor(true, 1, btScalar(0.02));
        w.step(240);
        const double end = static_cast<double>(hinge.getHingeAngle());
        EXPECT_NEAR(end < 0 ? end + 2 * SIMD_PI : end, 4.5, 0.02) << "started at " << start;
    }
    // A range of more than a turn limits nothing.
    TwoBodies w(Behind::cairn);
    auto& hinge = w.join(std::make_unique<btHingeConstraint>(*w.a, *w.b, kFrameA, kFrameB, true));
    hinge.setLimit(btScalar(-3.5), btScalar(3.5));
    hinge.enableAngularMotor(true, 2, 10);
    double turnedBy = 0, last = 0;
    for (int i = 0; i < 300; ++i) {
        w.step();
        const double angle = static_cast<double>(hinge.getHingeAngle());
        turnedBy += std::remainder(angle - last, 2 * SIMD_PI);
        last = angle;
    }
    EXPECT_NEAR(turnedBy, 10, 0.3);
}

TEST(Joints, PendulumKeepsItsAxleAndItsPeriod) {
    TestWorld w;
    btRigidBody& bob = w.box(1, btVector3(1, 0, 0), btVector3(btScalar(0.05), btScalar(0.05), btScalar(0.05)));
    w.join(std::make_unique<btHingeConstraint>(bob, btVector3(-1, 0, 0), btVector3(0, 0, 1), true));
    // Small swings: start 0.1 rad from the bottom.
    const btTransform swing = turned(btVector3(0, 0, 1), btScalar(-SIMD_HALF_PI + 0.1), btVector3(0, 0, 0));
    bob.setWorldTransform(swing * at(1, 0, 0));
    int crossings = 0;
    double first = 0, last = 0, before = static_cast<double>(bob.getWorldTransform().getOrigin().x());
    for (int i = 1; i <= 600; ++i) {
        w.step();
        const double x = static_cast<double>(bob.getWorldTransform().getOrigin().x());
        if (before < 0 && x >= 0) {
            const double time = (i - x / (x - before)) * static_cast<double>(kDt);
            (crossings++ ? last : first) = time;
        }
        before = x;
        EXPECT_NEAR(bob.getWorldTransform().getOrigin().length(), 1, 2e-3);
        EXPECT_NEAR(bob.getWorldTransform().getOrigin().z(), 0, 1e-4);
    }
    ASSERT_GE(crossings, 3);
    const double inertia = 1 + 0.1 * 0.1 / 6, period = 2 * SIMD_PI * std::sqrt(inertia / 9.81);
    EXPECT_NEAR((last - first) / (crossings - 1), period, 0.02 * period);
}

TEST(Joints, SliderMotorsMoveAsBehindStock) {
    for (const bool referenceA : {false, true}) {
        expectLikeStock(
            [&](TwoBodies& w) {
                auto& slider = w.join(std::make_unique<btSliderConstraint>(*w.a, *w.b, kFrameA, kFrameB, referenceA));
                slider.setPoweredLinMotor(true);
                slider.setTargetLinMotorVelocity(btScalar(0.5));
                slider.setMaxLinMotorForce(1000);
            },
            60, 0.05, 0.05, "linear motor");
        expectLikeStock(
            [&](TwoBodies& w) {
                auto& slider = w.join(std::make_unique<btSliderConstraint>(*w.a, *w.b, kFrameA, kFrameB, referenceA));
                slider.setLowerAngLimit(-SIMD_PI);
                slider.setUpperAngLimit(SIMD_PI);
                slider.setPoweredAngMotor(true);
                slider.setTargetAngMotorVelocity(btScalar(0.7));
                slider.setMaxAngMotorForce(1000);
                slider.setLowerLinLimit(0);
                slider.setUpperLinLimit(0);
            },
            60, 0.05, 0.05, "angular motor");
    }
}

TEST(Joints, SliderStopsAtItsLimits) {
    for (const bool referenceA : {false, true}) {
        for (const btScalar speed : {btScalar(-1), btScalar(1)}) {
            TwoBodies w(Behind::cairn);
            auto& slider = w.join(std::make_unique<btSliderConstraint>(*w.a, *w.b, kFrameA, kFrameB, referenceA));
            slider.setLowerLinLimit(btScalar(-0.2));
            slider.setUpperLinLimit(btScalar(0.5));
            slider.setPoweredLinMotor(true);
            slider.setTargetLinMotorVelocity(speed);
            slider.setMaxLinMotorForce(1);
            w.step(240);
            const double x = static_cast<double>(w.relative().getOrigin().x()) * (referenceA ? 1 : -1);
            EXPECT_NEAR(x, speed > 0 ? 0.5 : -0.2, 0.01) << "reference A: " << referenceA;
        }
    }
}

template <class SixDof> void motorOnAxis(SixDof& joint, int axis, btScalar speed, btScalar force);

template <> void motorOnAxis(btGeneric6DofConstraint& joint, int axis, btScalar speed, btScalar force) {
    if (axis < 3) {
        btTranslationalLimitMotor& motor = *joint.getTranslationalLimitMotor();
        motor.m_enableMotor[axis] = true;
        motor.m_targetVelocity[axis] = speed;
        motor.m_maxMotorForce[axis] = force;
    } else {
        btRotationalLimitMotor& motor = *joint.getRotationalLimitMotor(axis - 3);
        motor.m_enableMotor = true;
        motor.m_targetVelocity = speed;
        motor.m_maxMotorForce = force;
    }
}

template <> void motorOnAxis(btGeneric6DofSpring2Constraint& joint, int axis, btScalar speed, btScalar force) {
    joint.enableMotor(axis, true);
    joint.setTargetVelocity(axis, speed);
    joint.setMaxMotorForce(axis, force);
}

template <class SixDof> std::unique_ptr<SixDof> makeSixDof(TwoBodies& w);
template <> std::unique_ptr<btGeneric6DofConstraint> makeSixDof(TwoBodies& w) {
    return std::make_unique<btGeneric6DofConstraint>(*w.a, *w.b, kFrameA, kFrameB, true);
}
template <> std::unique_ptr<btGeneric6DofSpring2Constraint> makeSixDof(TwoBodies& w) {
    return std::make_unique<btGeneric6DofSpring2Constraint>(*w.a, *w.b, kFrameA, kFrameB);
}

template <class SixDof> void driveEachAxis(const char* name) {
    for (int axis = 0; axis < 6; ++axis) {
        expectLikeStock(
            [&](TwoBodies& w) {
                SixDof& joint = w.join(makeSixDof<SixDof>(w));
                for (int i = 0; i < 6; ++i) {
                    if (i == axis)
                        joint.setLimit(i, 1, -1); // free
                    else
                        joint.setLimit(i, 0, 0); // locked
                }
                motorOnAxis(joint, axis, btScalar(0.6), 100);
            },
            60, 0.05, 0.05, (std::string(name) + " axis " + std::to_string(axis)).c_str());
    }
}

TEST(Joints, SixDofMotorsMoveAsBehindStock) { driveEachAxis<btGeneric6DofConstraint>("6-dof"); }
TEST(Joints, SixDofSpring2MotorsMoveAsBehindStock) { driveEachAxis<btGeneric6DofSpring2Constraint>("6-dof spring 2"); }

// Several rotations at once, so that the order of the angles matters: all bounded, and pushed by a spin into a corner.
template <class SixDof> void turnIntoACorner(const char* name) {
    expectLikeStock(
        [&](TwoBodies& w) {
            SixDof& joint = w.join(makeSixDof<SixDof>(w));
            joint.setLinearLowerLimit(btVector3(0, 0, 0));
            joint.setLinearUpperLimit(btVector3(0, 0, 0));
            joint.setAngularLowerLimit(btVector3(btScalar(-0.2), btScalar(-0.3), btScalar(-0.4)));
            joint.setAngularUpperLimit(btVector3(btScalar(0.5), btScalar(0.6), btScalar(0.7)));
            for (int axis = 3; axis < 6; ++axis)
                motorOnAxis(joint, axis, btScalar(axis == 4 ? -1 : 1), btScalar(0.05));
        },
        300, 0.02, 0.06, name);
}

TEST(Joints, SixDofAnglesStopAsBehindStock) { turnIntoACorner<btGeneric6DofConstraint>("6-dof"); }
TEST(Joints, SixDofSpring2AnglesStopAsBehindStock) { turnIntoACorner<btGeneric6DofSpring2Constraint>("6-dof spring 2"); }

TEST(Joints, SpringsMoveAsBehindStock) {
    for (const bool among : {false, true}) {
        expectLikeStock(
            [&](TwoBodies& w) {
                auto& joint = w.join(makeSixDof<btGeneric6DofSpring2Constraint>(w));
                for (int i = 1; i < 6; ++i)
                    joint.setLimit(i, 0, 0);
                joint.setLimit(0, 1, -1);
                if (among) {
                    joint.setLimit(0, -2, 2);
                    joint.setLimit(5, btScalar(-0.5), btScalar(0.5));
                    joint.enableMotor(5, true);
                    joint.setTargetVelocity(5, btScalar(0.3));
                    joint.setMaxMotorForce(5, 10);
                }
                joint.enableSpring(0, true);
                joint.setStiffness(0, 20);
                joint.setDamping(0, 1);
                joint.setEquilibriumPoint(0, btScalar(0.5));
            },
            60, 0.05, 0.05, among ? "spring among limits and a motor" : "spring");
    }
    expectLikeStock(
        [&](TwoBodies& w) {
            auto& joint = w.join(makeSixDof<btGeneric6DofSpring2Constraint>(w));
            for (int i = 0; i < 6; ++i)
                joint.setLimit(i, 0, 0);
            joint.setLimit(4, btScalar(-0.9), btScalar(0.9));
            joint.enableMotor(4, true);
            joint.setServo(4, true);
            joint.setServoTarget(4, btScalar(0.4));
            joint.setTargetVelocity(4, 1);
            joint.setMaxMotorForce(4, 10);
        },
        90, 0.05, 0.05, "servo");
    expectLikeStock(
        [&](TwoBodies& w) {
            auto& joint = w.join(std::make_unique<btGeneric6DofSpringConstraint>(*w.a, *w.b, kFrameA, kFrameB, true));
            for (int i = 0; i < 5; ++i)
                joint.setLimit(i, 0, 0);
            joint.setLimit(5, 1, -1);
            joint.enableSpring(5, true);
            joint.setStiffness(5, 2);
            joint.setDamping(5, 1);
            joint.setEquilibriumPoint(5, btScalar(0.4));
        },
        60, 0.05, 0.1, "6-dof spring");
}

TEST(Joints, FixedHoldsBothKinds) {
    for (const bool sixDof : {false, true}) {
        TestWorld w;
        btRigidBody& post = w.box(0, btVector3(0, 5, 0));
        btRigidBody& arm = w.box(1, btVector3(btScalar(1.5), 5, 0));
        const btTransform inPost = at(btScalar(0.5), 0, 0), inArm = at(-1, 0, 0);
        if (sixDof) {
            auto& joint = w.join(std::make_unique<btGeneric6DofConstraint>(post, arm, inPost, inArm, true));
            for (int axis = 0; axis < 6; ++axis)
                joint.setLimit(axis, 0, 0);
        } else {
            w.join(std::make_unique<btFixedConstraint>(post, arm, inPost, inArm));
        }
        btJointFeedback feedback;
        w.constraints.back()->setJointFeedback(&feedback);
        w.step(120);
        EXPECT_NEAR(feedback.m_appliedForceBodyB.y(), 9.81, 0.05);
        EXPECT_NEAR(feedback.m_appliedTorqueBodyB.z(), 0, 0.05) << "about the arm's own centre nothing is left to turn it";
        EXPECT_NEAR(feedback.m_appliedTorqueBodyA.z(), -9.81 * 1.5, 0.1) << "the arm's weight on the post, 1.5 m away";
        EXPECT_LT((arm.getWorldTransform().getOrigin() - btVector3(btScalar(1.5), 5, 0)).length(), 0.01) << sixDof;
        EXPECT_LT(arm.getWorldTransform().getRotation().getAngleShortestPath(), 0.01) << sixDof;
    }
}

TEST(Joints, FeedbackOfAHangingBodyIsItsWeight) {
    TestWorld w;
    btRigidBody& bob = w.box(3, btVector3(0, -1, 0));
    auto& point = w.join(std::make_unique<btPoint2PointConstraint>(bob, btVector3(0, 1, 0)));
    btJointFeedback feedback;
    point.setJointFeedback(&feedback);
    point.enableFeedback(true);
    w.step(120);
    EXPECT_NEAR(feedback.m_appliedForceBodyA.y(), 3 * 9.81, 0.03);
    EXPECT_NEAR(feedback.m_appliedForceBodyB.y(), -3 * 9.81, 0.03);
    EXPECT_NEAR(feedback.m_appliedTorqueBodyA.length(), 0, 0.03);
    EXPECT_NEAR(point.getAppliedImpulse(), 3 * 9.81 * static_cast<double>(kDt), 0.001);
}

TEST(Joints, BreakAboveTheirThreshold) {
    for (const double share : {0.5, 2.0}) {
        TestWorld w;
        btRigidBody& bob = w.box(3, btVector3(0, -1, 0));
        auto& point = w.join(std::make_unique<btPoint2PointConstraint>(bob, btVector3(0, 1, 0)));
        point.setBreakingImpulseThreshold(static_cast<btScalar>(share * 3 * 9.81 * static_cast<double>(kDt)));
        w.step(60);
        EXPECT_EQ(point.isEnabled(), share > 1);
        EXPECT_EQ(bob.getWorldTransform().getOrigin().y() < -2, share < 1);
    }
}

TEST(Joints, APickIsAsStrongAsItsClamp) {
    TestWorld w;
    btRigidBody& body = w.box(1, btVector3(0, 0, 0));
    auto& pick = w.join(std::make_unique<btPoint2PointConstraint>(body, btVector3(0, 0, 0)));
    pick.m_setting.m_impulseClamp = btScalar(0.05);
    pick.setPivotB(btVector3(100, 0, 0));
    const btVector3 before = body.getLinearVelocity();
    w.step();
    EXPECT_NEAR(body.getLinearVelocity().x() - before.x(), 0.05, 1e-4);
    EXPECT_LT(body.getAngularVelocity().length(), 1e-4) << "held at its centre, it is not turned, however far the pull comes from";
    w.step(3);
    EXPECT_NEAR(body.getLinearVelocity().x() - before.x(), 0.2, 4e-4) << "a clipped impulse is a force";
}

// setParam(CFM) of a locked axis: at rest J v = 0, so erp C / dt = cfm K lambda, lambda = m g dt.
TEST(Joints, CfmLetsALockedAxisSagAsStocks) {
    const btScalar cfm = btScalar(0.3), erp = btScalar(0.4);
    const double sag = 9.81 * static_cast<double>(kDt) * static_cast<double>(kDt) * 0.3 / 0.4; // K = 1 / m
    for (const Behind behind : {Behind::stock, Behind::cairn}) {
        for (const int kind : {0, 1, 2}) {
            TestWorld w(behind);
            btRigidBody& bob = w.box(2, btVector3(0, 0, 0));
            const btTransform origin = btTransform::getIdentity();
            if (kind == 0) {
                w.join(std::make_unique<btPoint2PointConstraint>(bob, btVector3(0, 0, 0)));
            } else if (kind == 1) {
                w.join(std::make_unique<btGeneric6DofConstraint>(bob, origin, true));
            } else {
                w.join(std::make_unique<btGeneric6DofSpring2Constraint>(bob, origin));
            }
            btTypedConstraint& joint = *w.constraints.back();
            for (int axis = 0; axis < (kind == 0 ? 1 : 3); ++axis) {
                joint.setParam(kind == 0 ? BT_CONSTRAINT_CFM : BT_CONSTRAINT_STOP_CFM, cfm, kind == 0 ? -1 : axis);
                joint.setParam(kind == 0 ? BT_CONSTRAINT_ERP : BT_CONSTRAINT_STOP_ERP, erp, kind == 0 ? -1 : axis);
            }
            w.step(200);
            EXPECT_NEAR(static_cast<double>(bob.getWorldTransform().getOrigin().y()), -sag, 0.02 * sag)
                << "kind " << kind << (behind == Behind::stock ? ", stock" : ", Cairn");
        }
    }
}

TEST(Joints, AMotorPushesAgainstASpringOnItsAxis) {
    TestWorld w(Behind::cairn, kNoGravity);
    btRigidBody& post = w.box(0, btVector3(0, 0, 0));
    btRigidBody& body = w.box(1, btVector3(3, 0, 0));
    auto& joint = w.join(std::make_unique<btGeneric6DofSpring2Constraint>(post, body, at(3, 0, 0), at(0, 0, 0)));
    joint.setLimit(0, 1, -1);
    joint.enableSpring(0, true);
    joint.setStiffness(0, 50);
    joint.setDamping(0, 10);
    joint.setEquilibriumPoint(0, btScalar(0.1));
    joint.enableMotor(0, true);
    joint.setTargetVelocity(0, -5); // Bullet's linear motors are turned round
    joint.setMaxMotorForce(0, 4);
    btJointFeedback feedback;
    joint.setJointFeedback(&feedback);
    w.step(200);
    EXPECT_NEAR(body.getWorldTransform().getOrigin().x(), 3 + 0.1 + 4.0 / 50, 1e-3);
    EXPECT_NEAR(feedback.m_appliedForceBodyB.x(), 0, 0.01) << "motor and spring hold each other";
    EXPECT_LT(body.getLinearVelocity().length(), 1e-3);
}

TEST(Joints, AConstraintMayAskForMoreIterations) {
    TestWorld w;
    btRigidBody& bob = w.box(1, btVector3(0, -1, 0));
    auto& point = w.join(std::make_unique<btPoint2PointConstraint>(bob, btVector3(0, 1, 0)));
    w.step();
    const uint32_t usual = w.cairn->statistics().iterations;
    ASSERT_EQ(usual, w.cairn->params().iterations);
    point.setOverrideNumSolverIterations(static_cast<int>(3 * usual));
    w.step();
    EXPECT_EQ(w.cairn->statistics().iterations, 3 * usual);
    EXPECT_EQ(w.cairn->params().iterations, usual) << "the user's own stay";
    point.setOverrideNumSolverIterations(1);
    w.step();
    EXPECT_EQ(w.cairn->statistics().iterations, usual);
}

// btGearConstraint is known to nobody: it comes as the row of its getInfo2().
TEST(Joints, AGearTurnsItsWheels) {
    TestWorld w(Behind::cairn, kNoGravity);
    const btVector3 flat(btScalar(0.5), btScalar(0.5), btScalar(0.1));
    btRigidBody& first = w.box(1, btVector3(0, 0, 0), flat);
    btRigidBody& second = w.box(1, btVector3(2, 0, 0), flat);
    const btVector3 axis(0, 0, 1);
    w.join(std::make_unique<btHingeConstraint>(first, btVector3(0, 0, 0), axis));
    w.join(std::make_unique<btHingeConstraint>(second, btVector3(0, 0, 0), axis));
    const btScalar ratio = 3; // J = [axis, ratio axis]: the first turns ratio times as fast, the other way
    w.join(std::make_unique<btGearConstraint>(first, second, axis, axis, ratio));
    first.setDamping(0, 0);
    second.setDamping(0, 0);
    first.setAngularVelocity(btVector3(0, 0, 6));
    w.step(30);
    const double omega1 = static_cast<double>(first.getAngularVelocity().z());
    const double omega2 = static_cast<double>(second.getAngularVelocity().z());
    EXPECT_NEAR(omega1, -static_cast<double>(ratio) * omega2, 0.02);
    // One impulse l along J: omega1 = 6 + l / I, omega2 = 3 l / I.
    EXPECT_NEAR(omega1, 6 - 6.0 / (1 + 9), 0.05);
    EXPECT_LT(first.getWorldTransform().getOrigin().length(), 0.01);
}

} // namespace
