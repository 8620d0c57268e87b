// Tables are packed in parallel: what comes of it does not depend on how many threads did it.
#include "world.h"

#include <gtest/gtest.h>

#include <cstring>

namespace {

constexpr int kWide = 9, kHigh = 3;

// Over 500 manifolds of every kind that the adapter treats in a way of its own: boxes, rolling spheres, soft and anchored contacts,
// belts, anisotropic friction, ghosts, sleepers, CCD, points beyond the processing threshold.
struct Crowd {
    Crowd(uint32_t threads, Landing landing) : world(Behind::cairn, btVector3(0, btScalar(-9.81), 0), landing, threads) {
        cairn_params params = world.cairn->params();
        params.substeps = 1, params.iterations = 4; // it is the packing that is tested
        world.cairn->setParams(params);
        world.world->getSolverInfo().m_solverMode |= SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;
        world.floor();
        for (int y = 0; y < kHigh; ++y)
            for (int z = 0; z < kWide; ++z)
                for (int x = 0; x < kWide; ++x)
                    add(x, y, z);
    }
    void add(int x, int y, int z) {
        const int kind = (x + 3 * y + 5 * z) % 9;
        const btVector3 place(btScalar(x) * btScalar(0.995), btScalar(y) + btScalar(0.5), btScalar(z) * btScalar(0.995));
        if (kind == 0) {
            btRigidBody& ball = world.add(std::make_unique<btSphereShape>(btScalar(0.5)), 1, at(place.x(), place.y(), place.z()));
            ball.setRollingFriction(btScalar(0.1));
            ball.setSpinningFriction(btScalar(0.05));
            ball.setCcdMotionThreshold(btScalar(0.01));
            ball.setCcdSweptSphereRadius(btScalar(0.2));
            return;
        }
        btRigidBody& box = world.box(1, place);
        box.setAngularVelocity(btVector3(btScalar(x % 3), 0, btScalar(z % 2)));
        if (kind == 1)
            box.setContactStiffnessAndDamping(1000, 10);
        else if (kind == 2)
            box.setCollisionFlags(box.getCollisionFlags() | btCollisionObject::CF_HAS_FRICTION_ANCHOR);
        else if (kind == 3)
            box.setAnisotropicFriction(btVector3(1, btScalar(0.5), btScalar(0.2)));
        else if (kind == 4)
            box.setContactProcessingThreshold(btScalar(-0.002));
        else if (kind == 5 && y == kHigh - 1)
            box.setCollisionFlags(box.getCollisionFlags() | btCollisionObject::CF_NO_CONTACT_RESPONSE);
        else if (kind == 6)
            box.setRestitution(btScalar(0.5));
        else if (kind == 7)
            box.setCollisionFlags(box.getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
    }

    // Poses, velocities, and what the application may read of the points.
    std::vector<btScalar> state() const {
        std::vector<btScalar> all;
        const auto put = [&all](const btVector3& v) { all.insert(all.end(), {v.x(), v.y(), v.z()}); };
        for (const std::unique_ptr<btRigidBody>& body : world.bodies) {
            put(body->getWorldTransform().getOrigin());
            for (int row = 0; row < 3; ++row)
                put(body->getWorldTransform().getBasis().getRow(row));
            put(body->getLinearVelocity());
            put(body->getAngularVelocity());
        }
        btDispatcher& dispatcher = *const_cast<btDiscreteDynamicsWorld&>(*world.world).getDispatcher();
        for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
            const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
            for (int j = 0; j < manifold.getNumContacts(); ++j) {
                const btManifoldPoint& point = manifold.getContactPoint(j);
                all.insert(all.end(), {point.m_appliedImpulse, point.m_appliedImpulseLateral1, point.m_appliedImpulseLateral2});
            }
        }
        return all;
    }
    TestWorld world;
};

bool makeBelt(btManifoldPoint& point, const btCollisionObjectWrapper*, int, int, const btCollisionObjectWrapper*, int, int) {
    btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
    point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
    point.m_contactMotion1 = btScalar(0.3);
    return true;
}

class Gather : public testing::Test {
  protected:
    void SetUp() override { gContactAddedCallback = makeBelt; }
    void TearDown() override { gContactAddedCallback = nullptr; }
};

TEST_F(Gather, SameBitsForAnyNumberOfThreads) {
    for (const Landing landing : {Landing::preImage, Landing::action}) {
        Crowd one(1, landing), two(2, landing), three(3, landing);
        for (int step = 0; step < 12; ++step) {
            for (Crowd* crowd : {&one, &two, &three}) {
                crowd->world.step();
                ASSERT_EQ(crowd->world.cairn->lastStatus(), CAIRN_OK) << crowd->world.cairn->lastError();
            }
            const std::vector<btScalar> expected = one.state();
            for (const Crowd* crowd : {&two, &three}) {
                const std::vector<btScalar> state = crowd->state();
                ASSERT_EQ(state.size(), expected.size()) << "step " << step;
                ASSERT_EQ(std::memcmp(state.data(), expected.data(), state.size() * sizeof(btScalar)), 0) << "step " << step;
            }
        }
        EXPECT_GT(one.world.cairn->statistics().manifolds, 500u) << "else it was not split";
        EXPECT_GT(one.world.cairn->statistics().warm_started, 500u);
        EXPECT_EQ(three.world.cairn->statistics().threads, 3u);
    }
}

// A point beyond the processing threshold leaves no gap, and moves no other's impulse.
TEST_F(Gather, PointsThatTakeNoPartAreLeftOut) {
    TestWorld world;
    world.floor();
    btRigidBody& left = world.box(1, btVector3(-2, btScalar(0.499), 0));
    btRigidBody& soft = world.box(2, btVector3(0, btScalar(0.499), 0));
    btRigidBody& right = world.box(2, btVector3(2, btScalar(0.499), 0));
    left.setContactProcessingThreshold(btScalar(-1)); // deeper than it can be
    soft.setContactStiffnessAndDamping(100, 1);       // 1 mm of four such springs carry 2 % of its weight
    world.step();
    EXPECT_EQ(world.cairn->statistics().contacts, 8u);
    btScalar held = 0, yielding = 0;
    for (int i = 0; i < world.dispatcher.getNumManifolds(); ++i) {
        const btPersistentManifold& manifold = *world.dispatcher.getManifoldByIndexInternal(i);
        const bool ofLeft = manifold.getBody0() == &left || manifold.getBody1() == &left;
        for (int j = 0; j < manifold.getNumContacts(); ++j) {
            const btScalar impulse = manifold.getContactPoint(j).m_appliedImpulse;
            if (ofLeft)
                EXPECT_EQ(impulse, btScalar(0));
            else
                (manifold.getBody0() == &soft || manifold.getBody1() == &soft ? yielding : held) += impulse;
        }
    }
    EXPECT_GE(held, 2 * btScalar(9.81) * kDt * btScalar(0.99)) << right.getLinearVelocity().y();
    EXPECT_LT(left.getLinearVelocity().y(), btScalar(-0.1));
    EXPECT_GT(yielding, btScalar(0));
    EXPECT_LT(yielding, btScalar(0.3) * held) << "the springs are another contact's";
}

} // namespace
