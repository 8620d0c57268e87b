#include "layout.h"

#include "memory.h"

namespace cairn::gpu {

std::size_t carve(const Capacity& c, std::size_t scratch_size, std::byte* base, Layout& l) {
    const std::size_t bodies = c.bodies, elements = c.elements(), rows = c.body_rows(), tiles = c.tiles();
    const auto places = [](std::size_t count) { return (count + kGroup - 1) / kGroup * kGroup; };
    Carver to(base);
    l.capacity = c;
    to.add(l.request, 1);
    to.add(l.report, 1);
    for (u32** array :
         {&l.body_kind, &l.parent, &l.component, &l.cost, &l.cost_before, &l.weight, &l.split, &l.body_row, &l.island_of, &l.island_rank})
        to.add(*array, bodies);
    to.add(l.element_a, elements);
    to.add(l.element_b, elements);
    for (u32** array : {&l.mark, &l.run, &l.head, &l.shape, &l.element_island, &l.element_lane, &l.element_tile})
        to.add(*array, elements);
    const std::size_t sorted = bodies > 2 * elements ? bodies : 2 * elements;
    for (u32** array : {&l.keys, &l.sorted_keys, &l.values, &l.sorted})
        to.add(*array, sorted);
    to.add(l.scratch, scratch_size);
    l.scratch_size = scratch_size;
    to.add(l.row_body, rows);
    to.add(l.body_island, rows);
    to.add(l.slot_begin, rows + 1);
    to.add(l.clamped, rows);
    to.add(l.constants, rows);
    for (float** array : {&l.velocity, &l.iterate, &l.displacement, &l.mass, &l.mass_cross})
        to.add(*array, 8 * rows);
    to.add(l.slots, 8 * 2 * elements);
    to.add(l.energy_change, rows);
    to.add(l.energy_chunk, bodies / kEnergyChunk + 1);
    for (std::int32_t** array : {&l.lane_a, &l.lane_b, &l.slot_a, &l.slot_b})
        to.add(*array, elements);
    for (u32** array :
         {&l.lane_partial, &l.lane_island, &l.lane_shape, &l.lane_first, &l.lane_stride, &l.lane_head, &l.lane_count, &l.points_before})
        to.add(*array, elements);
    to.add(l.lane_static, elements);
    to.add(l.partial_restart, elements);
    to.add(l.partial_residual, elements);
    to.add(l.partial_level, 4 * elements);
    to.add(l.contact, places(c.contacts) * kContactFields);
    to.add(l.contact_cold, places(c.contacts) * kContactColdFields);
    to.add(l.contact_extra, places(c.special) * kContactExtraFields);
    to.add(l.joint, places(c.joints) * kJointFields);
    to.add(l.joint_cold, places(c.joints) * kJointColdFields);
    to.add(l.raw, places(c.rows) * kRawFields);
    to.add(l.island_begin, bodies + 1);
    to.add(l.island_root, bodies);
    to.add(l.island_bounces, bodies);
    to.add(l.control, bodies);
    to.add(l.trace, std::size_t{c.traced} * bodies);
    to.add(l.tile, tiles);
    return to.used();
}

} // namespace cairn::gpu
