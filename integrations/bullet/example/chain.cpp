// A 300 kg ball on a chain of 1 kg links swings for five seconds, first behind Bullet's own solver and then behind Cairn:
// how far do the links come apart? The two worlds differ in one line, the solver.
#include <cairn/bullet.hpp>

#include <btBulletDynamicsCommon.h>

#include <cstdio>
#include <memory>
#include <vector>

namespace {

constexpr int kLinks = 20;
constexpr btScalar kDt = btScalar(1) / 60;

// The widest gap at any joint over the run, in metres.
btScalar widestGap(btConstraintSolver& solver, int iterations) {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity(btVector3(0, btScalar(-9.81), 0));
    world.getSolverInfo().m_numIterations = iterations;

    btBoxShape link(btVector3(btScalar(0.4), btScalar(0.1), btScalar(0.1)));
    btSphereShape ball(btScalar(1));
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    std::vector<std::unique_ptr<btHingeConstraint>> hinges;
    const btVector3 axis(0, 0, 1), left(btScalar(-0.5), 0, 0), right(btScalar(0.5), 0, 0);
    for (int i = 0; i <= kLinks; ++i) {
        const bool last = i == kLinks;
        btCollisionShape* shape = &link;
        if (last)
            shape = &ball;
        const btScalar mass = btScalar(last ? 300 : 1);
        btVector3 inertia;
        shape->calculateLocalInertia(mass, inertia);
        bodies.push_back(std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(mass, nullptr, shape, inertia)));
        btRigidBody& body = *bodies.back();
        body.setWorldTransform(btTransform(btQuaternion::getIdentity(), btVector3(btScalar(i) + btScalar(last ? 1 : 0.5), 0, 0)));
        body.setActivationState(DISABLE_DEACTIVATION);
        world.addRigidBody(&body, 1, 0); // the chain collides with nothing
        if (i == 0)
            hinges.push_back(std::make_unique<btHingeConstraint>(body, left, axis));
        else
            hinges.push_back(std::make_unique<btHingeConstraint>(*bodies[static_cast<std::size_t>(i) - 1], body, right,
                                                                 last ? btVector3(-1, 0, 0) : left, axis, axis));
        world.addConstraint(hinges.back().get());
    }

    btScalar widest = 0;
    for (int frame = 0; frame < 300; ++frame) {
        world.stepSimulation(kDt, 0);
        for (const std::unique_ptr<btHingeConstraint>& hinge : hinges) {
            const btVector3 a = hinge->getRigidBodyA().getCenterOfMassTransform() * hinge->getAFrame().getOrigin();
            const btVector3 b = hinge->getRigidBodyB().getCenterOfMassTransform() * hinge->getBFrame().getOrigin();
            widest = btMax(widest, (a - b).length());
        }
    }
    for (const std::unique_ptr<btHingeConstraint>& hinge : hinges)
        world.removeConstraint(hinge.get());
    for (const std::unique_ptr<btRigidBody>& body : bodies)
        world.removeRigidBody(body.get());
    return widest;
}

} // namespace

int main() {
    btSequentialImpulseConstraintSolver stock;
    std::printf("Bullet's own solver, 300 iterations: widest gap %.4f m\n", static_cast<double>(widestGap(stock, 300)));

    cairn::bullet::ConstraintSolver cairn(CAIRN_METHOD_TJ);
    const double gap = static_cast<double>(widestGap(cairn, 300)); // iterations of the whole step, as the preset has them
    if (cairn.lastStatus() != CAIRN_OK) {
        std::fprintf(stderr, "Cairn: %s\n", cairn.lastError());
        return 1;
    }
    std::printf("Cairn, TJ, %u substeps of %u iterations: widest gap %.4f m\n", cairn.params().substeps,
                cairn.params().iterations / cairn.params().substeps, gap);
    return 0;
}
