// Every joint type of Bullet's, every feature of it: Cairn beside stock Bullet in small substeps.
#include "conformance.h"
#include "scenes.h"

#include <BulletDynamics/ConstraintSolver/btConeTwistConstraint.h>
#include <BulletDynamics/ConstraintSolver/btContactConstraint.h>
#include <BulletDynamics/ConstraintSolver/btFixedConstraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpring2Constraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpringConstraint.h>
#include <BulletDynamics/ConstraintSolver/btHinge2Constraint.h>
#include <BulletDynamics/ConstraintSolver/btUniversalConstraint.h>

#include <cctype>
#include <cmath>
#include <functional>

namespace {

using conformance::Reference;

btTransform turned(const btVector3& axis, btScalar angle, const btVector3& origin) {
    return btTransform(btQuaternion(axis.normalized(), angle), origin);
}

// Two free bodies without gravity, in frames that are nobody's axes; B, held at its centre, on a static A; B hanging from it.
enum class Start { free, centred, hanging };

// Two bodies whose joint frames coincide.
struct Pair : TestWorld {
    // aside: how far B hangs from the line through the anchors, along -z
    Pair(Behind behind, Start start, btScalar aside = 0)
        : TestWorld(behind, btVector3(0, btScalar(start == Start::hanging ? -9.81 : 0), 0)) {
        frameA = turned(btVector3(1, 2, -1), btScalar(0.8), btVector3(btScalar(0.6), btScalar(0.1), btScalar(-0.2)));
        frameB = turned(btVector3(-1, 1, 3), btScalar(1.3), btVector3(btScalar(-0.5), btScalar(0.2), btScalar(0.1)));
        btTransform poseA = turned(btVector3(0, 1, 1), btScalar(0.4), btVector3(1, 2, 3));
        btVector3 halfB(btScalar(0.3), btScalar(0.2), btScalar(0.2));
        if (start == Start::centred) {
            frameB.setOrigin(btVector3(0, 0, 0));
            halfB = btVector3(btScalar(0.2), btScalar(0.2), btScalar(0.2));
        }
        if (start == Start::hanging) {
            frameA = at(0, -1, 0);
            frameB = at(0, 1, aside);
            poseA = at(0, 4, 0);
        }
        a = &add(std::make_unique<btBoxShape>(btVector3(btScalar(0.3), btScalar(0.4), btScalar(0.2))),
                 btScalar(start == Start::free ? 2 : 0), poseA);
        b = &add(std::make_unique<btBoxShape>(halfB), 1, poseA * frameA * frameB.inverse());
        for (btRigidBody* body : {a, b})
            body->setFlags(0); // Bullet's gyroscopic modes differ from Cairn's; here only the joint counts
    }
    btTransform relative() const { return a->getWorldTransform().inverse() * b->getWorldTransform(); }
    // One step of the world, as `parts` of it.
    void run(int parts, const std::function<void(Pair&)>& push) {
        for (int i = 0; i < parts; ++i) {
            if (push)
                push(*this);
            world->stepSimulation(kDt / static_cast<btScalar>(parts), 0);
            world->clearForces();
        }
    }
    btRigidBody* a;
    btRigidBody* b;
    btTransform frameA, frameB;
};

using Make = std::function<btTypedConstraint*(Pair&)>;
using Set = std::function<void(btTypedConstraint*)>;

// A feature of a type, or why there is none.
struct Feature {
    Set set;
    std::string why;
    Feature(const char* reason) : why(reason) {}
    template <class F> Feature(F function) : set(function) {}
};

struct Type {
    const char* name;
    Make make;
    int axis;      // of A's frame, which limits, motors and springs are about: 0-2 linear, 3-5 angular
    btScalar sign; // of Bullet's coordinate, in terms of B relative to A
    bool moves;    // some axis is free
    btScalar lower, upper;
    Feature limit, motor, spring, servo;
};

template <class Joint> Joint& as(btTypedConstraint* joint) { return *static_cast<Joint*>(joint); }

template <class SixDof> void freeOneAxis(SixDof& joint, int axis) {
    for (int i = 0; i < 6; ++i)
        joint.setLimit(i, btScalar(i == axis ? 1 : 0), btScalar(i == axis ? -1 : 0));
}

template <int kAxis> void limitSixDof(btTypedConstraint* joint) {
    if (joint->getConstraintType() == D6_SPRING_2_CONSTRAINT_TYPE)
        as<btGeneric6DofSpring2Constraint>(joint).setLimit(kAxis, btScalar(-0.2), btScalar(0.4));
    else
        as<btGeneric6DofConstraint>(joint).setLimit(kAxis, btScalar(-0.2), btScalar(0.4));
}

void motorOnTurn(btTypedConstraint* joint) {
    btRotationalLimitMotor& motor = *as<btGeneric6DofConstraint>(joint).getRotationalLimitMotor(2);
    motor.m_enableMotor = true;
    motor.m_targetVelocity = 1;
    motor.m_maxMotorForce = 100;
}

template <int kAxis> void motorOnSpring2(btTypedConstraint* joint) {
    auto& sixDof = as<btGeneric6DofSpring2Constraint>(joint);
    sixDof.enableMotor(kAxis, true);
    sixDof.setTargetVelocity(kAxis, 1);
    sixDof.setMaxMotorForce(kAxis, 100);
}

template <int kAxis> void springOnSpring2(btTypedConstraint* joint) {
    auto& sixDof = as<btGeneric6DofSpring2Constraint>(joint);
    sixDof.enableSpring(kAxis, true);
    sixDof.setStiffness(kAxis, btScalar(kAxis < 3 ? 20 : 0.4));
    sixDof.setDamping(kAxis, btScalar(kAxis < 3 ? 1 : 0.02));
    sixDof.setEquilibriumPoint(kAxis, btScalar(0.3));
}

template <int kAxis> void servoOnSpring2(btTypedConstraint* joint) {
    auto& sixDof = as<btGeneric6DofSpring2Constraint>(joint);
    sixDof.enableMotor(kAxis, true);
    sixDof.setServo(kAxis, true);
    sixDof.setServoTarget(kAxis, btScalar(0.4));
    sixDof.setTargetVelocity(kAxis, btScalar(0.8));
    sixDof.setMaxMotorForce(kAxis, 100);
}

template <int kAxis> Make makeSpring2(RotateOrder order) {
    return [order](Pair& w) {
        auto joint = std::make_unique<btGeneric6DofSpring2Constraint>(*w.a, *w.b, w.frameA, w.frameB, order);
        freeOneAxis(*joint, kAxis);
        return &w.join(std::move(joint));
    };
}

// Several rotations, so that their order counts; the limits of one of them are tried.
Make makeOrdered(RotateOrder order) {
    return [order](Pair& w) {
        auto joint = std::make_unique<btGeneric6DofSpring2Constraint>(*w.a, *w.b, w.frameA, w.frameB, order);
        joint->setLinearLowerLimit(btVector3(0, 0, 0));
        joint->setLinearUpperLimit(btVector3(0, 0, 0));
        joint->setAngularLowerLimit(btVector3(btScalar(-0.7), btScalar(-0.7), btScalar(-0.7)));
        joint->setAngularUpperLimit(btVector3(btScalar(0.7), btScalar(0.7), btScalar(0.7)));
        return &w.join(std::move(joint));
    };
}

Type ordered(const char* name, RotateOrder order) {
    return {name,
            makeOrdered(order),
            5,
            -1,
            true,
            btScalar(-0.2),
            btScalar(0.4),
            limitSixDof<5>,
            motorOnSpring2<5>,
            springOnSpring2<5>,
            servoOnSpring2<5>};
}

std::vector<Type> types() {
    const btScalar low = btScalar(-0.2), high = btScalar(0.4);
    const auto hingeLimit = [](btTypedConstraint* j) { as<btHingeConstraint>(j).setLimit(btScalar(-0.2), btScalar(0.4)); };
    const auto hingeMotor = [](btTypedConstraint* j) { as<btHingeConstraint>(j).enableAngularMotor(true, 1, 100); };
    const auto makeCone = [](Pair& w) {
        auto joint = std::make_unique<btConeTwistConstraint>(*w.a, *w.b, w.frameA, w.frameB);
        return &w.join(std::move(joint));
    };
    const auto coneMotor = [](btTypedConstraint* j) {
        auto& cone = as<btConeTwistConstraint>(j);
        cone.setMotorTargetInConstraintSpace(btQuaternion(btVector3(1, 2, -1).normalized(), btScalar(0.5)));
        cone.setMaxMotorImpulse(1);
        cone.enableMotor(true);
    };
    const char* const none = "the type has none";
    const char* const no_servo = "the type has no position motor";
    return {
        {"point to point",
         [](Pair& w) { return &w.join(std::make_unique<btPoint2PointConstraint>(*w.a, *w.b, w.frameA.getOrigin(), w.frameB.getOrigin())); },
         5, 1, true, low, high, none, none, none, none},
        {"hinge", [](Pair& w) { return &w.join(std::make_unique<btHingeConstraint>(*w.a, *w.b, w.frameA, w.frameB, true)); }, 5, 1, true,
         low, high, hingeLimit, hingeMotor, none, no_servo},
        {"hinge, accumulated angle",
         [](Pair& w) { return &w.join(std::make_unique<btHingeAccumulatedAngleConstraint>(*w.a, *w.b, w.frameA, w.frameB, true)); }, 5, 1,
         true, low, high, hingeLimit, hingeMotor, none, no_servo},
        {"slider, along",
         [](Pair& w) {
             auto& slider = w.join(std::make_unique<btSliderConstraint>(*w.a, *w.b, w.frameA, w.frameB, true));
             slider.setLowerLinLimit(1), slider.setUpperLinLimit(-1);
             return &slider;
         },
         0, 1, true, low, high,
         [](btTypedConstraint* j) {
             as<btSliderConstraint>(j).setLowerLinLimit(btScalar(-0.2));
             as<btSliderConstraint>(j).setUpperLinLimit(btScalar(0.4));
         },
         [](btTypedConstraint* j) {
             as<btSliderConstraint>(j).setPoweredLinMotor(true);
             as<btSliderConstraint>(j).setTargetLinMotorVelocity(btScalar(0.5));
             as<btSliderConstraint>(j).setMaxLinMotorForce(1000);
         },
         none, no_servo},
        {"slider, about",
         [](Pair& w) {
             auto& slider = w.join(std::make_unique<btSliderConstraint>(*w.a, *w.b, w.frameA, w.frameB, true));
             slider.setLowerLinLimit(0), slider.setUpperLinLimit(0);
             slider.setLowerAngLimit(1), slider.setUpperAngLimit(-1);
             return &slider;
         },
         3, 1, true, low, high,
         [](btTypedConstraint* j) {
             as<btSliderConstraint>(j).setLowerAngLimit(btScalar(-0.2));
             as<btSliderConstraint>(j).setUpperAngLimit(btScalar(0.4));
         },
         [](btTypedConstraint* j) {
             as<btSliderConstraint>(j).setPoweredAngMotor(true);
             as<btSliderConstraint>(j).setTargetAngMotorVelocity(1);
             as<btSliderConstraint>(j).setMaxAngMotorForce(1000);
         },
         none, no_servo},
        {"cone-twist, twist", makeCone, 3, -1, true, btScalar(-0.4), btScalar(0.4),
         [](btTypedConstraint* j) { as<btConeTwistConstraint>(j).setLimit(btScalar(0.3), btScalar(0.5), btScalar(0.4)); }, coneMotor, none,
         "its motor is one"},
        {"cone-twist, swing about y", makeCone, 4, -1, true, btScalar(-0.5), btScalar(0.5),
         [](btTypedConstraint* j) { as<btConeTwistConstraint>(j).setLimit(btScalar(0.3), btScalar(0.5), btScalar(0.4)); }, coneMotor, none,
         "its motor is one"},
        {"cone-twist, swing about z", makeCone, 5, -1, true, btScalar(-0.3), btScalar(0.3),
         [](btTypedConstraint* j) { as<btConeTwistConstraint>(j).setLimit(btScalar(0.3), btScalar(0.5), btScalar(0.4)); }, coneMotor, none,
         "its motor is one"},
        {"cone-twist, a hinge about y", makeCone, 4, 1, true, btScalar(-0.5), btScalar(0.5),
         [](btTypedConstraint* j) { as<btConeTwistConstraint>(j).setLimit(btScalar(0.01), btScalar(0.5), btScalar(0.4)); }, coneMotor, none,
         "its motor is one"},
        {"6-dof, along",
         [](Pair& w) {
             auto& joint = w.join(std::make_unique<btGeneric6DofConstraint>(*w.a, *w.b, w.frameA, w.frameB, true));
             freeOneAxis(joint, 0);
             return &joint;
         },
         0, 1, true, low, high, limitSixDof<0>,
         [](btTypedConstraint* j) {
             btTranslationalLimitMotor& motor = *as<btGeneric6DofConstraint>(j).getTranslationalLimitMotor();
             motor.m_enableMotor[0] = true;
             motor.m_targetVelocity[0] = btScalar(0.5);
             motor.m_maxMotorForce[0] = 1000;
         },
         none, no_servo},
        {"6-dof, about",
         [](Pair& w) {
             auto& joint = w.join(std::make_unique<btGeneric6DofConstraint>(*w.a, *w.b, w.frameA, w.frameB, true));
             freeOneAxis(joint, 5);
             return &joint;
         },
         5, -1, true, low, high, limitSixDof<5>, motorOnTurn, none, no_servo},
        {"6-dof spring",
         [](Pair& w) {
             auto& joint = w.join(std::make_unique<btGeneric6DofSpringConstraint>(*w.a, *w.b, w.frameA, w.frameB, true));
             freeOneAxis(joint, 0);
             return &joint;
         },
         0, 1, true, low, high, limitSixDof<0>, "as 6-dof",
         [](btTypedConstraint* j) {
             auto& joint = as<btGeneric6DofSpringConstraint>(j);
             joint.enableSpring(0, true);
             joint.setStiffness(0, 20);
             joint.setDamping(0, btScalar(0.6));
             joint.setEquilibriumPoint(0, btScalar(0.3));
         },
         no_servo},
        {"6-dof spring 2, along", makeSpring2<0>(RO_XYZ), 0, 1, true, low, high, limitSixDof<0>, motorOnSpring2<0>, springOnSpring2<0>,
         servoOnSpring2<0>},
        {"6-dof spring 2, about", makeSpring2<5>(RO_XYZ), 5, -1, true, low, high, limitSixDof<5>, motorOnSpring2<5>, springOnSpring2<5>,
         servoOnSpring2<5>},
        ordered("6-dof spring 2, angles xyz", RO_XYZ),
        ordered("6-dof spring 2, angles xzy", RO_XZY),
        ordered("6-dof spring 2, angles yxz", RO_YXZ),
        ordered("6-dof spring 2, angles yzx", RO_YZX),
        ordered("6-dof spring 2, angles zxy", RO_ZXY),
        ordered("6-dof spring 2, angles zyx", RO_ZYX),
        {"universal",
         [](Pair& w) {
             const btTransform frame = w.a->getWorldTransform() * w.frameA;
             auto& joint = w.join(std::make_unique<btUniversalConstraint>(*w.a, *w.b, frame.getOrigin(), frame.getBasis().getColumn(2),
                                                                          frame.getBasis().getColumn(1)));
             return &joint;
         },
         5, -1, true, low, high,
         [](btTypedConstraint* j) {
             as<btUniversalConstraint>(j).setLowerLimit(-1, btScalar(-0.2));
             as<btUniversalConstraint>(j).setUpperLimit(1, btScalar(0.4));
         },
         motorOnTurn, none, no_servo},
        {"hinge 2",
         [](Pair& w) {
             const btTransform frame = w.a->getWorldTransform() * w.frameA;
             btVector3 anchor = frame.getOrigin(), axis1 = frame.getBasis().getColumn(2), axis2 = frame.getBasis().getColumn(0);
             auto& joint = w.join(std::make_unique<btHinge2Constraint>(*w.a, *w.b, anchor, axis1, axis2));
             joint.enableSpring(2, false);
             return &joint;
         },
         5, -1, true, low, high,
         [](btTypedConstraint* j) {
             as<btHinge2Constraint>(j).setLowerLimit(btScalar(-0.2));
             as<btHinge2Constraint>(j).setUpperLimit(btScalar(0.4));
         },
         motorOnSpring2<3>,
         [](btTypedConstraint* j) {
             auto& joint = as<btHinge2Constraint>(j);
             joint.enableSpring(2, true);
             joint.setStiffness(2, 30);
             joint.setDamping(2, 1);
             joint.setEquilibriumPoint(2, btScalar(0.2));
         },
         servoOnSpring2<5>},
        {"fixed", [](Pair& w) { return &w.join(std::make_unique<btFixedConstraint>(*w.a, *w.b, w.frameA, w.frameB)); }, 1, 1, false, low,
         high, "every axis is held", "every axis is held", "every axis is held", "every axis is held"},
    };
}

class JointMatrix : public testing::TestWithParam<std::size_t> {
  protected:
    Type type = types()[GetParam()];
    conformance::Cell cell(const char* column) const { return {"Joints", type.name, column}; }

