// The tables that go to libcairn: arrays of structs in btScalar, viewed in place. They keep their memory between steps.
#pragma once
#include <cairn/cairn.h>

#include <LinearMath/btScalar.h>
#include <LinearMath/btTransform.h>

#include <algorithm>
#include <cstdint>
#include <vector>

class btManifoldPoint;
class btPersistentManifold;
class btRigidBody;
class btTypedConstraint;

namespace cairn {
namespace bullet {

struct BodyRecord {
    btScalar position[3];
    btScalar orientation[4];
    btScalar linearVelocity[3];
    btScalar angularVelocity[3];
    btScalar inverseMass;
    btScalar inverseInertia[3];
    btScalar force[3];
    btScalar torque[3];
    btScalar linearFactor[3];
    btScalar angularFactor[3];
    uint32_t flags;
    uint32_t padding;
};

struct ContactRecord {
    uint64_t key;
    int32_t bodyA;
    int32_t bodyB;
    uint32_t flags;
    uint32_t padding;
    btScalar normal[3];
    btScalar armA[3];
    btScalar armB[3];
    btScalar separation;
    btScalar friction;
    btScalar restitution;
};

struct ContactResult {
    btScalar impulse;
    btScalar frictionImpulse[3];
};

// What few contacts have. A table of its own, parallel to contacts and empty where none has it.
struct ContactExtra {
    btScalar tangent[3];
    btScalar frictionScale[2];
    btScalar surfaceVelocity[3];
    btScalar rollingFriction;
    btScalar spinningFriction;
    btScalar stiffness;
    btScalar damping;

    static ContactExtra none() { return ContactExtra{{0, 0, 0}, {1, 1}, {0, 0, 0}, 0, 0, 0, 0}; }
};

struct JointRecord {
    uint64_t key;
    int32_t bodyA;
    int32_t bodyB;
    uint32_t axes[6];
    btScalar anchorA[3];
    btScalar anchorB[3];
    btScalar frameA[4];
    btScalar frameB[4];
    btScalar lower[6];
    btScalar upper[6];
    btScalar motorSpeed[6];
    btScalar motorForce[6];
    btScalar target[6];
    btScalar stiffness[6];
    btScalar damping[6];
    btScalar rate[6];
    btScalar maxForce;
    uint32_t rotation;
    btScalar impulse[6]; // result
    btScalar linear[3];  // result
    btScalar angular[3]; // result
};

struct RowRecord {
    uint64_t key;
    int32_t bodyA;
    int32_t bodyB;
    uint32_t block;
    uint32_t padding;
    btScalar jacobianA[6];
    btScalar jacobianB[6];
    btScalar rhs;
    btScalar lower;
    btScalar upper;
    btScalar compliance;
    btScalar impulse; // result
};

// Where a constraint's results are: its native joints and its rows.
struct ConstraintSlot {
    btTypedConstraint* constraint;
    std::size_t firstJoint;
    std::size_t jointCount;
    bool swapped;     // the joints' body b is Bullet's A
    int reportedAxis; // of the first joint: the axis whose impulse Bullet's users read; -1: the linear impulse's norm
    btScalar reportedSign;
    std::size_t firstRow;
    std::size_t rowCount;
};

// Bodies and contacts are not emptied between steps but given their new size at once and filled in parallel, every field of them.
struct Tables {
    std::vector<BodyRecord> bodies;
    std::vector<btRigidBody*> bodyOwners; // parallel to bodies, or ahead of it; NULL for what the step may not move
    std::vector<ContactRecord> contacts;
    std::vector<btManifoldPoint*> contactOwners; // parallel to contacts; while they are gathered NULL where a point takes no part
    std::vector<ContactExtra> contactExtras;
    std::vector<ContactResult> contactResults; // parallel to contacts once they are gathered
    std::vector<JointRecord> joints;
    std::vector<RowRecord> rows;
    std::vector<ConstraintSlot> constraints;
    bool drives = false;  // some joint has a spring, a servo or a rotation of another kind
    bool bounded = false; // some joint's force is bounded

    void clear() {
        bodyOwners.clear();
        contactExtras.clear();
        joints.clear();
        rows.clear();
        constraints.clear();
        drives = bounded = false;
    }
};

inline void store(btScalar (&to)[3], const btVector3& from) {
    to[0] = from.x();
    to[1] = from.y();
    to[2] = from.z();
}

inline void store(btScalar (&to)[4], const btQuaternion& from) {
    to[0] = from.x();
    to[1] = from.y();
    to[2] = from.z();
    to[3] = from.w();
}

inline btVector3 vector(const btScalar (&from)[3]) { return btVector3(from[0], from[1], from[2]); }

} // namespace bullet
} // namespace cairn
