#include "bullet_module_world.h"

#include <btBulletDynamicsCommon.h>

#include <BulletDynamics/ConstraintSolver/btFixedConstraint.h>
#include <BulletDynamics/ConstraintSolver/btNNCGConstraintSolver.h>
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btMLCPSolver.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace cairn_bullet {
namespace {

using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// Any solver, with the time between its being called and its returning, both of solveGroup and of allSolved: for the stock
// solvers that is solveGroup, for Cairn (which collects the groups) the sum.
template <class Solver> class Timed : public Solver {
  public:
    template <class... Arguments>
    explicit Timed(double& seconds, Arguments&&... arguments) : Solver(std::forward<Arguments>(arguments)...), m_seconds(seconds) {}

    btScalar solveGroup(btCollisionObject** bodies, int numBodies, btPersistentManifold** manifolds, int numManifolds,
                        btTypedConstraint** constraints, int numConstraints, const btContactSolverInfo& info, btIDebugDraw* debugDrawer,
                        btDispatcher* dispatcher) override {
        const Clock::time_point start = Clock::now();
        const btScalar result =
            Solver::solveGroup(bodies, numBodies, manifolds, numManifolds, constraints, numConstraints, info, debugDrawer, dispatcher);
        m_seconds += secondsSince(start);
        return result;
    }
    void allSolved(const btContactSolverInfo& info, btIDebugDraw* debugDrawer) override {
        const Clock::time_point start = Clock::now();
        Solver::allSolved(info, debugDrawer);
        m_seconds += secondsSince(start);
    }

  private:
    double& m_seconds;
};

// stepSimulation() keeps what is left of the time; ours leaves nothing, so that n substeps are always n.
class SteppedWorld : public btDiscreteDynamicsWorld {
  public:
    using btDiscreteDynamicsWorld::btDiscreteDynamicsWorld;
    void forgetRemainder() { m_localTime = 0; }
};

struct GroupFilter : btOverlapFilterCallback {
    bool needBroadphaseCollision(btBroadphaseProxy* first, btBroadphaseProxy* second) const override {
        const auto* a = static_cast<const btCollisionObject*>(first->m_clientObject);
        const auto* b = static_cast<const btCollisionObject*>(second->m_clientObject);
        const int groupA = a->getUserIndex2(), groupB = b->getUserIndex2();
        if (groupA < 0 || groupB < 0 || (groupA != 0 && groupA == groupB))
            return false;
        return !(a->isStaticOrKinematicObject() && b->isStaticOrKinematicObject());
    }
};

btScalar real(double value) {
    if (value >= static_cast<double>(SIMD_INFINITY))
        return SIMD_INFINITY;
    if (value <= -static_cast<double>(SIMD_INFINITY))
        return -SIMD_INFINITY;
    return static_cast<btScalar>(value);
}

btVector3 vector(const Vec3& v) { return btVector3(real(v[0]), real(v[1]), real(v[2])); }

btTransform transform(const Frame& frame) {
    const Mat3& m = frame.axes;
    return btTransform(
        btMatrix3x3(real(m[0]), real(m[1]), real(m[2]), real(m[3]), real(m[4]), real(m[5]), real(m[6]), real(m[7]), real(m[8])),
        vector(frame.origin));
}

Frame frameOf(const btTransform& pose) {
    Frame frame;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j)
            frame.axes[static_cast<std::size_t>(3 * i + j)] = static_cast<double>(pose.getBasis()[i][j]);
        frame.origin[static_cast<std::size_t>(i)] = static_cast<double>(pose.getOrigin()[i]);
    }
    return frame;
}

Frame frameOf(const Vec3& position, const Quat& q) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    return Frame{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
                  2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
                 position};
}

// outer * inner
Frame compose(const Frame& outer, const Frame& inner) {
    Frame result;
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            double sum = 0;
            for (std::size_t k = 0; k < 3; ++k)
                sum += outer.axes[3 * i + k] * inner.axes[3 * k + j];
            result.axes[3 * i + j] = sum;
        }
        double sum = outer.origin[i];
        for (std::size_t k = 0; k < 3; ++k)
            sum += outer.axes[3 * i + k] * inner.origin[k];
        result.origin[i] = sum;
    }
    return result;
}