    void compare(const char* column, const Set& set, const std::function<void(Pair&)>& begin, const std::function<void(Pair&)>& push,
                 double seconds, double tolerance, int parts = kSmall, bool onlyAtEnd = false, Start begins = Start::free) {
        Pair stock(Behind::stock, begins), cairn(Behind::cairn, begins);
        for (Pair* w : {&stock, &cairn}) {
            btTypedConstraint* const joint = type.make(*w);
            if (set)
                set(joint);
            if (begin)
                begin(*w);
        }
        const btTransform start = cairn.relative();
        double worst = 0, moved = 0;
        const int steps = static_cast<int>(std::lround(seconds / static_cast<double>(kDt)));
        for (int i = 1; i <= steps; ++i) {
            stock.run(parts, push);
            cairn.run(1, push);
            ASSERT_EQ(cairn.cairn->lastStatus(), CAIRN_OK) << cairn.cairn->lastError();
            moved = std::max(moved, distance(start, cairn.relative()));
            if (onlyAtEnd ? i == steps : i % 6 == 0)
                worst = std::max(worst, distance(stock.relative(), cairn.relative()));
        }
        EXPECT_GE(moved, 0.1) << type.name << ", " << column << ": nothing moves, the cell shows nothing";
        conformance::report(cell(column), worst, tolerance, "m or rad", parts == 1 ? Reference::stockStep : Reference::stock);
    }
    static double distance(const btTransform& x, const btTransform& y) {
        const btTransform d = x.inverse() * y;
        const double angle = std::abs(static_cast<double>(d.getRotation().getAngleShortestPath()));
        return std::max(static_cast<double>(d.getOrigin().length()), std::min(angle, 2 * SIMD_PI - angle));
    }
    // Forces that push along the axis, opposite on the two bodies.
    std::function<void(Pair&)> pushing(btScalar strength) const {
        const int axis = type.axis;
        return [axis, strength](Pair& w) {
            const btTransform frame = w.a->getWorldTransform() * w.frameA;
            const btVector3 d = frame.getBasis().getColumn(axis % 3) * strength;
            if (axis >= 3) {
                w.b->applyTorque(d);
                w.a->applyTorque(-d);
            } else {
                const btVector3 point = w.b->getWorldTransform() * w.frameB.getOrigin();
                w.b->applyForce(d, point - w.b->getWorldTransform().getOrigin());
                w.a->applyForce(-d, point - w.a->getWorldTransform().getOrigin());
            }
        };
    }
    // The coordinate that limits are about, in Bullet's sign.
    double coordinate(const Pair& w, btTypedConstraint* joint) const {
        const btTransform inA = (w.a->getWorldTransform() * w.frameA).inverse() * (w.b->getWorldTransform() * w.frameB);
        if (type.axis < 3)
            return static_cast<double>(type.sign * inA.getOrigin()[type.axis]);
        switch (joint->getConstraintType()) {
        case D6_CONSTRAINT_TYPE:
        case D6_SPRING_CONSTRAINT_TYPE:
            as<btGeneric6DofConstraint>(joint).calculateTransforms();
            return static_cast<double>(as<btGeneric6DofConstraint>(joint).getAngle(type.axis - 3));
        case D6_SPRING_2_CONSTRAINT_TYPE:
            as<btGeneric6DofSpring2Constraint>(joint).calculateTransforms();
            return static_cast<double>(as<btGeneric6DofSpring2Constraint>(joint).getAngle(type.axis - 3));
        default: {
            btQuaternion q = inA.getRotation();
            if (type.axis > 3 && joint->getConstraintType() == CONETWIST_CONSTRAINT_TYPE && type.sign < 0) {
                // how far the swing of A in B is, measured along the ellipse' axis; where on it it comes to rest is another thing
                q = q.inverse();
                q *= btQuaternion(-q.x(), 0, 0, q.w()).normalized();
                const btVector3 swing = q.getAxis() * (q.getAngle() > SIMD_PI ? q.getAngle() - SIMD_2_PI : q.getAngle());
                const double share = std::hypot(static_cast<double>(swing.y()) / 0.5, static_cast<double>(swing.z()) / 0.3);
                return std::copysign(share * static_cast<double>(type.upper), static_cast<double>(swing[type.axis - 3]));
            }
            return static_cast<double>(type.sign) * 2 * std::atan2(static_cast<double>(q[type.axis - 3]), static_cast<double>(q.w()));
        }
        }
    }
};

TEST_P(JointMatrix, FreeAxes) {
    if (!type.moves)
        return conformance::absent(cell("free axes"), "every axis is held");
    compare(
        "free axes", {},
        [this](Pair& w) {
            const btVector3 d = (w.a->getWorldTransform() * w.frameA).getBasis().getColumn(type.axis % 3);
            w.b->setAngularVelocity(btVector3(btScalar(0.7), btScalar(-0.4), btScalar(0.9)) + d * btScalar(type.axis < 3 ? 0 : 1));
            w.b->setLinearVelocity(btVector3(btScalar(0.4), btScalar(0.2), btScalar(-0.3)) + d * btScalar(type.axis < 3 ? 0.3 : 0));
            w.a->setAngularVelocity(btVector3(btScalar(-0.5), btScalar(0.3), btScalar(0.2)));
        },
        {}, 0.6, 0.03);
}

TEST_P(JointMatrix, Limits) {
    for (const bool upper : {false, true}) {
        const char* const column = upper ? "upper limit" : "lower limit";
        if (!type.limit.set) {
            conformance::absent(cell(column), type.limit.why);
            continue;
        }
        // pushed there from the middle, it stays there
        const btScalar strength = (upper ? type.sign : -type.sign) * btScalar(type.axis < 3 ? 1 : 0.05);
        Pair w(Behind::cairn, Start::free);
        btTypedConstraint* const joint = type.make(w);
        type.limit.set(joint);
        for (int i = 0; i < 120; ++i)
            w.run(1, pushing(strength));
        const double limit = static_cast<double>(upper ? type.upper : type.lower);
        conformance::report(cell(column), std::abs(coordinate(w, joint) - limit), 0.02, "m or rad", Reference::formula);
    }
}

TEST_P(JointMatrix, LimitsAsStocks) {
    if (!type.limit.set)
        return conformance::absent(cell("into a limit"), type.limit.why);
    const btScalar strength = type.sign * btScalar(type.axis < 3 ? 1 : 0.05);
    // In small steps of single precision stock's hinge of a cone-twist, which has one row for the axis and the limit, does not turn.
    // Its limits of a cone let a body slide along them as it may.
    const bool cone = std::string(type.name).find("cone") == 0;
    const bool coneHinge = std::string(type.name) == "cone-twist, a hinge about y";
    compare("into a limit", type.limit.set, {}, pushing(strength), 1.5, cone ? 0.08 : 0.02, coneHinge ? 1 : kSmall);
}

TEST_P(JointMatrix, Motor) {
    if (!type.motor.set)
        return conformance::absent(cell("motor"), type.motor.why);
    const bool cone = std::string(type.name).find("cone") == 0;
    // Bullet's cone-twist motor never brakes; Cairn's three servos do, so only where they end is the same.
    compare("motor", type.motor.set, {}, {}, cone ? 2 : 0.8, 0.03, kSmall, cone);
}

TEST_P(JointMatrix, Spring) {
    if (!type.spring.set)
        return conformance::absent(cell("spring"), type.spring.why);
    // The older spring's damping is a share of the step's speed: it is another spring in other steps. Of the newer one's axes
    // stock's push is cut where a body is held away from its centre; see below.
    const bool older = std::string(type.name) == "6-dof spring";
    compare("spring", type.spring.set, {}, {}, 1.0, 0.04, older ? 1 : kSmall, false, Start::centred);
}

TEST_P(JointMatrix, Servo) {
    if (!type.servo.set)
        return conformance::absent(cell("servo"), type.servo.why);
    compare("servo", type.servo.set, {}, {}, 1.0, 0.06);
}

// Of a hanging body: the threshold is of the step's impulse, and the step that breaks the joint gets no more than that.
TEST_P(JointMatrix, Breaking) {
    double worst = 0;
    for (const double share : {0.5, 5.0}) { // stock's 6-dof joints swing up to thrice the weight at first
        bool enabled[2];
        for (const Behind behind : {Behind::stock, Behind::cairn}) {
            Pair w(behind, Start::hanging);
            btTypedConstraint* const joint = type.make(w);
            joint->setBreakingImpulseThreshold(static_cast<btScalar>(share * 9.81 * static_cast<double>(kDt)));
            w.step();
            if (behind == Behind::cairn && share < 1)
                worst = std::abs(static_cast<double>(w.b->getLinearVelocity().y()) + (1 - share) * 9.81 * static_cast<double>(kDt));
            w.step(20);
            enabled[behind == Behind::cairn ? 1 : 0] = joint->isEnabled();
        }
        EXPECT_EQ(enabled[0], share > 1) << "stock";
        EXPECT_EQ(enabled[1], share > 1) << "Cairn";
    }
    conformance::report(cell("breaking"), worst, 0.002, "m/s", Reference::formula);
}

// Of a hanging body; beside its centre, by a moment arm, where the joint keeps it from turning about x.
TEST_P(JointMatrix, Feedback) {
    const std::string name = type.name;
    bool held = false;
    for (const char* one : {"hinge", "hinge, accumulated angle", "slider, along", "6-dof, along", "6-dof, about", "6-dof spring",
                            "6-dof spring 2, along", "6-dof spring 2, about", "universal", "fixed"})
        held = held || name == one;
    btJointFeedback feedback;
    Pair w(Behind::cairn, Start::hanging, btScalar(held ? 0.3 : 0));
    btTypedConstraint* const joint = type.make(w);
    joint->setJointFeedback(&feedback);
    joint->enableFeedback(true);
    w.step(120);
    const btVector3 weight(0, btScalar(9.81), 0), moment(btScalar(held ? -0.3 * 9.81 : 0), 0, 0); // about A's centre
    const double worst =
        static_cast<double>(std::max({(feedback.m_appliedForceBodyB - weight).length(), (feedback.m_appliedForceBodyA + weight).length(),
                                      (feedback.m_appliedTorqueBodyA - moment).length(), feedback.m_appliedTorqueBodyB.length()}));
    conformance::report(cell("feedback"), worst, 0.05, "N or N m", Reference::formula);
}

TEST_P(JointMatrix, Disabled) {
    compare(
        "disabled", [](btTypedConstraint* joint) { joint->setEnabled(false); },
        [](Pair& w) {
            w.b->setLinearVelocity(btVector3(1, 2, 3));
            w.b->setAngularVelocity(btVector3(1, 0, 0));
        },
        {}, 0.5, 0.001);
}

// Stock bounds the spring's speed by that of the bodies' masses alone, without what turning them adds to the effective mass; a
// spring away from a centre then pushes less than Hooke's law.
TEST_P(JointMatrix, ASpringAwayFromTheCentrePushesAsHooke) {
    if (std::string(type.name) != "6-dof spring 2, along")
        return;
    const double k = 20, target = 0.3, h = static_cast<double>(kDt) / kSmall;
    double impulse[2];
    for (const Behind behind : {Behind::stock, Behind::cairn}) {
        Pair w(behind, Start::free);
        auto* const joint = makeSpring2<1>(RO_XYZ)(w);
        springOnSpring2<1>(joint);
        btJointFeedback feedback;
        joint->setJointFeedback(&feedback);
        const btVector3 d = (w.a->getWorldTransform() * w.frameA).getBasis().getColumn(1);
        w.world->stepSimulation(kDt / kSmall, 0);
        impulse[behind == Behind::cairn ? 1 : 0] = static_cast<double>(feedback.m_appliedForceBodyB.dot(d)) * h;
    }
    EXPECT_LT(impulse[0], 0.6 * k * target * h) << "stock";
    conformance::report(cell("spring, off centre"), std::abs(impulse[1] / (k * target * h) - 1), 0.01, "of k x h", Reference::deliberate,
                        "Hooke's law, where stock's push is cut to that of bodies that do not turn");
}

// Types that only their getInfo2() knows: rows frozen for the step. With a parameter, so that they come last in the table.
class FrozenRows : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Matrix, FrozenRows, testing::Values(0));

