#include "joints.h"

#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/ConstraintSolver/btTypedConstraint.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

namespace cairn {
namespace bullet {
namespace {

// Bullet writes "no bound" as its largest number.
btScalar bound(btScalar value) {
    if (value >= SIMD_INFINITY)
        return kInfinity;
    return value <= -SIMD_INFINITY ? -kInfinity : value;
}

btQuaternion rotation(const btTransform& frame) {
    btQuaternion q;
    frame.getBasis().getRotation(q);
    return q.normalized(); // frames may come from axes that are only nearly unit
}

} // namespace

uint64_t Constraints::keyOf(btTypedConstraint& constraint) {
    Known& known = m_keys[&constraint];
    const void* bodyA = &constraint.getRigidBodyA();
    const void* bodyB = &constraint.getRigidBodyB();
    // A new constraint at the address of a deleted one gets a new key.
    if (known.key == 0 || known.bodyA != bodyA || known.bodyB != bodyB)
        known = Known{bodyA, bodyB, m_nextKey++, 0};
    known.step = m_step;
    return known.key << 16;
}

void Constraints::gather(btTypedConstraint& constraint, const btContactSolverInfo& info) {
    constraint.buildJacobian();
    constraint.internalSetAppliedImpulse(btScalar(0));
    if (btJointFeedback* feedback = constraint.getJointFeedback()) {
        feedback->m_appliedForceBodyA.setZero();
        feedback->m_appliedForceBodyB.setZero();
        feedback->m_appliedTorqueBodyA.setZero();
        feedback->m_appliedTorqueBodyB.setZero();
    }
    if (!constraint.isEnabled())
        return;
    // Also for native joints: it renews the angles and positions that the constraint's users read.
    btTypedConstraint::btConstraintInfo1 size = {0, 0}; // btContactConstraint leaves it
    constraint.getInfo1(&size);

    const int bodyA = m_bodies.indexOf(constraint.getRigidBodyA());
    const int bodyB = m_bodies.indexOf(constraint.getRigidBodyB());
    if (bodyA == bodyB || (!m_bodies.canMove(bodyA) && !m_bodies.canMove(bodyB)))
        return;
    if (constraint.getOverrideNumSolverIterations() > 0)
        m_wantedIterations = btMax(m_wantedIterations, static_cast<uint32_t>(constraint.getOverrideNumSolverIterations()));
    const JointShape shape = readConstraint(constraint, info);
    const uint64_t key = keyOf(constraint);
    ConstraintSlot slot = {&constraint,        m_tables.joints.size(), 0, shape.swapped, shape.reportedAxis,
                           shape.reportedSign, m_tables.rows.size(),   0};
    if (shape.native) {
        bool beside = false;
        for (const AxisShape& axis : shape.axes)
            beside = beside || (axis.hasSpring && axis.driven());
        addJoint(shape, false, bodyA, bodyB, key);
        if (beside)
            addJoint(shape, true, bodyA, bodyB, key | 1);
    } else if (size.m_numConstraintRows > 0) {
        gatherRows(constraint, size.m_numConstraintRows, bodyA, bodyB, key, info);
    }
    slot.jointCount = m_tables.joints.size() - slot.firstJoint;
    slot.rowCount = m_tables.rows.size() - slot.firstRow;
    m_tables.constraints.push_back(slot);
}

void Constraints::addJoint(const JointShape& shape, bool beside, int bodyA, int bodyB, uint64_t key) {
    m_tables.joints.emplace_back();
    JointRecord& record = m_tables.joints.back();
    record.key = key;
    record.bodyA = shape.swapped ? bodyB : bodyA;
    record.bodyB = shape.swapped ? bodyA : bodyB;
    store(record.anchorA, shape.frameA.getOrigin());
    store(record.anchorB, shape.frameB.getOrigin());
    store(record.frameA, rotation(shape.frameA));
    store(record.frameB, rotation(shape.frameB));
    record.rotation = shape.rotation;
    record.maxForce = shape.maxForce;
    m_tables.drives = m_tables.drives || shape.rotation != CAIRN_ROTATION_BY_AXES;
    m_tables.bounded = m_tables.bounded || shape.maxForce < kInfinity;
    for (int i = 0; i < 6; ++i) {
        const AxisShape& axis = shape.axes[i];
        record.axes[i] = beside ? CAIRN_AXIS_FREE : axis.flags;
        record.lower[i] = bound(axis.lower);
        record.upper[i] = bound(axis.upper);
        record.motorSpeed[i] = axis.served() ? bound(axis.motorSpeed) : axis.motorSpeed;
        record.motorForce[i] = bound(btFabs(axis.motorForce));
        record.target[i] = axis.servoTarget;
        record.stiffness[i] = axis.servoStiffness;
        record.rate[i] = axis.servoRate;
        record.damping[i] = 0;
        if (axis.hasSpring && axis.driven() == beside) {
            record.axes[i] |= CAIRN_AXIS_SPRING;
            record.target[i] = axis.springRest;
            record.stiffness[i] = axis.springStiffness;
            record.damping[i] = axis.springDamping;
        }
        m_tables.drives = m_tables.drives || (record.axes[i] & (CAIRN_AXIS_SPRING | CAIRN_AXIS_SERVO)) != 0;
    }
}

// Rows as btSequentialImpulseConstraintSolver::convertJoint asks for them.
void Constraints::gatherRows(btTypedConstraint& constraint, int count, int bodyA, int bodyB, uint64_t key,
                             const btContactSolverInfo& info) {
    m_scratch.resizeNoInitialize(count);
    for (int i = 0; i < count; ++i) {
        btSolverConstraint& row = m_scratch[i];
        row.m_contactNormal1.setZero();
        row.m_relpos1CrossNormal.setZero();
        row.m_contactNormal2.setZero();
        row.m_relpos2CrossNormal.setZero();
        row.m_rhs = 0;
        row.m_cfm = 0;
        row.m_lowerLimit = -SIMD_INFINITY;
        row.m_upperLimit = SIMD_INFINITY;
    }
    btSolverConstraint& first = m_scratch[0];
    first.m_cfm = info.m_globalCfm;
    btTypedConstraint::btConstraintInfo2 request;
    request.fps = btScalar(1) / info.m_timeStep;
    request.erp = info.m_erp;
    request.m_J1linearAxis = first.m_contactNormal1;
    request.m_J1angularAxis = first.m_relpos1CrossNormal;
    request.m_J2linearAxis = first.m_contactNormal2;
    request.m_J2angularAxis = first.m_relpos2CrossNormal;
    request.rowskip = static_cast<int>(sizeof(btSolverConstraint) / sizeof(btScalar));
    request.m_constraintError = &first.m_rhs;
    request.cfm = &first.m_cfm;
    request.m_lowerLimit = &first.m_lowerLimit;
    request.m_upperLimit = &first.m_upperLimit;
    request.m_numIterations = info.m_numIterations;
    request.m_damping = info.m_damping;
    constraint.getInfo2(&request);

    const btRigidBody& rbA = constraint.getRigidBodyA();
    const btRigidBody& rbB = constraint.getRigidBodyB();
    const btScalar breaking = constraint.getBreakingImpulseThreshold();
    for (int i = 0; i < count; ++i) {
        const btSolverConstraint& row = m_scratch[i];
        if (i % 6 == 0)
            ++m_block;
        m_tables.rows.emplace_back();
        RowRecord& record = m_tables.rows.back();
        // Rows come and go with limits, so a row is the same one only while their number is the same.
        record.key = key | (static_cast<uint64_t>(count) << 8) | static_cast<uint64_t>(i + 1);
        record.bodyA = bodyA;
        record.bodyB = bodyB;
        record.block = m_block;
        for (int k = 0; k < 3; ++k) {
            record.jacobianA[k] = row.m_contactNormal1[k];
            record.jacobianA[3 + k] = row.m_relpos1CrossNormal[k];
            record.jacobianB[k] = row.m_contactNormal2[k];
            record.jacobianB[3 + k] = row.m_relpos2CrossNormal[k];
        }
        // Springs may ask for an infinite speed and leave it to the bounds.
        const btScalar fastest = btScalar(1e6);
        record.rhs = row.m_rhs > fastest ? fastest : (row.m_rhs < -fastest ? -fastest : row.m_rhs);
        record.lower = bound(row.m_lowerLimit > -breaking ? row.m_lowerLimit : -breaking);
        record.upper = bound(row.m_upperLimit < breaking ? row.m_upperLimit : breaking);
        if (row.m_cfm > btScalar(0)) {
            // Stock's fixed point is (rhs - J v) / K = cfm lambda with K = J M^-1 J^T, so the compliance is cfm K.
            const btScalar k = rbA.getInvMass() * row.m_contactNormal1.length2() + rbB.getInvMass() * row.m_contactNormal2.length2() +
                               (rbA.getInvInertiaTensorWorld() * row.m_relpos1CrossNormal).dot(row.m_relpos1CrossNormal) +
                               (rbB.getInvInertiaTensorWorld() * row.m_relpos2CrossNormal).dot(row.m_relpos2CrossNormal);
            record.compliance = row.m_cfm * k;
        }
    }
}

void Constraints::scatter(btScalar dt) {
    for (const ConstraintSlot& slot : m_tables.constraints) {
        btTypedConstraint& constraint = *slot.constraint;
        const btTransform& poseA = constraint.getRigidBodyA().getWorldTransform();
        const btTransform& poseB = constraint.getRigidBodyB().getWorldTransform();
        btJointFeedback* feedback = constraint.getJointFeedback();
        btScalar applied = 0, largest = 0;
        for (std::size_t i = slot.firstJoint; i < slot.firstJoint + slot.jointCount; ++i) {
            const JointRecord& record = m_tables.joints[i];
            const btVector3 linear = vector(record.linear);
            if (i == slot.firstJoint)
                applied = slot.reportedAxis >= 0 ? slot.reportedSign * record.impulse[slot.reportedAxis] : linear.length();
            for (const btScalar component : record.impulse)
                largest = btMax(largest, btFabs(component));
            if (feedback) {
                const btScalar sign = slot.swapped ? btScalar(-1) : btScalar(1); // of what B gets
                const btVector3 force = linear * (sign / dt), torque = vector(record.angular) * (sign / dt);
                const btVector3 point = (slot.swapped ? poseA : poseB) * vector(record.anchorB); // where Cairn applies it
                feedback->m_appliedForceBodyA -= force;
                feedback->m_appliedForceBodyB += force;
                feedback->m_appliedTorqueBodyA -= torque + (point - poseA.getOrigin()).cross(force);
                feedback->m_appliedTorqueBodyB += torque + (point - poseB.getOrigin()).cross(force);
            }
        }
        for (std::size_t i = slot.firstRow; i < slot.firstRow + slot.rowCount; ++i) {
            const RowRecord& record = m_tables.rows[i];
            applied = record.impulse; // of the last row, as stock's
            largest = btMax(largest, btFabs(record.impulse));
            if (feedback) {
                const btScalar rate = record.impulse / dt;
                const btScalar* a = record.jacobianA;
                const btScalar* b = record.jacobianB;
                feedback->m_appliedForceBodyA += btVector3(a[0], a[1], a[2]) * rate;
                feedback->m_appliedTorqueBodyA += btVector3(a[3], a[4], a[5]) * rate;
                feedback->m_appliedForceBodyB += btVector3(b[0], b[1], b[2]) * rate;
                feedback->m_appliedTorqueBodyB += btVector3(b[3], b[4], b[5]) * rate;
            }
        }
        constraint.internalSetAppliedImpulse(applied);
        // Clipped substep by substep, its sum is the threshold but for rounding.
        if (largest >= constraint.getBreakingImpulseThreshold() * btScalar(0.9999))
            constraint.setEnabled(false);
    }
}

void Constraints::endStep() {
    m_block = 0;
    if (m_keys.size() <= 2 * m_tables.constraints.size() + 64)
        return;
    for (auto entry = m_keys.begin(); entry != m_keys.end();) {
        if (entry->second.step != m_step)
            entry = m_keys.erase(entry);
        else
            ++entry;
    }
}

} // namespace bullet
} // namespace cairn
