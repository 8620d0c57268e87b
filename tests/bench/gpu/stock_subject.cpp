#include "subject.h"

#ifdef CAIRN_BENCH_BULLET

#include "../stock_solver.h"

#include <btBulletDynamicsCommon.h>

namespace cairn_bench {
namespace {

btVector3 vectorAt(const std::vector<float>& values, std::size_t i) {
    return btVector3(btScalar(values[3 * i]), btScalar(values[3 * i + 1]), btScalar(values[3 * i + 2]));
}
btVector3 inverse(const btVector3& v) { return btVector3(1 / v.x(), 1 / v.y(), 1 / v.z()); }

// The solver alone, called as a world calls it for one group: no collision detection, no shapes.
class StockSubject final : public Subject {
  public:
    StockSubject(const World& world, int iterations) : m_world(world) {
        m_info.m_timeStep = btScalar(world.dt);
        m_info.m_numIterations = iterations;
        m_info.m_solverMode &= ~SOLVER_USE_WARMSTARTING; // the same work in every run
        const std::size_t count = world.bodies();
        m_bodies.reserve(count + 1);
        for (std::size_t i = 0; i < count; ++i) {
            const btScalar mass = 1 / btScalar(world.inverseMass[i]);
            m_bodies.push_back(std::make_unique<btRigidBody>(mass, nullptr, nullptr, inverse(vectorAt(world.inverseInertia, i))));
            m_bodies.back()->applyCentralForce(btVector3(0, mass * btScalar(world.gravity), 0));
        }
        m_bodies.push_back(std::make_unique<btRigidBody>(btScalar(0), nullptr, nullptr)); // the world
        for (std::size_t i = 0; i <= count; ++i)
            m_objects.push_back(m_bodies[i].get());
        for (const Manifold& manifold : manifoldsOf(world))
            add(manifold);
        for (std::size_t i = 0; i < world.joints(); ++i) {
            const btVector3 axis(0, 0, 1), pivotA = vectorAt(world.anchorA, i), pivotB = vectorAt(world.anchorB, i);
            m_hinges.push_back(
                std::make_unique<btHingeConstraint>(body(world.jointA[i]), body(world.jointB[i]), pivotA, pivotB, axis, axis));
            m_constraints.push_back(m_hinges.back().get());
        }
    }

    Spent step() override {
        for (std::size_t i = 0; i < m_world.bodies(); ++i) { // as they were: the solver moves them
            btRigidBody& moved = *m_bodies[i];
            const std::vector<float>& q = m_world.orientation;
            const btQuaternion turn(btScalar(q[4 * i]), btScalar(q[4 * i + 1]), btScalar(q[4 * i + 2]), btScalar(q[4 * i + 3]));
            moved.setCenterOfMassTransform(btTransform(turn, vectorAt(m_world.position, i)));
            moved.setLinearVelocity(vectorAt(m_world.linearVelocity, i));
            moved.setAngularVelocity(vectorAt(m_world.angularVelocity, i));
        }
        const int bodies = static_cast<int>(m_objects.size()), manifolds = static_cast<int>(m_manifoldPointers.size());
        m_solver.prepareSolve(bodies, manifolds);
        m_solver.solveGroup(m_objects.data(), bodies, m_manifoldPointers.data(), manifolds, m_constraints.data(),
                            static_cast<int>(m_constraints.size()), m_info, nullptr, nullptr);
        m_solver.allSolved(m_info, nullptr);
        Spent spent;
        spent.total = m_solver.cost.seconds;
        spent.iterations = m_solver.cost.sweep;
        return spent;
    }

    Done done() const override {
        Done done;
        done.bodies = static_cast<std::uint32_t>(m_world.bodies());
        done.points = static_cast<std::uint32_t>(m_solver.cost.points);
        done.manifolds = static_cast<std::uint32_t>(m_solver.cost.manifolds);
        done.joints = static_cast<std::uint32_t>(m_constraints.size());
        done.rows = static_cast<std::uint32_t>(m_solver.cost.rows);
        done.iterations = static_cast<std::uint32_t>(m_solver.cost.iterations);
        return done;
    }

    double fastest() const override {
        btScalar square = 0;
        for (const std::unique_ptr<btRigidBody>& moved : m_bodies)
            square = std::max(square, moved->getLinearVelocity().length2());
        return static_cast<double>(btSqrt(square));
    }

  private:
    btRigidBody& body(std::int32_t index) { return *m_bodies[index < 0 ? m_bodies.size() - 1 : static_cast<std::size_t>(index)]; }
    void add(const Manifold& manifold) {
        const std::int32_t a = m_world.bodyA[manifold.first], b = m_world.bodyB[manifold.first];
        // Bullet's normal points from its body 1 to its body 0.
        m_manifolds.push_back(std::make_unique<btPersistentManifold>(&body(b), &body(a), 0, btScalar(0.02), BT_LARGE_FLOAT));
        btPersistentManifold& made = *m_manifolds.back();
        const auto centre = [&](std::int32_t i) {
            return i < 0 ? btVector3(0, 0, 0) : vectorAt(m_world.position, static_cast<std::size_t>(i));
        };
        made.setNumContacts(static_cast<int>(manifold.count));
        for (std::size_t i = 0; i < manifold.count; ++i) {
            const std::size_t at = manifold.first + i;
            btManifoldPoint& point = made.getContactPoint(static_cast<int>(i));
            point = btManifoldPoint(btVector3(0, 0, 0), btVector3(0, 0, 0), vectorAt(m_world.normal, at), btScalar(m_world.separation[at]));
            point.m_positionWorldOnA = centre(b) + vectorAt(m_world.armB, at);
            point.m_positionWorldOnB = centre(a) + vectorAt(m_world.armA, at);
            point.m_combinedFriction = btScalar(m_world.friction[at]);
        }
        m_manifoldPointers.push_back(&made);
    }

    const World& m_world;
    btContactSolverInfo m_info;
    StockSolver m_solver;
    std::vector<std::unique_ptr<btRigidBody>> m_bodies; // the last is the world
    std::vector<std::unique_ptr<btPersistentManifold>> m_manifolds;
    std::vector<std::unique_ptr<btHingeConstraint>> m_hinges;
    std::vector<btCollisionObject*> m_objects;
    std::vector<btPersistentManifold*> m_manifoldPointers;
    std::vector<btTypedConstraint*> m_constraints;
};

} // namespace

std::string bulletVersion() { return bulletDescription(); }

std::unique_ptr<Subject> stockSubject(const World& world, int iterations) { return std::make_unique<StockSubject>(world, iterations); }

} // namespace cairn_bench

#else

std::string cairn_bench::bulletVersion() { return {}; }
std::unique_ptr<cairn_bench::Subject> cairn_bench::stockSubject(const World&, int) { return nullptr; }

#endif