class Rod : public btTypedConstraint { // a user's own: keeps the centres at their distance
  public:
    Rod(btRigidBody& a, btRigidBody& b) : btTypedConstraint(CONTACT_CONSTRAINT_TYPE, a, b), m_length(between().length()) {}
    btVector3 between() const { return m_rbB.getWorldTransform().getOrigin() - m_rbA.getWorldTransform().getOrigin(); }
    btScalar length() const { return m_length; }
    void getInfo1(btConstraintInfo1* info) override {
        info->m_numConstraintRows = 1;
        info->nub = 0;
    }
    void getInfo2(btConstraintInfo2* info) override {
        const btVector3 along = between().normalized();
        for (int i = 0; i < 3; ++i) {
            info->m_J1linearAxis[i] = -along[i];
            info->m_J2linearAxis[i] = along[i];
        }
        info->m_constraintError[0] = info->fps * info->erp * (m_length - between().length());
    }
    void setParam(int, btScalar, int) override {}
    btScalar getParam(int, int) const override { return 0; }

  private:
    btScalar m_length;
};

struct Wheels : Pair {
    explicit Wheels(Behind behind) : Pair(behind, Start::centred) {
        const btVector3 axis(0, 0, 1);
        first = &box(1, btVector3(0, 9, 0), btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.1)));
        second = &box(1, btVector3(2, 9, 0), btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.1)));
        for (btRigidBody* wheel : {first, second})
            join(std::make_unique<btHingeConstraint>(*wheel, btVector3(0, 0, 0), axis));
        gear = &join(std::make_unique<btGearConstraint>(*first, *second, axis, axis, btScalar(3)));
    }
    btRigidBody* first;
    btRigidBody* second;
    btGearConstraint* gear;
};

