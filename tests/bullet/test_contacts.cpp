// What Bullet keeps in a contact point beside its place: closed formulas, and the stock solver in small steps to compare with.
#include "world.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace {

constexpr double kGravity = 9.81;
constexpr int kFine = 20; // steps of stock's to one of Cairn's

double real(btScalar value) { return static_cast<double>(value); }
btVector3 vec(double x, double y, double z) {
    return btVector3(static_cast<btScalar>(x), static_cast<btScalar>(y), static_cast<btScalar>(z));
}

// A world that advances by kDt: Cairn in one step, stock in kFine.
void advance(TestWorld& w, int frames) {
    for (int i = 0; i < frames; ++i)
        if (w.cairn)
            w.step();
        else
            for (int k = 0; k < kFine; ++k)
                w.world->stepSimulation(kDt / kFine, 0);
}

template <class Visit> void each_point(TestWorld& w, const Visit& visit) {
    for (int m = 0; m < w.dispatcher.getNumManifolds(); ++m) {
        btPersistentManifold& manifold = *w.dispatcher.getManifoldByIndexInternal(m);
        for (int i = 0; i < manifold.getNumContacts(); ++i)
            visit(manifold, manifold.getContactPoint(i));
    }
}

// What a contact callback does to new points and to those that go on, in this test.
std::function<void(btManifoldPoint&, const btCollisionObject*)> g_edit; // the second: the point's body 0
bool on_added(btManifoldPoint& point, const btCollisionObjectWrapper* object0, int, int, const btCollisionObjectWrapper*, int, int) {
    g_edit(point, object0->getCollisionObject());
    return true;
}
class EditedContacts : public testing::Test {
  protected:
    void SetUp() override { gContactAddedCallback = on_added; }
    void TearDown() override {
        gContactAddedCallback = nullptr;
        g_edit = nullptr;
    }
    static void listen(btRigidBody& body) {
        body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
    }
};

btRigidBody& ball(TestWorld& w, double mass, double x = 0, double z = 0) {
    return w.add(std::make_unique<btSphereShape>(btScalar(0.5)), static_cast<btScalar>(mass),
                 at(static_cast<btScalar>(x), btScalar(0.5), static_cast<btScalar>(z)));
}

TEST(Rolling, SlowsABallDownAsStockDoes) {
    double speed[2], expected = 0;
    for (const Behind behind : {Behind::cairn, Behind::stock}) {
        TestWorld w(behind);
        btRigidBody& ground = w.floor();
        btRigidBody& rolls = ball(w, 1);
        ground.setRollingFriction(btScalar(0.05));
        rolls.setRollingFriction(btScalar(0.05));
        rolls.setLinearVelocity(btVector3(3, 0, 0));
        rolls.setAngularVelocity(btVector3(0, 0, -6));
        advance(w, 60);
        speed[behind == Behind::stock] = real(rolls.getLinearVelocity().x());
        each_point(w, [&](btPersistentManifold&, btManifoldPoint& point) {
            expected = 3 - 5.0 / 7 * real(point.m_combinedRollingFriction) * kGravity / 0.5;
        });
    }
    EXPECT_LT(expected, 2.5) << "hardly slowed: this test checks little";
    EXPECT_NEAR(speed[0], expected, 0.02);
    EXPECT_NEAR(speed[1], expected, 0.02);
}

TEST(Rolling, SpinningFrictionStopsASpinAsStockDoes) {
    double spin[2], expected = 0;
    for (const Behind behind : {Behind::cairn, Behind::stock}) {
        TestWorld w(behind);
        btRigidBody& ground = w.floor();
        btRigidBody& spins = ball(w, 1);
        for (btRigidBody* body : {&ground, &spins}) {
            body->setRollingFriction(btScalar(0.05)); // stock has neither without
            body->setSpinningFriction(btScalar(0.02));
        }
        spins.setAngularVelocity(btVector3(0, 8, 0));
        advance(w, 60);
        spin[behind == Behind::stock] = real(spins.getAngularVelocity().y());
        each_point(w, [&](btPersistentManifold&, btManifoldPoint& point) {
            expected = 8 - real(point.m_combinedSpinningFriction) * kGravity / (0.4 * 0.25);
        });
    }
    EXPECT_LT(expected, 7);
    EXPECT_NEAR(spin[0], expected, 0.02);
    EXPECT_NEAR(spin[1], expected, 0.02);
}

