// Thousands of steps in which bodies, contacts and joints of every type come and go at random, joints that contradict each other among
// them. All stays finite, tidy and the same, and nothing is thrown.
#include "world.h"

#include <BulletCollision/CollisionDispatch/btSimulationIslandManager.h>
#include <BulletDynamics/ConstraintSolver/btConeTwistConstraint.h>
#include <BulletDynamics/ConstraintSolver/btFixedConstraint.h>
#include <BulletDynamics/ConstraintSolver/btGearConstraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpring2Constraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpringConstraint.h>
#include <BulletDynamics/ConstraintSolver/btHinge2Constraint.h>
#include <BulletDynamics/ConstraintSolver/btUniversalConstraint.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

namespace {

// The adapter's own rows, as a user's type has them: keeps the centres at their distance.
class Rod : public btTypedConstraint {
  public:
    Rod(btRigidBody& a, btRigidBody& b) : btTypedConstraint(CONTACT_CONSTRAINT_TYPE, a, b), m_length(between().length()) {}
    void getInfo1(btConstraintInfo1* info) override {
        info->m_numConstraintRows = 1;
        info->nub = 0;
    }
    void getInfo2(btConstraintInfo2* info) override {
        const btVector3 apart = between(), along = apart.length2() > SIMD_EPSILON ? apart.normalized() : btVector3(0, 1, 0);
        for (int i = 0; i < 3; ++i) {
            info->m_J1linearAxis[i] = -along[i];
            info->m_J2linearAxis[i] = along[i];
        }
        info->m_constraintError[0] = info->fps * info->erp * (m_length - apart.length());
    }
    void setParam(int, btScalar, int) override {}
    btScalar getParam(int, int) const override { return 0; }

  private:
    btVector3 between() const { return m_rbB.getWorldTransform().getOrigin() - m_rbA.getWorldTransform().getOrigin(); }
    btScalar m_length;
};

constexpr btScalar kFastest = 100; // m/s; what falls 20 m has 20

// A box of walls into which things fall. The generator's bits alone decide: no distribution of the library's is used.
class Crowd {
  public:
    explicit Crowd(unsigned seed, Landing landing) : w(Behind::cairn, btVector3(0, btScalar(-9.81), 0), landing), m_random(seed) {
        w.world->getSolverInfo().m_numIterations = 10;
        cairn_params params = w.cairn->params();
        params.iterations = 8; // it is coming and going that is tried here
        params.substeps = 2;
        EXPECT_EQ(w.cairn->setParams(params), CAIRN_OK);
        w.floor();
        for (const btScalar side : {btScalar(-4), btScalar(4)}) {
            w.box(0, btVector3(side, 2, 0), btVector3(btScalar(0.5), 3, 5));
            w.box(0, btVector3(0, 2, side), btVector3(5, 3, btScalar(0.5)));
        }
        m_fixed = w.bodies.size();
    }

    void step(int number) {
        if (number % 50 == 0)
            w.world->getSimulationIslandManager()->setSplitIslands(number / 50 % 2 == 0);
        if (chance(8) && moving() < 40)
            addBody();
        if (chance(12) && moving() > 0)
            removeBody(m_fixed + below(moving()));
        if (chance(6) && moving() > 1 && w.constraints.size() < 40)
            addJoint();
        if (chance(10) && !w.constraints.empty())
            removeJoint(below(w.constraints.size()));
        if (chance(10) && moving() > 0)
            disturb(any());
        for (std::size_t i = w.bodies.size(); i-- > m_fixed;) // without response it falls through the floor
            if (w.bodies[i]->getWorldTransform().getOrigin().y() < -20)
                removeBody(i);
        w.step();
        ASSERT_EQ(w.cairn->lastStatus(), CAIRN_OK) << "step " << number << ": " << w.cairn->lastError();
        for (const std::unique_ptr<btRigidBody>& body : w.bodies) {
            if (!body->isStaticObject()) { // the island manager leaves -2 there
                ASSERT_EQ(body->getCompanionId(), -1) << "step " << number;
            }
            const btVector3 state[] = {body->getWorldTransform().getOrigin(), body->getWorldTransform().getBasis()[0],
                                       body->getLinearVelocity(), body->getAngularVelocity()};
            for (const btVector3& part : state)
                for (int i = 0; i < 3; ++i)
                    ASSERT_TRUE(std::isfinite(part[i])) << "step " << number;
            ASSERT_LT(body->getLinearVelocity().length(), kFastest) << "step " << number;
            for (const btVector3& part : state)
                hash(&part[0], 3 * sizeof(btScalar));
        }
        for (int m = 0; m < w.dispatcher.getNumManifolds(); ++m) {
            const btPersistentManifold& manifold = *w.dispatcher.getManifoldByIndexInternal(m);
            for (int i = 0; i < manifold.getNumContacts(); ++i) {
                const btScalar impulse = manifold.getContactPoint(i).m_appliedImpulse;
                ASSERT_TRUE(std::isfinite(impulse)) << "step " << number;
                m_touched += impulse > 0;
            }
        }
    }
    std::uint64_t hash() const { return m_hash; }
    int touched() const { return m_touched; }
    const std::vector<int>& made() const { return m_made; } // joints of each type

