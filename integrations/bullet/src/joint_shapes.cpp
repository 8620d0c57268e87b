// Signs and frames of Bullet's constraint types, in Cairn's terms: coordinates are of body B relative to body A, along and
// about the axes of A's frame. Bullet's own signs differ from type to type; each reader says how.
#include "joints.h"

#include <BulletDynamics/ConstraintSolver/btConeTwistConstraint.h>
#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofConstraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpring2Constraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpringConstraint.h>
#include <BulletDynamics/ConstraintSolver/btHingeConstraint.h>
#include <BulletDynamics/ConstraintSolver/btPoint2PointConstraint.h>
#include <BulletDynamics/ConstraintSolver/btSliderConstraint.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <utility>

namespace cairn {
namespace bullet {
namespace {

constexpr int kTx = 0, kRx = 3, kRz = 5;

void lock(AxisShape& axis) { axis.flags = CAIRN_AXIS_LOCKED; }

void drive(AxisShape& axis, btScalar speed, btScalar force) {
    axis.flags |= CAIRN_AXIS_DRIVEN;
    axis.motorSpeed = speed;
    axis.motorForce = force;
}

// To target at rate times what is missing, no faster than speed.
void serve(AxisShape& axis, btScalar target, btScalar rate, btScalar speed, btScalar force, btScalar stiffness) {
    drive(axis, btFabs(speed), force);
    axis.flags |= CAIRN_AXIS_SERVO;
    axis.servoTarget = target;
    axis.servoRate = rate;
    axis.servoStiffness = stiffness;
}

void spring(AxisShape& axis, btScalar rest, btScalar stiffness, btScalar damping) {
    axis.hasSpring = true;
    axis.springRest = rest;
    axis.springStiffness = btMax(stiffness, btScalar(0));
    axis.springDamping = btMax(damping, btScalar(0));
}

// Bullet's convention: lower > upper is free, equal is locked at that value. `sign` -1 turns the axis round.
void limit(AxisShape& axis, btScalar lower, btScalar upper, btScalar sign) {
    if (lower > upper)
        return;
    if (lower == upper && lower == btScalar(0)) {
        lock(axis);
        return;
    }
    axis.flags |= CAIRN_AXIS_LIMITED;
    axis.lower = sign > 0 ? lower : -upper;
    axis.upper = sign > 0 ? upper : -lower;
}

// 1 / effective mass of an axis of a's frame, at b's pivot.
btScalar inverseMass(const btTypedConstraint& joint, const JointShape& shape, int axis) {
    const btRigidBody& a = shape.swapped ? joint.getRigidBodyB() : joint.getRigidBodyA();
    const btRigidBody& b = shape.swapped ? joint.getRigidBodyA() : joint.getRigidBodyB();
    const btVector3 d = (a.getWorldTransform().getBasis() * shape.frameA.getBasis()).getColumn(axis % 3);
    const auto ofBody = [&](const btRigidBody& body) {
        const btVector3 arm = b.getWorldTransform() * shape.frameB.getOrigin() - body.getWorldTransform().getOrigin();
        const btVector3 turn = axis < kRx ? arm.cross(d) : d;
        return (axis < kRx ? body.getInvMass() : btScalar(0)) + turn.dot(body.getInvInertiaTensorWorld() * turn);
    };
    return ofBody(a) + ofBody(b);
}

// A locked axis with a cfm of its own. Stock's row, J v + cfm K lambda = -erp C / dt, is the implicit spring and damper
// k = erp / (dt^2 cfm K), c = (1 - erp) / (dt cfm K), K = J M^-1 J^T.
void soften(const btTypedConstraint& joint, JointShape& shape, int axis, btScalar erp, btScalar cfm, btScalar dt) {
    if (!(cfm > btScalar(0)) || !shape.axes[axis].held())
        return;
    const btScalar compliance = cfm * inverseMass(joint, shape, axis) * dt;
    if (!(compliance > btScalar(0)))
        return;
    erp = btMin(btMax(erp, btScalar(0)), btScalar(1));
    const btScalar rest = shape.axes[axis].locked() ? btScalar(0) : shape.axes[axis].lower;
    shape.axes[axis].flags = CAIRN_AXIS_FREE;
    spring(shape.axes[axis], rest, erp / (dt * compliance), (btScalar(1) - erp) / compliance);
}

// Bounded rows are along the world's axes. A pick may pull from far: its force is to act where the body is held, which is where
// Cairn's b is.
void readPoint(btPoint2PointConstraint& joint, const btContactSolverInfo& info, JointShape& shape) {
    shape.native = true;
    const bool pick = joint.m_setting.m_impulseClamp > btScalar(0);
    if (pick)
        shape.maxForce = btMin(shape.maxForce, joint.m_setting.m_impulseClamp / info.m_timeStep);
    shape.swapped = pick && joint.getRigidBodyB().isStaticOrKinematicObject();
    shape.frameA.setOrigin(shape.swapped ? joint.getPivotInB() : joint.getPivotInA());
    shape.frameB.setOrigin(shape.swapped ? joint.getPivotInA() : joint.getPivotInB());
    if (shape.maxForce < kInfinity) {
        const btRigidBody& a = shape.swapped ? joint.getRigidBodyB() : joint.getRigidBodyA();
        shape.frameA.setBasis(a.getWorldTransform().getBasis().transpose());
    }
    for (int axis = kTx; axis < kRx; ++axis) {
        lock(shape.axes[axis]);
        if (joint.getFlags() & BT_P2P_FLAGS_CFM)
            soften(joint, shape, axis, joint.getFlags() & BT_P2P_FLAGS_ERP ? joint.getParam(BT_CONSTRAINT_ERP) : info.m_erp,
                   joint.getParam(BT_CONSTRAINT_CFM), info.m_timeStep);
    }
}

// Would Bullet's limit push a hinge that stands at this angle (ours)?
bool limitedAt(btHingeConstraint& joint, btScalar angle) {
    joint.testLimit(joint.getAFrame().inverse(), btTransform(btQuaternion(btVector3(0, 0, 1), angle)) * joint.getBFrame().inverse());
    const bool limited = joint.getSolveLimit() != 0;
    joint.testLimit(joint.getRigidBodyA().getCenterOfMassTransform(), joint.getRigidBodyB().getCenterOfMassTransform());
    return limited;
}

// Bullet's angle and motor speed are ours with useReferenceFrameA, else turned round. Its motor is bounded by an impulse
// per step. It gives a range only as two angles in -pi ... pi: a range may lie across pi, which Cairn's coordinate does
// not pass (then A's frame is turned so that the range is centred on 0), or be so wide that nothing is limited, which
// only asking about the angle opposite its centre tells.
void readHinge(btHingeConstraint& joint, btScalar dt, JointShape& shape) {
    shape.native = true;
    shape.frameA = joint.getAFrame();
    shape.frameB = joint.getBFrame();
    if (!joint.getAngularOnly())
        for (int axis = kTx; axis < kRx; ++axis)
            lock(shape.axes[axis]);
    lock(shape.axes[kRx]);
    lock(shape.axes[kRx + 1]);
    const btScalar sign = joint.getUseReferenceFrameA() ? btScalar(1) : btScalar(-1);
    btScalar lower = joint.getLowerLimit(), upper = joint.getUpperLimit();
    if (joint.hasLimit() || lower == upper) {
        const bool across = lower > upper;
        const btScalar half = (across ? upper + SIMD_2_PI - lower : upper - lower) / 2;
        const btScalar centre = (lower + half) * sign;
        if (limitedAt(joint, centre + SIMD_PI)) {
            if (across) {
                shape.frameA.setBasis(shape.frameA.getBasis() * btMatrix3x3(btQuaternion(btVector3(0, 0, 1), centre)));
                lower = -half;
                upper = half;
            }
            limit(shape.axes[kRz], lower, upper, sign);
        }
    }
    if (joint.getEnableAngularMotor() && !shape.axes[kRz].held())
        drive(shape.axes[kRz], sign * joint.getMotorTargetVelocity(), joint.getMaxMotorImpulse() / dt);
    if (shape.axes[kRz].flags) {
        shape.reportedAxis = kRz;
        shape.reportedSign = btScalar(-1); // Bullet's row pushes A
    }
}

// The linear coordinate and motor are ours with useLinearReferenceFrameA, else turned round; angle as ours; the angular
// motor turned round.
void readSlider(btSliderConstraint& joint, JointShape& shape) {
    shape.native = true;
    shape.frameA = joint.getFrameOffsetA();
    shape.frameB = joint.getFrameOffsetB();
    for (int axis = 0; axis < 6; ++axis)
        if (axis != kTx && axis != kRx)
            lock(shape.axes[axis]);
    const btScalar sign = joint.getUseLinearReferenceFrameA() ? btScalar(1) : btScalar(-1);
    limit(shape.axes[kTx], joint.getLowerLinLimit(), joint.getUpperLinLimit(), sign);
    limit(shape.axes[kRx], joint.getLowerAngLimit(), joint.getUpperAngLimit(), btScalar(1));
    if (joint.getPoweredLinMotor() && !shape.axes[kTx].held())
        drive(shape.axes[kTx], sign * joint.getTargetLinMotorVelocity(), joint.getMaxLinMotorForce());
    if (joint.getPoweredAngMotor() && !shape.axes[kRx].held())
        drive(shape.axes[kRx], -joint.getTargetAngMotorVelocity(), joint.getMaxAngMotorForce());
    if (shape.axes[kRx].flags & (CAIRN_AXIS_LIMITED | CAIRN_AXIS_DRIVEN))
        shape.reportedAxis = kRx;
    else if (shape.axes[kTx].flags)
        shape.reportedAxis = kTx;
    shape.reportedSign = btScalar(-1);
}

// Coordinates, as Bullet splits them, are of A's frame in B's: A's x axis swings in an ellipse about B's, after which A twists
// about it. So Bullet's B is Cairn's a. A span below the threshold holds its axis: a universal joint or a hinge in A's frame.
void readConeTwist(btConeTwistConstraint& joint, btScalar dt, JointShape& shape) {
    shape.native = true;
    const bool holdsY = joint.getSwingSpan2() < joint.getFixThresh(), holdsZ = joint.getSwingSpan1() < joint.getFixThresh();
    shape.swapped = joint.isMotorEnabled() || !(holdsY || holdsZ);
    shape.frameA = shape.swapped ? joint.getBFrame() : joint.getAFrame();
    shape.frameB = shape.swapped ? joint.getAFrame() : joint.getBFrame();
    if (!joint.getAngularOnly())
        for (int axis = kTx; axis < kRx; ++axis)
            lock(shape.axes[axis]);
    if (joint.isMotorEnabled()) { // towards an orientation of A in B, without limits
        shape.rotation = CAIRN_ROTATION_VECTOR;
        shape.frameA.setBasis(shape.frameA.getBasis() * btMatrix3x3(joint.getMotorTarget()));
        const btScalar impulse = joint.getMaxMotorImpulse();
        for (int axis = kRx; axis <= kRz; ++axis)
            serve(shape.axes[axis], 0, joint.getBiasFactor() / dt, kInfinity, impulse < btScalar(0) ? kInfinity : impulse / dt, kInfinity);
        return;
    }
    const btScalar soft = joint.getLimitSoftness(); // limits act from this share of theirs on
    const btScalar twist = joint.getTwistSpan() * soft, y = joint.getSwingSpan2() * soft, z = joint.getSwingSpan1() * soft;
    if (twist < SIMD_PI)
        limit(shape.axes[kRx], -twist, twist, btScalar(1));
    if (!holdsY && !holdsZ) {
        shape.rotation = CAIRN_ROTATION_CONE;
        if (y < SIMD_PI || z < SIMD_PI) {
            shape.axes[kRx + 1].flags = shape.axes[kRz].flags = CAIRN_AXIS_LIMITED;
            shape.axes[kRx + 1].upper = y;
            shape.axes[kRz].upper = z;
        }
        return;
    }
    if (holdsY)
        lock(shape.axes[kRx + 1]);
    else if (y < SIMD_PI)
        limit(shape.axes[kRx + 1], -y, y, btScalar(1));
    if (holdsZ)
        lock(shape.axes[kRz]);
    else if (z < SIMD_PI)
        limit(shape.axes[kRz], -z, z, btScalar(1));
}

// Both 6-dof types: linear coordinates as ours, linear motors turned round, angles (and their motors) turned round.
void readLinear(JointShape& shape, int axis, btScalar lower, btScalar upper, bool motor, btScalar speed, btScalar force) {
    limit(shape.axes[axis], lower, upper, btScalar(1));
    if (motor && !shape.axes[axis].held())
        drive(shape.axes[axis], -speed, force);
}

void readAngular(JointShape& shape, int axis, btScalar lower, btScalar upper, bool motor, btScalar speed, btScalar force) {
    limit(shape.axes[kRx + axis], lower, upper, btScalar(-1));
    if (motor && !shape.axes[kRx + axis].held())
        drive(shape.axes[kRx + axis], -speed, force);
}

// The springs of btGeneric6DofSpringConstraint are motors: force at most stiffness times error, speed at most damping / (dt
// iterations) times that force. Both of the whole step, as stock has them, whatever Cairn's substeps.
void readSixDof(btGeneric6DofConstraint& joint, const btContactSolverInfo& info, JointShape& shape) {
    btGeneric6DofSpringConstraint* springs =
        joint.getConstraintType() == D6_SPRING_CONSTRAINT_TYPE ? static_cast<btGeneric6DofSpringConstraint*>(&joint) : nullptr;
    shape.native = true;
    shape.frameA = joint.getFrameOffsetA();
    shape.frameB = joint.getFrameOffsetB();
    const btScalar dt = info.m_timeStep, perForce = btScalar(1) / (dt * static_cast<btScalar>(btMax(info.m_numIterations, 1)));
    const auto sprung = [&](int axis) { return springs && springs->isSpringEnabled(axis); };
    const auto addSpring = [&](int axis, btScalar sign) {
        const btScalar stiffness = btFabs(springs->getStiffness(axis));
        if (!shape.axes[axis].held())
            serve(shape.axes[axis], sign * springs->getEquilibriumPoint(axis), perForce * springs->getDamping(axis) * stiffness, kInfinity,
                  kInfinity, stiffness);
    };
    // bits of an axis in getFlags(): own cfm and erp of its limit
    const auto own = [&](int axis, int bit) { return (joint.getFlags() & (bit << (axis * BT_6DOF_FLAGS_AXIS_SHIFT))) != 0; };
    const auto addSoftness = [&](int axis, btScalar erp, btScalar cfm) {
        if (own(axis, BT_6DOF_FLAGS_CFM_STOP))
            soften(joint, shape, axis, own(axis, BT_6DOF_FLAGS_ERP_STOP) ? erp : info.m_erp, cfm, dt);
    };
    btTranslationalLimitMotor& linear = *joint.getTranslationalLimitMotor();
    for (int i = 0; i < 3; ++i) {
        readLinear(shape, i, linear.m_lowerLimit[i], linear.m_upperLimit[i], linear.m_enableMotor[i] && !sprung(i),
                   linear.m_targetVelocity[i], linear.m_maxMotorForce[i]);
        if (sprung(i))
            addSpring(i, btScalar(1));
        addSoftness(i, linear.m_stopERP[i], linear.m_stopCFM[i]);
        btRotationalLimitMotor& angular = *joint.getRotationalLimitMotor(i);
        readAngular(shape, i, angular.m_loLimit, angular.m_hiLimit, angular.m_enableMotor && !sprung(kRx + i), angular.m_targetVelocity,
                    angular.m_maxMotorForce);
        if (sprung(kRx + i))
            addSpring(kRx + i, btScalar(-1));
        addSoftness(kRx + i, angular.m_stopERP, angular.m_stopCFM);
    }
}

// Cairn's Cardan angles are about x, y and z in this order; another order is that of a frame whose axes are these. Its z is turned
// round where the frame would be left-handed: so are the coordinates of that axis.
void reorder(JointShape& shape, const int (&order)[3]) {
    const bool mirrored = order[1] != (order[0] + 1) % 3;
    const JointShape old = shape;
    btMatrix3x3 axes;
    for (int row = 0; row < 3; ++row)
        axes[row].setValue(row == order[0] ? 1 : 0, row == order[1] ? 1 : 0, row == order[2] ? (mirrored ? -1 : 1) : 0);
    shape.frameA.setBasis(old.frameA.getBasis() * axes);
    shape.frameB.setBasis(old.frameB.getBasis() * axes);
    for (int axis = 0; axis < 6; ++axis) {
        AxisShape& to = shape.axes[axis];
        to = old.axes[axis < kRx ? order[axis] : kRx + order[axis - kRx]];
        if (!mirrored || axis % 3 != 2)
            continue;
        std::swap(to.lower, to.upper);
        to.lower = -to.lower;
        to.upper = -to.upper;
        if (!to.served()) // a servo's is a bound
            to.motorSpeed = -to.motorSpeed;
        to.servoTarget = -to.servoTarget;
        to.springRest = -to.springRest;
    }
}

void readSixDof2(btGeneric6DofSpring2Constraint& joint, btScalar dt, JointShape& shape) {
    btTranslationalLimitMotor2& linear = *joint.getTranslationalLimitMotor();
    shape.native = true;
    shape.frameA = joint.getFrameOffsetA();
    shape.frameB = joint.getFrameOffsetB();
    for (int i = 0; i < 3; ++i) {
        readLinear(shape, i, linear.m_lowerLimit[i], linear.m_upperLimit[i], linear.m_enableMotor[i] && !linear.m_servoMotor[i],
                   linear.m_targetVelocity[i], linear.m_maxMotorForce[i]);
        if (linear.m_enableMotor[i] && linear.m_servoMotor[i] && !shape.axes[i].held())
            serve(shape.axes[i], linear.m_servoTarget[i], linear.m_motorERP[i] / dt, linear.m_targetVelocity[i], linear.m_maxMotorForce[i],
                  kInfinity);
        if (linear.m_enableSpring[i] && !shape.axes[i].held())
            spring(shape.axes[i], linear.m_equilibriumPoint[i], linear.m_springStiffness[i], linear.m_springDamping[i]);
        soften(joint, shape, i, linear.m_stopERP[i], linear.m_stopCFM[i], dt);

        const btRotationalLimitMotor2& angular = *joint.getRotationalLimitMotor(i);
        const int axis = kRx + i;
        readAngular(shape, i, angular.m_loLimit, angular.m_hiLimit, angular.m_enableMotor && !angular.m_servoMotor,
                    angular.m_targetVelocity, angular.m_maxMotorForce);
        if (angular.m_enableMotor && angular.m_servoMotor && !shape.axes[axis].held())
            serve(shape.axes[axis], -angular.m_servoTarget, angular.m_motorERP / dt, angular.m_targetVelocity, angular.m_maxMotorForce,
                  kInfinity);
        if (angular.m_enableSpring && !shape.axes[axis].held())
            spring(shape.axes[axis], -angular.m_equilibriumPoint, angular.m_springStiffness, angular.m_springDamping);
        soften(joint, shape, axis, angular.m_stopERP, angular.m_stopCFM, dt);
    }
    int unlocked = 0;
    for (int axis = kRx; axis <= kRz; ++axis)
        unlocked += shape.axes[axis].locked() ? 0 : 1;
    static const int orders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    if (joint.getRotationOrder() != RO_XYZ && unlocked > 1)
        reorder(shape, orders[joint.getRotationOrder()]);
}

} // namespace

JointShape readConstraint(btTypedConstraint& constraint, const btContactSolverInfo& info) {
    JointShape shape;
    if (constraint.getBreakingImpulseThreshold() < SIMD_INFINITY)
        shape.maxForce = btMax(constraint.getBreakingImpulseThreshold(), btScalar(0)) / info.m_timeStep;
    switch (constraint.getConstraintType()) {
    case POINT2POINT_CONSTRAINT_TYPE:
        readPoint(static_cast<btPoint2PointConstraint&>(constraint), info, shape);
        break;
    case HINGE_CONSTRAINT_TYPE:
        readHinge(static_cast<btHingeConstraint&>(constraint), info.m_timeStep, shape);
        break;
    case SLIDER_CONSTRAINT_TYPE:
        readSlider(static_cast<btSliderConstraint&>(constraint), shape);
        break;
    case D6_CONSTRAINT_TYPE:
    case D6_SPRING_CONSTRAINT_TYPE:
        readSixDof(static_cast<btGeneric6DofConstraint&>(constraint), info, shape);
        break;
    case D6_SPRING_2_CONSTRAINT_TYPE: // btFixedConstraint and btHinge2Constraint too
        readSixDof2(static_cast<btGeneric6DofSpring2Constraint&>(constraint), info.m_timeStep, shape);
        break;
    case CONETWIST_CONSTRAINT_TYPE:
        readConeTwist(static_cast<btConeTwistConstraint&>(constraint), info.m_timeStep, shape);
        break;
    default: // a gear, a btContactConstraint, the user's own
        break;
    }
    return shape;
}

} // namespace bullet
} // namespace cairn