Frame inverse(const Frame& frame) {
    Frame result;
    for (std::size_t i = 0; i < 3; ++i) {
        double sum = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            result.axes[3 * i + k] = frame.axes[3 * k + i];
            sum -= frame.axes[3 * k + i] * frame.origin[k];
        }
        result.origin[i] = sum;
    }
    return result;
}

// Angle of a rotation matrix from the sine (antisymmetric part) and the cosine, exact for small angles too.
double rotationAngle(const Mat3& m) {
    const double sine = std::sqrt((m[7] - m[5]) * (m[7] - m[5]) + (m[2] - m[6]) * (m[2] - m[6]) + (m[3] - m[1]) * (m[3] - m[1])) / 2;
    return std::atan2(sine, (m[0] + m[4] + m[8] - 1) / 2);
}

// Angle between the frames' axes number `axis`.
double axisAngle(const Mat3& m, std::size_t axis) {
    double sine = 0;
    for (std::size_t i = 0; i < 3; ++i)
        if (i != axis)
            sine += m[3 * i + axis] * m[3 * i + axis];
    return std::atan2(std::sqrt(sine), m[4 * axis]);
}

constexpr std::size_t kTx = 0, kRx = 3, kRz = 5;

struct JointState {
    std::unique_ptr<btTypedConstraint> constraint;
    JointSettings settings;
    Frame inA, inB;
};

bool locked(const JointSettings& joint, std::size_t axis) {
    switch (joint.kind) {
    case JointKind::ball:
        return axis < kRx;
    case JointKind::hinge:
        return axis != kRz;
    case JointKind::slider:
        return axis != kTx;
    case JointKind::fixed:
        return true;
    case JointKind::sixDof:
        return joint.lower[axis] == joint.upper[axis];
    }
    return false;
}

} // namespace

struct World::State {
    double solverSeconds = 0, stepSeconds = 0;
    bool sleeping = false;
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    GroupFilter filter;
    std::unique_ptr<btDantzigSolver> dantzig;
    std::unique_ptr<btConstraintSolver> solver;
    cairn::bullet::ConstraintSolver* cairn = nullptr;
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    std::vector<JointState> joints;
    std::unique_ptr<SteppedWorld> world; // destroyed first

    ~State() {
        for (JointState& joint : joints)
            world->removeConstraint(joint.constraint.get());
        for (std::unique_ptr<btRigidBody>& body : bodies)
            if (body->isInWorld())
                world->removeRigidBody(body.get());
    }

    int add(std::unique_ptr<btCollisionShape> shape, const BodySettings& settings) {
        btVector3 inertia(0, 0, 0);
        if (settings.mass > 0) {
            if (settings.inertia)
                inertia = vector(*settings.inertia);
            else
                shape->calculateLocalInertia(real(settings.mass), inertia);
        }
        btRigidBody::btRigidBodyConstructionInfo info(real(settings.mass), nullptr, shape.get(), inertia);
        info.m_startWorldTransform = transform(frameOf(settings.position, settings.orientation));
        info.m_friction = real(settings.friction);
        info.m_restitution = real(settings.restitution);
        auto body = std::make_unique<btRigidBody>(info);
        body->setLinearVelocity(vector(settings.linearVelocity));
        body->setAngularVelocity(vector(settings.angularVelocity));
        body->setUserIndex(static_cast<int>(bodies.size()));
        body->setUserIndex2(settings.group);
        if (!sleeping && settings.mass > 0)
            body->setActivationState(DISABLE_DEACTIVATION);
        world->addRigidBody(body.get());
        const Vec3& force = settings.force;
        if (settings.mass > 0 && (force[0] != 0 || force[1] != 0 || force[2] != 0)) // as a gravity of its own: on in every substep
            body->setGravity(world->getGravity() + vector(force) / real(settings.mass));
        shapes.push_back(std::move(shape));
        bodies.push_back(std::move(body));
        return static_cast<int>(bodies.size()) - 1;
    }

    btRigidBody& body(int index) {
        if (index == -1)
            return btTypedConstraint::getFixedBody();
        if (index < 0 || static_cast<std::size_t>(index) >= bodies.size())
            throw std::out_of_range("there is no body " + std::to_string(index) + "; bodies are 0 ... " +
                                    std::to_string(static_cast<int>(bodies.size()) - 1) + ", and -1 is the world");
        return *bodies[static_cast<std::size_t>(index)];
    }

    Frame pose(int index) const {
        if (index < 0)
            return frameOf({0, 0, 0}, {0, 0, 0, 1});
        return frameOf(bodies[static_cast<std::size_t>(index)]->getWorldTransform());
    }
};

