// A small Bullet world for tests: behind Cairn, or behind Bullet's own solver to compare with.
#pragma once
#include <cairn/bullet.hpp>

#include <btBulletDynamicsCommon.h>

#include <memory>
#include <utility>
#include <vector>

constexpr btScalar kDt = btScalar(1) / 60;
constexpr bool kDouble = sizeof(btScalar) == sizeof(double);

enum class Behind { stock, cairn };
enum class Landing { preImage, action, mixin }; // the adapter's three ways to end a step where the substeps did

constexpr Landing kLandings[] = {Landing::preImage, Landing::action, Landing::mixin};

class TestWorld {
  public:
    explicit TestWorld(Behind behind = Behind::cairn, const btVector3& gravity = btVector3(0, btScalar(-9.81), 0),
                       Landing landing = Landing::preImage, uint32_t threads = 1) {
        cairn_config config = {};
        config.struct_size = sizeof config;
        config.threads = threads;
        if (behind == Behind::cairn) {
            auto made = std::make_unique<cairn::bullet::ConstraintSolver>(CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, &config);
            cairn = made.get();
            solver = std::move(made);
        } else {
            solver = std::make_unique<btSequentialImpulseConstraintSolver>();
        }
        if (landing == Landing::mixin) {
            using World = cairn::bullet::LandingWorld<btDiscreteDynamicsWorld>;
            auto made = std::make_unique<World>(&dispatcher, &broadphase, solver.get(), &configuration);
            made->land(*cairn);
            world = std::move(made);
        } else {
            world = std::make_unique<btDiscreteDynamicsWorld>(&dispatcher, &broadphase, solver.get(), &configuration);
            if (landing == Landing::action)
                cairn->attach(*world);
        }
        world->setGravity(gravity);
        world->getSolverInfo().m_numIterations = 100;
    }
    ~TestWorld() {
        for (const std::unique_ptr<btTypedConstraint>& constraint : constraints)
            world->removeConstraint(constraint.get());
        for (const std::unique_ptr<btRigidBody>& body : bodies)
            world->removeRigidBody(body.get());
    }
    TestWorld(const TestWorld&) = delete;
    TestWorld& operator=(const TestWorld&) = delete;

    btRigidBody& add(std::unique_ptr<btCollisionShape> shape, btScalar mass, const btTransform& pose, bool sleeps = false,
                     bool additionalDamping = false) {
        btVector3 inertia(0, 0, 0);
        if (mass > 0)
            shape->calculateLocalInertia(mass, inertia);
        btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape.get(), inertia);
        info.m_startWorldTransform = pose;
        info.m_additionalDamping = additionalDamping;
        bodies.push_back(std::make_unique<btRigidBody>(info));
        shapes.push_back(std::move(shape));
        if (!sleeps && mass > 0)
            bodies.back()->setActivationState(DISABLE_DEACTIVATION);
        world->addRigidBody(bodies.back().get());
        return *bodies.back();
    }
    btRigidBody& box(btScalar mass, const btVector3& position,
                     const btVector3& half = btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5))) {
        return add(std::make_unique<btBoxShape>(half), mass, btTransform(btQuaternion::getIdentity(), position));
    }
    btRigidBody& floor() { return box(0, btVector3(0, -1, 0), btVector3(50, 1, 50)); }

    template <class Constraint> Constraint& join(std::unique_ptr<Constraint> constraint) {
        Constraint& joined = *constraint;
        world->addConstraint(constraint.get(), true);
        constraints.push_back(std::move(constraint));
        return joined;
    }

    void step(int count = 1) {
        for (int i = 0; i < count; ++i)
            world->stepSimulation(kDt, 0);
    }

    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    std::unique_ptr<btConstraintSolver> solver;
    cairn::bullet::ConstraintSolver* cairn = nullptr;
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    std::vector<std::unique_ptr<btTypedConstraint>> constraints;
    std::unique_ptr<btDiscreteDynamicsWorld> world;
};

inline btTransform at(btScalar x, btScalar y, btScalar z) { return btTransform(btQuaternion::getIdentity(), btVector3(x, y, z)); }
