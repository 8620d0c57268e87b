// bullet_program KIND STEPS: simulates behind a solver of that kind, prints "gap top" in full precision, and exits with 7.
#include "scene.h"

#include <BulletDynamics/ConstraintSolver/btNNCGConstraintSolver.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorldMt.h>
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btMLCPSolver.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

struct Derived : btSequentialImpulseConstraintSolver {};

// Steps without Bullet's own internalSingleStepSimulation().
struct OwnWorld : btDiscreteDynamicsWorld {
    using btDiscreteDynamicsWorld::btDiscreteDynamicsWorld;
    void internalSingleStepSimulation(btScalar dt) override {
        predictUnconstraintMotion(dt);
        performDiscreteCollisionDetection();
        calculateSimulationIslands();
        getSolverInfo().m_timeStep = dt;
        solveConstraints(getSolverInfo());
        integrateTransforms(dt);
    }
};

template <class World = btDiscreteDynamicsWorld> Outcome behind(btConstraintSolver& solver, int steps) {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    World world(&dispatcher, &broadphase, &solver, &configuration);
    return simulate(world, steps);
}

} // namespace

int run(const std::string& kind, int steps) {
    Outcome outcome;
    if (kind == "plain") {
        btSequentialImpulseConstraintSolver solver;
        outcome = behind(solver, steps);
    } else if (kind == "own") {
        btSequentialImpulseConstraintSolver solver;
        outcome = behind<OwnWorld>(solver, steps);
    } else if (kind == "nncg") {
        btNNCGConstraintSolver solver;
        outcome = behind(solver, steps);
    } else if (kind == "mlcp") {
        btDantzigSolver dantzig;
        btMLCPSolver solver(&dantzig);
        outcome = behind(solver, steps);
    } else if (kind == "derived") {
        Derived solver;
        outcome = behind(solver, steps);
    } else if (kind == "again") { // three in a row, on the heap and on the stack: some get the address of one before
        for (int i = 0; i < 3; ++i) {
            btConstraintSolver* solver = new btSequentialImpulseConstraintSolver;
            behind(*solver, steps);
            delete solver;
            btSequentialImpulseConstraintSolver another;
            outcome = behind(another, steps);
        }
    } else if (kind == "pool") {
        btDefaultCollisionConfiguration configuration;
        btCollisionDispatcher dispatcher(&configuration);
        btDbvtBroadphase broadphase;
        btConstraintSolverPoolMt pool(2);
        btDiscreteDynamicsWorldMt world(&dispatcher, &broadphase, &pool, nullptr, &configuration);
        outcome = simulate(world, steps);
    } else {
        return 1;
    }
    std::printf("%.17g %.17g\n", outcome.widestGap, outcome.lowestTop);
    return 7;
}

#ifdef AS_PLUGIN // for a host that loads it late
extern "C" int bullet_plugin(const char* kind, int steps) { return run(kind, steps); }
#else
int main(int argc, char** argv) { return argc == 3 ? run(argv[1], std::atoi(argv[2])) : 1; }
#endif