World::World(const Vec3& gravity, const std::string& solver, const cairn_config& config, bool sleeping)
    : m_state(std::make_unique<State>()) {
    State& s = *m_state;
    s.sleeping = sleeping;
    if (solver == "pgs") {
        s.solver = std::make_unique<Timed<btSequentialImpulseConstraintSolver>>(s.solverSeconds);
    } else if (solver == "nncg") {
        s.solver = std::make_unique<Timed<btNNCGConstraintSolver>>(s.solverSeconds);
    } else if (solver == "dantzig") {
        s.dantzig = std::make_unique<btDantzigSolver>();
        s.solver = std::make_unique<Timed<btMLCPSolver>>(s.solverSeconds, s.dantzig.get());
    } else if (solver == "cairn") {
        auto made =
            std::make_unique<Timed<cairn::bullet::ConstraintSolver>>(s.solverSeconds, CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, &config);
        if (made->lastStatus() != CAIRN_OK)
            throw std::runtime_error(made->lastError());
        made->setErrorCallback([](void*, cairn_status, const char*) {}, nullptr); // step() throws instead
        s.cairn = made.get();
        s.solver = std::move(made);
    } else {
        throw std::invalid_argument("there is no solver '" + solver + "'; there are pgs, nncg, dantzig and cairn");
    }
    s.world = std::make_unique<SteppedWorld>(&s.dispatcher, &s.broadphase, s.solver.get(), &s.configuration);
    s.world->setGravity(vector(gravity));
    s.world->getPairCache()->setOverlapFilterCallback(&s.filter);
}

World::~World() = default;

int World::addBox(const Vec3& halfExtents, const BodySettings& settings) {
    return m_state->add(std::make_unique<btBoxShape>(vector(halfExtents)), settings);
}

int World::addSphere(double radius, const BodySettings& settings) {
    return m_state->add(std::make_unique<btSphereShape>(real(radius)), settings);
}

int World::addCapsule(double radius, double halfLength, const BodySettings& settings) {
    return m_state->add(std::make_unique<btCapsuleShape>(real(radius), real(2 * halfLength)), settings);
}

int World::addHull(const std::vector<Vec3>& points, const BodySettings& settings) {
    if (points.size() < 4)
        throw std::invalid_argument("a hull has at least 4 points, not " + std::to_string(points.size()));
    auto hull = std::make_unique<btConvexHullShape>();
    for (const Vec3& point : points)
        hull->addPoint(vector(point), false);
    hull->setMargin(0); // Bullet would put it outside the hull
    hull->recalcLocalAabb();
    hull->initializePolyhedralFeatures(); // faces are clipped against each other: whole manifolds in one step, as of boxes
    return m_state->add(std::move(hull), settings);
}

int World::addPlane(const Vec3& normal, double offset, const BodySettings& settings) {
    if (settings.mass != 0)
        throw std::invalid_argument("a plane cannot move: its mass must be 0");
    return m_state->add(std::make_unique<btStaticPlaneShape>(vector(normal), real(offset)), settings);
}

