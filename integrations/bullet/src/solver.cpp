#include <cairn/bullet.hpp>

#include "contacts.h"
#include "joints.h"

#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/Dynamics/btActionInterface.h>
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <new>
#include <string>

namespace cairn {
namespace bullet {
namespace {

constexpr uint32_t kReal = sizeof(btScalar) == sizeof(double) ? CAIRN_F64 : CAIRN_F32;

template <class Record> cairn_view view(std::vector<Record>& records, std::size_t offset, uint32_t type) {
    cairn_view result = {nullptr, 0, type, CAIRN_HOST};
    if (!records.empty()) {
        result.data = reinterpret_cast<char*>(records.data()) + offset;
        result.stride = static_cast<int64_t>(sizeof(Record));
    }
    return result;
}

#define CAIRN_REAL(records, field) view(records, offsetof(std::decay_t<decltype(records)>::value_type, field), kReal)
#define CAIRN_FIELD(records, field, type) view(records, offsetof(std::decay_t<decltype(records)>::value_type, field), type)

cairn_bodies viewBodies(std::vector<BodyRecord>& records) {
    cairn_bodies table = {};
    table.struct_size = sizeof table;
    table.count = static_cast<uint32_t>(records.size());
    table.position = CAIRN_REAL(records, position);
    table.orientation = CAIRN_REAL(records, orientation);
    table.linear_velocity = CAIRN_REAL(records, linearVelocity);
    table.angular_velocity = CAIRN_REAL(records, angularVelocity);
    table.inverse_mass = CAIRN_REAL(records, inverseMass);
    table.inverse_inertia = CAIRN_REAL(records, inverseInertia);
    table.force = CAIRN_REAL(records, force);
    table.torque = CAIRN_REAL(records, torque);
    table.linear_factor = CAIRN_REAL(records, linearFactor);
    table.angular_factor = CAIRN_REAL(records, angularFactor);
    table.flags = CAIRN_FIELD(records, flags, CAIRN_U32);
    return table;
}

cairn_contacts viewContacts(std::vector<ContactRecord>& records, std::vector<ContactExtra>& extras) {
    cairn_contacts table = {};
    table.struct_size = sizeof table;
    table.count = static_cast<uint32_t>(records.size());
    table.body_a = CAIRN_FIELD(records, bodyA, CAIRN_I32);
    table.body_b = CAIRN_FIELD(records, bodyB, CAIRN_I32);
    table.normal = CAIRN_REAL(records, normal);
    table.arm_a = CAIRN_REAL(records, armA);
    table.arm_b = CAIRN_REAL(records, armB);
    table.separation = CAIRN_REAL(records, separation);
    table.friction = CAIRN_REAL(records, friction);
    table.restitution = CAIRN_REAL(records, restitution);
    table.key = CAIRN_FIELD(records, key, CAIRN_U64);
    table.flags = CAIRN_FIELD(records, flags, CAIRN_U32);
    table.tangent = CAIRN_REAL(extras, tangent);
    table.friction_scale = CAIRN_REAL(extras, frictionScale);
    table.surface_velocity = CAIRN_REAL(extras, surfaceVelocity);
    table.rolling_friction = CAIRN_REAL(extras, rollingFriction);
    table.spinning_friction = CAIRN_REAL(extras, spinningFriction);
    table.stiffness = CAIRN_REAL(extras, stiffness);
    table.damping = CAIRN_REAL(extras, damping);
    return table;
}

cairn_joints viewJoints(std::vector<JointRecord>& records, bool drives, bool bounded) {
    cairn_joints table = {};
    table.struct_size = sizeof table;
    table.count = static_cast<uint32_t>(records.size());
    table.body_a = CAIRN_FIELD(records, bodyA, CAIRN_I32);
    table.body_b = CAIRN_FIELD(records, bodyB, CAIRN_I32);
    table.anchor_a = CAIRN_REAL(records, anchorA);
    table.anchor_b = CAIRN_REAL(records, anchorB);
    table.frame_a = CAIRN_REAL(records, frameA);
    table.frame_b = CAIRN_REAL(records, frameB);
    table.axes = CAIRN_FIELD(records, axes, CAIRN_U32);
    table.lower = CAIRN_REAL(records, lower);
    table.upper = CAIRN_REAL(records, upper);
    table.motor_speed = CAIRN_REAL(records, motorSpeed);
    table.motor_force = CAIRN_REAL(records, motorForce);
    table.key = CAIRN_FIELD(records, key, CAIRN_U64);
    if (drives) {
        table.rotation = CAIRN_FIELD(records, rotation, CAIRN_U32);
        table.target = CAIRN_REAL(records, target);
        table.stiffness = CAIRN_REAL(records, stiffness);
        table.damping = CAIRN_REAL(records, damping);
        table.rate = CAIRN_REAL(records, rate);
    }
    if (bounded)
        table.max_force = CAIRN_REAL(records, maxForce);
    return table;
}

cairn_rows viewRows(std::vector<RowRecord>& records) {
    cairn_rows table = {};
    table.struct_size = sizeof table;
    table.count = static_cast<uint32_t>(records.size());
    table.body_a = CAIRN_FIELD(records, bodyA, CAIRN_I32);
    table.body_b = CAIRN_FIELD(records, bodyB, CAIRN_I32);
    table.jacobian_a = CAIRN_REAL(records, jacobianA);
    table.jacobian_b = CAIRN_REAL(records, jacobianB);
    table.rhs = CAIRN_REAL(records, rhs);
    table.lower = CAIRN_REAL(records, lower);
    table.upper = CAIRN_REAL(records, upper);
    table.compliance = CAIRN_REAL(records, compliance);
    table.block = CAIRN_FIELD(records, block, CAIRN_U32);
    table.key = CAIRN_FIELD(records, key, CAIRN_U64);
    return table;
}

cairn_results viewResults(Tables& tables) {
    cairn_results results = {};
    results.struct_size = sizeof results;
    results.position = CAIRN_REAL(tables.bodies, position);
    results.orientation = CAIRN_REAL(tables.bodies, orientation);
    results.linear_velocity = CAIRN_REAL(tables.bodies, linearVelocity);
    results.angular_velocity = CAIRN_REAL(tables.bodies, angularVelocity);
    results.contact_impulse = CAIRN_REAL(tables.contactResults, impulse);
    results.friction_impulse = CAIRN_REAL(tables.contactResults, frictionImpulse);
    results.joint_impulse = CAIRN_REAL(tables.joints, impulse);
    results.row_impulse = CAIRN_REAL(tables.rows, impulse);
    results.joint_linear = CAIRN_REAL(tables.joints, linear);
    results.joint_angular = CAIRN_REAL(tables.joints, angular);
    return results;
}

#undef CAIRN_REAL
#undef CAIRN_FIELD

} // namespace

struct ConstraintSolver::Implementation {
    cairn_solver* solver = nullptr;
    cairn_params params = {};  // the user's
    cairn_params applied = {}; // the solver's now
    bool followInfo = true;
    cairn_status status = CAIRN_OK;
    std::string error;
    std::string reported;
    ErrorCallback callback = nullptr;
    void* callbackUser = nullptr;

