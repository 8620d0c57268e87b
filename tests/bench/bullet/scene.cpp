#include "scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace cairn_bench {

Scene::Scene(const std::string& name, std::size_t bodies, btConstraintSolver& solver)
    : m_world(&m_dispatcher, &m_broadphase, &solver, &m_configuration) {
    m_world.setGravity(btVector3(0, btScalar(-9.81), 0));
    if (name == "wall")
        wall(bodies);
    else if (name == "pile")
        pile(bodies);
    else
        throw std::invalid_argument("no scene is called " + name);
}

Scene::~Scene() {
    for (std::unique_ptr<btRigidBody>& body : m_bodies)
        m_world.removeRigidBody(body.get());
}

// A running bond: every other course has half bricks at its ends.
void Scene::wall(std::size_t bodies) {
    m_shapes.push_back(std::make_unique<btBoxShape>(btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5))));
    m_shapes.push_back(std::make_unique<btBoxShape>(btVector3(btScalar(0.25), btScalar(0.5), btScalar(0.5))));
    const std::size_t width = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(bodies) * 1.6))));
    for (std::size_t i = 0; i < bodies; ++i) {
        const std::size_t pair = i / (2 * width + 1), place = i % (2 * width + 1);
        const bool shifted = place >= width, first = place == width, last = place == 2 * width;
        const btScalar x = first  ? btScalar(-0.25)
                           : last ? btScalar(width) - btScalar(0.75)
                                  : btScalar(place % width) - btScalar(shifted ? 0.5 : 0);
        const btScalar y = btScalar(2 * pair + (shifted ? 1 : 0)) + btScalar(0.5);
        const bool half = first || last;
        add(*m_shapes[half ? 1 : 0], half ? btScalar(0.5) : btScalar(1), btTransform(btQuaternion::getIdentity(), btVector3(x, y, 0)));
    }
    plane(btVector3(0, 1, 0), 0);
}

void Scene::pile(std::size_t bodies) {
    m_shapes.push_back(std::make_unique<btBoxShape>(btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5))));
    m_shapes.push_back(std::make_unique<btSphereShape>(btScalar(0.5)));
    m_shapes.push_back(std::make_unique<btCapsuleShape>(btScalar(0.35), btScalar(0.6)));
    const std::size_t width = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(std::cbrt(static_cast<double>(bodies)))));
    std::uint32_t random = 1; // Numerical Recipes' quick generator
    const auto next = [&random] {
        random = 1664525u * random + 1013904223u;
        return btScalar(random >> 8) / btScalar(1 << 24) - btScalar(0.5);
    };
    constexpr btScalar pitch = btScalar(1.3);
    for (std::size_t i = 0; i < bodies; ++i) {
        const btVector3 cell(btScalar(i % width), btScalar(i / (width * width)), btScalar(i / width % width));
        const btScalar x = next(), z = next(), turn = next();
        const btVector3 place = pitch * cell + btVector3(btScalar(0.1) * x, btScalar(0.8), btScalar(0.1) * z);
        add(*m_shapes[i % 3], 1, btTransform(btQuaternion(btVector3(1, 1, 0).normalized(), btScalar(0.3) * turn), place));
    }
    const btScalar half = pitch / 2, side = pitch * btScalar(width - 1) + half;
    plane(btVector3(0, 1, 0), 0);
    plane(btVector3(1, 0, 0), -half);
    plane(btVector3(-1, 0, 0), -side);
    plane(btVector3(0, 0, 1), -half);
    plane(btVector3(0, 0, -1), -side);
}

void Scene::add(btCollisionShape& shape, btScalar mass, const btTransform& pose) {
    btVector3 inertia(0, 0, 0);
    if (mass > 0)
        shape.calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, &shape, inertia);
    info.m_startWorldTransform = pose;
    info.m_friction = btScalar(0.5);
    m_bodies.push_back(std::make_unique<btRigidBody>(info));
    m_bodies.back()->setActivationState(DISABLE_DEACTIVATION);
    m_world.addRigidBody(m_bodies.back().get());
    m_movable += mass > 0 ? 1 : 0;
}

void Scene::plane(const btVector3& normal, btScalar distance) {
    m_shapes.push_back(std::make_unique<btStaticPlaneShape>(normal, distance));
    add(*m_shapes.back(), 0, btTransform::getIdentity());
}

std::vector<State> Scene::state() const {
    std::vector<State> state;
    for (std::size_t i = 0; i < m_movable; ++i) {
        const btRigidBody& body = *m_bodies[i];
        state.push_back({body.getWorldTransform(), body.getLinearVelocity(), body.getAngularVelocity()});
    }
    return state;
}

void Scene::set(const std::vector<State>& state) {
    for (std::size_t i = 0; i < m_movable; ++i) {
        m_bodies[i]->setCenterOfMassTransform(state[i].pose);
        m_bodies[i]->setLinearVelocity(state[i].linear);
        m_bodies[i]->setAngularVelocity(state[i].angular);
    }
}

std::uint64_t Scene::hash() const {
    std::uint64_t hash = 14695981039346656037u; // FNV-1a, by words
    const auto mix = [&hash](const btVector3& v) {
        for (const btScalar part : {v.x(), v.y(), v.z()}) {
            std::uint64_t bits = 0;
            std::memcpy(&bits, &part, sizeof part);
            hash = (hash ^ bits) * 1099511628211u;
        }
    };
    for (std::size_t i = 0; i < m_movable; ++i) {
        const btRigidBody& body = *m_bodies[i];
        mix(body.getWorldTransform().getOrigin());
        for (int row = 0; row < 3; ++row)
            mix(body.getWorldTransform().getBasis().getRow(row));
        mix(body.getLinearVelocity());
        mix(body.getAngularVelocity());
    }
    return hash;
}

Scene::Depth Scene::depth() const {
    Depth depth;
    for (int i = 0; i < m_dispatcher.getNumManifolds(); ++i) {
        const btPersistentManifold& manifold = *const_cast<btCollisionDispatcher&>(m_dispatcher).getManifoldByIndexInternal(i);
        for (int j = 0; j < manifold.getNumContacts(); ++j) {
            const double deep = std::max(0.0, -static_cast<double>(manifold.getContactPoint(j).getDistance()));
            depth.worst = std::max(depth.worst, deep);
            depth.sum += deep;
            ++depth.points;
        }
    }
    return depth;
}

double Scene::farthestFrom(const std::vector<State>& places) const {
    btScalar worst = 0;
    for (std::size_t i = 0; i < m_movable; ++i)
        worst = std::max(worst, m_bodies[i]->getCenterOfMassPosition().distance(places[i].pose.getOrigin()));
    return static_cast<double>(worst);
}

double Scene::rmsSpeed() const {
    double sum = 0;
    for (std::size_t i = 0; i < m_movable; ++i)
        sum += static_cast<double>(m_bodies[i]->getLinearVelocity().length2());
    return m_movable > 0 ? std::sqrt(sum / static_cast<double>(m_movable)) : 0;
}

} // namespace cairn_bench