// Stock allows no more than the coefficient as an impulse (N m s), whatever the load; Cairn's bound goes with the load alone.
TEST(Rolling, IsNotCappedUnderHeavyLoad) {
    double speed[2];
    for (const Behind behind : {Behind::cairn, Behind::stock}) {
        TestWorld w(behind);
        btRigidBody& ground = w.floor();
        btRigidBody& rolls = ball(w, 100);
        ground.setRollingFriction(btScalar(0.05));
        rolls.setRollingFriction(btScalar(0.05));
        rolls.setLinearVelocity(btVector3(3, 0, 0));
        rolls.setAngularVelocity(btVector3(0, 0, -6));
        w.step(60);
        speed[behind == Behind::stock] = real(rolls.getLinearVelocity().x());
    }
    EXPECT_NEAR(speed[0], 3 - 5.0 / 7 * 0.05 * kGravity / 0.5, 0.02);
    EXPECT_GT(speed[1], 2.9);
}

// Bullet's capsules and cylinders resist rolling about their own axis only.
TEST(Rolling, AnisotropicAsTheShapeSays) {
    for (const bool resists : {true, false}) {
        double turn[2];
        for (const Behind behind : {Behind::cairn, Behind::stock}) {
            TestWorld w(behind);
            w.floor().setRollingFriction(btScalar(0.05));
            btRigidBody& log = w.add(std::make_unique<btCapsuleShapeX>(btScalar(0.5), btScalar(2)), 1, at(0, btScalar(0.5), 0));
            log.setRollingFriction(btScalar(0.05));
            log.setAnisotropicFriction(resists ? log.getCollisionShape()->getAnisotropicRollingFrictionDirection() : btVector3(0, 1, 1),
                                       btCollisionObject::CF_ANISOTROPIC_ROLLING_FRICTION);
            log.setLinearVelocity(btVector3(0, 0, 3));
            log.setAngularVelocity(btVector3(6, 0, 0));
            advance(w, 60);
            turn[behind == Behind::stock] = real(log.getAngularVelocity().x());
        }
        EXPECT_NEAR(turn[0], turn[1], 0.02) << resists;
        if (resists)
            EXPECT_LT(turn[0], 5.5);
        else
            EXPECT_NEAR(turn[0], 6, 0.01);
    }
}

// A belt: the user's directions and m_contactMotion.
TEST_F(EditedContacts, ContactMotionIsABelt) {
    for (const bool two : {true, false}) {
        btVector3 early[2], late[2];
        for (const Behind behind : {Behind::cairn, Behind::stock}) {
            TestWorld w(behind);
            w.world->getSolverInfo().m_solverMode |=
                SOLVER_ENABLE_FRICTION_DIRECTION_CACHING | (two ? SOLVER_USE_2_FRICTION_DIRECTIONS : 0);
            btRigidBody& belt = w.floor();
            listen(belt);
            belt.setFriction(1);
            btRigidBody& box = w.box(2, btVector3(0, btScalar(0.5), 0));
            g_edit = [&](btManifoldPoint& point, const btCollisionObject* body0) {
                const btScalar sign = body0 == &box ? btScalar(1) : btScalar(-1); // of body 0 relative to body 1
                point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
                point.m_lateralFrictionDir1 = btVector3(1, 0, 0);
                point.m_lateralFrictionDir2 = btVector3(0, 0, 1);
                point.m_contactMotion1 = sign * 2;
                point.m_contactMotion2 = sign * 1;
            };
            advance(w, 6);
            early[behind == Behind::stock] = box.getLinearVelocity();
            advance(w, 54);
            late[behind == Behind::stock] = box.getLinearVelocity();
        }
        SCOPED_TRACE(testing::Message() << "two directions: " << two);
        EXPECT_NEAR(real(late[0].x()), 2, 0.02);
        EXPECT_NEAR(real(late[1].x()), 2, 0.02);
        EXPECT_NEAR(real(late[0].z()), two ? 1 : 0, 0.02);
        EXPECT_NEAR(real(late[1].z()), two ? 1 : 0, 0.02);
        // on its way the cone pulls straight towards the belt, mu g in all; stock's pyramid mu g along each direction
        EXPECT_NEAR(real(early[0].length()), 0.5 * kGravity * 0.1, 0.03);
        EXPECT_NEAR(real(early[1].x()), 0.5 * kGravity * 0.1, 0.03);
    }
}

