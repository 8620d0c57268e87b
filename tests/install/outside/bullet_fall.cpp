// A ball falls on a plane in Bullet's world with Cairn as its solver, and lies there. Returns 0 if so.
#include <cairn/bullet.hpp>

#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <cstdio>

int main() {
    cairn::bullet::ConstraintSolver solver(CAIRN_METHOD_TJSOFT);
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity(btVector3(0, btScalar(-9.81), 0));

    btStaticPlaneShape plane(btVector3(0, 1, 0), 0);
    btSphereShape sphere(btScalar(0.5));
    btRigidBody ground(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane));
    btDefaultMotionState state(btTransform(btQuaternion::getIdentity(), btVector3(0, 2, 0)));
    btRigidBody ball(btRigidBody::btRigidBodyConstructionInfo(1, &state, &sphere, btVector3(1, 1, 1) * btScalar(0.1)));
    world.addRigidBody(&ground);
    world.addRigidBody(&ball);

    for (int frame = 0; frame < 180; ++frame)
        world.stepSimulation(btScalar(1) / 60, 0);
    const double height = static_cast<double>(ball.getCenterOfMassPosition().y());
    world.removeRigidBody(&ball);
    world.removeRigidBody(&ground);

    std::printf("height %g m, radius 0.5 m\n", height);
    return solver.lastStatus() == CAIRN_OK && std::fabs(height - 0.5) < 0.01 ? 0 : 1;
}
