// The scene stack-1m in a Bullet world: 5 x 5 x 5 boxes of 1 m and 1 kg on a plane, no gaps, friction 0.5 on each body.
#pragma once
#include "stock_solver.h"

#include <cairn/bullet.hpp>

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

namespace cairn_bench {

constexpr int kIterations = 300;

class StackWorld {
  public:
    explicit StackWorld(std::unique_ptr<btConstraintSolver> solver, bool twoFrictionDirections = false) : m_solver(std::move(solver)) {
        m_world.setGravity(btVector3(0, btScalar(-9.81), 0));
        m_world.getSolverInfo().m_numIterations = kIterations;
        if (twoFrictionDirections)
            m_world.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
        add(m_plane, 0, btVector3(0, 0, 0));
        for (int y = 0; y < 5; ++y)
            for (int z = 0; z < 5; ++z)
                for (int x = 0; x < 5; ++x)
                    add(m_box, 1, btVector3(btScalar(x - 2), btScalar(y) + btScalar(0.5), btScalar(z - 2)));
    }
    ~StackWorld() {
        for (std::unique_ptr<btRigidBody>& body : m_bodies)
            m_world.removeRigidBody(body.get());
    }
    StackWorld(const StackWorld&) = delete;
    StackWorld& operator=(const StackWorld&) = delete;

    void step() { m_world.stepSimulation(btScalar(0.016), 0); }

    // m: how far the box that strayed most is from where it started
    double worstDrift() const {
        btScalar worst = 0;
        for (std::size_t i = 0; i < m_bodies.size(); ++i)
            worst = std::max(worst, m_bodies[i]->getCenterOfMassPosition().distance(m_places[i]));
        return static_cast<double>(worst);
    }

  private:
    void add(btCollisionShape& shape, btScalar mass, const btVector3& place) {
        btVector3 inertia(0, 0, 0);
        if (mass > 0)
            shape.calculateLocalInertia(mass, inertia);
        btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, &shape, inertia);
        info.m_startWorldTransform.setOrigin(place);
        info.m_friction = btScalar(0.5);
        m_bodies.push_back(std::make_unique<btRigidBody>(info));
        m_places.push_back(place);
        m_bodies.back()->setActivationState(DISABLE_DEACTIVATION);
        m_world.addRigidBody(m_bodies.back().get());
    }

    btDefaultCollisionConfiguration m_configuration;
    btCollisionDispatcher m_dispatcher{&m_configuration};
    btDbvtBroadphase m_broadphase;
    std::unique_ptr<btConstraintSolver> m_solver;
    btStaticPlaneShape m_plane{btVector3(0, 1, 0), 0};
    btBoxShape m_box{btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5))};
    std::vector<std::unique_ptr<btRigidBody>> m_bodies;
    std::vector<btVector3> m_places;
    btDiscreteDynamicsWorld m_world{&m_dispatcher, &m_broadphase, m_solver.get(), &m_configuration};
};

} // namespace cairn_bench
