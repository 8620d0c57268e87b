// Bullet's constraints: known types become native joints, which turn with the bodies in every substep; all others go as the
// rows that getInfo2() gives at the step's start.
#pragma once
#include "bodies.h"

#include <BulletDynamics/ConstraintSolver/btSolverConstraint.h>
#include <LinearMath/btAlignedObjectArray.h>

#include <limits>
#include <unordered_map>

struct btContactSolverInfo;

namespace cairn {
namespace bullet {

constexpr btScalar kInfinity = std::numeric_limits<btScalar>::infinity();

// One of a joint's six axes: its limits, its motor or servo and, perhaps besides, its spring.
struct AxisShape {
    uint32_t flags = CAIRN_AXIS_FREE;
    btScalar lower = 0, upper = 0;
    btScalar motorSpeed = 0, motorForce = 0;
    btScalar servoTarget = 0, servoStiffness = 0, servoRate = 0;
    bool hasSpring = false;
    btScalar springRest = 0, springStiffness = 0, springDamping = 0;

    bool locked() const { return flags == CAIRN_AXIS_LOCKED; }
    // Equal limits leave a motor nothing to do, in Bullet too.
    bool held() const { return locked() || ((flags & CAIRN_AXIS_LIMITED) && !(lower < upper)); }
    bool driven() const { return (flags & CAIRN_AXIS_DRIVEN) != 0; }
    bool served() const { return (flags & CAIRN_AXIS_SERVO) != 0; }
};

// A joint of Cairn's without the bodies: frames, axes, limits, motors and springs in Cairn's signs.
struct JointShape {
    bool native = false;  // else rows
    bool swapped = false; // Cairn's a is Bullet's B
    btTransform frameA = btTransform::getIdentity();
    btTransform frameB = btTransform::getIdentity();
    AxisShape axes[6];
    uint32_t rotation = CAIRN_ROTATION_BY_AXES;
    btScalar maxForce = kInfinity;
    int reportedAxis = -1;
    btScalar reportedSign = btScalar(1);
};

// Never fails: a constraint that it does not know is not native.
JointShape readConstraint(btTypedConstraint& constraint, const btContactSolverInfo& info);

class Constraints {
  public:
    explicit Constraints(Tables& tables, Bodies& bodies) : m_tables(tables), m_bodies(bodies) {}

    void beginStep() {
        ++m_step;
        m_wantedIterations = 0;
    }
    void gather(btTypedConstraint& constraint, const btContactSolverInfo& info);
    // The most that a constraint of this step asks for, 0: none does.
    uint32_t wantedIterations() const { return m_wantedIterations; }
    // Applied impulses, joint feedback, breaking.
    void scatter(btScalar dt);
    // Forgets constraints that have not been seen for a while.
    void endStep();
    void clear() { m_keys.clear(); }

  private:
    struct Known {
        const void* bodyA;
        const void* bodyB;
        uint64_t key;
        uint64_t step;
    };
    // Eight bits are left free for the number of a row; unique among joints and rows.
    uint64_t keyOf(btTypedConstraint& constraint);
    void gatherRows(btTypedConstraint& constraint, int count, int bodyA, int bodyB, uint64_t key, const btContactSolverInfo& info);
    // A joint of the shape: its motors, and the springs of axes without one; or the springs beside motors.
    void addJoint(const JointShape& shape, bool beside, int bodyA, int bodyB, uint64_t key);

    Tables& m_tables;
    Bodies& m_bodies;
    btAlignedObjectArray<btSolverConstraint> m_scratch;
    std::unordered_map<const btTypedConstraint*, Known> m_keys;
    uint64_t m_step = 0;
    uint64_t m_nextKey = 1;
    uint32_t m_block = 0;
    uint32_t m_wantedIterations = 0;
};

} // namespace bullet
} // namespace cairn
