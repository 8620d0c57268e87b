// From tables to blocks: what is solved together, who shares a body (n of paper eq. 19), islands, lanes and slots.
#include "islands.h"
#include "pack.h"
#include "scene.h"

namespace cairn {

template <class S> void Scene<S>::find_blocks(const Input& input, const Params& params) {
    const auto add = [](std::vector<Block>& blocks, std::int32_t a, std::int32_t b, std::uint32_t i, std::uint32_t most) {
        if (!blocks.empty()) {
            Block& last = blocks.back();
            if (last.a == a && last.b == b && last.first + last.count == i && last.count < most) {
                ++last.count;
                return;
            }
        }
        blocks.push_back({a, b, i, 1, 0, 0});
    };
    const auto body = [](const Column& column, std::size_t i) { return static_cast<std::int32_t>(column.integer(i)); };

    contact_blocks_.clear();
    joint_blocks_.clear();
    raw_blocks_.clear();
    contacts = joints = rows = 0;
    for (std::uint32_t i = 0; i < input.contacts.count; ++i) {
        const std::int32_t a = body(input.contacts.body_a, i), b = body(input.contacts.body_b, i);
        if (!movable(a) && !movable(b))
            continue;
        add(contact_blocks_, a, b, i, kPoints);
        ++contacts;
    }
    for (std::uint32_t i = 0; i < input.joints.count; ++i) {
        const std::int32_t a = body(input.joints.body_a, i), b = body(input.joints.body_b, i);
        if (!movable(a) && !movable(b))
            continue;
        joint_blocks_.push_back({a, b, i, 1, 0, 0});
        ++joints;
        rows += joint_rows(input.joints, i);
    }
    std::int64_t last_block = 0;
    for (std::uint32_t i = 0; i < input.rows.count; ++i) {
        const std::int32_t a = body(input.rows.body_a, i), b = body(input.rows.body_b, i);
        const std::int64_t block = input.rows.block.present() ? input.rows.block.integer(i) : 0;
        if (movable(a) || movable(b)) {
            if (block == last_block)
                add(raw_blocks_, a, b, i, kRawRows);
            else
                raw_blocks_.push_back({a, b, i, 1, 0, 0});
            ++rows;
        }
        last_block = block;
    }
    manifolds = static_cast<std::uint32_t>(contact_blocks_.size());

    split_counts.assign(input.bodies.count, 0);
    const auto share = [&](const Block& block, std::uint32_t n) {
        if (movable(block.a))
            split_counts[static_cast<std::size_t>(block.a)] += n;
        if (movable(block.b))
            split_counts[static_cast<std::size_t>(block.b)] += n;
    };
    for (Block& block : contact_blocks_) {
        for (std::uint32_t p = 0; p < block.count; ++p)
            block.contact = std::min(block.contact, contact_kind(input.contacts, block.first + p, params.friction_model));
        share(block, params.splitting == Splitting::manifold ? 1 : block.count);
        rows += block.count * rows_of(block.contact);
    }
    for (const Block& block : joint_blocks_)
        share(block, 1);
    for (const Block& block : raw_blocks_)
        share(block, 1);
    for (std::size_t i = 0; i < split_counts.size(); ++i)
        mass_[8 * i + 3] = static_cast<S>(split_counts[i]);
}

template <class S> void Scene<S>::find_islands() {
    const std::uint32_t bodies = frame.body_count;
    parent_.resize(bodies);
    for (std::uint32_t i = 0; i < bodies; ++i)
        parent_[i] = i;
    const auto every_block = [&](const auto& visit) {
        for (std::vector<Block>* blocks : {&contact_blocks_, &joint_blocks_, &raw_blocks_})
            for (Block& block : *blocks)
                visit(block);
    };
    every_block([&](Block& block) {
        if (movable(block.a) && movable(block.b))
            unite(parent_, static_cast<std::uint32_t>(block.a), static_cast<std::uint32_t>(block.b));
    });
    body_island_.resize_filled(bodies, 0);
    std::uint32_t islands = 0;
    for (std::uint32_t i = 0; i < bodies; ++i) {
        if (!constants_[i].movable)
            continue;
        const std::uint32_t root = find_root(parent_, i);
        body_island_[i] = root == i ? islands++ : body_island_[root];
    }
    frame.island_count = islands;
    island_begin_.resize_filled(islands + std::size_t{1}, 0);
    every_block([&](Block& block) {
        block.island = body_island_[static_cast<std::size_t>(movable(block.a) ? block.a : block.b)];
        ++island_begin_[block.island + std::size_t{1}];
    });
    for (std::uint32_t i = 0; i < islands; ++i)
        island_begin_[i + std::size_t{1}] += island_begin_[i];
}

// Groups of lanes: blocks of one shape side by side, in the order of the input.
template <class S> void Scene<S>::lay_out(const Input& input) {
    contact_groups_.clear();
    joint_groups_.clear();
    raw_groups_.clear();
    std::uint32_t lanes = 0;
    const auto fill = [&](std::vector<Block>& blocks, std::vector<Group>& groups, const Group& shape, const auto& belongs) {
        std::uint32_t in_group = kGroup;
        for (Block& block : blocks) {
            if (!belongs(block))
                continue;
            if (in_group == kGroup) {
                Group g = shape;
                if (!groups.empty())
                    g.first = groups.back().first + groups.back().count * kGroup;
                groups.push_back(g);
                lanes += kGroup;
                in_group = 0;
            }
            block.lane = lanes - kGroup + in_group++;
        }
    };
    for (std::uint32_t shape = 0; shape < kContactShapes; ++shape)
        fill(contact_blocks_, contact_groups_, contact_group_of(shape),
             [&](const Block& block) { return contact_shape(block.count, block.contact) == shape; });
    for (std::uint32_t shape = 0; shape < kJointShapes; ++shape)
        fill(joint_blocks_, joint_groups_, joint_group_of(shape), [&](const Block& block) {
            return joint_shape(joint_rotation(input.joints, block.first), joint_bounded(input.joints, block.first)) == shape;
        });
    for (std::uint32_t shape = 0; shape < kRawShapes; ++shape)
        fill(raw_blocks_, raw_groups_, raw_group_of(shape), [&](const Block& block) { return raw_shape(block.count) == shape; });
    frame.contact_groups = static_cast<std::uint32_t>(contact_groups_.size());
    frame.joint_groups = static_cast<std::uint32_t>(joint_groups_.size());
    frame.raw_groups = static_cast<std::uint32_t>(raw_groups_.size());
}

// Slots in the order of the input, body by body; sides that cannot move and idle lanes get slots that nobody reads.
template <class S> void Scene<S>::assign_slots() {
    const std::uint32_t bodies = frame.body_count, lanes = (frame.contact_groups + frame.joint_groups + frame.raw_groups) * kGroup;
    lane_a_.resize_filled(lanes, static_cast<std::int32_t>(bodies));
    lane_b_.resize_filled(lanes, static_cast<std::int32_t>(bodies));
    lane_static_.resize_filled(lanes, 0);
    slot_a_.resize_filled(lanes, -1);
    slot_b_.resize_filled(lanes, -1);
    lane_partial_.resize(lanes);
    lane_island_.resize_filled(lanes, 0);
    slot_begin_.resize_filled(bodies + std::size_t{1}, 0);
    const auto every_block = [&](const auto& visit) {
        for (const std::vector<Block>* blocks : {&contact_blocks_, &joint_blocks_, &raw_blocks_})
            for (const Block& block : *blocks)
                visit(block);
    };
    every_block([&](const Block& block) {
        if (movable(block.a))
            ++slot_begin_[static_cast<std::size_t>(block.a) + 1];
        if (movable(block.b))
            ++slot_begin_[static_cast<std::size_t>(block.b) + 1];
    });
    for (std::uint32_t i = 0; i < bodies; ++i)
        slot_begin_[i + std::size_t{1}] += slot_begin_[i];
    scratch_.assign(slot_begin_.begin(), slot_begin_.end());
    std::vector<std::uint32_t> next_partial(island_begin_.begin(), island_begin_.end());
    std::fill_n(lane_partial_.data(), lanes, 0xffffffffu);
    every_block([&](const Block& block) {
        const std::uint32_t lane = block.lane;
        if (block.a >= 0)
            lane_a_[lane] = block.a;
        if (block.b >= 0)
            lane_b_[lane] = block.b;
        if (movable(block.a))
            slot_a_[lane] = static_cast<std::int32_t>(scratch_[static_cast<std::size_t>(block.a)]++);
        if (movable(block.b))
            slot_b_[lane] = static_cast<std::int32_t>(scratch_[static_cast<std::size_t>(block.b)]++);
        lane_static_[lane] = movable(block.a) && movable(block.b) ? S(0) : S(1);
        lane_partial_[lane] = next_partial[block.island]++;
        lane_island_[lane] = block.island;
    });
    std::uint32_t slots = slot_begin_[bodies], partials = island_begin_[frame.island_count];
    for (std::uint32_t lane = 0; lane < lanes; ++lane) {
        if (slot_a_[lane] < 0)
            slot_a_[lane] = static_cast<std::int32_t>(slots++);
        if (slot_b_[lane] < 0)
            slot_b_[lane] = static_cast<std::int32_t>(slots++);
        if (lane_partial_[lane] == 0xffffffffu)
            lane_partial_[lane] = partials++;
    }
    slots_.resize(8 * static_cast<std::size_t>(slots));
    partial_restart_.resize_filled(partials, 0);
    partial_residual_.resize_filled(partials, 0);
}

template void Scene<float>::find_blocks(const Input&, const Params&);
template void Scene<double>::find_blocks(const Input&, const Params&);
template void Scene<float>::find_islands();
template void Scene<double>::find_islands();
template void Scene<float>::lay_out(const Input&);
template void Scene<double>::lay_out(const Input&);
template void Scene<float>::assign_slots();
template void Scene<double>::assign_slots();

} // namespace cairn