TEST_P(FrozenRows, Gear) {
    const auto cell = [](const char* column) { return conformance::Cell{"Joints", "gear (rows)", column}; };
    Wheels free(Behind::cairn);
    free.first->setAngularVelocity(btVector3(0, 0, 6));
    free.step(30);
    const double w1 = static_cast<double>(free.first->getAngularVelocity().z()),
                 w2 = static_cast<double>(free.second->getAngularVelocity().z());
    // one impulse along J = [1, 3]: w1 = 6 + l / I, w2 = 3 l / I, and w1 + 3 w2 = 0
    conformance::report(cell("free axes"), std::max(std::abs(w1 - 5.4), std::abs(w2 + 1.8)), 0.03, "rad/s", Reference::formula);

    // pushed with a torque T, the gear carries T I2 / (I1 9 + I2), the wheels being alike
    btJointFeedback feedback;
    Wheels pushed(Behind::cairn);
    pushed.gear->setJointFeedback(&feedback);
    pushed.first->applyTorque(btVector3(0, 0, 2));
    pushed.step();
    conformance::report(cell("feedback"),
                        std::max(std::abs(static_cast<double>(feedback.m_appliedTorqueBodyA.z()) + 0.2),
                                 std::abs(static_cast<double>(feedback.m_appliedTorqueBodyB.z()) + 0.6)),
                        0.01, "N m", Reference::formula);

    double worst = 0;
    for (const double share : {0.5, 2.0}) {
        Wheels w(Behind::cairn);
        w.gear->setBreakingImpulseThreshold(static_cast<btScalar>(share * 0.2 * static_cast<double>(kDt)));
        w.first->applyTorque(btVector3(0, 0, 2));
        w.step();
        EXPECT_EQ(w.gear->isEnabled(), share > 1);
        const double given = std::min(share, 1.0) * 0.2 * static_cast<double>(kDt) * 3;
        const double turn = static_cast<double>((w.second->getInvInertiaTensorWorld().inverse() * w.second->getAngularVelocity()).z());
        worst = std::max(worst, std::abs(turn + given) / given);
    }
    conformance::report(cell("breaking"), worst, 0.02, "of the impulse", Reference::formula);

    Wheels off(Behind::cairn);
    off.gear->setEnabled(false);
    off.first->setAngularVelocity(btVector3(0, 0, 6));
    off.step(30);
    conformance::report(cell("disabled"), static_cast<double>(off.second->getAngularVelocity().length()), 1e-3, "rad/s",
                        Reference::formula);
    for (const char* column : {"lower limit", "upper limit", "into a limit", "motor", "spring", "servo"})
        conformance::absent(cell(column), "the type has none");
}

