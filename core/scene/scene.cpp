#include "scene.h"

#include "settings.h"
#include "unpack.h"

namespace cairn {

template <class S>
Scene<S>::Scene(const Hooks& hooks)
    : constants_(hooks), velocity_(hooks), iterate_(hooks), displacement_(hooks), mass_(hooks), mass_cross_(hooks), slots_(hooks),
      contact_(hooks), contact_cold_(hooks), contact_extra_(hooks), joint_(hooks), joint_cold_(hooks), raw_(hooks), lane_static_(hooks),
      partial_restart_(hooks), partial_residual_(hooks), lane_a_(hooks), lane_b_(hooks), slot_a_(hooks), slot_b_(hooks),
      lane_partial_(hooks), lane_island_(hooks), moving_(hooks), body_island_(hooks), slot_begin_(hooks), clamped_(hooks),
      island_begin_(hooks), island_bounces_(hooks), energy_change_(hooks), control_(hooks), trace_(hooks) {}

template <class S> void Scene<S>::pack_bodies(const Input& input, std::uint32_t substeps, const Selection* selection) {
    const BodyColumns& in = input.bodies;
    const std::size_t count = in.count;
    frame.body_count = static_cast<std::uint32_t>(count);
    constants_.resize(count);
    clamped_.resize_filled(count, 0);
    velocity_.resize_filled(8 * (count + 1), 0);
    iterate_.resize_filled(8 * (count + 1), 0);
    displacement_.resize_filled(8 * (count + 1), 0);
    mass_.resize_filled(8 * (count + 1), 0);
    mass_cross_.resize_filled(8 * (count + 1), 0);
    moving_.resize(count);
    energy_change_.resize_filled(count, 0);
    displacement_[8 * count + 7] = 1;
    for (std::size_t i = 0; i < count; ++i) {
        if (selection && !selection->holds(static_cast<std::uint32_t>(i))) { // as if it were still and could not move
            constants_[i].movable = false;
            continue;
        }
        pack_body<S>(in, i, input.dt, input.gravity, substeps,
                     {&constants_[i], velocity_.data() + 8 * i, displacement_.data() + 8 * i, mass_.data() + 8 * i});
    }
    std::uint32_t moving = 0;
    for (std::uint32_t i = 0; i < frame.body_count; ++i)
        if (constants_[i].movable)
            moving_[moving++] = i;
    frame.movable_count = moving;
    for (std::uint32_t i = 0; i < frame.body_count; ++i)
        if (!constants_[i].movable && !is_still(velocity_.data() + 8 * std::size_t{i}))
            moving_[moving++] = i;
    frame.moving_count = moving;
}

template <class S> void Scene<S>::pack(const Input& input, const Params& params, const WarmStartCache& cache, const Selection* selection) {
    set_parameters(frame, params, input.dt);
    pack_bodies(input, params.substeps, selection);
    find_blocks(input, params);
    find_islands();
    lay_out(input);
    assign_slots();

    const auto places = [](const std::vector<Group>& groups) {
        return groups.empty() ? std::size_t{0} : groups.back().first + std::size_t{groups.back().count} * kGroup;
    };
    const std::size_t points = places(contact_groups_), joint_places = places(joint_groups_);
    frame.contact = contact_.resize_filled(points * kContactFields, 0);
    frame.contact_cold = contact_cold_.resize_filled(points * kContactColdFields, 0);
    std::size_t special_points = 0;
    for (const Group& g : contact_groups_)
        special_points += g.special() ? std::size_t{g.count} * kGroup : 0;
    frame.contact_extra = contact_extra_.resize_filled(special_points * kContactExtraFields, 0);
    frame.joint = joint_.resize_filled(joint_places * kJointFields, 0);
    frame.joint_cold = joint_cold_.resize_filled(joint_places * kJointColdFields, 0);
    for (std::size_t i = 0; i < joint_places; ++i) // idle lanes have unit quaternions, too
        for (const std::size_t frame_w : {kStartFrameA + 3, kStartFrameB + 3})
            *field_at(fields_at(frame.joint_cold, kJointColdFields, i), frame_w) = 1;
    frame.raw = raw_.resize_filled(places(raw_groups_) * kRawFields, 0);

    const double h = static_cast<double>(frame.h);
    warm_started = 0;
    bounces = false;
    const auto recall = [&](const KeyedValues& values, const Column& keys, std::size_t i, double share) {
        const double* last = share > 0 ? values.find(key_of(keys, i)) : nullptr;
        warm_started += last ? 1u : 0u;
        return last;
    };
    for (const Block& block : contact_blocks_)
        for (std::uint32_t p = 0; p < block.count; ++p) {
            const std::size_t i = block.first + p;
            bounces = bounces || contact_bounces(input.contacts, i);
            pack_contact(input.contacts, i, params.friction_model, h,
                         recall(cache.contacts, input.contacts.key, i, params.contact_warm_start), contact_at(block, p),
                         contact_cold_at(block, p), contact_extra_at(block, p));
        }
    for (const Block& block : joint_blocks_)
        pack_joint(input.bodies, input.joints, block.first, h, recall(cache.joints, input.joints.key, block.first, params.joint_warm_start),
                   joint_at(block), joint_cold_at(block));
    for (const Block& block : raw_blocks_)
        for (std::uint32_t r = 0; r < block.count; ++r)
            pack_row(input.rows, block.first, block.count, r, h,
                     recall(cache.rows, input.rows.key, block.first + r, params.joint_warm_start), raw_at(block, r));

    control_.resize_filled(frame.island_count, Control<S>{});
    island_bounces_.resize_filled(frame.island_count, 0);

    frame.velocity = velocity_.data();
    frame.iterate = iterate_.data();
    frame.displacement = displacement_.data();
    frame.mass = mass_.data();
    frame.mass_cross = mass_cross_.data();
    frame.body = constants_.data();
    frame.moving = moving_.data();
    frame.body_island = body_island_.data();
    frame.slot_begin = slot_begin_.data();
    frame.slots = slots_.data();
    frame.rotation_clamped = clamped_.data();
    frame.contact_group = contact_groups_.data();
    frame.joint_group = joint_groups_.data();
    frame.raw_group = raw_groups_.data();
    frame.lane_a = lane_a_.data();
    frame.lane_b = lane_b_.data();
    frame.slot_a = slot_a_.data();
    frame.slot_b = slot_b_.data();
    frame.lane_partial = lane_partial_.data();
    frame.lane_island = lane_island_.data();
    frame.lane_static = lane_static_.data();
    frame.partial_restart = partial_restart_.data();
    frame.partial_residual = partial_residual_.data();
    frame.island_begin = island_begin_.data();
    frame.island_bounces = island_bounces_.data();
    frame.control = control_.data();
    frame.energy_change = energy_change_.data();
    frame.trace = nullptr;
    if (params.residual_trace)
        frame.trace = trace_.resize_filled(std::size_t{params.iterations} * frame.island_count, S(-1));
}

template <class S> std::string Scene<S>::not_finite() const {
    for (std::uint32_t i = 0; i < frame.body_count; ++i) {
        if (!constants_[i].movable)
            continue;
        if (!is_finite(velocity_.data() + 8 * std::size_t{i}, displacement_.data() + 8 * std::size_t{i}))
            return "body " + std::to_string(i) + " is no longer finite";
    }
    return {};
}

template <class S> void Scene<S>::clear(const Input& input, const Output& output) {
    for (std::size_t i = 0; i < input.contacts.count; ++i)
        clear_contact(output, i);
    for (std::size_t i = 0; i < input.joints.count; ++i)
        clear_joint(output, i);
    for (std::size_t i = 0; i < input.rows.count; ++i)
        clear_row(output, i);
}

template <class S> void Scene<S>::write(const Input& input, const Output& output) const {
    for (std::uint32_t i = 0; i < frame.body_count; ++i)
        if (constants_[i].movable)
            write_body(input.bodies, output, i, velocity_.data() + 8 * std::size_t{i}, displacement_.data() + 8 * std::size_t{i});
    for (const Block& block : contact_blocks_)
        for (std::uint32_t p = 0; p < block.count; ++p)
            write_contact(output, block.first + p, contact_at(block, p), contact_cold_at(block, p), contact_extra_at(block, p));
    for (const Block& block : joint_blocks_)
        write_joint(output, block.first, joint_at(block), joint_cold_at(block));
    for (const Block& block : raw_blocks_)
        for (std::uint32_t r = 0; r < block.count; ++r)
            write_row(output, block.first + r, raw_at(block, r));
}

template <class S> void Scene<S>::remember(const Input& input, WarmStartCache& cache) const {
    const double per_h = 1 / static_cast<double>(frame.h);
    double values[kJointMemory];
    if (input.contacts.key.present())
        for (const Block& block : contact_blocks_)
            for (std::uint32_t p = 0; p < block.count; ++p) {
                remember_contact(contact_at(block, p), contact_cold_at(block, p), per_h, values);
                cache.contacts.insert(input.contacts.key.key(block.first + p), values);
            }
    if (input.joints.key.present())
        for (const Block& block : joint_blocks_) {
            remember_joint(joint_cold_at(block), per_h, values);
            cache.joints.insert(input.joints.key.key(block.first), values);
        }
    if (input.rows.key.present())
        for (const Block& block : raw_blocks_)
            for (std::uint32_t r = 0; r < block.count; ++r) {
                remember_row(raw_at(block, r), per_h, values);
                cache.rows.insert(input.rows.key.key(block.first + r), values);
            }
}

template class Scene<float>;
template class Scene<double>;

} // namespace cairn