// One user's direction is all the friction there is, as strong as the direction is long; lateral impulses are in its units.
TEST_F(EditedContacts, AUsersDirectionMayBeAloneAndOfAnyLength) {
    btVector3 velocity[2];
    for (const Behind behind : {Behind::cairn, Behind::stock}) {
        TestWorld w(behind);
        w.world->getSolverInfo().m_solverMode |= SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;
        listen(w.floor());
        btRigidBody& box = w.box(2, btVector3(0, btScalar(0.25), 0), btVector3(btScalar(0.5), btScalar(0.25), btScalar(0.5)));
        g_edit = [](btManifoldPoint& point, const btCollisionObject*) {
            point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
            point.m_lateralFrictionDir1 = btVector3(btScalar(0.5), 0, 0);
        };
        box.setLinearVelocity(btVector3(3, 0, 1));
        advance(w, 30);
        velocity[behind == Behind::stock] = box.getLinearVelocity();
        if (w.cairn) {
            each_point(w, [](btPersistentManifold&, btManifoldPoint& point) {
                EXPECT_NEAR(real(btFabs(point.m_appliedImpulseLateral1)), 0.25 * real(point.m_appliedImpulse),
                            1e-3 * real(point.m_appliedImpulse));
                EXPECT_EQ(point.m_appliedImpulseLateral2, btScalar(0));
            });
        }
    }
    EXPECT_NEAR(real(velocity[0].x()), 3 - 0.5 * 0.25 * kGravity * 0.5, 0.02);
    EXPECT_NEAR(real(velocity[0].z()), 1, 1e-3);
    EXPECT_LT((velocity[0] - velocity[1]).length(), btScalar(0.03));
}

// In every combination of the solver's modes a box that slides is slowed by mu g, as stock's is along an axis.
TEST(SolverModes, FrictionIsTheSame) {
    for (int bits = 0; bits < 16; ++bits) {
        const int modes = (bits & 1 ? SOLVER_USE_2_FRICTION_DIRECTIONS : 0) | (bits & 2 ? SOLVER_ENABLE_FRICTION_DIRECTION_CACHING : 0) |
                          (bits & 4 ? SOLVER_DISABLE_VELOCITY_DEPENDENT_FRICTION_DIRECTION : 0) |
                          (bits & 8 ? SOLVER_INTERLEAVE_CONTACT_AND_FRICTION_CONSTRAINTS : 0);
        for (const double heading : {0.0, 0.6}) {
            TestWorld w;
            w.world->getSolverInfo().m_solverMode |= modes;
            w.floor();
            btRigidBody& box = w.box(2, btVector3(0, btScalar(0.25), 0), btVector3(btScalar(0.5), btScalar(0.25), btScalar(0.5)));
            const btVector3 ahead = vec(std::cos(heading), 0, std::sin(heading));
            box.setLinearVelocity(ahead * 3);
            w.step(30);
            const btVector3 expected = ahead * static_cast<btScalar>(3 - 0.25 * kGravity * 0.5);
            EXPECT_LT((box.getLinearVelocity() - expected).length(), btScalar(0.02)) << "modes " << modes << ", heading " << heading;
        }
    }
}

// Each axis of the body has its own friction; a body that is turned takes them along.
TEST(Anisotropic, FrictionAlongEachAxisAsStock) {
    for (const double turn : {0.0, 0.9})
        for (const bool across : {false, true}) {
            btVector3 velocity[2];
            const double heading = turn + (across ? std::acos(0.0) : 0);
            const btVector3 way = vec(std::cos(heading), 0, -std::sin(heading));
            for (const Behind behind : {Behind::cairn, Behind::stock}) {
                TestWorld w(behind);
                w.floor();
                const btTransform pose(btQuaternion(btVector3(0, 1, 0), static_cast<btScalar>(turn)), btVector3(0, btScalar(0.25), 0));
                btRigidBody& sledge = w.add(std::make_unique<btBoxShape>(btVector3(btScalar(0.5), btScalar(0.25), btScalar(0.5))), 2, pose);
                sledge.setAnisotropicFriction(btVector3(btScalar(0.2), 1, btScalar(0.8)));
                sledge.setLinearVelocity(way * 3);
                advance(w, 30);
                velocity[behind == Behind::stock] = sledge.getLinearVelocity();
            }
            const double share = across ? 0.8 : 0.2, expected = 3 - share * 0.25 * kGravity * 0.5;
            EXPECT_NEAR(real(velocity[0].dot(way)), expected, 0.02) << turn << across;
            EXPECT_NEAR(real(velocity[1].dot(way)), expected, 0.02) << turn << across;
            EXPECT_LT((velocity[0] - velocity[1]).length(), btScalar(0.04));
        }
}

