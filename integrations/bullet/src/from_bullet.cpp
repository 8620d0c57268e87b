// What comes from Bullet's settings: parameters from btContactSolverInfo, threads from its task scheduler.
#include <cairn/bullet.hpp>

#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <LinearMath/btThreads.h>

#include <algorithm>

namespace cairn {
namespace bullet {
namespace {

// How stiff an error reduction is against Bullet's default.
double stiffness(btScalar erp, btScalar usual) { return static_cast<double>(erp / usual); }

void scaleBaumgarte(double& share, double factor) { share = std::min(share * factor, 1.0); }

// From the frequency that the limit leaves, or a softer one would still be cut to the same. Soft constraints need one above 0.
void scaleHertz(double& hertz, double limit, double factor) { hertz = std::max(std::min(hertz, limit) * factor, 1e-3); }

} // namespace

cairn_params fromBullet(const btContactSolverInfo& info, const cairn_params& preset) {
    const btContactSolverInfo usual;
    cairn_params params = preset;
    const double substeps = static_cast<double>(preset.substeps);

    // More than the preset has: as many. Fewer than Bullet's default: fewer in the same proportion.
    const double asked = static_cast<double>(info.m_numIterations), ten = static_cast<double>(usual.m_numIterations);
    const double before = static_cast<double>(preset.iterations);
    if (info.m_numIterations < usual.m_numIterations)
        params.iterations = static_cast<uint32_t>(std::max(before * std::max(asked, 0.0) / ten, substeps));
    else if (asked > before)
        params.iterations = static_cast<uint32_t>(std::min(asked, 1e6));
    params.position_iterations =
        static_cast<uint32_t>(static_cast<double>(preset.position_iterations) * static_cast<double>(params.iterations) / before);

    const double limit = preset.hertz_limit * substeps / static_cast<double>(info.m_timeStep);
    if (info.m_erp2 != usual.m_erp2) {
        const double factor = stiffness(info.m_erp2, usual.m_erp2);
        scaleBaumgarte(params.contact_baumgarte, factor);
        params.contact_hertz_floor = std::min(preset.contact_hertz_floor, preset.hertz_limit) * factor;
        scaleHertz(params.contact_hertz, limit, factor);
    }
    if (info.m_erp != usual.m_erp) {
        const double factor = stiffness(info.m_erp, usual.m_erp);
        scaleBaumgarte(params.joint_baumgarte, factor);
        scaleHertz(params.joint_hertz, limit, factor);
    }
    if (!(info.m_solverMode & SOLVER_USE_WARMSTARTING)) {
        params.contact_warm_start = 0;
        params.joint_warm_start = 0;
    } else if (info.m_warmstartingFactor != usual.m_warmstartingFactor) {
        params.contact_warm_start =
            std::min(preset.contact_warm_start * static_cast<double>(info.m_warmstartingFactor / usual.m_warmstartingFactor), 1.0);
    }
    return params;
}

cairn_config onTaskScheduler(btITaskScheduler* scheduler, const cairn_config* config) {
    struct Tasks : btIParallelForBody {
        Tasks(cairn_task runs, void* of) : task(runs), argument(of) {}
        void forLoop(int begin, int end) const override {
            for (int i = begin; i < end; ++i)
                task(argument, static_cast<uint32_t>(i));
        }
        cairn_task task;
        void* argument;
    };
    cairn_config result = {};
    if (config)
        result = *config;
    result.struct_size = sizeof result;
    if (!scheduler)
        return result;
    result.threads = static_cast<uint32_t>(std::max(scheduler->getNumThreads(), 1));
    result.user = scheduler;
    result.parallel_for = [](void* user, uint32_t count, cairn_task task, void* argument) {
        static_cast<btITaskScheduler*>(user)->parallelFor(0, static_cast<int>(count), 1, Tasks(task, argument));
    };
    return result;
}

} // namespace bullet
} // namespace cairn