TEST_P(FrozenRows, UsersOwnType) {
    const auto cell = [](const char* column) { return conformance::Cell{"Joints", "a user's own (rows)", column}; };
    const auto swung = [](Behind behind, btScalar dt, int steps, double& length) {
        TestWorld w(behind);
        btRigidBody& post = w.box(0, btVector3(0, 0, 0));
        btRigidBody& bob = w.box(1, btVector3(2, 0, 0));
        Rod& rod = w.join(std::make_unique<Rod>(post, bob));
        for (int i = 0; i < steps; ++i)
            w.world->stepSimulation(dt, 0);
        length = static_cast<double>(rod.between().length());
        return rod.between();
    };
    double length[2];
    const btVector3 stock = swung(Behind::stock, kDt / kSmall, 36 * kSmall, length[0]), cairn = swung(Behind::cairn, kDt, 36, length[1]);
    conformance::report(cell("free axes"), static_cast<double>((stock - cairn).length()), 0.05, "m", Reference::stock);

    double worst = 0;
    btJointFeedback feedback;
    for (const double share : {0.5, 2.0}) {
        TestWorld w;
        btRigidBody& post = w.box(0, btVector3(0, 0, 0));
        btRigidBody& bob = w.box(1, btVector3(0, -2, 0));
        Rod& rod = w.join(std::make_unique<Rod>(post, bob));
        rod.setJointFeedback(&feedback);
        rod.setBreakingImpulseThreshold(static_cast<btScalar>(share * 9.81 * static_cast<double>(kDt)));
        w.step();
        const double fallen = (1 - std::min(share, 1.0)) * 9.81 * static_cast<double>(kDt);
        worst = std::max(worst, std::abs(static_cast<double>(bob.getLinearVelocity().y()) + fallen));
        EXPECT_EQ(rod.isEnabled(), share > 1);
    }
    conformance::report(cell("breaking"), worst, 0.002, "m/s", Reference::formula);
    conformance::report(cell("feedback"), static_cast<double>((feedback.m_appliedForceBodyB - btVector3(0, btScalar(9.81), 0)).length()),
                        0.05, "N or N m", Reference::formula);
    for (const char* column : {"lower limit", "upper limit", "into a limit", "motor", "spring", "servo", "disabled"})
        conformance::absent(cell(column), "as its rows say");
}

