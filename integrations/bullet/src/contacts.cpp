#include "contacts.h"

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

namespace cairn {
namespace bullet {
namespace {

// Does the surface roll under the contact, so that its anchor does not turn with the body? A sphere always. A shape round
// about one axis (radius r, half length l), where the false gap that its spin s would open in a step, r (s dt)^2 / 2, is
// larger than what tumbling at rate t across the axis really moves its far end, l t dt.
bool isRound(const btCollisionObject& object, btScalar dt) {
    const btCollisionShape* shape = object.getCollisionShape();
    btScalar radius, halfLength;
    int axis;
    switch (shape->getShapeType()) {
    case SPHERE_SHAPE_PROXYTYPE:
        return true;
    case CAPSULE_SHAPE_PROXYTYPE: {
        const btCapsuleShape* capsule = static_cast<const btCapsuleShape*>(shape);
        axis = capsule->getUpAxis();
        radius = capsule->getRadius();
        halfLength = capsule->getHalfHeight();
        break;
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
        const btCylinderShape* cylinder = static_cast<const btCylinderShape*>(shape);
        axis = cylinder->getUpAxis();
        radius = cylinder->getRadius();
        halfLength = cylinder->getHalfExtentsWithMargin()[axis];
        break;
    }
    default:
        return false;
    }
    const btRigidBody* body = btRigidBody::upcast(&object);
    if (!body)
        return false;
    const btVector3& angular = body->getAngularVelocity();
    const btScalar spin = angular.dot(object.getWorldTransform().getBasis().getColumn(axis));
    const btScalar tumble = btSqrt(btMax(angular.length2() - spin * spin, btScalar(0)));
    return halfLength * tumble < radius * spin * spin * dt / 2;
}

btScalar clamped(btScalar value, btScalar low, btScalar high) { return value < low ? low : (value > high ? high : value); }

} // namespace

void gatherContacts(btPersistentManifold& manifold, btDispatcher* dispatcher, const btContactSolverInfo& info, Bodies& bodies,
                    ContactKeys& keys, Tables& tables) {
    const int count = manifold.getNumContacts();
    // Bullet's manifolds point at const objects although their users change them.
    btCollisionObject* object0 = const_cast<btCollisionObject*>(manifold.getBody0());
    btCollisionObject* object1 = const_cast<btCollisionObject*>(manifold.getBody1());
    if (count == 0 || (dispatcher && !dispatcher->needsResponse(object0, object1)))
        return;
    const int index0 = bodies.indexOf(*object0);
    const int index1 = bodies.indexOf(*object1);
    if (!bodies.canMove(index0) && !bodies.canMove(index1))
        return;

    // The normal points from body 1 to body 0, so Cairn's a is body 1 and b is body 0.
    uint32_t flags = 0;
    if (isRound(*object1, info.m_timeStep))
        flags |= CAIRN_CONTACT_ROUND_A;
    if (isRound(*object0, info.m_timeStep))
        flags |= CAIRN_CONTACT_ROUND_B;
    uint64_t pointKeys[ContactKeys::kPoints];
    keys.match(manifold, pointKeys);
    const btVector3& center0 = object0->getWorldTransform().getOrigin();
    const btVector3& center1 = object1->getWorldTransform().getOrigin();
    const btScalar threshold = manifold.getContactProcessingThreshold();
    for (int i = 0; i < count; ++i) {
        btManifoldPoint& point = manifold.getContactPoint(i);
        if (!(point.getDistance() <= threshold))
            continue;
        tables.contacts.emplace_back();
        tables.contactOwners.push_back(&point);
        ContactRecord& record = tables.contacts.back();
        record.key = pointKeys[i];
        record.bodyA = index1;
        record.bodyB = index0;
        record.flags = flags;
        store(record.normal, point.m_normalWorldOnB);
        store(record.armA, point.getPositionWorldOnB() - center1);
        store(record.armB, point.getPositionWorldOnA() - center0);
        record.separation = point.getDistance() + info.m_linearSlop;
        record.friction = btMax(point.m_combinedFriction, btScalar(0));
        record.restitution = clamped(point.m_combinedRestitution, btScalar(0), btScalar(1));
        if ((info.m_solverMode & SOLVER_ENABLE_FRICTION_DIRECTION_CACHING) &&
            (point.m_contactPointFlags & BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED)) {
            store(record.tangent, point.m_lateralFrictionDir1);
            tables.tangents = true;
        }
    }
}

void scatterContacts(const Tables& tables) {
    for (std::size_t i = 0; i < tables.contacts.size(); ++i) {
        const ContactRecord& record = tables.contacts[i];
        btManifoldPoint& point = *tables.contactOwners[i];
        const btVector3 friction = vector(record.frictionImpulse); // on body 0
        point.m_appliedImpulse = record.impulse;
        if (!(point.m_contactPointFlags & BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED))
            btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
        point.m_appliedImpulseLateral1 = friction.dot(point.m_lateralFrictionDir1);
        point.m_appliedImpulseLateral2 = friction.dot(point.m_lateralFrictionDir2);
    }
}

} // namespace bullet
} // namespace cairn
