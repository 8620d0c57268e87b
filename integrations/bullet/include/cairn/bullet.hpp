// Cairn behind Bullet: a btConstraintSolver that hands every contact and constraint of a world to libcairn.
//
//     cairn::bullet::ConstraintSolver solver(CAIRN_METHOD_TJSOFT);
//     btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
//     world.stepSimulation(dt, 0); // nothing else changes
//
// Compiled inside the application's build, in C++14, with the application's own definition of btScalar. It computes
// nothing that decides a result: it gathers Bullet's state, calls the C interface (cairn/cairn.h), and scatters what
// comes back. README.md beside this folder says what is honoured and what differs from the stock solver.
#ifndef CAIRN_BULLET_HPP
#define CAIRN_BULLET_HPP

#include <cairn/cairn.h>

#include <BulletDynamics/ConstraintSolver/btConstraintSolver.h>

#include <memory>
#include <vector>

class btCollisionWorld;
class btDynamicsWorld;
class btITaskScheduler;

namespace cairn {
namespace bullet {

// What an application that has changed btContactSolverInfo expects of a preset: fields at Bullet's defaults leave `preset` as it
// is, the others move it. README.md has the table. Nothing is checked: cairn_solver_set_params() does that.
cairn_params fromBullet(const btContactSolverInfo& info, const cairn_params& preset);

// `config` with Bullet's task scheduler (btGetTaskScheduler(), or one of your own) for the CPU sweeps, which else have threads of
// their own; results are the same. NULL, which a Bullet without BT_THREADSAFE may give, changes nothing. It takes the `user` of all
// hooks. The scheduler is borrowed for the solver's life, the count of its threads is today's. For a solver inside a
// btConstraintSolverPoolMt take threads = 1 instead: the pool is parallel itself.
cairn_config onTaskScheduler(btITaskScheduler* scheduler, const cairn_config* config = nullptr);

class ConstraintSolver : public btConstraintSolver {
  public:
    // Called once for each new kind of trouble; `text` lives until the call returns. See setErrorCallback().
    using ErrorCallback = void (*)(void* user, cairn_status status, const char* text);

    // `config` as in cairn_solver_create(), NULL for the defaults. Never throws for a reason of Cairn's: look at
    // lastStatus() if it matters whether a solver could be made.
    explicit ConstraintSolver(uint32_t method = CAIRN_METHOD_TJSOFT, uint32_t preset = CAIRN_PRESET_DEFAULT,
                              const cairn_config* config = nullptr);
    ~ConstraintSolver() override;
    ConstraintSolver(const ConstraintSolver&) = delete;
    ConstraintSolver& operator=(const ConstraintSolver&) = delete;

    // A method with the parameters of a preset (CAIRN_METHOD_..., CAIRN_PRESET_...), which follow the world's
    // btContactSolverInfo (fromBullet) in every step.
    cairn_status setMethod(uint32_t method, uint32_t preset = CAIRN_PRESET_DEFAULT);
    // Parameters as they are: btContactSolverInfo no longer moves them, until followInfo(true) or setMethod(). But
    // `restitution_threshold` is always its m_restitutionVelocityThreshold, and `iterations` the largest that a constraint asks for with
    // setOverrideNumSolverIterations(), if that is more.
    cairn_status setParams(const cairn_params& params);
    void followInfo(bool follow);
    // As set, before btContactSolverInfo moves them. handle() has those of the last step.
    const cairn_params& params() const;

    // What the last step did (the last call to libcairn, where a world makes several in a step).
    cairn_statistics statistics() const;
    // What that call took beside libcairn, in seconds: Bullet's state into tables, and results back.
    struct CopyTimes {
        double gather, scatter;
    };
    CopyTimes copyTimes() const;
    // For what has no call here: residual traces, split counts, saving the cache. NULL if creation failed.
    cairn_solver* handle() const;

    // Bullet cannot be told of an error, and nothing is thrown through it: a step that libcairn refuses leaves every
    // velocity and pose as it was (Bullet then moves the bodies freely), is kept here until the next step, and is
    // reported: to the callback or, without one, to stderr; an error that repeats is reported once.
    cairn_status lastStatus() const;
    const char* lastError() const;
    void setErrorCallback(ErrorCallback callback, void* user);

    // btConstraintSolver. Between prepareSolve() and allSolved() the groups are collected and solved together; a group
    // that comes without prepareSolve() (a btConstraintSolverPoolMt does that) is solved at once.
    void prepareSolve(int numBodies, int numManifolds) override;
    btScalar solveGroup(btCollisionObject** bodies, int numBodies, btPersistentManifold** manifolds, int numManifolds,
                        btTypedConstraint** constraints, int numConstraints, const btContactSolverInfo& info, btIDebugDraw* debugDrawer,
                        btDispatcher* dispatcher) override;
    void allSolved(const btContactSolverInfo& info, btIDebugDraw* debugDrawer) override;

    // Where the bodies land: after the solve the world integrates once more, so without more ado the solver leaves poses
    // from which it lands on the substeps' end. attach() makes the landing exact instead and the way to it straight: the
    // solver leaves the step's average velocity, the world integrates (and sweeps, for CCD) along the real way, and an action
    // then sets the end's poses and velocities. What other actions add to velocities is kept, but they see the average unless
    // they were added later. The world must outlive its last step with the solver; detach() before one goes on without the other.
    void attach(btDynamicsWorld& world);
    void detach();

    // attach() by hand, for a world class of your own (LandingWorld below is one): landLater(true) once, then land() after each
    // integrateTransforms(). Nothing in the world's bodies or the solver may be touched by another thread meanwhile.
    void landLater(bool later);
    void land(btCollisionWorld& world);

    // Forgets the impulses kept for warm starts.
    void reset() override;
    btConstraintSolverType getSolverType() const override { return BT_SEQUENTIAL_IMPULSE_SOLVER; }

  private:
    struct Implementation;
    std::unique_ptr<Implementation> m_implementation;
};

// A world class that lands exactly before its first action runs, so that every action sees the velocities of the step's end:
//     LandingWorld<btDiscreteDynamicsWorld> world(&dispatcher, &broadphase, &solver, &configuration);
//     world.land(solver); // each solver that serves it: all of a btDiscreteDynamicsWorldMt's pool, and the one for large islands
template <class World> class LandingWorld : public World {
  public:
    using World::World;

    // Borrowed: the solver must live as long as the world steps.
    void land(ConstraintSolver& solver) {
        solver.landLater(true);
        m_solvers.push_back(&solver);
    }

  protected:
    void integrateTransforms(btScalar timeStep) override {
        World::integrateTransforms(timeStep);
        for (ConstraintSolver* solver : m_solvers)
            solver->land(*this);
    }

  private:
    std::vector<ConstraintSolver*> m_solvers;
};

} // namespace bullet
} // namespace cairn
#endif
