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

// What follows writes to one contact's extra.

// Friction along directions that the user gave the point: as strong as they are long, and only along the first unless there are to
// be two; it drives the slip to m_contactMotion.
void useGivenDirections(const btManifoldPoint& point, bool two, ContactExtra& extra) {
    const btVector3& normal = point.m_normalWorldOnB;
    const btVector3 first = acrossNormal(point.m_lateralFrictionDir1, normal), second = acrossNormal(point.m_lateralFrictionDir2, normal);
    const btScalar length1 = first.length(), length2 = two ? second.length() : btScalar(0);
    store(extra.tangent, length1 > btScalar(0) ? first : second.cross(normal));
    constexpr btScalar rounding = btScalar(1e-3);
    if (btFabs(length1 - 1) > rounding || btFabs(length2 - 1) > rounding) {
        extra.frictionScale[0] = length1;
        extra.frictionScale[1] = length2;
    }
    btVector3 motion(0, 0, 0);
    if (length1 > btScalar(0))
        motion += first * (point.m_contactMotion1 / (length1 * length1));
    if (length2 > btScalar(0))
        motion += second * (point.m_contactMotion2 / (length2 * length2));
    if (!motion.isZero())
        store(extra.surfaceVelocity, motion);
}

void useAnisotropicFriction(const btManifoldPoint& point, const Anisotropy& scaled, ContactExtra& extra) {
    const Ellipse ellipse = ellipseOf(scaled, point.m_normalWorldOnB);
    store(extra.tangent, ellipse.axis);
    extra.frictionScale[0] = ellipse.longer;
    extra.frictionScale[1] = ellipse.shorter;
}

// Where the two surfaces' points have slid apart, friction pulls them together again by m_frictionERP of the gap in this step.
void useAnchor(const btManifoldPoint& point, const btContactSolverInfo& info, ContactExtra& extra) {
    const btVector3 gap = acrossNormal(point.getPositionWorldOnA() - point.getPositionWorldOnB(), point.m_normalWorldOnB);
    btScalar(&target)[3] = extra.surfaceVelocity;
    store(target, vector(target) - gap * (info.m_frictionERP / info.m_timeStep));
}

// Stock scales each axis of rolling friction before it knows where the bodies roll; here the coefficient is that along the axis
// about which they do, or the largest.
void useRollingFriction(const btManifoldPoint& point, const Anisotropy& scaled, ContactExtra& extra) {
    btScalar share = 1;
    if (scaled.any()) {
        const btRigidBody *body0 = btRigidBody::upcast(scaled.objects[0]), *body1 = btRigidBody::upcast(scaled.objects[1]);
        const btVector3 none(0, 0, 0);
        const btVector3 turn = (body0 ? body0->getAngularVelocity() : none) - (body1 ? body1->getAngularVelocity() : none);
        const btVector3 roll = acrossNormal(turn, point.m_normalWorldOnB);
        share = roll.length2() > SIMD_EPSILON ? scaled(roll.normalized()).length() : ellipseOf(scaled, point.m_normalWorldOnB).longer;
    }
    extra.rollingFriction = point.m_combinedRollingFriction * share;
    extra.spinningFriction = btMax(point.m_combinedSpinningFriction, btScalar(0));
}

// A contact's cfm and erp are those of a spring and damper in the step's dt: cfm = 1 / (dt k + d), erp = dt k / (dt k + d). A rigid
// one (cfm 0) keeps the method's own bias.
void soften(const btManifoldPoint& point, const btContactSolverInfo& info, ContactExtra& extra) {
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
    extra.stiffness = clamped(stiffness, 0, btScalar(1e30)); // one without either would be rigid to Cairn
    extra.damping = clamped(damping, btScalar(SIMD_EPSILON), btScalar(1e30));
}

// What few points have, found by fill().
enum Feature : uint8_t { kExtras = 1, kPredictive = 2 };

bool givesDirections(const btManifoldPoint& point, const btContactSolverInfo& info) {
    return (info.m_solverMode & SOLVER_ENABLE_FRICTION_DIRECTION_CACHING) &&
           (point.m_contactPointFlags & BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED);
}
constexpr int kSoft = BT_CONTACT_FLAG_HAS_CONTACT_CFM | BT_CONTACT_FLAG_HAS_CONTACT_ERP | BT_CONTACT_FLAG_CONTACT_STIFFNESS_DAMPING;

// Bullet's manifolds point at const objects although their users change them.
btCollisionObject& object0Of(const btPersistentManifold& manifold) { return *const_cast<btCollisionObject*>(manifold.getBody0()); }
btCollisionObject& object1Of(const btPersistentManifold& manifold) { return *const_cast<btCollisionObject*>(manifold.getBody1()); }

} // namespace