// Between the axes Cairn's ellipse takes most power from the slip: the force is S^2 v / |S v|, stock's S v. Both lie on the ellipse.
TEST(Anisotropic, BetweenTheAxesTheForceIsTheEllipses) {
    TestWorld w;
    w.floor();
    btRigidBody& sledge = w.box(2, btVector3(0, btScalar(0.25), 0), btVector3(btScalar(0.5), btScalar(0.25), btScalar(0.5)));
    sledge.setAnisotropicFriction(btVector3(btScalar(0.2), 1, btScalar(0.8)));
    w.step(10);
    const double angle = 0.7, x = std::cos(angle), z = std::sin(angle);
    sledge.setLinearVelocity(vec(5 * x, 0, 5 * z));
    w.step();
    const double size = 0.25 * kGravity * real(kDt) / std::hypot(0.2 * x, 0.8 * z);
    EXPECT_NEAR(real(sledge.getLinearVelocity().x()), 5 * x - 0.04 * x * size, 1e-3);
    EXPECT_NEAR(real(sledge.getLinearVelocity().z()), 5 * z - 0.64 * z * size, 1e-3);
}

// Deeper than its split impulse's threshold, stock would leave a spring's push out of the velocities, and the body fall through.
void keep_springs(TestWorld& w) { w.world->getSolverInfo().m_splitImpulse = 0; }

// A body on points of stiffness k rests m g / k below the surface, as stock's does.
TEST(Soft, StiffnessAndDampingAsStock) {
    const double mass = 2, k = 800;
    double depth[2], bounce[2];
    for (const Behind behind : {Behind::cairn, Behind::stock}) {
        TestWorld w(behind);
        keep_springs(w);
        w.floor();
        btRigidBody& soft = ball(w, mass);
        soft.setContactStiffnessAndDamping(static_cast<btScalar>(k), btScalar(5));
        double lowest = 0;
        for (int i = 0; i < 40; ++i) {
            advance(w, 1);
            lowest = std::min(lowest, real(soft.getWorldTransform().getOrigin().y()) - 0.5);
        }
        bounce[behind == Behind::stock] = -lowest;
        advance(w, 600);
        depth[behind == Behind::stock] = 0.5 - real(soft.getWorldTransform().getOrigin().y());
        EXPECT_LT(soft.getLinearVelocity().length(), btScalar(2e-3));
    }
    const double expected = mass * kGravity / k;
    EXPECT_NEAR(depth[0], expected, 0.01 * expected);
    EXPECT_NEAR(depth[1], expected, 0.03 * expected);
    EXPECT_GT(bounce[0], 1.5 * expected) << "it swings through";
    EXPECT_NEAR(bounce[0], bounce[1], 0.15 * expected);
}

// cfm and erp of a point are a spring k = erp / (dt cfm): the same depth at rest as stock's with that step.
TEST_F(EditedContacts, CfmAndErpAreASpring) {
    const double mass = 2, cfm = 0.05, erp = 0.4, k = erp / (real(kDt) * cfm);
    for (const Behind behind : {Behind::cairn, Behind::stock}) {
        TestWorld w(behind);
        keep_springs(w);
        listen(w.floor());
        btRigidBody& soft = ball(w, mass);
        g_edit = [&](btManifoldPoint& point, const btCollisionObject*) {
            point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_CFM | BT_CONTACT_FLAG_HAS_CONTACT_ERP;
            point.m_contactCFM = static_cast<btScalar>(cfm);
            point.m_contactERP = static_cast<btScalar>(erp);
        };
        w.step(300);
        EXPECT_NEAR(0.5 - real(soft.getWorldTransform().getOrigin().y()), mass * kGravity / k, 0.02 * mass * kGravity / k)
            << (behind == Behind::stock ? "stock" : "cairn");
    }
}

// Pushed off its place by 4 mm, a box with friction anchors is drawn back; without, it stays there.
TEST(Anchor, DrawsABoxBack) {
    for (const bool anchored : {true, false})
        for (const Behind behind : {Behind::cairn, Behind::stock}) {
            TestWorld w(behind);
            w.floor().setFriction(1);
            btRigidBody& box = w.box(2, btVector3(0, btScalar(0.5), 0));
            box.setFriction(1);
            if (anchored)
                box.setCollisionFlags(box.getCollisionFlags() | btCollisionObject::CF_HAS_FRICTION_ANCHOR);
            w.step(30);
            const btScalar home = box.getWorldTransform().getOrigin().x();
            btTransform pose = box.getWorldTransform();
            pose.getOrigin() += btVector3(btScalar(0.004), 0, 0);
            box.setWorldTransform(pose);
            w.step(60);
            EXPECT_NEAR(real(box.getWorldTransform().getOrigin().x() - home), anchored ? 0 : 0.004, 2e-4)
                << (behind == Behind::stock ? "stock" : "cairn");
        }
}

