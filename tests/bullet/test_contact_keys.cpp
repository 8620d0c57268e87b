// Warm starts follow a contact point, not its slot in the manifold.
#include "../../integrations/bullet/src/contact_keys.h"
#include "world.h"

#include <gtest/gtest.h>

#include <set>

namespace {

using cairn::bullet::ContactKeys;

btManifoldPoint pointAt(btScalar x, btScalar z) {
    return btManifoldPoint(btVector3(x, 0, z), btVector3(x, 0, z), btVector3(0, 1, 0), btScalar(-0.001));
}

struct Pair {
    btBoxShape shape{btVector3(1, 1, 1)};
    btRigidBody a{btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &shape)};
    btRigidBody b{btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &shape)};
    btPersistentManifold manifold{&a, &b, 0, btScalar(0.02), btScalar(0.02)};
};

void match(ContactKeys& keys, const btPersistentManifold& manifold, uint64_t (&found)[4]) {
    const uint32_t place = keys.place(manifold);
    ASSERT_NE(place, ContactKeys::kSeen);
    if (keys.match(place, manifold, found) > 0)
        keys.number(place, found);
}

TEST(ContactKeys, FollowAPointIntoAnotherSlot) {
    Pair pair;
    ContactKeys keys;
    for (const btScalar x : {btScalar(-1), btScalar(1)})
        for (const btScalar z : {btScalar(-1), btScalar(1)})
            pair.manifold.addManifoldPoint(pointAt(x, z));
    uint64_t before[4], after[4];
    keys.beginStep();
    match(keys, pair.manifold, before);
    EXPECT_EQ(std::set<uint64_t>(before, before + 4).size(), 4u);
    EXPECT_EQ(std::set<uint64_t>(before, before + 4).count(0), 0u);

    pair.manifold.removeContactPoint(0); // the last point moves into its slot
    for (int i = 0; i < 3; ++i) {        // and all slide a little on body a
        btManifoldPoint& point = pair.manifold.getContactPoint(i);
        point.m_localPointA += btVector3(btScalar(0.005), 0, 0);
    }
    keys.beginStep();
    match(keys, pair.manifold, after);
    EXPECT_EQ(after[0], before[3]);
    EXPECT_EQ(after[1], before[1]);
    EXPECT_EQ(after[2], before[2]);
}

TEST(ContactKeys, NewPointsAndNewPairsGetNewKeys) {
    Pair pair;
    ContactKeys keys;
    pair.manifold.addManifoldPoint(pointAt(0, 0));
    uint64_t first[4], second[4], third[4];
    keys.beginStep();
    match(keys, pair.manifold, first);
    pair.manifold.clearManifold();
    pair.manifold.addManifoldPoint(pointAt(btScalar(0.5), 0));
    keys.beginStep();
    match(keys, pair.manifold, second);
    EXPECT_NE(second[0], first[0]);
    pair.manifold.setBodies(&pair.b, &pair.a); // the memory of a manifold is used again for another pair
    keys.beginStep();
    match(keys, pair.manifold, third);
    EXPECT_NE(third[0], second[0]);
}

TEST(ContactKeys, AStandingTowerIsWarmStarted) {
    TestWorld w;
    w.floor();
    for (int i = 0; i < 5; ++i)
        w.box(1, btVector3(0, btScalar(0.5) + btScalar(i), 0));
    w.step(60);
    uint32_t points = 0, warm = 0;
    for (int i = 0; i < 20; ++i) {
        w.step();
        points += w.cairn->statistics().contacts;
        warm += w.cairn->statistics().warm_started;
    }
    EXPECT_GE(points, 400u);
    EXPECT_GE(warm, points - 4) << "Bullet now and then has a new one";
}

} // namespace
