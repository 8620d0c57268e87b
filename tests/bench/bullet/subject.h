// A scene behind a solver whose time is taken, part by part.
#pragma once
#include "../stock_solver.h"
#include "scene.h"

#include <cairn/bullet.hpp>

#include <chrono>
#include <stdexcept>

namespace cairn_bench {

// Seconds of one step. Stock builds its rows as it gathers; libcairn does that on its own side, so there it is of the solver's rest.
struct StepTimes {
    double step = 0;   // all of stepSimulation()
    double solver = 0; // of it, all inside the btConstraintSolver
    double gather = 0, scatter = 0;
    double sweeps = 0; // velocity iterations alone
};

class Subject {
  public:
    virtual ~Subject() = default;
    Scene& scene() { return *m_scene; }
    StepTimes step() {
        const auto start = std::chrono::steady_clock::now();
        m_scene->step();
        const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        StepTimes times = solverTimes();
        times.step = wall;
        return times;
    }
    virtual std::size_t points() const = 0;

  protected:
    virtual StepTimes solverTimes() = 0;
    std::unique_ptr<Scene> m_scene;
};

class StockSubject final : public Subject {
  public:
    StockSubject(const std::string& name, std::size_t bodies, int iterations) {
        m_scene = std::make_unique<Scene>(name, bodies, m_solver);
        m_scene->info().m_numIterations = iterations;
    }
    ~StockSubject() override { m_scene.reset(); } // before its solver
    std::size_t points() const override { return static_cast<std::size_t>(m_solver.cost.points); }

  private:
    class Solver final : public StockSolver {
      public:
        double setup = 0, finish = 0;
        void prepareSolve(int numBodies, int numManifolds) override {
            setup = finish = 0;
            StockSolver::prepareSolve(numBodies, numManifolds);
        }

      protected:
        btScalar solveGroupCacheFriendlySetup(btCollisionObject** bodies, int numBodies, btPersistentManifold** manifolds, int numManifolds,
                                              btTypedConstraint** constraints, int numConstraints, const btContactSolverInfo& info,
                                              btIDebugDraw* drawer) override {
            double cpu = 0;
            const Span span(setup, cpu);
            return StockSolver::solveGroupCacheFriendlySetup(bodies, numBodies, manifolds, numManifolds, constraints, numConstraints, info,
                                                             drawer);
        }
        btScalar solveGroupCacheFriendlyFinish(btCollisionObject** bodies, int numBodies, const btContactSolverInfo& info) override {
            double cpu = 0;
            const Span span(finish, cpu);
            return StockSolver::solveGroupCacheFriendlyFinish(bodies, numBodies, info);
        }
    };
    StepTimes solverTimes() override {
        StepTimes times;
        times.solver = m_solver.cost.seconds;
        times.gather = m_solver.setup;
        times.scatter = m_solver.finish;
        times.sweeps = m_solver.cost.sweep;
        return times;
    }
    Solver m_solver;
};

class CairnSubject final : public Subject {
  public:
    // The preset `default` of tjsoft; threads: 0, all. Throws std::runtime_error, as its steps do, with libcairn's text.
    CairnSubject(const std::string& name, std::size_t bodies, std::uint32_t threads) {
        cairn_config config = {};
        config.struct_size = sizeof config;
        config.threads = threads;
        m_solver = std::make_unique<Timed<cairn::bullet::ConstraintSolver>>(CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, &config);
        check();
        m_scene = std::make_unique<Scene>(name, bodies, *m_solver);
    }
    ~CairnSubject() override { m_scene.reset(); }
    std::size_t points() const override { return m_solver->statistics().contacts; }
    // Substeps of ten sweeps, as the preset has them, and one of fewer.
    void setIterations(std::uint32_t iterations) {
        cairn_params params = m_solver->params();
        params.iterations = std::max(1u, iterations);
        params.substeps = std::max(1u, (iterations + 5) / 10);
        m_solver->setParams(params);
        check();
    }
    const cairn_params& params() const { return m_solver->params(); }
    std::uint32_t threads() const { return m_solver->statistics().threads; }

  private:
    void check() const {
        if (m_solver->lastStatus() != CAIRN_OK)
            throw std::runtime_error(m_solver->lastError());
    }
    StepTimes solverTimes() override {
        check();
        StepTimes times;
        times.solver = m_solver->cost.seconds;
        times.gather = m_solver->copyTimes().gather;
        times.scatter = m_solver->copyTimes().scatter;
        times.sweeps = m_solver->statistics().time_sweep;
        return times;
    }
    std::unique_ptr<Timed<cairn::bullet::ConstraintSolver>> m_solver;
};

} // namespace cairn_bench