int World::addJoint(const JointSettings& settings) {
    State& s = *m_state;
    btRigidBody& a = s.body(settings.bodyA);
    btRigidBody& b = s.body(settings.bodyB);
    if (settings.bodyA == settings.bodyB)
        throw std::invalid_argument("a joint needs two bodies, not body " + std::to_string(settings.bodyA) + " twice");
    const Frame atA = {settings.axes, settings.anchor}, atB = {settings.axes, settings.anchorB};
    JointState joint = {nullptr, settings, compose(inverse(s.pose(settings.bodyA)), atA), compose(inverse(s.pose(settings.bodyB)), atB)};
    const btTransform inA = transform(joint.inA), inB = transform(joint.inB);
    switch (settings.kind) {
    case JointKind::ball:
        joint.constraint = std::make_unique<btPoint2PointConstraint>(a, b, inA.getOrigin(), inB.getOrigin());
        break;
    case JointKind::hinge: {
        auto hinge = std::make_unique<btHingeConstraint>(a, b, inA, inB, true);
        if (settings.lower[kRz] <= settings.upper[kRz] && (std::isfinite(settings.lower[kRz]) || std::isfinite(settings.upper[kRz])))
            hinge->setLimit(real(std::max(settings.lower[kRz], -static_cast<double>(SIMD_PI))),
                            real(std::min(settings.upper[kRz], static_cast<double>(SIMD_PI))));
        joint.constraint = std::move(hinge); // its motor is set in step(): Bullet bounds it by an impulse
        break;
    }
    case JointKind::slider: {
        auto slider = std::make_unique<btSliderConstraint>(a, b, inA, inB, true);
        if (settings.lower[kTx] <= settings.upper[kTx] && (std::isfinite(settings.lower[kTx]) || std::isfinite(settings.upper[kTx]))) {
            slider->setLowerLinLimit(real(settings.lower[kTx]));
            slider->setUpperLinLimit(real(settings.upper[kTx]));
        }
        if (settings.motorForce[kTx] > 0) {
            slider->setPoweredLinMotor(true);
            slider->setTargetLinMotorVelocity(real(settings.motorSpeed[kTx]));
            slider->setMaxLinMotorForce(real(settings.motorForce[kTx]));
        }
        joint.constraint = std::move(slider);
        break;
    }
    case JointKind::fixed:
        joint.constraint = std::make_unique<btFixedConstraint>(a, b, inA, inB);
        break;
    case JointKind::sixDof: {
        auto six = std::make_unique<btGeneric6DofConstraint>(a, b, inA, inB, true);
        for (std::size_t i = 0; i < 6; ++i) {
            const int axis = static_cast<int>(i);
            const bool turns = i >= kRx; // Bullet's angles have the other sign
            if (!std::isfinite(settings.lower[i]) && !std::isfinite(settings.upper[i]))
                six->setLimit(axis, 1, -1); // free
            else
                six->setLimit(axis, real(turns ? -settings.upper[i] : settings.lower[i]),
                              real(turns ? -settings.lower[i] : settings.upper[i]));
            if (!(settings.motorForce[i] > 0))
                continue;
            const btScalar speed = real(-settings.motorSpeed[i]), force = real(settings.motorForce[i]);
            if (turns) {
                btRotationalLimitMotor& motor = *six->getRotationalLimitMotor(axis - 3);
                motor.m_enableMotor = true;
                motor.m_targetVelocity = speed;
                motor.m_maxMotorForce = force;
            } else {
                btTranslationalLimitMotor& motor = *six->getTranslationalLimitMotor();
                motor.m_enableMotor[axis] = true;
                motor.m_targetVelocity[axis] = speed;
                motor.m_maxMotorForce[axis] = force;
            }
        }
        joint.constraint = std::move(six);
        break;
    }
    }
    s.world->addConstraint(joint.constraint.get(), true);
    s.joints.push_back(std::move(joint));
    return static_cast<int>(s.joints.size()) - 1;
}

void World::step(double dt, int substeps) {
    if (!(dt > 0) || !std::isfinite(dt))
        throw std::invalid_argument("dt must be a positive number of seconds, not " + std::to_string(dt));
    if (substeps < 1)
        throw std::invalid_argument("substeps must be at least 1, not " + std::to_string(substeps));
    State& s = *m_state;
    const double h = dt / substeps;
    for (JointState& joint : s.joints)
        if (joint.settings.kind == JointKind::hinge && joint.settings.motorForce[kRz] > 0)
            static_cast<btHingeConstraint&>(*joint.constraint)
                .enableAngularMotor(true, real(joint.settings.motorSpeed[kRz]), real(joint.settings.motorForce[kRz] * h));
    s.solverSeconds = 0;
    const Clock::time_point start = Clock::now();
    if (substeps == 1) {
        s.world->stepSimulation(real(dt), 0);
    } else {
        s.world->forgetRemainder();
        s.world->stepSimulation(real(h * (substeps + 0.5)), substeps, real(h));
    }
    s.stepSeconds = secondsSince(start);
    if (s.cairn && s.cairn->lastStatus() != CAIRN_OK)
        throw std::runtime_error(s.cairn->lastError());
}

std::size_t World::bodyCount() const { return m_state->bodies.size(); }

void World::poses(double* to) const {
    for (const std::unique_ptr<btRigidBody>& body : m_state->bodies) {
        const btTransform& pose = body->getWorldTransform();
        const btQuaternion q = pose.getRotation();
        for (int i = 0; i < 3; ++i)
            *to++ = static_cast<double>(pose.getOrigin()[i]);
        for (const btScalar component : {q.x(), q.y(), q.z(), q.w()})
            *to++ = static_cast<double>(component);
    }
}