void Contacts::choose(const std::vector<btPersistentManifold*>& manifolds, btDispatcher* dispatcher) {
    constexpr std::size_t ahead = 16; // a manifold's head lies behind its points, in a line or two of its own
    m_entries.clear();
    uint32_t points = 0;
    for (std::size_t i = 0; i < manifolds.size(); ++i) {
        if (i + ahead < manifolds.size())
            prefetch<80>(reinterpret_cast<const char*>(&manifolds[i + ahead]->m_index1a) - 40);
        if (i + ahead / 2 < manifolds.size())
            m_keys.prefetchGuess(*manifolds[i + ahead / 2]);
        btPersistentManifold& manifold = *manifolds[i];
        const int count = manifold.getNumContacts();
        btCollisionObject &object0 = object0Of(manifold), &object1 = object1Of(manifold);
        if (count == 0 || (dispatcher && !dispatcher->needsResponse(&object0, &object1)))
            continue;
        const int index0 = m_bodies.indexOf(object0), index1 = m_bodies.indexOf(object1);
        if (!m_bodies.canMove(index0) && !m_bodies.canMove(index1))
            continue;
        const uint32_t place = m_keys.place(manifold);
        if (place == ContactKeys::kSeen)
            continue;
        m_entries.push_back(Entry{&manifold, index0, index1, place, points, static_cast<uint8_t>(count), 0, 0, 0});
        points += static_cast<uint32_t>(count);
    }
    m_tables.contacts.resize(points);
    m_tables.contactOwners.resize(points);
}

void Contacts::gather(const std::vector<btPersistentManifold*>& manifolds, btDispatcher* dispatcher, const btContactSolverInfo& info,
                      const Loops& loops) {
    constexpr std::size_t grain = 64;
    m_keys.beginStep();
    choose(manifolds, dispatcher);
    loops.each<4>(
        m_entries.size(), grain,
        [&](std::size_t i) {
            prefetch<ContactKeys::kPoints * sizeof(btManifoldPoint)>(m_entries[i].manifold);
            m_keys.prefetchPlace(m_entries[i].place);
        },
        [&](std::size_t i) { fill(m_entries[i], info); });

    int features = 0, left = 0;
    for (const Entry& entry : m_entries) {
        features |= entry.features;
        left |= entry.left;
        if (entry.fresh > 0)
            number(entry);
        if (entry.features & kPredictive)
            bounce(entry);
    }
    if (features & kExtras) {
        m_tables.contactExtras.resize(m_tables.contacts.size(), ContactExtra::none());
        loops.each(m_entries.size(), grain, [&](std::size_t i) {
            if (m_entries[i].features & kExtras)
                useFeatures(m_entries[i], info);
        });
    }
    if (left)
        closeGaps();
    m_tables.contactResults.resize(m_tables.contacts.size());
    m_keys.endStep(manifolds.size());
}

void Contacts::fill(Entry& entry, const btContactSolverInfo& info) {
    btPersistentManifold& manifold = *entry.manifold;
    const btCollisionObject &object0 = object0Of(manifold), &object1 = object1Of(manifold);
    // The normal points from body 1 to body 0, so Cairn's a is body 1 and b is body 0.
    uint32_t flags = 0;
    if (isRound(object1, info.m_timeStep))
        flags |= CAIRN_CONTACT_ROUND_A;
    if (isRound(object0, info.m_timeStep))
        flags |= CAIRN_CONTACT_ROUND_B;
    uint64_t pointKeys[ContactKeys::kPoints];
    entry.fresh = static_cast<uint8_t>(m_keys.match(entry.place, manifold, pointKeys));
    const btVector3& center0 = object0.getWorldTransform().getOrigin();
    const btVector3& center1 = object1.getWorldTransform().getOrigin();
    const btScalar threshold = manifold.getContactProcessingThreshold();
    const bool slides = Anisotropy{{&object0, &object1}, btCollisionObject::CF_ANISOTROPIC_FRICTION}.any();
    for (int i = 0; i < entry.count; ++i) {
        btManifoldPoint& point = manifold.getContactPoint(i);
        const btScalar square = point.m_normalWorldOnB.length2();
        const std::size_t at = entry.first + static_cast<std::size_t>(i);
        if (!(point.getDistance() <= threshold) || square <= SIMD_EPSILON) { // or no direction to push in
            m_tables.contactOwners[at] = nullptr;
            ++entry.left;
            continue;
        }
        m_tables.contactOwners[at] = &point;
        ContactRecord& record = m_tables.contacts[at];
        record.key = pointKeys[i];
        record.bodyA = entry.body1;
        record.bodyB = entry.body0;
        record.flags = flags;
        const bool isUnit = btFabs(square - 1) < btScalar(1e-3); // or a callback has left it long
        store(record.normal, isUnit ? point.m_normalWorldOnB : point.m_normalWorldOnB / btSqrt(square));
        store(record.armA, point.getPositionWorldOnB() - center1);
        store(record.armB, point.getPositionWorldOnA() - center0);
        record.separation = point.getDistance() + info.m_linearSlop;
        record.friction = btMax(point.m_combinedFriction, btScalar(0));
        record.restitution = clamped(point.m_combinedRestitution, btScalar(0), btScalar(1));
        const bool extra = slides || (point.m_contactPointFlags & (BT_CONTACT_FLAG_FRICTION_ANCHOR | kSoft)) ||
                           point.m_combinedRollingFriction > btScalar(0) || givesDirections(point, info);
        int features = extra ? kExtras : 0;
        if (isPredictive(point))
            features |= kPredictive;
        entry.features = static_cast<uint8_t>(entry.features | features);
    }
}

