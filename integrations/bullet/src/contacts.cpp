#include "contacts.h"

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
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

// Bullet's predictive points, the ones it adds for CCD, come without restitution: stock lets the body arrive and bounce in
// the next step. Here it arrives within the step, in one of the substeps, and so must bounce there.
bool isPredictive(const btManifoldPoint& point) {
    return point.getDistance() > btScalar(0) && point.m_combinedRestitution == btScalar(0) && point.m_localPointA == btVector3(0, 0, 0);
}

btScalar clamped(btScalar value, btScalar low, btScalar high) { return value < low ? low : (value > high ? high : value); }

btVector3 acrossNormal(const btVector3& vector, const btVector3& normal) { return vector - normal * normal.dot(vector); }

// Both objects' anisotropic friction, or rolling friction, on a direction: first body 0's, as stock's applyAnisotropicFriction.
struct Anisotropy {
    const btCollisionObject* objects[2];
    int mode;

    bool any() const { return objects[0]->hasAnisotropicFriction(mode) || objects[1]->hasAnisotropicFriction(mode); }
    btVector3 operator()(btVector3 direction) const {
        for (const btCollisionObject* object : objects)
            if (object->hasAnisotropicFriction(mode)) {
                const btMatrix3x3& axes = object->getWorldTransform().getBasis();
                direction = axes * ((direction * axes) * object->getAnisotropicFriction());
            }
        return direction;
    }
};

// The image of the unit circle across `normal` under an anisotropy is an ellipse there: its longer half axis as a unit vector, and
// the lengths of both.
struct Ellipse {
    btVector3 axis;
    btScalar longer, shorter;
};
Ellipse ellipseOf(const Anisotropy& scaled, const btVector3& normal) {
    btVector3 e1, e2;
    btPlaneSpace1(normal, e1, e2);
    const btVector3 s1 = scaled(e1), s2 = scaled(e2);
    // M M^T, whose eigenvectors are the axes
    const btScalar xx = e1.dot(s1) * e1.dot(s1) + e1.dot(s2) * e1.dot(s2), yy = e2.dot(s1) * e2.dot(s1) + e2.dot(s2) * e2.dot(s2);
    const btScalar xy = e1.dot(s1) * e2.dot(s1) + e1.dot(s2) * e2.dot(s2);
    const btScalar mean = (xx + yy) / 2, half = (xx - yy) / 2, radius = btSqrt(half * half + xy * xy);
    btVector3 axis = half >= btScalar(0) ? e1 * (half + radius) + e2 * xy : e1 * xy + e2 * (radius - half);
    axis = axis.length2() > btScalar(0) ? axis.normalized() : e1;
    return Ellipse{axis, btSqrt(mean + radius), btSqrt(btMax(mean - radius, btScalar(0)))};
}

// Friction along directions that the user gave the point: as strong as they are long, and only along the first unless there are to
// be two; it drives the slip to m_contactMotion.
void useGivenDirections(const btManifoldPoint& point, bool two, Tables& tables) {
    const btVector3& normal = point.m_normalWorldOnB;
    const btVector3 first = acrossNormal(point.m_lateralFrictionDir1, normal), second = acrossNormal(point.m_lateralFrictionDir2, normal);
    const btScalar length1 = first.length(), length2 = two ? second.length() : btScalar(0);
    store(tables.contacts.back().tangent, length1 > btScalar(0) ? first : second.cross(normal));
    tables.tangents = true;
    constexpr btScalar rounding = btScalar(1e-3);
    if (btFabs(length1 - 1) > rounding || btFabs(length2 - 1) > rounding) {
        tables.extra().frictionScale[0] = length1;
        tables.extra().frictionScale[1] = length2;
    }
    btVector3 motion(0, 0, 0);
    if (length1 > btScalar(0))
        motion += first * (point.m_contactMotion1 / (length1 * length1));
    if (length2 > btScalar(0))
        motion += second * (point.m_contactMotion2 / (length2 * length2));
    if (!motion.isZero())
        store(tables.extra().surfaceVelocity, motion);
}

void useAnisotropicFriction(const btManifoldPoint& point, const Anisotropy& scaled, Tables& tables) {
    const Ellipse ellipse = ellipseOf(scaled, point.m_normalWorldOnB);
    store(tables.contacts.back().tangent, ellipse.axis);
    tables.tangents = true;
    tables.extra().frictionScale[0] = ellipse.longer;
    tables.extra().frictionScale[1] = ellipse.shorter;
}

// Where the two surfaces' points have slid apart, friction pulls them together again by m_frictionERP of the gap in this step.
void useAnchor(const btManifoldPoint& point, const btContactSolverInfo& info, Tables& tables) {
    const btVector3 gap = acrossNormal(point.getPositionWorldOnA() - point.getPositionWorldOnB(), point.m_normalWorldOnB);
    btScalar(&target)[3] = tables.extra().surfaceVelocity;
    store(target, vector(target) - gap * (info.m_frictionERP / info.m_timeStep));
}

