// Every flag of Bullet's bodies: one that falls, one that slides on a floor and one that swings from a joint, beside stock Bullet in
// small substeps.
#include "conformance.h"
#include "scenes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

namespace {

using conformance::Reference;

enum class Way { falls, slides, swings };
constexpr Way kWays[] = {Way::falls, Way::slides, Way::swings};
const char* nameOf(Way way) { return way == Way::falls ? "falls" : way == Way::slides ? "slides" : "swings"; }

double distance(const btTransform& x, const btTransform& y) {
    const btTransform d = x.inverse() * y;
    const double angle = std::abs(real(d.getRotation().getAngleShortestPath()));
    return std::max(real(d.getOrigin().length()), std::min(angle, 2 * static_cast<double>(SIMD_PI) - angle));
}

// A body of 2 kg without flags, of three different sides. To slide it stands on three feet, whose loads are determinate, and with them
// how friction turns it.
struct Moving : TestWorld {
    Moving(Behind behind, Way way, bool additionalDamping = false, Landing landing = Landing::preImage)
        : TestWorld(behind, vec(0, -kGravity, 0), landing) {
        const btVector3 start = way == Way::falls ? btVector3(0, 10, 0) : way == Way::slides ? btVector3(0, btScalar(0.25), 0) : arm;
        body = &add(way == Way::slides ? onFeet() : brick(), 2, btTransform(btQuaternion::getIdentity(), start), false, additionalDamping);
        body->setFlags(0);
        if (way == Way::falls) {
            body->setLinearVelocity(btVector3(2, 1, -1));
            body->setAngularVelocity(btVector3(1, -2, btScalar(0.5)));
        } else if (way == Way::slides) {
            ground = &floor();
            body->setLinearVelocity(btVector3(3, 0, 1));
            body->setAngularVelocity(btVector3(0, 1, 0));
        } else {
            join(std::make_unique<btPoint2PointConstraint>(*body, -arm));
            body->setAngularVelocity(btVector3(0, btScalar(-2) / 3, 0)); // about the pivot: at 1 m/s
            body->setLinearVelocity(btVector3(0, 0, 1));
        }
    }
    static std::unique_ptr<btCollisionShape> brick() {
        return std::make_unique<btBoxShape>(btVector3(btScalar(0.4), btScalar(0.25), btScalar(0.3)));
    }
    static std::unique_ptr<btCollisionShape> onFeet() {
        static btBoxShape top(btVector3(btScalar(0.4), btScalar(0.15), btScalar(0.3)));
        static btSphereShape foot(btScalar(0.1));
        auto shape = std::make_unique<btCompoundShape>();
        shape->addChildShape(at(0, btScalar(0.1), 0), &top);
        shape->addChildShape(at(btScalar(0.4), btScalar(-0.15), 0), &foot);
        for (const btScalar z : {btScalar(-0.3), btScalar(0.3)})
            shape->addChildShape(at(btScalar(-0.3), btScalar(-0.15), z), &foot);
        return shape;
    }
    const btVector3 arm{btScalar(1.5), 0, 0};
    btRigidBody* body;
    btRigidBody* ground = nullptr;
};

using Act = std::function<void(Moving&)>;

struct Flag {
    const char* name;
    Act set;                                   // before the first step
    Act push;                                  // before each part of a step
    std::function<void(Moving&, int)> between; // before each step, by its number
    bool additionalDamping = false;
    Landing landing = Landing::preImage; // Cairn's
    int parts = kSmall;
    double tolerance = 0.02;
};

// The pose after each step, here or in the motion state.
std::vector<btTransform> played(const Flag& flag, Behind behind, Way way) {
    Moving w(behind, way, flag.additionalDamping, behind == Behind::cairn ? flag.landing : Landing::preImage);
    if (flag.set)
        flag.set(w);
    const int parts = behind == Behind::cairn ? 1 : flag.parts;
    std::vector<btTransform> poses;
    for (int i = 0; i < 30; ++i) {
        if (flag.between)
            flag.between(w, i);
        for (int k = 0; k < parts; ++k) {
            if (flag.push)
                flag.push(w);
            w.world->stepSimulation(kDt / static_cast<btScalar>(parts), 0);
        }
        if (w.cairn) {
            EXPECT_EQ(w.cairn->lastStatus(), CAIRN_OK) << w.cairn->lastError();
        }
        btTransform pose = w.body->getWorldTransform();
        if (w.body->getMotionState())
            w.body->getMotionState()->getWorldTransform(pose);
        poses.push_back(pose);
    }
    return poses;
}

double apart(const std::vector<btTransform>& x, const std::vector<btTransform>& y) {
    double worst = 0;
    for (std::size_t i = 0; i < x.size(); ++i)
        worst = std::max(worst, distance(x[i], y[i]));
    return worst;
}

conformance::Cell cell(const char* row, const char* column) { return {"Bodies", row, column}; }

void compare(const Flag& flag, const std::vector<Way>& ways = {Way::falls, Way::slides, Way::swings}) {
    for (const Way way : ways) {
        const std::vector<btTransform> stock = played(flag, Behind::stock, way), cairn = played(flag, Behind::cairn, way);
        EXPECT_GT(distance(cairn.front(), cairn.back()), 0.02) << flag.name << ": nothing moves, the cell shows nothing";
        conformance::report(cell(flag.name, nameOf(way)), apart(stock, cairn), flag.tolerance, "m or rad",
                            flag.parts == 1 ? Reference::stockStep : Reference::stock);
    }
}

Flag flagged(const char* name, Act set, double tolerance = 0.02) {
    Flag flag;
    flag.name = name;
    flag.set = std::move(set);
    flag.tolerance = tolerance;
    return flag;
}

TEST(Bodies, Plain) { compare(flagged("none", {})); }

TEST(Bodies, Factors) {
    compare(flagged("linear factor 1, 0, 1", [](Moving& w) {
        w.body->setLinearFactor(btVector3(1, 0, 1));
        w.body->setLinearVelocity(btVector3(w.body->getLinearVelocity().x(), 0, w.body->getLinearVelocity().z()));
    }));
    compare(flagged("angular factor 1, 0, 1", [](Moving& w) {
        w.body->setAngularFactor(btVector3(1, 0, 1));
        w.body->setAngularVelocity(btVector3(w.body->getAngularVelocity().x(), 0, w.body->getAngularVelocity().z()));
        if (!w.constraints.empty())
            w.body->setLinearVelocity(btVector3(0, 0, 0)); // it swings down
    }));
    compare(flagged("angular factor 0", [](Moving& w) {
        w.body->setAngularFactor(0);
        w.body->setAngularVelocity(btVector3(0, 0, 0));
        if (!w.constraints.empty()) { // it cannot swing: let it fall along a rail
            w.body->setLinearVelocity(btVector3(0, 0, 0));
            w.world->removeConstraint(w.constraints.back().get());
            w.constraints.pop_back();
            auto slider = std::make_unique<btGeneric6DofConstraint>(*w.body, btTransform::getIdentity(), true);
            slider->setLinearLowerLimit(btVector3(0, 1, 0));
            slider->setLinearUpperLimit(btVector3(0, -1, 0)); // free along y alone
            w.join(std::move(slider));
        }
    }));
}

TEST(Bodies, Damping) {
    compare(flagged("damping", [](Moving& w) { w.body->setDamping(btScalar(0.4), btScalar(0.6)); }));
    Flag additional = flagged("additional damping", [](Moving& w) { // stops a body as it gets slow
        w.body->setGravity(btVector3(0, 0, 0));
        const btScalar slow = btScalar(0.3) / w.body->getLinearVelocity().length();
        w.body->setLinearVelocity(w.body->getLinearVelocity() * slow);
        w.body->setAngularVelocity(w.body->getAngularVelocity() * slow);
        w.body->setDamping(btScalar(0.9), btScalar(0.9));
    });
    additional.additionalDamping = true;
    additional.parts = 1;
    additional.tolerance = 1e-3;
    compare(additional);
}

TEST(Bodies, Forces) {
    Flag forces = flagged("user forces and torques", {});
    forces.push = [](Moving& w) {
        w.body->applyForce(btVector3(8, 3, -5), btVector3(btScalar(0.1), btScalar(0.05), btScalar(0.2)));
        w.body->applyCentralForce(btVector3(-2, 1, 3));
        w.body->applyTorque(btVector3(btScalar(0.2), btScalar(0.4), btScalar(-0.1)));
    };
    compare(forces);
    Flag impulses = flagged("user impulses", {});
    impulses.between = [](Moving& w, int step) {
        if (step == 10)
            w.body->applyImpulse(btVector3(2, 1, -2), btVector3(btScalar(0.1), 0, btScalar(0.2)));
    };
    compare(impulses);
    compare(flagged("its own gravity", [](Moving& w) { w.body->setGravity(btVector3(2, -4, 1)); }));
}

// Stock's implicit modes lose angular momentum as their steps are long, its explicit one gains; in small substeps all are one motion.
TEST(Bodies, Gyroscopic) {
    const struct {
        const char* name;
        int flags;
    } modes[] = {{"gyroscopic: explicit", BT_ENABLE_GYROSCOPIC_FORCE_EXPLICIT},
                 {"gyroscopic: implicit, world", BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_WORLD},
                 {"gyroscopic: implicit, body", BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY}};
    for (const auto& mode : modes) {
        const int flags = mode.flags;
        compare(flagged(
            mode.name, [flags](Moving& w) { w.body->setFlags(flags); }, 0.03));
        double lost[2];
        for (const Behind behind : {Behind::cairn, Behind::stock}) {
            Moving w(behind, Way::falls);
            w.body->setFlags(flags);
            w.body->setAngularVelocity(btVector3(3, -6, btScalar(1.5)));
            const auto momentum = [&w] { return w.body->getInvInertiaTensorWorld().inverse() * w.body->getAngularVelocity(); };
            const btVector3 before = momentum();
            w.step(60);
            lost[behind == Behind::stock] = real((momentum() - before).length() / before.length());
        }
        conformance::report(cell(mode.name, "angular momentum in 1 s"), lost[0], 1e-3, "of it", Reference::deliberate,
                            "it is kept, where stock's steps change it");
        EXPECT_GT(lost[1], 2e-3) << mode.name << ": stock does the same";
    }
}

// Where Bullet sweeps a body, the adapter leaves the start pose and the end's velocity, one step's Euler off; attach() does not.
TEST(Bodies, Ccd) {
    for (const bool attached : {false, true}) {
        Flag ccd = flagged(attached ? "CCD, attach()" : "CCD", [](Moving& w) {
            w.body->setCcdMotionThreshold(btScalar(1e-4));
            w.body->setCcdSweptSphereRadius(btScalar(0.2));
        });
        ccd.landing = attached ? Landing::action : Landing::preImage;
        ccd.tolerance = attached ? 0.02 : 0.06;
        compare(ccd);
    }
}

const btVector3 small(btScalar(0.1), btScalar(0.1), btScalar(0.1)); // a post's

TEST(Bodies, Static) {
    for (const Way way : kWays) {
        Moving w(Behind::cairn, way);
        btRigidBody& still = way == Way::slides ? *w.ground : w.box(0, btVector3(0, 0, 0), small);
        if (way == Way::swings)
            w.join(std::make_unique<btPoint2PointConstraint>(*w.body, still, -w.arm, btVector3(0, 0, 0)));
        const btTransform before = still.getWorldTransform();
        w.step(30);
        conformance::report(cell("static", nameOf(way)),
                            distance(before, still.getWorldTransform()) + real(still.getLinearVelocity().length()), 0, "m or rad",
                            Reference::formula);
    }
}

// The floor, or the post, moves at a constant velocity, told step by step; contacts and joints are found where it will stand.
TEST(Bodies, Kinematic) {
    for (const bool turns : {false, true}) {
        const char* const row = turns ? "kinematic, turning" : "kinematic, moving";
        const btVector3 speed = turns ? btVector3(0, 0, 0) : btVector3(btScalar(0.8), 0, btScalar(-0.4));
        const btScalar rate = turns ? 1 : 0;
        for (const Way way : kWays) {
            // in single precision Bullet finds no angular velocity in so small a turn as that of a substep
            const bool same = turns && way == Way::slides;
            std::vector<btTransform> poses[2];
            double strayed = 0;
            for (const Behind behind : {Behind::cairn, Behind::stock}) {
                Moving w(behind, way);
                btRigidBody& driven = way == Way::slides ? *w.ground : w.box(0, btVector3(0, 0, 0), small);
                driven.setCollisionFlags(driven.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
                driven.setActivationState(DISABLE_DEACTIVATION);
                if (way == Way::swings) {
                    w.world->removeConstraint(w.constraints.back().get());
                    w.constraints.pop_back();
                    const btVector3 hook(0, 0, btScalar(0.5)); // off the axis about which it turns
                    w.body->setWorldTransform(at(w.arm.x(), 0, hook.z()));
                    w.join(std::make_unique<btPoint2PointConstraint>(*w.body, driven, -w.arm, hook));
                }
                const btTransform start = driven.getWorldTransform();
                const int parts = w.cairn || same ? 1 : kSmall;
                for (int i = 1; i <= 30 * parts; ++i) {
                    const btScalar t = kDt * static_cast<btScalar>(i) / static_cast<btScalar>(parts);
                    const btTransform told(btQuaternion(btVector3(0, 1, 0), rate * t), start.getOrigin() + speed * t);
                    driven.setWorldTransform(told);
                    w.world->stepSimulation(kDt / static_cast<btScalar>(parts), 0);
                    if (w.cairn)
                        strayed = std::max(strayed, distance(told, driven.getWorldTransform()));
                    if (i % parts == 0)
                        poses[w.cairn != nullptr].push_back(w.body->getWorldTransform());
                }
            }
            EXPECT_EQ(strayed, 0) << row;
            if (way == Way::falls)
                conformance::report(cell(row, "falls"), strayed, 0, "m or rad", Reference::formula);
            else
                conformance::report(cell(row, nameOf(way)), apart(poses[0], poses[1]), same ? 0.03 : 0.02, "m or rad",
                                    same ? Reference::stockStep : Reference::stock);
        }
    }
}

TEST(Bodies, Sleeping) {
    for (const Way way : kWays) {
        Moving w(Behind::cairn, way);
        if (way == Way::slides)
            w.body->translate(btVector3(0, btScalar(0.005), 0)); // awake, it would fall
        w.body->setLinearVelocity(btVector3(0, 0, 0));
        w.body->setAngularVelocity(btVector3(0, 0, 0));
        w.body->forceActivationState(ISLAND_SLEEPING);
        const btTransform before = w.body->getWorldTransform();
        w.step(30);
        conformance::report(cell("sleeping", nameOf(way)), distance(before, w.body->getWorldTransform()), 0, "m or rad",
                            Reference::formula);
    }
    Flag wakes = flagged("woken by the application", [](Moving& w) { w.body->forceActivationState(ISLAND_SLEEPING); });
    wakes.between = [](Moving& w, int step) {
        if (step != 10)
            return;
        w.body->forceActivationState(ACTIVE_TAG);
        w.body->activate(true);
        w.body->applyCentralImpulse(btVector3(4, 0, -2));
    };
    compare(wakes);
    // A ball that comes along wakes it, and pushes it straight.
    const Flag blow = flagged(
        "woken by a blow",
        [](Moving& w) {
            if (!w.ground) // where it stands, friction needs its weight
                w.body->setGravity(btVector3(0, 0, 0));
            w.body->setLinearVelocity(btVector3(0, 0, 0));
            w.body->setAngularVelocity(btVector3(0, 0, 0));
            w.body->forceActivationState(ISLAND_SLEEPING);
            btRigidBody& ball =
                w.add(std::make_unique<btSphereShape>(btScalar(0.15)), 2, at(0, 0, btScalar(-0.9)) * w.body->getWorldTransform());
            ball.setGravity(btVector3(0, 0, 0));
            ball.setLinearVelocity(btVector3(0, 0, 3));
        },
        0.05);
    compare(blow);
}

// What is drawn: after whole steps the pose, between them the pose of a step ago, extrapolated.
TEST(Bodies, MotionStates) {
    std::vector<std::unique_ptr<btDefaultMotionState>> states;
    compare(flagged("motion state", [&states](Moving& w) {
        states.push_back(std::make_unique<btDefaultMotionState>(w.body->getWorldTransform()));
        w.body->setMotionState(states.back().get());
    }));
    for (const Way way : kWays) {
        Moving stock(Behind::stock, way), cairn(Behind::cairn, way);
        btDefaultMotionState drawn(cairn.body->getWorldTransform());
        cairn.body->setMotionState(&drawn);
        std::vector<btTransform> poses[2];
        int time = -kSmall; // of the drawn pose, in stock's substeps
        for (int i = 1; i <= 40; ++i) {
            cairn.world->stepSimulation(kDt * btScalar(0.7), 1, kDt);
            time += kSmall * 7 / 10;
            if (time <= 0)
                continue;
            for (int k = std::max(time - kSmall * 7 / 10, 0); k < time; ++k)
                stock.world->stepSimulation(kDt / kSmall, 0);
            poses[0].push_back(stock.body->getWorldTransform());
            poses[1].push_back(drawn.m_graphicsWorldTrans);
        }
        conformance::report(cell("motion state, between the steps", nameOf(way)), apart(poses[0], poses[1]), 0.02, "m or rad",
                            Reference::stock);
        cairn.body->setMotionState(nullptr);
    }
}

// Factors between 0 and 1: what moves a free body is scaled once, as stock does it, and mass twice, F M^-1 F.
TEST(Bodies, FractionalFactors) {
    for (const bool angular : {false, true}) {
        Flag flag = flagged(angular ? "angular factor 0.5" : "linear factor 0.5", [angular](Moving& w) {
            const btVector3 half(btScalar(0.5), btScalar(0.5), btScalar(0.5));
            if (angular)
                w.body->setAngularFactor(half);
            else
                w.body->setLinearFactor(half);
        });
        flag.push = [](Moving& w) { w.body->applyTorque(btVector3(btScalar(0.2), btScalar(0.4), btScalar(-0.1))); };
        compare(flag);
    }
    // a ball of 1 kg at 1 m/s meets another without a bounce, as one of 4 kg
    double together[2];
    for (const Behind behind : {Behind::cairn, Behind::stock}) {
        TestWorld w(behind, btVector3(0, 0, 0));
        btRigidBody* balls[2];
        for (int i = 0; i < 2; ++i)
            balls[i] = &w.add(std::make_unique<btSphereShape>(btScalar(0.5)), 1, at(btScalar(1.2) * btScalar(i), 0, 0));
        balls[0]->setLinearFactor(btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5)));
        balls[0]->setLinearVelocity(btVector3(1, 0, 0));
        w.step(60);
        together[behind == Behind::stock] = real(balls[1]->getLinearVelocity().x());
    }
    conformance::report(cell("linear factor 0.5", "meets its like"), std::abs(together[0] - 0.8), 1e-3, "m/s", Reference::formula);
    EXPECT_NEAR(together[1], 0.8, 1e-3) << "stock's";
}

} // namespace