void Contacts::useFeatures(const Entry& entry, const btContactSolverInfo& info) {
    btPersistentManifold& manifold = *entry.manifold;
    const btCollisionObject &object0 = object0Of(manifold), &object1 = object1Of(manifold);
    const Anisotropy slides = {{&object0, &object1}, btCollisionObject::CF_ANISOTROPIC_FRICTION};
    const Anisotropy rolls = {{&object0, &object1}, btCollisionObject::CF_ANISOTROPIC_ROLLING_FRICTION};
    for (std::size_t at = entry.first; at < entry.first + std::size_t{entry.count}; ++at) {
        if (!m_tables.contactOwners[at])
            continue;
        const btManifoldPoint& point = *m_tables.contactOwners[at];
        ContactExtra& extra = m_tables.contactExtras[at];
        if (givesDirections(point, info))
            useGivenDirections(point, (info.m_solverMode & SOLVER_USE_2_FRICTION_DIRECTIONS) != 0, extra);
        else if (slides.any())
            useAnisotropicFriction(point, slides, extra);
        if (point.m_contactPointFlags & BT_CONTACT_FLAG_FRICTION_ANCHOR)
            useAnchor(point, info, extra);
        if (point.m_contactPointFlags & kSoft)
            soften(point, info, extra);
        if (point.m_combinedRollingFriction > btScalar(0))
            useRollingFriction(point, rolls, extra);
    }
}

void Contacts::bounce(const Entry& entry) {
    for (std::size_t at = entry.first; at < entry.first + std::size_t{entry.count}; ++at)
        if (m_tables.contactOwners[at] && isPredictive(*m_tables.contactOwners[at])) {
            const btScalar restitution = gCalculateCombinedRestitutionCallback(&object0Of(*entry.manifold), &object1Of(*entry.manifold));
            m_tables.contacts[at].restitution = clamped(restitution, btScalar(0), btScalar(1));
        }
}

void Contacts::number(const Entry& entry) {
    uint64_t keys[ContactKeys::kPoints];
    m_keys.number(entry.place, keys);
    for (std::size_t i = 0; i < entry.count; ++i)
        m_tables.contacts[entry.first + i].key = keys[i];
}

void Contacts::closeGaps() {
    std::vector<ContactExtra>& extras = m_tables.contactExtras;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < m_tables.contacts.size(); ++i) {
        if (!m_tables.contactOwners[i])
            continue;
        m_tables.contacts[kept] = m_tables.contacts[i];
        m_tables.contactOwners[kept] = m_tables.contactOwners[i];
        if (!extras.empty())
            extras[kept] = extras[i];
        ++kept;
    }
    m_tables.contacts.resize(kept);
    m_tables.contactOwners.resize(kept);
    if (!extras.empty())
        extras.resize(kept);
}

void Contacts::scatter(const Loops& loops) const {
    // the directions need not be unit where they are the user's
    const auto along = [](const btVector3& direction, const btVector3& impulse) {
        const btScalar square = direction.length2();
        return square > btScalar(0) ? impulse.dot(direction) / square : btScalar(0);
    };
    constexpr std::size_t unread = offsetof(btManifoldPoint, m_normalWorldOnB);
    const auto fetch = [&](std::size_t i) {
        prefetch<sizeof(btManifoldPoint) - unread>(reinterpret_cast<const char*>(m_tables.contactOwners[i]) + unread);
    };
    loops.each<24>(m_tables.contacts.size(), 256, fetch, [&](std::size_t i) {
        const ContactResult& result = m_tables.contactResults[i];
        btManifoldPoint& point = *m_tables.contactOwners[i];
        const btVector3 friction = vector(result.frictionImpulse); // on body 0
        point.m_appliedImpulse = result.impulse;
        if (!(point.m_contactPointFlags & BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED))
            btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
        point.m_appliedImpulseLateral1 = along(point.m_lateralFrictionDir1, friction);
        point.m_appliedImpulseLateral2 = along(point.m_lateralFrictionDir2, friction);
    });
}

} // namespace bullet
} // namespace cairn