    Tables tables;
    Bodies bodies{tables};
    Contacts contacts{tables, bodies};
    Constraints constraints{tables, bodies};

    // Bodies of the groups that were solved since the last landing, where the landing comes after integrateTransforms().
    bool landLater = false;
    std::vector<Flight> flights;

    // Lands in the worlds that run actions.
    struct Action : btActionInterface {
        explicit Action(Implementation& owner) : m_owner(owner) {}
        void updateAction(btCollisionWorld* world, btScalar) override { m_owner.land(*world); }
        void debugDraw(btIDebugDraw*) override {}
        Implementation& m_owner;
    };
    Action action{*this};
    btDynamicsWorld* attachedTo = nullptr;

    void land(btCollisionWorld& world) {
        bullet::land(flights, world);
        flights.clear();
    }

    // Collected between prepareSolve() and allSolved().
    bool collecting = false;
    btDispatcher* dispatcher = nullptr;
    std::vector<btCollisionObject*> groupBodies;
    std::vector<btPersistentManifold*> groupManifolds;
    std::vector<btTypedConstraint*> groupConstraints;
    int bodiesAnnounced = 0;
    bool groupsCame = false;
    CopyTimes copyTimes = {0, 0};

    cairn_status fail(cairn_status failure, const char* text) {
        status = failure;
        error = text;
        if (error != reported) {
            reported = error;
            if (callback)
                callback(callbackUser, failure, text);
            else
                std::fprintf(stderr, "cairn: %s: %s; the bodies of this step move without constraints\n", cairn_status_name(failure), text);
        }
        return failure;
    }

    void readParams() {
        params.struct_size = sizeof params;
        if (cairn_solver_get_params(solver, &params) == CAIRN_OK)
            applied = params;
    }