  private:
    std::size_t below(std::size_t count) { return m_random() % count; }
    bool chance(unsigned oneIn) { return m_random() % oneIn == 0; }
    btScalar real(double low, double high) {
        return static_cast<btScalar>(low + (high - low) * static_cast<double>(m_random() % 4096) / 4095);
    }
    btVector3 inside(double size) { return btVector3(real(-size, size), real(-size, size), real(-size, size)); }
    std::size_t moving() const { return w.bodies.size() - m_fixed; }
    btRigidBody& any() { return *w.bodies[m_fixed + below(moving())]; }

    void addBody() {
        std::unique_ptr<btCollisionShape> shape;
        const btScalar size = real(0.2, 0.5);
        switch (below(6)) {
        case 0:
            shape = std::make_unique<btSphereShape>(size);
            break;
        case 1:
            shape = std::make_unique<btCapsuleShape>(size, size);
            break;
        case 2:
            shape = std::make_unique<btCylinderShape>(btVector3(size, size, size));
            break;
        case 3: {
            auto compound = std::make_unique<btCompoundShape>();
            compound->addChildShape(at(-size, 0, 0), &m_part);
            compound->addChildShape(at(size, 0, 0), &m_part);
            shape = std::move(compound);
            break;
        }
        default:
            shape = std::make_unique<btBoxShape>(btVector3(size, size / 2, real(0.2, 0.5)));
        }
        const btTransform pose(btQuaternion(inside(1) + btVector3(0, 2, 0), real(0, 3)), btVector3(real(-3, 3), real(2, 6), real(-3, 3)));
        btRigidBody& body = w.add(std::move(shape), real(0.5, 3), pose, chance(2));
        body.setLinearVelocity(inside(3));
        body.setAngularVelocity(inside(5));
        body.setRestitution(real(0, 0.6));
        body.setRollingFriction(chance(3) ? btScalar(0.05) : btScalar(0));
        body.setSpinningFriction(chance(3) ? btScalar(0.05) : btScalar(0));
        if (chance(6))
            body.setAnisotropicFriction(btVector3(btScalar(0.3), 1, btScalar(0.7)));
        if (chance(6))
            body.setContactStiffnessAndDamping(2000, 40);
        if (chance(6))
            body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_HAS_FRICTION_ANCHOR);
        if (chance(6)) {
            const btVector3 upright(0, 1, 0);
            body.setAngularFactor(upright);
            body.setAngularVelocity(body.getAngularVelocity() * upright); // nothing could stop the rest: a drive of endless power
        }
        if (chance(4)) {
            body.setCcdMotionThreshold(size / 4);
            body.setCcdSweptSphereRadius(size / 2);
        }
    }

    void removeBody(std::size_t index) {
        btRigidBody* const body = w.bodies[index].get();
        for (std::size_t i = w.constraints.size(); i-- > 0;)
            if (&w.constraints[i]->getRigidBodyA() == body || &w.constraints[i]->getRigidBodyB() == body)
                removeJoint(i);
        w.world->removeRigidBody(body);
        w.bodies.erase(w.bodies.begin() + static_cast<std::ptrdiff_t>(index));
        w.shapes.erase(w.shapes.begin() + static_cast<std::ptrdiff_t>(index));
    }
    void removeJoint(std::size_t index) {
        w.world->removeConstraint(w.constraints[index].get());
        w.constraints.erase(w.constraints.begin() + static_cast<std::ptrdiff_t>(index));
    }

