#include "pack.h"

#include "../core/scene/unpack.h"
#include "cache.h"
#include "memory.h"
#include "sorting.h"

namespace cairn::gpu {

namespace {

constexpr u32 kLargeIsland = 32; // blocks: more are added up by a whole CUDA block

// Union-find over bodies as in core/scene/islands.h: the smallest body becomes the root, whoever comes first.
__device__ u32 find_root(const volatile u32* parent, u32 i) { // volatile: others are at work, and a cache would hide it
    while (parent[i] != i)
        i = parent[i];
    return i;
}
__device__ void unite(u32* parent, u32 i, u32 j) {
    for (;;) {
        i = find_root(parent, i);
        j = find_root(parent, j);
        if (i == j)
            return;
        const u32 low = i < j ? i : j, high = i < j ? j : i;
        if (atomicCAS(&parent[high], high, low) == high)
            return;
    }
}

// First place of sorted keys that is not below `key`.
__device__ u32 lower_bound(const u32* keys, u32 count, u32 key) {
    u32 begin = 0, end = count;
    while (begin < end) {
        const u32 middle = begin + (end - begin) / 2;
        if (keys[middle] < key)
            begin = middle + 1;
        else
            end = middle;
    }
    return begin;
}

struct Step {
    Layout d;
    Counts n;
    __device__ bool stopped() const { return d.report->bad_input != 0; }
    __device__ const Input& input() const { return d.request->input; }
    __device__ u32 kind_of(std::int32_t body) const { return body < 0 ? kFixedBody : d.body_kind[body]; }
    // Of a head's two bodies, one that can move.
    __device__ u32 movable_body(u32 e) const {
        return static_cast<u32>(kind_of(d.element_a[e]) == kMovableBody ? d.element_a[e] : d.element_b[e]);
    }
};

// ---- Bodies and blocks ----

struct ClassifyBody : Step {
    __device__ void operator()(u32 i) const {
        const BodyColumns& in = input().bodies;
        const DVec v = real3(in.linear_velocity, i), w = real3(in.angular_velocity, i);
        const auto zero = [](double x) { return static_cast<float>(x) == 0; };
        const bool still = zero(v.x) && zero(v.y) && zero(v.z) && zero(w.x) && zero(w.y) && zero(w.z);
        d.body_kind[i] = is_movable(in, i) ? kMovableBody : still ? kFixedBody : kKinematicBody;
        d.parent[i] = i;
        d.cost[i] = 0;
        d.weight[i] = 0;
        d.split[i] = 0;
    }
};

// The table of element e of all capacities, and the row in it; false beyond its end.
struct Place {
    u32 kind, row; // 0 contact, 1 joint, 2 raw row
};
__device__ bool place_of(const Step& s, u32 e, Place& place) {
    const u32 joints = s.d.joint_base(), raws = s.d.raw_base();
    place = e < joints ? Place{0, e} : e < raws ? Place{1, e - joints} : Place{2, e - raws};
    return place.row < (place.kind == 0 ? s.n.contacts : place.kind == 1 ? s.n.joints : s.n.rows);
}

// mark: e + 1 where a run of elements of the same two bodies (and block) begins, else 0.
struct ReadElement : Step {
    __device__ void operator()(u32 e) const {
        d.mark[e] = 0;
        d.head[e] = 0;
        d.element_a[e] = d.element_b[e] = -1;
        Place at;
        if (!place_of(*this, e, at))
            return;
        const Column& a = at.kind == 0 ? input().contacts.body_a : at.kind == 1 ? input().joints.body_a : input().rows.body_a;
        const Column& b = at.kind == 0 ? input().contacts.body_b : at.kind == 1 ? input().joints.body_b : input().rows.body_b;
        const auto body = [](const Column& column, u32 i) { return static_cast<std::int32_t>(column.integer(i)); };
        d.element_a[e] = body(a, at.row);
        d.element_b[e] = body(b, at.row);
        if (kind_of(d.element_a[e]) != kMovableBody && kind_of(d.element_b[e]) != kMovableBody)
            return;
        const Column& block = input().rows.block;
        const bool goes_on = at.kind != 1 && at.row > 0 && body(a, at.row - 1) == d.element_a[e] && body(b, at.row - 1) == d.element_b[e] &&
                             (at.kind == 0 || !block.present() || block.integer(at.row - 1) == block.integer(at.row));
        d.mark[e] = goes_on ? 0 : e + 1;
        d.head[e] = 1; // for now: it has an effect
    }
};

// A run is cut into blocks of four contact points (six raw rows). head: their count at a block's first element, else 0.
struct FindHead : Step {
    __device__ void operator()(u32 e) const {
        Place at;
        d.shape[e] = 0; // of elements without effect; others get a count below
        if (!place_of(*this, e, at) || d.head[e] == 0)
            return;
        const u32 limit = at.kind == 0 ? kPoints : at.kind == 1 ? 1 : kRawRows;
        if ((e + 1 - d.run[e]) % limit == 0)
            d.shape[e] = count_of(e, at, limit);
    }
    __device__ u32 count_of(u32 e, Place at, u32 limit) const {
        u32 count = 1;
        for (Place next = at; count < limit; ++count)
            if (!place_of(*this, e + count, next) || next.kind != at.kind || d.mark[e + count] != 0 || d.head[e + count] == 0)
                break;
        return count;
    }
};

// Counts, shape, who shares a body, islands. `shape` holds FindHead's count until now.
struct MakeBlock : Step {
    __device__ void operator()(u32 e) const {
        Place at;
        const u32 count = d.shape[e];
        d.head[e] = count;
        if (count == 0 || !place_of(*this, e, at))
            return;
        Report& report = *d.report;
        if (at.kind == 0) {
            ContactKind kind = ContactKind::smooth;
            for (u32 p = 0; p < count; ++p) {
                const ContactKind found = contact_kind(input().contacts, at.row + p, d.request->friction_model);
                kind = found < kind ? found : kind;
            }
            d.shape[e] = contact_shape(count, kind);
            atomicAdd(&report.contacts, count);
            atomicAdd(&report.manifolds, 1u);
            atomicAdd(&report.rows, count * rows_of(kind));
        } else if (at.kind == 1) {
            const JointColumns& in = input().joints;
            d.shape[e] = joint_shape(joint_rotation(in, at.row), joint_bounded(in, at.row));
            atomicAdd(&report.joints, 1u);
            atomicAdd(&report.rows, joint_rows(in, at.row));
        } else {
            d.shape[e] = raw_shape(count);
            atomicAdd(&report.rows, count);
        }
        const u32 shares = at.kind == 0 && d.request->points_count ? count : 1;
        const std::int32_t a = d.element_a[e], b = d.element_b[e];
        const bool moves_a = kind_of(a) == kMovableBody, moves_b = kind_of(b) == kMovableBody;
        if (moves_a)
            atomicAdd(&d.split[a], shares);
        if (moves_b)
            atomicAdd(&d.split[b], shares);
        if (moves_a && moves_b)
            unite(d.parent, static_cast<u32>(a), static_cast<u32>(b));
    }
};

// ---- Islands and tiles ----

struct FindIsland : Step {
    __device__ void operator()(u32 i) const {
        d.component[i] = find_root(d.parent, i);
        if (d.body_kind[i] == kMovableBody)
            atomicAdd(&d.report->movable, 1u);
    }
};
struct SettleIsland : Step { // in a pass of its own: the one before still follows parents
    __device__ void operator()(u32 i) const { d.parent[i] = d.component[i]; }
};
// A kinematic body is shared by what touches it: it moves along in one tile only.
struct TieKinematic : Step {
    __device__ void operator()(u32 e) const {
        if (d.head[e] == 0)
            return;
        atomicAdd(&d.weight[d.parent[movable_body(e)]], 1u);
        const std::int32_t a = d.element_a[e], b = d.element_b[e];
        if (kind_of(a) == kKinematicBody || kind_of(b) == kKinematicBody)
            unite(d.component, static_cast<u32>(a), static_cast<u32>(b));
    }
};
// cost: bodies and lanes of a component, at its root.
struct CostOfBody : Step {
    __device__ void operator()(u32 i) const {
        if (d.body_kind[i] != kFixedBody)
            atomicAdd(&d.cost[find_root(d.component, i)], 1u + (d.parent[i] == i ? d.weight[i] : 0));
    }
};
__device__ u32 tile_of_body(const Step& s, u32 i) { return s.d.cost_before[find_root(s.d.component, i)] / s.d.request->quota; }

struct CountTiles : Step {
    __device__ void operator()(u32) const {
        const u32 last = n.bodies - 1, total = n.bodies > 0 ? d.cost_before[last] + d.cost[last] : 0;
        d.report->tiles = total == 0 ? 1 : (total - 1) / d.request->quota + 1;
    }
};
struct IslandKey : Step {
    __device__ void operator()(u32 i) const {
        atomicMax(&d.report->component, d.cost[i]);
        const bool root = d.body_kind[i] == kMovableBody && d.parent[i] == i;
        d.keys[i] = root ? 2 * tile_of_body(*this, i) + (d.weight[i] > kLargeIsland ? 0 : 1) : kNone;
        d.values[i] = i;
        d.island_rank[i] = root ? 1 : 0; // to be summed up
    }
};
struct NumberIsland : Step {
    __device__ void operator()(u32 place) const {
        const bool used = d.sorted_keys[place] != kNone;
        if (used) {
            const u32 root = d.sorted[place];
            d.island_of[root] = place;
            d.island_root[place] = root;
        }
        if (used && (place + 1 == n.bodies || d.sorted_keys[place + 1] == kNone))
            d.report->islands = place + 1;
    }
};
struct RankIsland : Step { // its number in the order of the input
    __device__ void operator()(u32 i) const {
        if (i < d.report->islands)
            d.island_rank[i] = d.weight[d.island_root[i]];
    }
};
struct TileIslands : Step {
    __device__ void operator()(u32 t) const {
        if (t >= d.report->tiles)
            return;
        const auto from = [&](u32 key) { return lower_bound(d.sorted_keys, n.bodies, key); };
        d.tile[t].large = {from(2 * t), from(2 * t + 1)};
        d.tile[t].islands = {from(2 * t), from(2 * t + 2)};
    }
};

// ---- Rows ----

struct RowKey : Step {
    __device__ void operator()(u32 i) const {
        const u32 kind = d.body_kind[i];
        d.keys[i] = kind == kFixedBody ? kNone : 2 * tile_of_body(*this, i) + (kind == kMovableBody ? 0 : 1);
        d.values[i] = i;
    }
};
struct PlaceRow : Step {
    __device__ void operator()(u32 place) const {
        const u32 key = d.sorted_keys[place], i = d.sorted[place];
        if (key == kNone)
            return;
        const u32 row = place + key / 2; // each tile before has a world of its own
        d.row_body[row] = i;
        d.body_row[i] = row;
        d.body_island[row] = d.body_kind[i] == kMovableBody ? d.island_of[d.parent[i]] : 0;
    }
};
struct TileRows : Step {
    __device__ void operator()(u32 t) const {
        if (t >= d.report->tiles)
            return;
        const auto from = [&](u32 key) { return lower_bound(d.sorted_keys, n.bodies, key); };
        Tile& tile = d.tile[t];
        const u32 begin = from(2 * t) + t, movable = from(2 * t + 1) + t, moving = from(2 * t + 2) + t;
        tile.movable = {begin, movable};
        tile.moving = {begin, moving};
        tile.rows = {begin, moving + 1};
        d.row_body[moving] = kNone; // the world
        atomicMax(&d.report->tile_rows, tile.rows.size());
    }
};

// ---- Lanes ----

struct LaneKey : Step {
    u32 base, shapes; // of the kind
    __device__ void operator()(u32 k) const {
        const u32 e = base + k;
        const bool heads = d.head[e] != 0;
        const u32 tile = heads ? tile_of_body(*this, movable_body(e)) : 0;
        d.element_tile[e] = tile;
        d.keys[k] = heads ? tile * shapes + d.shape[e] : kNone;
        d.values[k] = e;
    }
};
struct PlaceLane : Step {
    u32 base;
    __device__ void operator()(u32 place) const {
        const bool used = d.sorted_keys[place] != kNone;
        const u32 e = d.sorted[place], lane = base + place;
        d.lane_head[lane] = used ? e : kNone;
        d.lane_count[lane] = used ? d.head[e] : 0;
        if (used)
            d.element_lane[e] = lane;
    }
};
// Points of lanes of one tile and shape lie side by side: all first points, then all second ones.
struct PlacePoints : Step {
    u32 base, capacity;
    __device__ void operator()(u32 place) const {
        const u32 lane = base + place, key = d.sorted_keys[place];
        if (key == kNone)
            return;
        const u32 begin = lower_bound(d.sorted_keys, capacity, key), end = lower_bound(d.sorted_keys, capacity, key + 1);
        d.lane_first[lane] = d.points_before[base + begin] + (place - begin);
        d.lane_stride[lane] = end - begin;
    }
};
struct TileLanes : Step {
    u32 kind, shapes, capacity;
    __device__ void operator()(u32 t) const {
        if (t >= d.report->tiles)
            return;
        Tile& tile = d.tile[t];
        Range& range = kind == 0 ? tile.contacts : kind == 1 ? tile.joints : tile.raws;
        range = {lower_bound(d.sorted_keys, capacity, t * shapes), lower_bound(d.sorted_keys, capacity, (t + 1) * shapes)};
    }
};
struct LargestTile : Step {
    __device__ void operator()(u32 t) const {
        if (t < d.report->tiles)
            atomicMax(&d.report->tile_lanes, d.tile[t].contacts.size() + d.tile[t].joints.size() + d.tile[t].raws.size());
    }
};

// ---- Partial sums and slots: an island's, and a body's, in the order of the input ----

struct PartialKey : Step {
    __device__ void operator()(u32 e) const {
        const bool heads = d.head[e] != 0;
        const u32 island = heads ? d.island_of[d.parent[movable_body(e)]] : kNone;
        d.element_island[e] = island;
        d.keys[e] = island;
        d.values[e] = e;
    }
};
struct PlacePartial : Step {
    __device__ void operator()(u32 place) const {
        if (d.sorted_keys[place] != kNone)
            d.lane_partial[d.element_lane[d.sorted[place]]] = place;
    }
};
struct IslandBegin : Step {
    __device__ void operator()(u32 i) const {
        if (i <= d.report->islands)
            d.island_begin[i] = lower_bound(d.sorted_keys, d.capacity.elements(), i);
    }
};

__device__ u32 row_of(const Step& s, u32 e, std::int32_t body) {
    return s.kind_of(body) == kFixedBody ? s.d.tile[s.d.element_tile[e]].rows.end - 1 : s.d.body_row[body];
}
struct SlotKey : Step {
    __device__ void operator()(u32 e) const {
        const bool heads = d.head[e] != 0;
        d.keys[2 * e] = heads ? row_of(*this, e, d.element_a[e]) : kNone;
        d.keys[2 * e + 1] = heads ? row_of(*this, e, d.element_b[e]) : kNone;
        d.values[2 * e] = 2 * e;
        d.values[2 * e + 1] = 2 * e + 1;
    }
};
struct PlaceSlot : Step {
    __device__ void operator()(u32 place) const {
        const u32 row = d.sorted_keys[place], side = d.sorted[place];
        if (row == kNone)
            return;
        const u32 lane = d.element_lane[side / 2];
        (side % 2 == 0 ? d.slot_a : d.slot_b)[lane] = static_cast<std::int32_t>(place);
        (side % 2 == 0 ? d.lane_a : d.lane_b)[lane] = static_cast<std::int32_t>(row);
    }
};
struct SlotBegin : Step {
    __device__ void operator()(u32 row) const { d.slot_begin[row] = lower_bound(d.sorted_keys, 2 * d.capacity.elements(), row); }
};

// ---- Numbers ----

// Impulses of the last step under this key, or null.
__device__ const double* recall(const Memory& memory, u64 key, u32 width) {
    if (key == 0 || memory.table_size == 0)
        return nullptr;
    for (u32 at = home_of(key, memory.table_size); memory.table[at] != 0; at = (at + 1) & (memory.table_size - 1)) {
        const u32 i = memory.table[at] - 1;
        if (memory.key[i] == key)
            return memory.values + static_cast<std::size_t>(i) * width;
    }
    return nullptr;
}

struct PackRow : Step {
    __device__ void operator()(u32 row) const {
        if (row >= d.tile[d.report->tiles - 1].rows.end)
            return;
        const u32 i = d.row_body[row];
        const std::size_t at = 8 * static_cast<std::size_t>(row);
        for (u32 c = 0; c < 8; ++c)
            d.velocity[at + c] = d.iterate[at + c] = d.displacement[at + c] = d.mass[at + c] = d.mass_cross[at + c] = 0;
        d.displacement[at + 7] = 1;
        d.energy_change[row] = 0;
        d.clamped[row] = 0;
        if (i == kNone)
            return;
        const Request& request = *d.request;
        pack_body<float>(input().bodies, i, input().dt, input().gravity, request.substeps,
                         {d.constants + row, d.velocity + at, d.displacement + at, d.mass + at});
        if (d.body_kind[i] == kMovableBody)
            d.mass[at + 3] = static_cast<float>(d.split[i]);
    }
};
template <u32 kFields> __device__ float* cleared(float* array, u32 place) {
    float* const fields = fields_at(array, kFields, place);
    for (u32 f = 0; f < kFields; ++f)
        fields[f * kGroup] = 0;
    return fields;
}

struct PackLane : Step {
    Memories last;
    __device__ void operator()(u32 lane) const {
        const u32 e = d.lane_head[lane];
        Place at;
        if (e == kNone || !place_of(*this, e, at))
            return;
        d.lane_island[lane] = d.element_island[e];
        d.lane_shape[lane] = d.shape[e];
        d.lane_static[lane] = kind_of(d.element_a[e]) == kMovableBody && kind_of(d.element_b[e]) == kMovableBody ? 0.0f : 1.0f;
        const Request& request = *d.request;
        const double h = static_cast<double>(request.h);
        const auto recalled = [&](const Memory& memory, const Column& keys, u32 i, u32 width, double share) {
            const double* const values = share > 0 ? recall(memory, key_of(keys, i), width) : nullptr;
            if (values)
                atomicAdd(&d.report->warm_started, 1u);
            return values;
        };
        const u32 count = d.head[e];
        if (at.kind == 0) {
            const ContactColumns& in = input().contacts;
            const bool special = contact_group_of(d.shape[e]).special();
            for (u32 p = 0; p < count; ++p) {
                const u32 i = at.row + p, place = d.lane_first[lane] + p * d.lane_stride[lane];
                pack_contact(in, i, request.friction_model, h, recalled(last.contacts, in.key, i, kContactMemory, request.contact_share),
                             cleared<kContactFields>(d.contact, place), cleared<kContactColdFields>(d.contact_cold, place),
                             special ? cleared<kContactExtraFields>(d.contact_extra, place) : nullptr);
            }
        } else if (at.kind == 1) {
            const JointColumns& in = input().joints;
            const u32 place = lane - d.joint_base();
            d.lane_first[lane] = place;
            d.lane_stride[lane] = 1;
            pack_joint(input().bodies, in, at.row, h, recalled(last.joints, in.key, at.row, kJointMemory, request.joint_share),
                       cleared<kJointFields>(d.joint, place), cleared<kJointColdFields>(d.joint_cold, place));
        } else {
            const RowColumns& in = input().rows;
            for (u32 r = 0; r < count; ++r) {
                const u32 place = d.lane_first[lane] + r * d.lane_stride[lane];
                pack_row(in, at.row, count, r, h, recalled(last.rows, in.key, at.row + r, kRowMemory, request.joint_share),
                         cleared<kRawFields>(d.raw, place));
            }
        }
    }
};
struct ClearIsland : Step {
    __device__ void operator()(u32 i) const {
        d.control[i] = Control<float>{};
        d.island_bounces[i] = 0;
    }
};

} // namespace

std::size_t pack_scratch(const Capacity& capacity) {
    const u32 most = capacity.bodies > 2 * capacity.elements() ? capacity.bodies : 2 * capacity.elements();
    return sorting_scratch(most);
}

void pack(const Layout& d, const Counts& n, const Memories& last, bool trace, cudaStream_t stream) {
    const Step step{d, n};
    const Capacity& c = d.capacity;
    const u32 elements = c.elements(), tiles = c.tiles();
    const Sorter sorter{d.keys, d.sorted_keys, d.values, d.sorted, d.scratch, d.scratch_size, stream};
    const auto bodies = [&](const auto& body) { loop(stream, n.bodies, body); };
    const auto each_element = [&](const auto& body) { loop(stream, elements, body); };

    bodies(ClassifyBody{step});
    each_element(ReadElement{step});
    sorter.running_maximum(d.mark, d.run, elements);
    each_element(FindHead{step});
    each_element(MakeBlock{step});

    bodies(FindIsland{step});
    bodies(SettleIsland{step});
    each_element(TieKinematic{step});
    bodies(CostOfBody{step});
    sorter.sums_before(d.cost, d.cost_before, n.bodies);
    loop(stream, 1, CountTiles{step});
    bodies(IslandKey{step});
    sorter.sort(n.bodies);
    bodies(NumberIsland{step});
    loop(stream, tiles, TileIslands{step});
    if (trace) {
        sorter.sums_before(d.island_rank, d.weight, n.bodies); // weight has served
        bodies(RankIsland{step});
    }
    loop(stream, c.bodies, ClearIsland{step});

    bodies(RowKey{step});
    sorter.sort(n.bodies);
    bodies(PlaceRow{step});
    loop(stream, tiles, TileRows{step});

    const struct {
        u32 base, capacity, shapes;
    } kinds[] = {{0, c.contacts, kContactShapes}, {c.contacts, c.joints, kJointShapes}, {c.contacts + c.joints, c.rows, kRawShapes}};
    for (u32 kind = 0; kind < 3; ++kind) {
        const auto& k = kinds[kind];
        loop(stream, k.capacity, LaneKey{step, k.base, k.shapes});
        sorter.sort(k.capacity);
        loop(stream, k.capacity, PlaceLane{step, k.base});
        sorter.sums_before(d.lane_count + k.base, d.points_before + k.base, k.capacity);
        loop(stream, k.capacity, PlacePoints{step, k.base, k.capacity});
        loop(stream, tiles, TileLanes{step, kind, k.shapes, k.capacity});
    }
    loop(stream, tiles, LargestTile{step});

    each_element(PartialKey{step});
    sorter.sort(elements);
    each_element(PlacePartial{step});
    loop(stream, c.bodies + 1, IslandBegin{step});
    each_element(SlotKey{step});
    sorter.sort(2 * elements);
    loop(stream, 2 * elements, PlaceSlot{step});
    loop(stream, c.body_rows() + 1, SlotBegin{step});

    loop(stream, c.body_rows(), PackRow{step});
    each_element(PackLane{step, last});
}

} // namespace cairn::gpu
