// Bullet's constraints: known types become native joints, which turn with the bodies in every substep; all others, and
// springs, servos and clamped picks, go as the rows that getInfo2() gives at the step's start.
#pragma once
#include "bodies.h"

#include <BulletDynamics/ConstraintSolver/btSolverConstraint.h>
#include <LinearMath/btAlignedObjectArray.h>

#include <unordered_map>

struct btContactSolverInfo;

namespace cairn {
namespace bullet {

// A joint of Cairn's without the bodies: frames, axes, limits and motors in Cairn's signs.
struct JointShape {
    btTransform frameA = btTransform::getIdentity();
    btTransform frameB = btTransform::getIdentity();
    uint32_t axes[6] = {0, 0, 0, 0, 0, 0};
    btScalar lower[6] = {0, 0, 0, 0, 0, 0};
    btScalar upper[6] = {0, 0, 0, 0, 0, 0};
    btScalar motorSpeed[6] = {0, 0, 0, 0, 0, 0};
    btScalar motorForce[6] = {0, 0, 0, 0, 0, 0};
    int reportedAxis = -1;
    btScalar reportedSign = btScalar(1);
    bool native = false;  // some of it, or all, is a native joint
    uint32_t rowMask = 0; // bit i: row i of getInfo2() goes as a raw row; set for rows that the joint cannot express
    bool allRows = false; // no native part: every row goes
};

// Reads a constraint whose getInfo1() has just been called. Never fails: what it does not know is allRows.
JointShape readConstraint(btTypedConstraint& constraint, const btContactSolverInfo& info);

class Constraints {
  public:
    explicit Constraints(Tables& tables, Bodies& bodies) : m_tables(tables), m_bodies(bodies) {}

    void beginStep() { ++m_step; }
    void gather(btTypedConstraint& constraint, const btContactSolverInfo& info);
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
    void gatherRows(btTypedConstraint& constraint, int count, uint32_t mask, int bodyA, int bodyB, uint64_t key,
                    const btContactSolverInfo& info);

    Tables& m_tables;
    Bodies& m_bodies;
    btAlignedObjectArray<btSolverConstraint> m_scratch;
    std::unordered_map<const btTypedConstraint*, Known> m_keys;
    uint64_t m_step = 0;
    uint64_t m_nextKey = 1;
    uint32_t m_block = 0;
};

} // namespace bullet
} // namespace cairn
