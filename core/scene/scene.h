// A step's input in the solver's own layout (frame.h), and back.
#pragma once
#include "../memory.h"
#include "../method/params.h"
#include "cache.h"
#include "frame.h"
#include "input.h"
#include "survey.h"

#include <string>
#include <vector>

namespace cairn {

// A block of the splitting touches two bodies; -1 is the world.
struct Block {
    std::int32_t a, b;
    std::uint32_t first, count; // elements of its table
    std::uint32_t lane;         // over all kinds
    std::uint32_t island;
    ContactKind contact = ContactKind::smooth;
};

template <class S> class Scene {
  public:
    explicit Scene(const Hooks& hooks);

    // Packs a step, or the selected islands of it alone. Throws std::bad_alloc.
    void pack(const Input& input, const Params& params, const WarmStartCache& cache, const Selection* selection = nullptr);
    // The body that is no longer finite, or an empty text.
    std::string not_finite() const;
    // Zeros for every contact, joint and row, before what has an effect is written.
    static void clear(const Input& input, const Output& output);
    void write(const Input& input, const Output& output) const;
    // Adds the impulses of the last substep, for the next step: after the schedule.
    void remember(const Input& input, WarmStartCache& cache) const;

    Frame<S> frame{};
    std::vector<std::uint32_t> split_counts;
    std::uint32_t manifolds = 0, contacts = 0, joints = 0, rows = 0, warm_started = 0;
    bool bounces = false;

    // What was packed, in the order of the input: for those who look at a step's constraints without sweeping them.
    const std::vector<Block>& contact_blocks() const { return contact_blocks_; }
    const std::vector<Block>& joint_blocks() const { return joint_blocks_; }
    const std::vector<Block>& raw_blocks() const { return raw_blocks_; }
    const Group& joint_group(const Block& block) const { return joint_groups_[joint_lane(block) / kGroup]; }
    // The first field of point p of a manifold, of a joint, of row r of a raw block.
    S* contact_at(const Block& block, std::uint32_t p) const {
        return field_of(frame.contact, kContactFields, contact_groups_, block.lane, p);
    }
    S* contact_cold_at(const Block& block, std::uint32_t p) const {
        return field_of(frame.contact_cold, kContactColdFields, contact_groups_, block.lane, p);
    }
    // null where its group is not special
    S* contact_extra_at(const Block& block, std::uint32_t p) const {
        return block.contact > ContactKind::special ? nullptr
                                                    : field_of(frame.contact_extra, kContactExtraFields, contact_groups_, block.lane, p);
    }
    S* joint_at(const Block& block) const { return field_of(frame.joint, kJointFields, joint_groups_, joint_lane(block), 0); }
    S* joint_cold_at(const Block& block) const { return field_of(frame.joint_cold, kJointColdFields, joint_groups_, joint_lane(block), 0); }
    S* raw_at(const Block& block, std::uint32_t r) const { return field_of(frame.raw, kRawFields, raw_groups_, raw_lane(block), r); }

  private:
    void pack_bodies(const Input& input, std::uint32_t substeps, const Selection* selection);
    void find_blocks(const Input& input, const Params& params);
    void find_islands();
    void lay_out(const Input& input);
    void assign_slots();
    bool movable(std::int32_t body) const { return body >= 0 && constants_[static_cast<std::size_t>(body)].movable; }

    static S* field_of(S* array, std::uint32_t fields, const std::vector<Group>& groups, std::uint32_t lane, std::uint32_t p) {
        return fields_of(array, fields, groups[lane / kGroup], p, lane % kGroup);
    }
    std::uint32_t joint_lane(const Block& block) const { return block.lane - frame.contact_groups * kGroup; }
    std::uint32_t raw_lane(const Block& block) const { return joint_lane(block) - frame.joint_groups * kGroup; }

    Buffer<BodyConstants<S>> constants_;
    Buffer<S> velocity_, iterate_, displacement_, mass_, mass_cross_, slots_;
    Buffer<S> contact_, contact_cold_, contact_extra_, joint_, joint_cold_, raw_, lane_static_, partial_restart_, partial_residual_;
    Buffer<std::int32_t> lane_a_, lane_b_, slot_a_, slot_b_;
    Buffer<std::uint32_t> lane_partial_, lane_island_, moving_, body_island_, slot_begin_, clamped_, island_begin_;
    Buffer<std::uint8_t> island_bounces_;
    Buffer<double> energy_change_;
    Buffer<Control<S>> control_;
    Buffer<S> trace_;
    std::vector<Group> contact_groups_, joint_groups_, raw_groups_;
    // in the order of the input, kind after kind
    std::vector<Block> contact_blocks_, joint_blocks_, raw_blocks_;
    std::vector<std::uint32_t> parent_, scratch_;
};

} // namespace cairn
