// Two Bullet worlds that grow, stepped through Bullet's own collision detection: a wall that should stand still and a pile that should
// come to rest. Metre-sized boxes of 1 kg, friction 0.5 on each body, dt 16 ms, sleeping off, Bullet's other settings as they come.
#pragma once
#include <btBulletDynamicsCommon.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace cairn_bench {

struct State {
    btTransform pose;
    btVector3 linear, angular;
};

class Scene {
  public:
    // wall: running bond, 8 boxes wide to 5 high, neighbours touch. pile: boxes, spheres and capsules in turn, dropped from a loose
    // lattice between four walls. `solver` is borrowed. Throws std::invalid_argument for another name.
    Scene(const std::string& name, std::size_t bodies, btConstraintSolver& solver);
    ~Scene();
    Scene(const Scene&) = delete;
    Scene& operator=(const Scene&) = delete;

    void step() { m_world.stepSimulation(btScalar(0.016), 0); }
    btContactSolverInfo& info() { return m_world.getSolverInfo(); }

    std::vector<State> state() const;
    void set(const std::vector<State>& state);
    std::uint64_t hash() const; // of the movable bodies' poses and velocities, by their bits

    // m: how deep contact points were when the last step began; a point apart counts as 0 in the mean.
    struct Depth {
        double worst = 0, sum = 0;
        std::size_t points = 0;
    };
    Depth depth() const;
    double farthestFrom(const std::vector<State>& places) const; // m
    double rmsSpeed() const;                                     // m/s; of linear velocities

  private:
    void wall(std::size_t bodies);
    void pile(std::size_t bodies);
    void add(btCollisionShape& shape, btScalar mass, const btTransform& pose);
    void plane(const btVector3& normal, btScalar distance);

    btDefaultCollisionConfiguration m_configuration;
    btCollisionDispatcher m_dispatcher{&m_configuration};
    btDbvtBroadphase m_broadphase;
    std::vector<std::unique_ptr<btCollisionShape>> m_shapes;
    std::vector<std::unique_ptr<btRigidBody>> m_bodies; // static ones last
    std::size_t m_movable = 0;
    btDiscreteDynamicsWorld m_world;
};

} // namespace cairn_bench
