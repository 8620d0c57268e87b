// A Bullet program's simulation: 150 boxes in 50 towers, and a heavy ball on a chain of hinges that stock stretches. It knows nothing of
// Cairn.
#pragma once
#include <btBulletDynamicsCommon.h>

#include <memory>
#include <vector>

struct Outcome {
    double widestGap = 0;   // of the chain, over the run
    double lowestTop = 1e9; // of the towers, at the end
};

inline Outcome simulate(btDiscreteDynamicsWorld& world, int steps) {
    world.setGravity(btVector3(0, btScalar(-9.81), 0));
    btBoxShape ground(btVector3(500, 1, 500)), cube(btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5)));
    btSphereShape sphere(btScalar(0.5));
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    const auto add = [&](btCollisionShape& shape, btScalar mass, const btVector3& place) {
        btVector3 inertia(0, 0, 0);
        if (mass > 0)
            shape.calculateLocalInertia(mass, inertia);
        bodies.push_back(std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(mass, nullptr, &shape, inertia)));
        bodies.back()->setWorldTransform(btTransform(btQuaternion::getIdentity(), place));
        bodies.back()->setActivationState(DISABLE_DEACTIVATION);
        world.addRigidBody(bodies.back().get());
        return bodies.back().get();
    };
    add(ground, 0, btVector3(0, -1, 0));
    std::vector<btRigidBody*> tops;
    for (int i = 0; i < 150; ++i) {
        btRigidBody* box = add(cube, 1, btVector3(btScalar(i / 3 * 3), btScalar(0.5) + btScalar(i % 3), 0));
        if (i % 3 == 2)
            tops.push_back(box);
    }
    std::vector<std::unique_ptr<btHingeConstraint>> hinges;
    btRigidBody* last = nullptr;
    const btVector3 left(btScalar(-0.5), 0, 0), right(btScalar(0.5), 0, 0), axis(0, 0, 1);
    for (int i = 0; i < 20; ++i) {
        btRigidBody* link = add(i == 19 ? static_cast<btCollisionShape&>(sphere) : cube, btScalar(i == 19 ? 300 : 1),
                                btVector3(btScalar(i) + btScalar(0.5), 60, 50));
        if (last)
            hinges.push_back(std::make_unique<btHingeConstraint>(*last, *link, right, left, axis, axis));
        else
            hinges.push_back(std::make_unique<btHingeConstraint>(*link, left, axis));
        world.addConstraint(hinges.back().get(), true);
        last = link;
    }
    Outcome outcome;
    for (int step = 0; step < steps; ++step) {
        world.stepSimulation(btScalar(1) / 60, 0);
        for (const std::unique_ptr<btHingeConstraint>& hinge : hinges) {
            const btVector3 a = hinge->getRigidBodyA().getCenterOfMassTransform() * hinge->getAFrame().getOrigin();
            const btVector3 b = hinge->getRigidBodyB().getCenterOfMassTransform() * hinge->getBFrame().getOrigin();
            outcome.widestGap = btMax(outcome.widestGap, static_cast<double>((a - b).length()));
        }
    }
    for (const btRigidBody* top : tops)
        outcome.lowestTop = btMin(outcome.lowestTop, static_cast<double>(top->getWorldTransform().getOrigin().y()));
    for (const std::unique_ptr<btHingeConstraint>& hinge : hinges)
        world.removeConstraint(hinge.get());
    for (const std::unique_ptr<btRigidBody>& body : bodies)
        world.removeRigidBody(body.get());
    return outcome;
}
