// A half of the preload library: cairn::bullet::ConstraintSolver in the precision of the program's Bullet. Its references to
// Bullet are met by the Bullet that the program has loaded, so it is linked to none.
#include "stand_in.h"

#include "settings.h"

#include <cairn/bullet.hpp>

#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <limits>
#include <memory>
#include <new>

namespace cairn {
namespace preload {
namespace {

static_assert(BT_BULLET_VERSION == CAIRN_BULLET_MAJOR * 100 + CAIRN_BULLET_MINOR, "the headers are of the version that CMake found");

bullet::ConstraintSolver& of(void* solver) { return *static_cast<bullet::ConstraintSolver*>(solver); }

void* create(const char** why) {
    static std::string& reason = *new std::string;
    Settings settings;
    if (!readSettings(settings, reason)) {
        *why = reason.c_str();
        return nullptr;
    }
    std::unique_ptr<bullet::ConstraintSolver> made(new (std::nothrow)
                                                       bullet::ConstraintSolver(settings.method, settings.preset, &settings.config));
    if (!made || made->lastStatus() != CAIRN_OK || made->setParams(settings.params) != CAIRN_OK) {
        reason = made ? made->lastError() : "no memory";
        *why = reason.c_str();
        return nullptr;
    }
    made->followInfo(!settings.own);
    return made.release();
}

void destroy(void* solver) { delete &of(solver); }

void note(const bullet::ConstraintSolver& solver, Record& record) {
    if (solver.lastStatus() != CAIRN_OK) {
        ++record.failures;
        return;
    }
    const cairn_statistics s = solver.statistics();
    ++record.solves;
    record.bodies += s.bodies;
    record.contacts += s.contacts;
    record.joints += s.joints;
    record.rows += s.rows;
    cairn_params params = {};
    params.struct_size = sizeof params;
    cairn_solver_get_params(solver.handle(), &params);
    record.method = params.method;
    record.iterations = params.iterations;
    record.substeps = params.substeps;
    record.residual = s.residual;
}

void solve(void* solver, const Group& group, Record& record) {
    bullet::ConstraintSolver& s = of(solver);
    // prepareSolve() and allSolved() cannot be replaced: Bullet's compiler has put their empty bodies where they are called. So
    // let the world hand over all of its islands at once: in parts, each would take the others' place in the warm-start cache. (The
    // info is the world's own, const on its way here only. The first step still comes in parts. Threads of a pool may do this at
    // the same time, to the same value.)
    constexpr int all = std::numeric_limits<int>::max();
    btContactSolverInfo& info = *static_cast<btContactSolverInfo*>(const_cast<void*>(group.info));
    if (info.m_minimumSolverBatchSize != all)
        info.m_minimumSolverBatchSize = all;
    s.solveGroup(reinterpret_cast<btCollisionObject**>(group.bodies), group.bodyCount,
                 reinterpret_cast<btPersistentManifold**>(group.manifolds), group.manifoldCount,
                 reinterpret_cast<btTypedConstraint**>(group.constraints), group.constraintCount, info,
                 static_cast<btIDebugDraw*>(group.drawer), static_cast<btDispatcher*>(group.dispatcher));
    if (group.bodyCount + group.manifoldCount + group.constraintCount > 0)
        note(s, record);
}

void reset(void* solver) { of(solver).reset(); }

double gap(const btTypedConstraint& constraint) {
    btVector3 a, b;
    switch (constraint.getConstraintType()) {
    case POINT2POINT_CONSTRAINT_TYPE: {
        const btPoint2PointConstraint& joint = static_cast<const btPoint2PointConstraint&>(constraint);
        a = joint.getPivotInA();
        b = joint.getPivotInB();
        break;
    }
    case HINGE_CONSTRAINT_TYPE: {
        const btHingeConstraint& joint = static_cast<const btHingeConstraint&>(constraint);
        a = joint.getAFrame().getOrigin();
        b = joint.getBFrame().getOrigin();
        break;
    }
    default:
        return 0;
    }
    a = constraint.getRigidBodyA().getCenterOfMassTransform() * a;
    b = constraint.getRigidBodyB().getCenterOfMassTransform() * b;
    return static_cast<double>((a - b).length());
}

void measure(const Group& group, Record& record) {
    btDispatcher* dispatcher = static_cast<btDispatcher*>(group.dispatcher);
    for (int i = 0; i < group.manifoldCount; ++i) {
        const btPersistentManifold& manifold = *static_cast<btPersistentManifold*>(group.manifolds[i]);
        if (dispatcher && !dispatcher->needsResponse(manifold.getBody0(), manifold.getBody1()))
            continue;
        for (int k = 0; k < manifold.getNumContacts(); ++k)
            record.deepest = std::fmax(record.deepest, -static_cast<double>(manifold.getContactPoint(k).getDistance()));
    }
    for (int i = 0; i < group.constraintCount; ++i) {
        const btTypedConstraint& constraint = *static_cast<btTypedConstraint*>(group.constraints[i]);
        if (constraint.isEnabled())
            record.widest = std::fmax(record.widest, gap(constraint));
    }
}

} // namespace
} // namespace preload
} // namespace cairn

extern "C" __attribute__((visibility("default"))) const cairn::preload::StandIn* cairn_bullet_stand_in() {
    using namespace cairn::preload;
    static const StandIn standIn = {create, destroy, solve, reset, measure};
    return &standIn;
}
