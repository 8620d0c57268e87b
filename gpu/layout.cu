#include "layout.h"

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
#endif

namespace cairn::gpu {

namespace {

// Arrays one after the other, each on a line of the memory's own; the gaps are poisoned where a sanitizer looks.
class Carver {
  public:
    explicit Carver(std::byte* base) : base_(base) {}

    template <class T> void add(T*& array, std::size_t count) {
        array = base_ ? reinterpret_cast<T*>(base_ + used_) : nullptr;
        const std::size_t size = count * sizeof(T), padded = (size + kLine) / kLine * kLine; // at least a byte of gap
#if defined(__SANITIZE_ADDRESS__)
        if (base_) {
            ASAN_UNPOISON_MEMORY_REGION(base_ + used_, size);
            ASAN_POISON_MEMORY_REGION(base_ + used_ + size, padded - size);
        }
#endif
        used_ += padded;
    }
    std::size_t used() const { return used_; }

  private:
    static constexpr std::size_t kLine = 256;
    std::byte* base_;
    std::size_t used_ = 0;
};

} // namespace

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