    cairn_status applyParams(const btContactSolverInfo& info) {
        cairn_params wanted = followInfo ? fromBullet(info, params) : params;
        wanted.restitution_threshold = static_cast<double>(info.m_restitutionVelocityThreshold);
        wanted.iterations = std::max(wanted.iterations, constraints.wantedIterations());
        if (std::memcmp(&wanted, &applied, sizeof wanted) == 0)
            return CAIRN_OK;
        const cairn_status set = cairn_solver_set_params(solver, &wanted);
        if (set == CAIRN_OK)
            applied = wanted;
        return set;
    }

    void collect(btCollisionObject** bodyList, int numBodies, btPersistentManifold** manifolds, int numManifolds,
                 btTypedConstraint** constraintList, int numConstraints) {
        groupBodies.insert(groupBodies.end(), bodyList, bodyList + numBodies);
        groupManifolds.insert(groupManifolds.end(), manifolds, manifolds + numManifolds);
        groupConstraints.insert(groupConstraints.end(), constraintList, constraintList + numConstraints);
    }

    void forgetGroups() {
        groupBodies.clear();
        groupManifolds.clear();
        groupConstraints.clear();
    }

    cairn_status step(const btContactSolverInfo& info) {
        using Clock = std::chrono::steady_clock;
        const auto seconds = [](Clock::time_point from) { return std::chrono::duration<double>(Clock::now() - from).count(); };
        const Clock::time_point begun = Clock::now();
        copyTimes = CopyTimes{0, 0};
        tables.clear();
        bodies.beginStep();
        constraints.beginStep();
        Loops().each<8>(
            groupBodies.size(), 1024, [&](std::size_t i) { prefetch<sizeof(btRigidBody)>(groupBodies[i]); },
            [&](std::size_t i) {
                groupBodies[i]->setCompanionId(-1); // as the stock solver leaves it; the island manager counts on it
                bodies.indexOf(*groupBodies[i]);
            });
        for (btTypedConstraint* constraint : groupConstraints)
            constraints.gather(*constraint, info);
        const Loops loops(solver);
        contacts.gather(groupManifolds, dispatcher, info, loops);
        constraints.endStep();
        if (bodies.empty())
            return CAIRN_OK;
        bodies.gather(loops);

        const cairn_status set = applyParams(info);
        if (set != CAIRN_OK)
            return set;
        const cairn_bodies bodyTable = viewBodies(tables.bodies);
        const cairn_contacts contactTable = viewContacts(tables.contacts, tables.contactExtras);
        const cairn_joints jointTable = viewJoints(tables.joints, tables.drives, tables.bounded);
        const cairn_rows rowTable = viewRows(tables.rows);
        const cairn_results results = viewResults(tables);
        cairn_step input = {};
        input.struct_size = sizeof input;
        input.dt = static_cast<double>(info.m_timeStep);
        input.bodies = &bodyTable;
        input.contacts = tables.contacts.empty() ? nullptr : &contactTable;
        input.joints = tables.joints.empty() ? nullptr : &jointTable;
        input.rows = tables.rows.empty() ? nullptr : &rowTable;
        copyTimes.gather = seconds(begun);
        const cairn_status solved = cairn_solver_step(solver, &input, &results);
        if (solved != CAIRN_OK)
            return solved;
        const Clock::time_point came = Clock::now();
        constraints.scatter(info.m_timeStep); // before the bodies move
        contacts.scatter(loops);
        if (landLater)
            bodies.scatter(info.m_timeStep, flights, loops);
        else
            bodies.scatter(info.m_timeStep, loops);
        copyTimes.scatter = seconds(came);
        return CAIRN_OK;
    }