TEST_P(FrozenRows, ContactConstraint) {
    for (const char* column :
         {"free axes", "lower limit", "upper limit", "into a limit", "motor", "spring", "servo", "breaking", "feedback", "disabled"})
        conformance::absent({"Joints", "btContactConstraint", column}, "it gives no rows, in Bullet too");
    // it does no harm: not even to a body that it names
    TestWorld w;
    btRigidBody& body = w.box(1, btVector3(0, 5, 0));
    btRigidBody& other = w.box(1, btVector3(9, 5, 0));
    struct Open : btContactConstraint { // abstract, and its constructor protected
        Open(btPersistentManifold* contact, btRigidBody& a, btRigidBody& b) : btContactConstraint(contact, a, b) {}
        void setParam(int, btScalar, int) override {}
        btScalar getParam(int, int) const override { return 0; }
    };
    btPersistentManifold manifold;
    w.join(std::make_unique<Open>(&manifold, body, other));
    w.step();
    EXPECT_EQ(w.cairn->lastStatus(), CAIRN_OK) << w.cairn->lastError();
    EXPECT_NEAR(static_cast<double>(body.getLinearVelocity().y()), -9.81 * static_cast<double>(kDt), 1e-5);
}

std::string nameOf(const testing::TestParamInfo<std::size_t>& info) {
    std::string name;
    for (const char c : std::string(types()[info.param].name))
        if (std::isalnum(static_cast<unsigned char>(c)))
            name += c;
    return name;
}

INSTANTIATE_TEST_SUITE_P(Each, JointMatrix, testing::Range(std::size_t{0}, types().size()), nameOf);

} // namespace
