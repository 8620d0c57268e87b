// The stages over SIMD lanes. CMake compiles this file once an instruction set, with CAIRN_ISA, CAIRN_LANES and CAIRN_REAL.
#include "kernels.h"

#include "../stages/run.h"

namespace cairn {
#define CAIRN_JOIN(a, b) a##b
#define CAIRN_NAMESPACE(isa) CAIRN_JOIN(kernels_, isa)
namespace CAIRN_NAMESPACE(CAIRN_ISA) {

    namespace {

    void run_group(Stage stage, const Frame<Real>& f, std::uint32_t index) {
        const std::uint32_t joints = f.contact_groups, raws = joints + f.joint_groups;
        for (std::uint32_t sub = 0; sub < kGroup; sub += kLanes) {
            const std::size_t lane = static_cast<std::size_t>(index) * kGroup + sub;
            if (index < joints)
                run_contacts(stage, f, f.contact_group[index], lane, sub);
            else if (index < raws)
                run_joints(stage, f, f.joint_group[index - joints], lane, sub);
            else
                run_raw(stage, f, f.raw_group[index - raws], lane, sub);
        }
    }

    } // namespace

    void run_stage(Stage stage, const Frame<Real>& f, std::uint32_t begin, std::uint32_t end) {
        switch (domain_of(stage)) {
        case Domain::groups:
            for (std::uint32_t i = begin; i < end; ++i)
                run_group(stage, f, i);
            break;
        case Domain::islands:
            for (std::uint32_t i = begin; i < end; ++i)
                run_island(stage, f, i, [&](const Real* values) { return tree_sum(values, f.island_begin[i], f.island_begin[i + 1]); });
            break;
        default:
            for (std::uint32_t i = begin; i < end; ++i)
                run_body(stage, f, f.moving[i]);
            break;
        }
    }

} // namespace )
} // namespace cairn