    // Joined where they are: B's frame is A's, as the bodies stand.
    void addJoint() {
        btRigidBody &a = any(), &b = any();
        if (&a == &b)
            return;
        const btTransform middle(btQuaternion(inside(1) + btVector3(0, 2, 0), real(0, 3)),
                                 (a.getWorldTransform().getOrigin() + b.getWorldTransform().getOrigin()) / 2);
        const btTransform inA = a.getWorldTransform().inverse() * middle, inB = b.getWorldTransform().inverse() * middle;
        btVector3 anchor = middle.getOrigin(), axis1 = middle.getBasis().getColumn(2), axis2 = middle.getBasis().getColumn(0);
        const std::size_t type = below(m_made.size());
        ++m_made[type];
        std::unique_ptr<btTypedConstraint> joint;
        switch (type) {
        case 0:
            joint = std::make_unique<btPoint2PointConstraint>(a, b, inA.getOrigin(), inB.getOrigin());
            break;
        case 1: {
            auto hinge = std::make_unique<btHingeConstraint>(a, b, inA, inB);
            hinge->setLimit(btScalar(-0.5), btScalar(0.5));
            hinge->enableAngularMotor(true, 1, 1);
            joint = std::move(hinge);
            break;
        }
        case 2:
            joint = std::make_unique<btHingeAccumulatedAngleConstraint>(a, b, inA, inB);
            break;
        case 3: {
            auto slider = std::make_unique<btSliderConstraint>(a, b, inA, inB, true);
            slider->setLowerLinLimit(btScalar(-0.3)), slider->setUpperLinLimit(btScalar(0.3));
            joint = std::move(slider);
            break;
        }
        case 4: {
            auto cone = std::make_unique<btConeTwistConstraint>(a, b, inA, inB);
            cone->setLimit(btScalar(0.4), btScalar(0.6), btScalar(0.5));
            cone->setMotorTarget(btQuaternion::getIdentity()); // Bullet leaves it unset
            cone->enableMotor(chance(2));
            joint = std::move(cone);
            break;
        }
        case 5:
            joint = std::make_unique<btGeneric6DofConstraint>(a, b, inA, inB, true);
            break;
        case 6: {
            auto spring = std::make_unique<btGeneric6DofSpringConstraint>(a, b, inA, inB, true);
            spring->enableSpring(1, true);
            spring->setStiffness(1, 30);
            joint = std::move(spring);
            break;
        }
        case 7: {
            auto spring = std::make_unique<btGeneric6DofSpring2Constraint>(a, b, inA, inB, static_cast<RotateOrder>(below(6)));
            spring->enableSpring(0, true);
            spring->setStiffness(0, 50);
            spring->setDamping(0, 2);
            joint = std::move(spring);
            break;
        }
        case 8:
            joint = std::make_unique<btUniversalConstraint>(a, b, anchor, axis1, axis2);
            break;
        case 9:
            joint = std::make_unique<btHinge2Constraint>(a, b, anchor, axis1, axis2);
            break;
        case 10:
            joint = std::make_unique<btFixedConstraint>(a, b, inA, inB);
            break;
        case 11:
            joint = std::make_unique<btGearConstraint>(a, b, axis1, axis2, btScalar(2));
            break;
        default:
            joint = std::make_unique<Rod>(a, b);
        }
        if (chance(3))
            joint->setBreakingImpulseThreshold(1);
        joint->setEnabled(!chance(8));
        w.join(std::move(joint));
    }

    void disturb(btRigidBody& body) {
        switch (below(5)) {
        case 0:
            body.activate(true);
            body.applyCentralImpulse(inside(3));
            break;
        case 1:
            body.forceActivationState(ISLAND_SLEEPING);
            break;
        case 2:
            body.forceActivationState(ACTIVE_TAG);
            break;
        case 3:
            body.setCollisionFlags(body.getCollisionFlags() ^ btCollisionObject::CF_NO_CONTACT_RESPONSE);
            break;
        default:
            body.setFlags(chance(2) ? 0 : BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY);
        }
    }

    void hash(const void* data, std::size_t size) { // FNV-1a
        const unsigned char* const bytes = static_cast<const unsigned char*>(data);
        for (std::size_t i = 0; i < size; ++i)
            m_hash = (m_hash ^ bytes[i]) * 1099511628211u;
    }

    btBoxShape m_part{btVector3(btScalar(0.2), btScalar(0.2), btScalar(0.2))};
    TestWorld w; // after the part: it goes first
    std::mt19937 m_random;
    std::size_t m_fixed = 0;
    std::uint64_t m_hash = 14695981039346656037u;
    int m_touched = 0;
    std::vector<int> m_made = std::vector<int>(13, 0);
};

class Stress : public testing::TestWithParam<Landing> {};
INSTANTIATE_TEST_SUITE_P(Landings, Stress, testing::ValuesIn(kLandings));

TEST_P(Stress, BodiesAndJointsComeAndGo) {
    std::uint64_t hashes[2];
    for (std::uint64_t& hash : hashes) {
        Crowd crowd(7, GetParam());
        for (int i = 0; i < 3000; ++i) {
            crowd.step(i);
            if (HasFatalFailure())
                return;
        }
        hash = crowd.hash();
        for (std::size_t type = 0; type < crowd.made().size(); ++type)
            EXPECT_GT(crowd.made()[type], 3) << "joint type " << type << " was hardly tried";
        EXPECT_GT(crowd.touched(), 30000);
    }
    EXPECT_EQ(hashes[0], hashes[1]) << "two runs of the same steps";
}

} // namespace
