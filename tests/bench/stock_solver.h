// What a solver behind Bullet spends, and stock Bullet's, which tells what it iterates over.
#pragma once
#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolver.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <string>

namespace cairn_bench {

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
        cost.rows += m_tmpSolverNonContactConstraintPool.size() + m_tmpSolverContactConstraintPool.size() +
                     m_tmpSolverContactFrictionConstraintPool.size() + m_tmpSolverContactRollingFrictionConstraintPool.size();
        cost.manifolds += numManifolds;
        double cpu = 0;
        const Span span(cost.sweep, cpu);
        const btScalar result = btSequentialImpulseConstraintSolver::solveGroupCacheFriendlyIterations(
            bodies, numBodies, manifolds, numManifolds, constraints, numConstraints, info, debugDrawer);
        cost.iterations = std::max(cost.iterations, static_cast<double>(m_analyticsData.m_numIterationsUsed));
        return result;
    }
};

// "3.24, scalar rows, floats"
inline std::string bulletDescription() {
    const int minor = BT_BULLET_VERSION % 100;
    StockSolver stock;
    return std::to_string(BT_BULLET_VERSION / 100) + (minor < 10 ? ".0" : ".") + std::to_string(minor) + ", " + stock.arithmetic() +
           " rows, " + (sizeof(btScalar) == sizeof(float) ? "floats" : "doubles");
}

} // namespace cairn_bench