void World::velocities(double* to) const {
    for (const std::unique_ptr<btRigidBody>& body : m_state->bodies) {
        for (int i = 0; i < 3; ++i)
            *to++ = static_cast<double>(body->getLinearVelocity()[i]);
        for (int i = 0; i < 3; ++i)
            *to++ = static_cast<double>(body->getAngularVelocity()[i]);
    }
}

void World::setVelocity(int index, const Vec3& linear, const Vec3& angular) {
    if (index < 0)
        throw std::out_of_range("the world has no velocity");
    btRigidBody& body = m_state->body(index);
    body.setLinearVelocity(vector(linear));
    body.setAngularVelocity(vector(angular));
}

void World::removeBody(int index) {
    if (index < 0)
        throw std::out_of_range("the world cannot be removed");
    btRigidBody& body = m_state->body(index);
    for (const JointState& joint : m_state->joints)
        if (joint.settings.bodyA == index || joint.settings.bodyB == index)
            throw std::invalid_argument("body " + std::to_string(index) + " is held by a joint");
    if (!body.isInWorld())
        throw std::invalid_argument("body " + std::to_string(index) + " was removed before");
    m_state->world->removeRigidBody(&body);
    body.setLinearVelocity(btVector3(0, 0, 0));
    body.setAngularVelocity(btVector3(0, 0, 0));
}

ContactColumns World::contacts() const {
    ContactColumns columns;
    btDispatcher& dispatcher = m_state->dispatcher;
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
        for (int i = 0; i < manifold.getNumContacts(); ++i) {
            const btManifoldPoint& point = manifold.getContactPoint(i);
            columns.bodyA.push_back(manifold.getBody1()->getUserIndex());
            columns.bodyB.push_back(manifold.getBody0()->getUserIndex());
            columns.separation.push_back(static_cast<double>(point.getDistance()));
            columns.impulse.push_back(static_cast<double>(point.m_appliedImpulse));
            const btVector3 friction =
                point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 + point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2;
            for (int k = 0; k < 3; ++k) {
                columns.position.push_back(static_cast<double>(point.getPositionWorldOnB()[k]));
                columns.normal.push_back(static_cast<double>(point.m_normalWorldOnB[k]));
                columns.frictionImpulse.push_back(static_cast<double>(friction[k]));
            }
        }
    }
    return columns;
}

std::vector<double> World::jointErrors() const {
    std::vector<double> errors;
    errors.reserve(2 * m_state->joints.size());
    for (const JointState& joint : m_state->joints) {
        const Frame a = compose(m_state->pose(joint.settings.bodyA), joint.inA);
        const Frame b = compose(m_state->pose(joint.settings.bodyB), joint.inB);
        const Frame relative = compose(inverse(a), b); // b's frame in a's
        double linear = 0;
        for (std::size_t i = 0; i < 3; ++i)
            if (locked(joint.settings, kTx + i))
                linear += relative.origin[i] * relative.origin[i];
        errors.push_back(std::sqrt(linear));
        std::size_t freeCount = 0, freeAxis = 0;
        for (std::size_t i = 0; i < 3; ++i)
            if (!locked(joint.settings, kRx + i)) {
                ++freeCount;
                freeAxis = i;
            }
        // All rotations held: the whole angle; one free: the tilt of its axis; two or three free: Bullet's 6-dof angles are
        // then a matter of its Euler convention, and a ball holds none.
        errors.push_back(freeCount == 0 ? rotationAngle(relative.axes) : (freeCount == 1 ? axisAngle(relative.axes, freeAxis) : 0));
    }
    return errors;
}

int World::iterations() const { return m_state->world->getSolverInfo().m_numIterations; }

void World::setIterations(int iterations) {
    if (iterations < 1)
        throw std::invalid_argument("iterations must be at least 1, not " + std::to_string(iterations));
    m_state->world->getSolverInfo().m_numIterations = iterations;
}

bool World::splitImpulse() const { return m_state->world->getSolverInfo().m_splitImpulse != 0; }

void World::setSplitImpulse(bool on) { m_state->world->getSolverInfo().m_splitImpulse = on ? 1 : 0; }

double World::solverSeconds() const { return m_state->solverSeconds; }

double World::stepSeconds() const { return m_state->stepSeconds; }

cairn::bullet::ConstraintSolver* World::cairn() const { return m_state->cairn; }

} // namespace cairn_bullet
