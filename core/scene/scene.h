// A step's input in the solver's own layout (frame.h), and back.
#pragma once
#include "../memory.h"
#include "../method/params.h"
#include "cache.h"
#include "frame.h"
#include "input.h"

#include <string>
#include <vector>

namespace cairn {

// A block of the splitting touches two bodies; -1 is the world.
struct Block {
    std::int32_t a, b;
    std::uint32_t first, count; // elements of its table
    std::uint32_t lane;         // over all kinds
    std::uint32_t island;
};

// cairn_joints.axes of one axis; a limit without room is a lock.
std::uint32_t axis_flags(const Input& input, std::size_t joint, std::size_t axis);

template <class S> class Scene {
  public:
    explicit Scene(const Hooks& hooks);

    // Packs a step. Throws std::bad_alloc.
    void pack(const Input& input, const Params& params, const WarmStartCache& cache);
    // The body that is no longer finite, or an empty text.
    std::string not_finite() const;
    void write(const Input& input, const Output& output) const;
    // Impulses of the last substep, for the next step.
    void remember(const Input& input, WarmStartCache& cache) const;
    double kinetic_energy(std::uint32_t body) const;

    Frame<S> frame{};
    std::vector<std::uint32_t> split_counts;
    std::uint32_t manifolds = 0, contacts = 0, joints = 0, rows = 0, warm_started = 0;
    bool bounces = false;

  private:
    void pack_bodies(const Input& input, std::uint32_t substeps);
    void find_blocks(const Input& input, const Params& params);
    void find_islands();
    void lay_out(const Input& input, const Params& params);
    void assign_slots();
    void pack_contact(const Input& input, std::size_t i, S* hot, S* cold, const Params& params, const WarmStartCache& cache);
    void pack_joint(const Input& input, std::size_t i, S* hot, S* cold, const WarmStartCache& cache);
    void pack_row(const Input& input, const Block& block, std::uint32_t r, S* hot, const WarmStartCache& cache);
    bool movable(std::int32_t body) const { return body >= 0 && constants_[static_cast<std::size_t>(body)].movable; }

    // where lane i of a kind's group g lies
    template <class Groups> static std::size_t hot_at(const Groups& groups, std::uint32_t lane) {
        return groups[lane / kGroup].offset + lane % kGroup;
    }
    template <class Groups> static std::size_t cold_at(const Groups& groups, std::uint32_t lane) {
        return groups[lane / kGroup].cold_offset + lane % kGroup;
    }

    Buffer<BodyConstants<S>> constants_;
    Buffer<S> velocity_, iterate_, displacement_, mass_, mass_cross_, slots_;
    Buffer<S> contact_, contact_cold_, joint_, joint_cold_, raw_, lane_static_, partial_restart_, partial_residual_;
    Buffer<std::int32_t> lane_a_, lane_b_, slot_a_, slot_b_;
    Buffer<std::uint32_t> lane_partial_, moving_, body_island_, slot_begin_, clamped_, island_begin_;
    Buffer<std::uint8_t> island_bounces_;
    Buffer<Control<S>> control_;
    std::vector<Group> contact_groups_, joint_groups_, raw_groups_;
    // in the order of the input, kind after kind
    std::vector<Block> contact_blocks_, joint_blocks_, raw_blocks_;
    std::vector<std::uint32_t> parent_, scratch_;
};

} // namespace cairn
