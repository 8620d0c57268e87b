// Signs and frames of Bullet's constraint types, in Cairn's terms: coordinates are of body B relative to body A, along and
// about the axes of A's frame. Bullet's own signs differ from type to type; each reader says how.
#include "joints.h"

#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofConstraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpring2Constraint.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpringConstraint.h>
#include <BulletDynamics/ConstraintSolver/btHingeConstraint.h>
#include <BulletDynamics/ConstraintSolver/btPoint2PointConstraint.h>
#include <BulletDynamics/ConstraintSolver/btSliderConstraint.h>

namespace cairn {
namespace bullet {
namespace {

constexpr int kTx = 0, kRx = 3, kRz = 5;

void lock(JointShape& shape, int axis) { shape.axes[axis] = CAIRN_AXIS_LOCKED; }

void drive(JointShape& shape, int axis, btScalar speed, btScalar force) {
    shape.axes[axis] |= CAIRN_AXIS_DRIVEN;
    shape.motorSpeed[axis] = speed;
    shape.motorForce[axis] = force;
}

// Bullet's convention: lower > upper is free, equal is locked at that value. `sign` -1 turns the axis round.
void limit(JointShape& shape, int axis, btScalar lower, btScalar upper, btScalar sign) {
    if (lower > upper)
        return;
    if (lower == upper && lower == btScalar(0)) {
        lock(shape, axis);
        return;
    }
    shape.axes[axis] |= CAIRN_AXIS_LIMITED;
    shape.lower[axis] = sign > 0 ? lower : -upper;
    shape.upper[axis] = sign > 0 ? upper : -lower;
}

bool locked(const JointShape& shape, int axis) { return shape.axes[axis] == CAIRN_AXIS_LOCKED; }

// Equal limits leave a motor nothing to do, in Bullet too.
bool held(const JointShape& shape, int axis) {
    return locked(shape, axis) || ((shape.axes[axis] & CAIRN_AXIS_LIMITED) && !(shape.lower[axis] < shape.upper[axis]));
}

void readPoint(btPoint2PointConstraint& joint, JointShape& shape) {
    if (joint.m_setting.m_impulseClamp > btScalar(0)) { // a pick: its rows are bounded
        shape.allRows = true;
        return;
    }
    shape.native = true;
    shape.frameA.setOrigin(joint.getPivotInA());
    shape.frameB.setOrigin(joint.getPivotInB());
    for (int axis = kTx; axis < kRx; ++axis)
        lock(shape, axis);
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
            lock(shape, axis);
    lock(shape, kRx);
    lock(shape, kRx + 1);
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
            limit(shape, kRz, lower, upper, sign);
        }
    }
    if (joint.getEnableAngularMotor() && !held(shape, kRz))
        drive(shape, kRz, sign * joint.getMotorTargetVelocity(), joint.getMaxMotorImpulse() / dt);
    if (shape.axes[kRz]) {
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
            lock(shape, axis);
    const btScalar sign = joint.getUseLinearReferenceFrameA() ? btScalar(1) : btScalar(-1);
    limit(shape, kTx, joint.getLowerLinLimit(), joint.getUpperLinLimit(), sign);
    limit(shape, kRx, joint.getLowerAngLimit(), joint.getUpperAngLimit(), btScalar(1));
    if (joint.getPoweredLinMotor() && !held(shape, kTx))
        drive(shape, kTx, sign * joint.getTargetLinMotorVelocity(), joint.getMaxLinMotorForce());
    if (joint.getPoweredAngMotor() && !held(shape, kRx))
        drive(shape, kRx, -joint.getTargetAngMotorVelocity(), joint.getMaxAngMotorForce());
    if (shape.axes[kRx] & (CAIRN_AXIS_LIMITED | CAIRN_AXIS_DRIVEN))
        shape.reportedAxis = kRx;
    else if (shape.axes[kTx])
        shape.reportedAxis = kTx;
    shape.reportedSign = btScalar(-1);
}

// Both 6-dof types: linear coordinates as ours, linear motors turned round, angles (and their motors) turned round.
void readLinear(JointShape& shape, int axis, btScalar lower, btScalar upper, bool motor, btScalar speed, btScalar force) {
    limit(shape, axis, lower, upper, btScalar(1));
    if (motor && !held(shape, axis))
        drive(shape, axis, -speed, force);
}

void readAngular(JointShape& shape, int axis, btScalar lower, btScalar upper, bool motor, btScalar speed, btScalar force) {
    limit(shape, kRx + axis, lower, upper, btScalar(-1));
    if (motor && !held(shape, kRx + axis))
        drive(shape, kRx + axis, -speed, force);
}

void readSixDof(btGeneric6DofConstraint& joint, JointShape& shape) {
    btGeneric6DofSpringConstraint* springs =
        joint.getConstraintType() == D6_SPRING_CONSTRAINT_TYPE ? static_cast<btGeneric6DofSpringConstraint*>(&joint) : nullptr;
    shape.native = true;
    shape.frameA = joint.getFrameOffsetA();
    shape.frameB = joint.getFrameOffsetB();
    btTranslationalLimitMotor& linear = *joint.getTranslationalLimitMotor();
    int row = 0;
    bool hasRow[6], spring[6];
    for (int i = 0; i < 6; ++i)
        spring[i] = springs && springs->isSpringEnabled(i);
    for (int i = 0; i < 3; ++i) {
        readLinear(shape, i, linear.m_lowerLimit[i], linear.m_upperLimit[i], linear.m_enableMotor[i] && !spring[i],
                   linear.m_targetVelocity[i], linear.m_maxMotorForce[i]);
        hasRow[i] = linear.needApplyForce(i);
        spring[i] = spring[i] && linear.m_currentLimit[i] == 0; // at a limit the row is the limit's
    }
    for (int i = 0; i < 3; ++i) {
        btRotationalLimitMotor& angular = *joint.getRotationalLimitMotor(i);
        readAngular(shape, i, angular.m_loLimit, angular.m_hiLimit, angular.m_enableMotor && !spring[kRx + i], angular.m_targetVelocity,
                    angular.m_maxMotorForce);
        hasRow[kRx + i] = angular.needApplyTorques();
        spring[kRx + i] = spring[kRx + i] && angular.m_currentLimit == 0;
    }
    // getInfo2 gives one row an axis that needs one, angular axes first if frame offsets are in use.
    for (int k = 0; k < 6; ++k) {
        const int axis = joint.getUseFrameOffset() ? (k + kRx) % 6 : k;
        if (!hasRow[axis])
            continue;
        if (spring[axis])
            shape.rowMask |= 1u << row;
        ++row;
    }
}

void readSixDof2(btGeneric6DofSpring2Constraint& joint, JointShape& shape) {
    btTranslationalLimitMotor2& linear = *joint.getTranslationalLimitMotor();
    shape.frameA = joint.getFrameOffsetA();
    shape.frameB = joint.getFrameOffsetB();
    int unlocked = 0;
    for (int i = 0; i < 3; ++i) {
        readLinear(shape, i, linear.m_lowerLimit[i], linear.m_upperLimit[i], linear.m_enableMotor[i] && !linear.m_servoMotor[i],
                   linear.m_targetVelocity[i], linear.m_maxMotorForce[i]);
        const btRotationalLimitMotor2& angular = *joint.getRotationalLimitMotor(i);
        readAngular(shape, i, angular.m_loLimit, angular.m_hiLimit, angular.m_enableMotor && !angular.m_servoMotor,
                    angular.m_targetVelocity, angular.m_maxMotorForce);
        if (!locked(shape, kRx + i))
            ++unlocked;
    }
    if (joint.getRotationOrder() != RO_XYZ && unlocked > 1) { // Cairn's Cardan angles are in that order
        shape = JointShape();
        shape.allRows = true;
        return;
    }
    shape.native = true;
    // getInfo2: angular axes first, in the order of rotation; of each axis its limits (two rows), motor, spring.
    static const int order[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    int row = 0;
    const auto count = [&row, &shape](int currentLimit, bool motor, bool servo, bool spring) {
        row += currentLimit == 4 ? 2 : (currentLimit != 0 ? 1 : 0);
        if (motor) {
            if (servo)
                shape.rowMask |= 1u << row;
            ++row;
        }
        if (spring) {
            shape.rowMask |= 1u << row;
            ++row;
        }
    };
    for (int i = 0; i < 3; ++i) {
        const btRotationalLimitMotor2& angular = *joint.getRotationalLimitMotor(order[joint.getRotationOrder()][i]);
        count(angular.m_currentLimit, angular.m_enableMotor, angular.m_servoMotor, angular.m_enableSpring);
    }
    for (int i = 0; i < 3; ++i)
        count(linear.m_currentLimit[i], linear.m_enableMotor[i], linear.m_servoMotor[i], linear.m_enableSpring[i]);
}

} // namespace

JointShape readConstraint(btTypedConstraint& constraint, const btContactSolverInfo& info) {
    JointShape shape;
    switch (constraint.getConstraintType()) {
    case POINT2POINT_CONSTRAINT_TYPE:
        readPoint(static_cast<btPoint2PointConstraint&>(constraint), shape);
        break;
    case HINGE_CONSTRAINT_TYPE:
        readHinge(static_cast<btHingeConstraint&>(constraint), info.m_timeStep, shape);
        break;
    case SLIDER_CONSTRAINT_TYPE:
        readSlider(static_cast<btSliderConstraint&>(constraint), shape);
        break;
    case D6_CONSTRAINT_TYPE:
    case D6_SPRING_CONSTRAINT_TYPE:
        readSixDof(static_cast<btGeneric6DofConstraint&>(constraint), shape);
        break;
    case D6_SPRING_2_CONSTRAINT_TYPE: // btFixedConstraint and btHinge2Constraint too
        readSixDof2(static_cast<btGeneric6DofSpring2Constraint&>(constraint), shape);
        break;
    default:
        shape.allRows = true;
        break;
    }
    return shape;
}

} // namespace bullet
} // namespace cairn