// A point that is still apart lets the body come as near as it is, no nearer and no slower.
TEST(Speculative, ABodyLandsOnTheSurface) {
    TestWorld w(Behind::cairn, btVector3(0, 0, 0));
    w.floor();
    btRigidBody& falling = ball(w, 1);
    btTransform pose = falling.getWorldTransform();
    pose.getOrigin() += vec(0, 0.015, 0);
    falling.setWorldTransform(pose);
    falling.setLinearVelocity(btVector3(0, btScalar(-0.6), 0)); // 10 mm a step
    const auto height = [&] { return real(falling.getWorldTransform().getOrigin().y()) - 0.5; };
    w.step();
    EXPECT_NEAR(height(), 0.005, 1e-4);
    EXPECT_NEAR(real(falling.getLinearVelocity().y()), -0.6, 1e-3);
    w.step();
    EXPECT_NEAR(height(), 0, 1e-3);
    w.step();
    EXPECT_NEAR(real(falling.getLinearVelocity().y()), 0, 0.02);
}

TEST(Speculative, ThePointsBeyondTheProcessingThresholdDoNotCount) {
    TestWorld w(Behind::cairn, btVector3(0, 0, 0));
    w.floor().setContactProcessingThreshold(0);
    btRigidBody& falling = ball(w, 1);
    btTransform pose = falling.getWorldTransform();
    pose.getOrigin() += vec(0, 0.015, 0);
    falling.setWorldTransform(pose);
    falling.setContactProcessingThreshold(0);
    falling.setLinearVelocity(btVector3(0, btScalar(-1.2), 0));
    w.step();
    EXPECT_NEAR(real(falling.getLinearVelocity().y()), -1.2, 1e-4) << "it goes 5 mm in";
    w.step();
    EXPECT_GT(real(falling.getLinearVelocity().y()), -0.2);
}

// Each child of a compound has its manifold, each triangle of a mesh its normal.
TEST(Shapes, ACompoundRestsOnAMesh) {
    btTriangleMesh triangles;
    for (int i = -4; i < 4; ++i)
        for (int k = -4; k < 4; ++k) {
            const btVector3 corner = vec(i, 0, k);
            triangles.addTriangle(corner, corner + vec(0, 0, 1), corner + vec(1, 0, 0));
            triangles.addTriangle(corner + vec(1, 0, 1), corner + vec(1, 0, 0), corner + vec(0, 0, 1));
        }
    btBoxShape part(btVector3(btScalar(0.3), btScalar(0.3), btScalar(0.3)));
    TestWorld w;
    w.add(std::make_unique<btBvhTriangleMeshShape>(&triangles, true), 0, at(0, 0, 0));
    auto dumbbell = std::make_unique<btCompoundShape>();
    dumbbell->addChildShape(at(-1, 0, 0), &part);
    dumbbell->addChildShape(at(1, 0, 0), &part);
    btRigidBody& body = w.add(std::move(dumbbell), 3, at(btScalar(0.2), btScalar(0.35), btScalar(0.1)));
    w.step(180);
    double sum = 0;
    each_point(w, [&](btPersistentManifold&, btManifoldPoint& point) { sum += real(point.m_appliedImpulse); });
    EXPECT_NEAR(sum, 3 * kGravity * real(kDt), 0.01 * 3 * kGravity * real(kDt));
    EXPECT_NEAR(real(body.getWorldTransform().getOrigin().y()), 0.3, 0.05) << "the mesh has a margin of 0.04";
    EXPECT_NEAR(real(body.getWorldTransform().getOrigin().x()), 0.2, 0.01);
    EXPECT_LT(body.getAngularVelocity().length(), btScalar(5e-3));
}

// What a callback writes to a point is what is solved.
TEST_F(EditedContacts, CallbacksDecide) {
    TestWorld w;
    btRigidBody& ground = w.floor();
    listen(ground);
    btRigidBody& box = w.box(2, btVector3(0, btScalar(0.25), 0), btVector3(btScalar(0.5), btScalar(0.25), btScalar(0.5)));
    g_edit = [](btManifoldPoint& point, const btCollisionObject*) {
        point.m_combinedFriction = 0;
        point.m_normalWorldOnB *= btScalar(1.01); // interpolated normals are not quite unit
    };
    box.setLinearVelocity(btVector3(2, 0, 0));
    w.step(60);
    EXPECT_EQ(w.cairn->lastStatus(), CAIRN_OK) << w.cairn->lastError();
    EXPECT_NEAR(real(box.getLinearVelocity().x()), 2, 1e-3);
    EXPECT_NEAR(real(box.getWorldTransform().getOrigin().y()), 0.25, 5e-3);
}

} // namespace
