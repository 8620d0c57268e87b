// The stages over SIMD lanes. CMake compiles this file once an instruction set, with CAIRN_ISA, CAIRN_LANES and CAIRN_REAL.
#include "kernels.h"

#include "../rows/contact.h"
#include "../rows/joint.h"
#include "../rows/raw.h"
#include "../stages/bodies.h"
#include "../stages/islands.h"

namespace cairn {
#define CAIRN_JOIN(a, b) a##b
#define CAIRN_NAMESPACE(isa) CAIRN_JOIN(kernels_, isa)
namespace CAIRN_NAMESPACE(CAIRN_ISA) {

    namespace {

    void run_group(Stage stage, const Frame<Real>& f, std::uint32_t index) {
        const std::uint32_t joints = f.contact_groups, raws = joints + f.joint_groups;
        for (std::uint32_t sub = 0; sub < kGroup; sub += kLanes) {
            const std::size_t lane = static_cast<std::size_t>(index) * kGroup + sub;
            if (index < joints) {
                const Group& g = f.contact_group[index];
                switch (stage) {
                case Stage::approach:
                    approach_contacts(f, g, lane, sub);
                    break;
                case Stage::build:
                    build_contacts(f, g, lane, sub);
                    break;
                case Stage::sweep:
                    sweep_contacts(f, g, lane, sub);
                    break;
                case Stage::position_sweep:
                    position_contacts(f, g, lane, sub);
                    break;
                default:
                    accumulate_contacts(f, g, sub);
                    break;
                }
            } else if (index < raws) {
                const Group& g = f.joint_group[index - joints];
                switch (stage) {
                case Stage::approach:
                    store_partials(f, lane, Lane(Real(0)), Lane(Real(0)));
                    break;
                case Stage::build:
                    build_joints(f, g, lane, sub);
                    break;
                case Stage::sweep:
                    sweep_joints(f, g, lane, sub);
                    break;
                case Stage::position_sweep:
                    position_joints(f, g, lane, sub);
                    break;
                default:
                    accumulate_joints(f, g, sub);
                    break;
                }
            } else {
                const Group& g = f.raw_group[index - raws];
                switch (stage) {
                case Stage::approach:
                    store_partials(f, lane, Lane(Real(0)), Lane(Real(0)));
                    break;
                case Stage::build:
                    build_raw(f, g, lane, sub);
                    break;
                case Stage::sweep:
                    sweep_raw(f, g, lane, sub);
                    break;
                case Stage::position_sweep:
                    scatter_raw(f, lane, no_wrench());
                    break; // they have no position to correct
                default:
                    accumulate_raw(f, g, sub);
                    break;
                }
            }
        }
    }

    } // namespace

    void run_stage(Stage stage, const Frame<Real>& f, std::uint32_t begin, std::uint32_t end) {
        switch (stage) {
        case Stage::approach:
        case Stage::build:
        case Stage::sweep:
        case Stage::position_sweep:
        case Stage::accumulate:
            for (std::uint32_t i = begin; i < end; ++i)
                run_group(stage, f, i);
            break;
        case Stage::inertia:
            for (std::uint32_t i = begin; i < end; ++i)
                refresh_inertia(f, f.moving[i]);
            break;
        case Stage::forces:
            for (std::uint32_t i = begin; i < end; ++i)
                apply_forces(f, f.moving[i]);
            break;
        case Stage::apply_start:
            for (std::uint32_t i = begin; i < end; ++i)
                apply_start(f, f.moving[i]);
            break;
        case Stage::apply:
            for (std::uint32_t i = begin; i < end; ++i)
                apply_sweep(f, f.moving[i]);
            break;
        case Stage::integrate:
            for (std::uint32_t i = begin; i < end; ++i)
                integrate_pose(f, f.moving[i]);
            break;
        case Stage::position_apply:
            for (std::uint32_t i = begin; i < end; ++i)
                apply_position(f, f.moving[i]);
            break;
        case Stage::bouncing:
            for (std::uint32_t i = begin; i < end; ++i)
                mark_bouncing(f, i);
            break;
        case Stage::begin:
            for (std::uint32_t i = begin; i < end; ++i)
                begin_island(f, i);
            break;
        case Stage::reduce:
            for (std::uint32_t i = begin; i < end; ++i)
                reduce_island(f, i);
            break;
        }
    }

} // namespace )
} // namespace cairn