    void solve(const btContactSolverInfo& info) {
        if (!solver) { // reported when it could not be made
            for (btCollisionObject* object : groupBodies)
                object->setCompanionId(-1);
            return;
        }
        try {
            const cairn_status solved = step(info);
            if (solved == CAIRN_OK)
                status = CAIRN_OK;
            else
                fail(solved, cairn_last_error());
        } catch (const std::bad_alloc&) {
            fail(CAIRN_ERROR_OUT_OF_MEMORY, "no memory for the tables of this step");
        }
    }
};

ConstraintSolver::ConstraintSolver(uint32_t method, uint32_t preset, const cairn_config* config) : m_implementation(new Implementation) {
    const cairn_status created = cairn_solver_create(config, &m_implementation->solver);
    if (created != CAIRN_OK) {
        m_implementation->fail(created, cairn_last_error());
        return;
    }
    setMethod(method, preset);
}

ConstraintSolver::~ConstraintSolver() { cairn_solver_destroy(m_implementation->solver); }

cairn_status ConstraintSolver::setMethod(uint32_t method, uint32_t preset) {
    cairn_params params = {};
    params.struct_size = sizeof params;
    const cairn_status filled = cairn_params_preset(method, preset, &params);
    if (filled != CAIRN_OK)
        return m_implementation->fail(filled, cairn_last_error());
    const cairn_status set = setParams(params);
    if (set == CAIRN_OK)
        followInfo(true);
    return set;
}

const cairn_params& ConstraintSolver::params() const { return m_implementation->params; }

cairn_status ConstraintSolver::setParams(const cairn_params& params) {
    if (!m_implementation->solver)
        return m_implementation->status;
    const cairn_status set = cairn_solver_set_params(m_implementation->solver, &params);
    if (set != CAIRN_OK)
        return m_implementation->fail(set, cairn_last_error());
    m_implementation->readParams();
    followInfo(false);
    return CAIRN_OK;
}

void ConstraintSolver::followInfo(bool follow) { m_implementation->followInfo = follow; }

cairn_statistics ConstraintSolver::statistics() const {
    cairn_statistics statistics = {};
    statistics.struct_size = sizeof statistics;
    if (m_implementation->solver)
        cairn_solver_get_statistics(m_implementation->solver, &statistics);
    return statistics;
}

ConstraintSolver::CopyTimes ConstraintSolver::copyTimes() const { return m_implementation->copyTimes; }

cairn_solver* ConstraintSolver::handle() const { return m_implementation->solver; }

cairn_status ConstraintSolver::lastStatus() const { return m_implementation->status; }

const char* ConstraintSolver::lastError() const { return m_implementation->status == CAIRN_OK ? "" : m_implementation->error.c_str(); }

void ConstraintSolver::setErrorCallback(ErrorCallback callback, void* user) {
    m_implementation->callback = callback;
    m_implementation->callbackUser = user;
}

void ConstraintSolver::prepareSolve(int numBodies, int) {
    m_implementation->forgetGroups();
    m_implementation->bodiesAnnounced = numBodies;
    m_implementation->groupsCame = false;
    m_implementation->collecting = true;
}

btScalar ConstraintSolver::solveGroup(btCollisionObject** bodies, int numBodies, btPersistentManifold** manifolds, int numManifolds,
                                      btTypedConstraint** constraints, int numConstraints, const btContactSolverInfo& info, btIDebugDraw*,
                                      btDispatcher* dispatcher) {
    m_implementation->dispatcher = dispatcher;
    m_implementation->groupsCame = true;
    m_implementation->collect(bodies, numBodies, manifolds, numManifolds, constraints, numConstraints);
    if (!m_implementation->collecting) {
        m_implementation->solve(info);
        m_implementation->forgetGroups();
    }
    return btScalar(0);
}

void ConstraintSolver::allSolved(const btContactSolverInfo& info, btIDebugDraw*) {
    if (m_implementation->groupsCame || m_implementation->bodiesAnnounced == 0)
        m_implementation->solve(info);
    else // a discrete world hands over at least an empty group
        m_implementation->fail(
            CAIRN_ERROR_UNSUPPORTED,
            "the world announced bodies but called solveGroup for none, as a btMultiBodyDynamicsWorld does, which needs a "
            "btMultiBodyConstraintSolver: use a btDiscreteDynamicsWorld");
    m_implementation->forgetGroups();
    m_implementation->collecting = false;
}

void ConstraintSolver::attach(btDynamicsWorld& world) {
    detach();
    m_implementation->attachedTo = &world;
    world.addAction(&m_implementation->action);
    landLater(true);
}

void ConstraintSolver::detach() {
    if (!m_implementation->attachedTo)
        return;
    m_implementation->attachedTo->removeAction(&m_implementation->action);
    m_implementation->attachedTo = nullptr;
    landLater(false);
}

void ConstraintSolver::landLater(bool later) {
    m_implementation->landLater = later;
    m_implementation->flights.clear();
}

void ConstraintSolver::land(btCollisionWorld& world) { m_implementation->land(world); }

void ConstraintSolver::reset() {
    m_implementation->contacts.clear();
    m_implementation->constraints.clear();
    if (m_implementation->solver)
        cairn_solver_reset(m_implementation->solver);
}

} // namespace bullet
} // namespace cairn
