// The scene stack-1m in a Bullet world: 5 x 5 x 5 boxes of 1 m and 1 kg on a plane, no gaps, friction 0.5 on each body.
#pragma once
#include <cairn/bullet.hpp>

#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolver.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

namespace cairn_bench {

constexpr int kIterations = 300;

// What a solver did in a step. Its time runs from its being called to its returning, over every call of a step.
struct Cost {
    double seconds = 0, cpu = 0; // wall clock; processor time, of all threads
    double sweep = 0;            // of seconds: the iterations alone
    double points = 0, rows = 0, manifolds = 0, iterations = 0;
};

class Span {
  public:
    Span(double& wall, double& cpu) : m_wall(wall), m_cpu(cpu) {}
    ~Span() {
        m_wall += std::chrono::duration<double>(std::chrono::steady_clock::now() - m_wallStart).count();
        m_cpu += static_cast<double>(std::clock() - m_cpuStart) / CLOCKS_PER_SEC;
    }
    Span(const Span&) = delete;
    Span& operator=(const Span&) = delete;

  private:
    double &m_wall, &m_cpu;
    std::chrono::steady_clock::time_point m_wallStart = std::chrono::steady_clock::now();
    std::clock_t m_cpuStart = std::clock();
};

template <class Solver> class Timed : public Solver {
  public:
    using Solver::Solver;
    Cost cost;

    void prepareSolve(int numBodies, int numManifolds) override {
        cost = Cost();
        const Span span(cost.seconds, cost.cpu);
        Solver::prepareSolve(numBodies, numManifolds);
    }
    btScalar solveGroup(btCollisionObject** bodies, int numBodies, btPersistentManifold** manifolds, int numManifolds,
                        btTypedConstraint** constraints, int numConstraints, const btContactSolverInfo& info, btIDebugDraw* debugDrawer,
                        btDispatcher* dispatcher) override {
        const Span span(cost.seconds, cost.cpu);
        return Solver::solveGroup(bodies, numBodies, manifolds, numManifolds, constraints, numConstraints, info, debugDrawer, dispatcher);
    }
    void allSolved(const btContactSolverInfo& info, btIDebugDraw* debugDrawer) override {
        const Span span(cost.seconds, cost.cpu);
        Solver::allSolved(info, debugDrawer);
    }
};

// Bullet's own, which empties its rows on return: they are counted just before it iterates over them.
class StockSolver : public Timed<btSequentialImpulseConstraintSolver> {
  public:
    const char* arithmetic() { return getActiveConstraintRowSolverGeneric() == getScalarConstraintRowSolverGeneric() ? "scalar" : "SSE"; }

  protected:
    btScalar solveGroupCacheFriendlyIterations(btCollisionObject** bodies, int numBodies, btPersistentManifold** manifolds,
                                               int numManifolds, btTypedConstraint** constraints, int numConstraints,
                                               const btContactSolverInfo& info, btIDebugDraw* debugDrawer) override {
        cost.points += m_tmpSolverContactConstraintPool.size();
        cost.rows += m_tmpSolverContactConstraintPool.size() + m_tmpSolverContactFrictionConstraintPool.size() +
                     m_tmpSolverContactRollingFrictionConstraintPool.size();
        cost.manifolds += numManifolds;
        double cpu = 0;
        const Span span(cost.sweep, cpu);
        const btScalar result = btSequentialImpulseConstraintSolver::solveGroupCacheFriendlyIterations(
            bodies, numBodies, manifolds, numManifolds, constraints, numConstraints, info, debugDrawer);
        cost.iterations = std::max(cost.iterations, static_cast<double>(m_analyticsData.m_numIterationsUsed));
        return result;
    }
};

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
