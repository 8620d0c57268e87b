#include "bodies.h"

#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>
#include <BulletDynamics/ConstraintSolver/btTypedConstraint.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <LinearMath/btTransformUtil.h>

#include <cmath>

namespace cairn {
namespace bullet {
namespace {

btQuaternion quaternion(const btScalar (&from)[4]) { return btQuaternion(from[0], from[1], from[2], from[3]); }

// The constant angular velocity that turns `from` into `to` in dt, the short way round.
btVector3 turnRate(const btQuaternion& from, const btQuaternion& to, btScalar dt) {
    const btQuaternion turn = to * from.inverse();
    const btVector3 axis(turn.x(), turn.y(), turn.z());
    const btScalar sine = axis.length();
    if (!(sine > btScalar(0)))
        return btVector3(0, 0, 0);
    const btScalar angle = 2 * std::atan2(sine, btFabs(turn.w())); // acos(w) would lose small angles
    return axis * ((turn.w() < 0 ? -angle : angle) / (sine * dt));
}

// A free body goes by M^-1 times Bullet's totals, which have its factor F in them once; what F M^-1 F must get for the same.
btVector3 unfactored(const btVector3& total, const btVector3& factor) {
    btVector3 result = total;
    for (int i = 0; i < 3; ++i)
        if (factor[i] != btScalar(0))
            result[i] /= factor[i] * factor[i];
    return result;
}

// v becomes `end` exactly where nobody else changed it, and else keeps the change.
btVector3 landed(const btVector3& v, const btScalar (&average)[3], const btScalar (&end)[3]) {
    return v == vector(average) ? vector(end) : v + (vector(end) - vector(average));
}

} // namespace

void Bodies::beginStep() {
    ++m_step;
    m_outsideWorld.clear();
    m_objects.clear();
    m_movable.clear();
    m_fixed = &btTypedConstraint::getFixedBody();
}

int Bodies::indexOf(btCollisionObject& object) {
    const int worldIndex = object.getWorldArrayIndex();
    if (worldIndex >= 0) {
        const std::size_t at = static_cast<std::size_t>(worldIndex);
        if (at >= m_byWorldIndex.size())
            m_byWorldIndex.resize(at + at / 2 + 64, Place{0, 0});
        Place& place = m_byWorldIndex[at];
        if (place.step != m_step)
            place = Place{m_step, add(object)};
        return place.index;
    }
    if (&object == m_fixed)
        return CAIRN_WORLD;
    for (const std::pair<btCollisionObject*, int>& known : m_outsideWorld)
        if (known.first == &object)
            return known.second;
    m_outsideWorld.emplace_back(&object, add(object));
    return m_outsideWorld.back().second;
}

int Bodies::add(btCollisionObject& object) {
    const int index = static_cast<int>(m_objects.size());
    btRigidBody* body = btRigidBody::upcast(&object);
    const bool moves = body && object.isActive() && !object.isStaticOrKinematicObject() && body->getInvMass() > btScalar(0);
    m_objects.push_back(&object);
    m_tables.bodyOwners.push_back(moves ? body : nullptr);
    if (moves)
        m_movable.push_back(static_cast<uint32_t>(index));
    return index;
}

void Bodies::gather(const Loops& loops) {
    m_tables.bodies.resize(m_objects.size());
    loops.each<4>(
        m_objects.size(), 128, [&](std::size_t i) { prefetch<sizeof(btRigidBody)>(m_objects[i]); },
        [&](std::size_t i) { fill(m_tables.bodies[i], *m_objects[i], m_tables.bodyOwners[i]); });
}

void Bodies::fill(BodyRecord& record, btCollisionObject& object, btRigidBody* owner) {
    record = BodyRecord(); // zeroed: static until found otherwise
    const btTransform& pose = object.getWorldTransform();
    btQuaternion orientation;
    pose.getBasis().getRotation(orientation);
    store(record.position, pose.getOrigin());
    store(record.orientation, orientation);
    store(record.linearFactor, btVector3(1, 1, 1));
    store(record.angularFactor, btVector3(1, 1, 1));

    const btRigidBody* body = btRigidBody::upcast(&object);
    if (owner) {
        store(record.linearVelocity, body->getLinearVelocity());
        store(record.angularVelocity, body->getAngularVelocity());
        record.inverseMass = body->getInvMass();
        store(record.inverseInertia, body->getInvInertiaDiagLocal());
        store(record.force, unfactored(body->getTotalForce(), body->getLinearFactor())); // gravity is in it
        store(record.torque, unfactored(body->getTotalTorque(), body->getAngularFactor()));
        store(record.linearFactor, body->getLinearFactor());
        store(record.angularFactor, body->getAngularFactor());
        const int gyroscopic =
            BT_ENABLE_GYROSCOPIC_FORCE_EXPLICIT | BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_WORLD | BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY;
        if (!(body->getFlags() & gyroscopic))
            record.flags = CAIRN_BODY_NO_GYROSCOPIC;
    } else if (body && object.isActive() && object.isKinematicObject()) {
        store(record.linearVelocity, body->getLinearVelocity());
        store(record.angularVelocity, body->getAngularVelocity());
        record.flags = CAIRN_BODY_AT_END_POSE;
    }
}

template <class Move> void Bodies::eachMovable(const Loops& loops, const Move& move) const {
    loops.each<4>(
        m_movable.size(), 64, [&](std::size_t i) { prefetch<sizeof(btRigidBody)>(m_tables.bodyOwners[m_movable[i]]); },
        [&](std::size_t i) { move(i, *m_tables.bodyOwners[m_movable[i]], m_tables.bodies[m_movable[i]]); });
}

void Bodies::scatter(btScalar dt, const Loops& loops) const {
    eachMovable(loops, [dt](std::size_t, btRigidBody& body, const BodyRecord& record) {
        body.setLinearVelocity(vector(record.linearVelocity));
        body.setAngularVelocity(vector(record.angularVelocity));

        // After the solver the world integrates once more with the velocity that we leave, so leave the pose that this
        // takes to where the substeps ended. Integrating backwards from there finds it: Bullet's rotation increment,
        // its clamp of the angle included, is even in the sign of the velocity.
        // Where Bullet will sweep the shape along that path (CCD), the path must be the real one: after a bounce the
        // pre-image lies behind the wall. There, leave the start and let Bullet integrate, as behind its own solver.
        const btVector3& linear = body.getLinearVelocity();
        const btVector3& angular = body.getAngularVelocity();
        const btScalar threshold = body.getCcdSquareMotionThreshold();
        if (threshold > btScalar(0) && threshold < (linear * dt).length2())
            return;
        const btTransform end(quaternion(record.orientation), vector(record.position));
        btTransform start;
        btTransformUtil::integrateTransform(end, -linear, -angular, dt, start);
        body.setWorldTransform(start);
    });
}

void Bodies::scatter(btScalar dt, std::vector<Flight>& flights, const Loops& loops) const {
    const std::size_t before = flights.size();
    flights.resize(before + m_movable.size());
    eachMovable(loops, [&](std::size_t i, btRigidBody& body, const BodyRecord& record) {
        const btTransform& start = body.getWorldTransform();
        btQuaternion orientation;
        start.getBasis().getRotation(orientation);
        body.setLinearVelocity((vector(record.position) - start.getOrigin()) / dt);
        body.setAngularVelocity(turnRate(orientation, quaternion(record.orientation), dt));

        Flight& flight = flights[before + i];
        flight.body = &body;
        flight.worldIndex = body.getWorldArrayIndex();
        store(flight.position, vector(record.position));
        store(flight.orientation, quaternion(record.orientation));
        store(flight.linear, vector(record.linearVelocity));
        store(flight.angular, vector(record.angularVelocity));
        store(flight.averageLinear, body.getLinearVelocity());
        store(flight.averageAngular, body.getAngularVelocity());
    });
}

void land(const std::vector<Flight>& flights, btCollisionWorld& world) {
    const btCollisionObjectArray& objects = world.getCollisionObjectArray();
    for (const Flight& flight : flights) {
        // An action that ran before may have removed the body, and deleted it.
        const bool there = flight.worldIndex >= 0 && flight.worldIndex < objects.size() && objects[flight.worldIndex] == flight.body;
        if (!there && objects.findLinearSearch(flight.body) == objects.size())
            continue;
        btRigidBody& body = *flight.body;
        if (body.getHitFraction() == btScalar(1)) // else CCD has stopped it on the way
            body.setCenterOfMassTransform(btTransform(quaternion(flight.orientation), vector(flight.position)));
        // Motion states are interpolated along the way that the body went, whatever its velocity is at the end.
        body.setInterpolationLinearVelocity(vector(flight.averageLinear));
        body.setInterpolationAngularVelocity(vector(flight.averageAngular));
        body.setLinearVelocity(landed(body.getLinearVelocity(), flight.averageLinear, flight.linear));
        body.setAngularVelocity(landed(body.getAngularVelocity(), flight.averageAngular, flight.angular));
    }
}

} // namespace bullet
} // namespace cairn