// Stock scales each axis of rolling friction before it knows where the bodies roll; here the coefficient is that along the axis
// about which they do, or the largest.
void useRollingFriction(const btManifoldPoint& point, const Anisotropy& scaled, Tables& tables) {
    btScalar share = 1;
    if (scaled.any()) {
        const btRigidBody *body0 = btRigidBody::upcast(scaled.objects[0]), *body1 = btRigidBody::upcast(scaled.objects[1]);
        const btVector3 none(0, 0, 0);
        const btVector3 turn = (body0 ? body0->getAngularVelocity() : none) - (body1 ? body1->getAngularVelocity() : none);
        const btVector3 roll = acrossNormal(turn, point.m_normalWorldOnB);
        share = roll.length2() > SIMD_EPSILON ? scaled(roll.normalized()).length() : ellipseOf(scaled, point.m_normalWorldOnB).longer;
    }
    ContactExtra& extra = tables.extra();
    extra.rollingFriction = point.m_combinedRollingFriction * share;
    extra.spinningFriction = btMax(point.m_combinedSpinningFriction, btScalar(0));
}

// A contact's cfm and erp are those of a spring and damper in the step's dt: cfm = 1 / (dt k + d), erp = dt k / (dt k + d). A rigid
// one (cfm 0) keeps the method's own bias.
void soften(const btManifoldPoint& point, const btContactSolverInfo& info, Tables& tables) {
    const int flags = point.m_contactPointFlags;
    btScalar stiffness, damping;
    if (flags & (BT_CONTACT_FLAG_HAS_CONTACT_CFM | BT_CONTACT_FLAG_HAS_CONTACT_ERP)) {
        const btScalar cfm = flags & BT_CONTACT_FLAG_HAS_CONTACT_CFM ? point.m_contactCFM : info.m_globalCfm;
        const btScalar erp = flags & BT_CONTACT_FLAG_HAS_CONTACT_ERP ? point.m_contactERP : info.m_erp2;
        if (!(cfm > btScalar(0)))
            return;
        stiffness = erp / (info.m_timeStep * cfm);
        damping = (1 - erp) / cfm;
    } else {
        stiffness = point.m_combinedContactStiffness1;
        damping = point.m_combinedContactDamping1;
    }
    tables.extra().stiffness = clamped(stiffness, 0, btScalar(1e30)); // one without either would be rigid to Cairn
    tables.extra().damping = clamped(damping, btScalar(SIMD_EPSILON), btScalar(1e30));
}

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
    const Anisotropy slides = {{object0, object1}, btCollisionObject::CF_ANISOTROPIC_FRICTION};
    const Anisotropy rolls = {{object0, object1}, btCollisionObject::CF_ANISOTROPIC_ROLLING_FRICTION};
    constexpr int softFlags = BT_CONTACT_FLAG_HAS_CONTACT_CFM | BT_CONTACT_FLAG_HAS_CONTACT_ERP | BT_CONTACT_FLAG_CONTACT_STIFFNESS_DAMPING;
    for (int i = 0; i < count; ++i) {
        btManifoldPoint& point = manifold.getContactPoint(i);
        if (!(point.getDistance() <= threshold))
            continue;
        const btScalar square = point.m_normalWorldOnB.length2();
        if (square <= SIMD_EPSILON) // no direction to push in
            continue;
        tables.contacts.emplace_back();
        tables.contactOwners.push_back(&point);
        ContactRecord& record = tables.contacts.back();
        record.key = pointKeys[i];
        record.bodyA = index1;
        record.bodyB = index0;
        record.flags = flags;
        const bool isUnit = btFabs(square - 1) < btScalar(1e-3); // or a callback has left it long
        store(record.normal, isUnit ? point.m_normalWorldOnB : point.m_normalWorldOnB / btSqrt(square));
        store(record.armA, point.getPositionWorldOnB() - center1);
        store(record.armB, point.getPositionWorldOnA() - center0);
        record.separation = point.getDistance() + info.m_linearSlop;
        record.friction = btMax(point.m_combinedFriction, btScalar(0));
        const btScalar restitution =
            isPredictive(point) ? gCalculateCombinedRestitutionCallback(object0, object1) : point.m_combinedRestitution;
        record.restitution = clamped(restitution, btScalar(0), btScalar(1));
        const int pointFlags = point.m_contactPointFlags;
        if ((info.m_solverMode & SOLVER_ENABLE_FRICTION_DIRECTION_CACHING) && (pointFlags & BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED))
            useGivenDirections(point, (info.m_solverMode & SOLVER_USE_2_FRICTION_DIRECTIONS) != 0, tables);
        else if (slides.any())
            useAnisotropicFriction(point, slides, tables);
        if (pointFlags & BT_CONTACT_FLAG_FRICTION_ANCHOR)
            useAnchor(point, info, tables);
        if (pointFlags & softFlags)
            soften(point, info, tables);
        if (point.m_combinedRollingFriction > btScalar(0))
            useRollingFriction(point, rolls, tables);
    }
}

void scatterContacts(const Tables& tables) {
    // the directions need not be unit where they are the user's
    const auto along = [](const btVector3& direction, const btVector3& impulse) {
        const btScalar square = direction.length2();
        return square > btScalar(0) ? impulse.dot(direction) / square : btScalar(0);
    };
    for (std::size_t i = 0; i < tables.contacts.size(); ++i) {
        const ContactRecord& record = tables.contacts[i];
        btManifoldPoint& point = *tables.contactOwners[i];
        const btVector3 friction = vector(record.frictionImpulse); // on body 0
        point.m_appliedImpulse = record.impulse;
        if (!(point.m_contactPointFlags & BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED))
            btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
        point.m_appliedImpulseLateral1 = along(point.m_lateralFrictionDir1, friction);
        point.m_appliedImpulseLateral2 = along(point.m_lateralFrictionDir2, friction);
    }
}

} // namespace bullet
} // namespace cairn
