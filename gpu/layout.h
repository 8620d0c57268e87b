// What a step keeps on the device: one allocation, carved into arrays whose sizes follow from the tables' alone, so that
// nothing has to be read back to size them. pack.cu fills it, the executors work on it, finish.cu reads it out.
//
// An *element* is a row of a table: contact i is element i, joint i is element contacts + i, raw row i is element
// contacts + joints + i (capacities, not counts). A block of the splitting is known by its first element, its *head*.
// A *lane* is a block in the order in which it is solved: by kind, tile and shape. A *row* is a body in the solver's order: by tile,
// movable ones, then kinematic ones, then the tile's own immovable world. A *tile* is a set of islands that nothing ties
// to the rest, small enough for one CUDA block; or everything, where the whole device works on one.
#pragma once
#include "../core/method/params.h"
#include "../core/scene/frame.h"
#include "../core/scene/input.h"
#include "cuda.h"

namespace cairn::gpu {

constexpr u32 kTileQuota = 128; // bodies and lanes: a tile is closed when it has as many

// How much there is of each table: of a step, or at most.
struct Counts {
    u32 bodies = 0, contacts = 0, joints = 0, rows = 0;

    CAIRN_HD u32 elements() const { return contacts + joints + rows; }
    CAIRN_HD u32 tiles() const { return (bodies + elements()) / kTileQuota + 2; } // at most
};
struct Capacity : Counts {
    u32 traced = 0;  // sweeps of which residuals are kept
    u32 special = 0; // contacts that may be special

    CAIRN_HD u32 body_rows() const { return bodies + tiles(); }
    bool holds(const Capacity& other) const {
        return bodies >= other.bodies && contacts >= other.contacts && joints >= other.joints && rows >= other.rows &&
               traced >= other.traced && special >= other.special;
    }
};

constexpr u32 kNone = 0xffffffffu; // no element, no lane

// Kinds of body; a kinematic one moves, but nothing moves it.
constexpr u32 kFixedBody = 0, kKinematicBody = 1, kMovableBody = 2;

struct Range {
    u32 begin, end;
    CAIRN_HD u32 size() const { return end - begin; }
};
struct Tile {
    Range movable, moving, rows;  // body rows; moving: movable and kinematic ones
    Range contacts, joints, raws; // lanes of each kind, counted from the kind's first
    Range large, islands;         // islands; large: those whose sums are worth a block
};

// What the step is to do. Written by the host, read by every kernel.
struct Request {
    Input input; // columns in device memory
    Output output;
    Friction friction_model;
    u32 substeps;
    u32 quota;        // kTileQuota, or 0xffffffff: everything is one tile
    u32 points_count; // 1: a contact point is a block of the splitting
    float h;
    double contact_share, joint_share; // of the last step's impulses; 0: the cache is not read
};

// What the step has found. Written by kernels, read by the host at the end.
struct Report {
    u32 bad_input;                                                 // tables with a bad element (check.h), 0: none
    u32 not_finite;                                                // count of bodies - the first such body, 0: none
    u32 movable, islands, tiles, tile_rows, tile_lanes, component; // the last three: of the largest
    u32 contacts, manifolds, joints, rows, warm_started, rotation_clamped;
    u32 sweeps[3], any_sweeps; // of the busiest island; any_sweeps: of biased and relaxing ones together
};

// Keyed impulses of the last step (core/scene/cache.h): values by row of the table, and a hash table of rows by key.
struct Memory {
    u64* key; // [capacity], 0: nothing remembered
    double* values;
    u32* table; // open addressing: row + 1, 0 = empty; a power of two, at most half full
    u32 capacity, table_size;
};
struct Memories {
    Memory contacts, joints, rows;
};

struct Layout {
    Capacity capacity;
    Request* request;
    Report* report;
    // bodies, in the order of the input
    u32 *body_kind, *parent, *component, *cost, *cost_before, *weight, *split, *body_row, *island_of;
    // (island_of: at an island's root)
    // elements
    std::int32_t *element_a, *element_b;
    u32 *mark, *run, *head, *shape, *element_island, *element_lane, *element_tile;
    // what sorts and scans work on
    u32 *keys, *sorted_keys, *values, *sorted;
    std::byte* scratch;
    std::size_t scratch_size;
    // rows
    u32 *row_body, *body_island, *slot_begin, *clamped;
    BodyConstants<float>* constants;
    float *velocity, *iterate, *displacement, *mass, *mass_cross, *slots;
    double *energy_change, *energy_chunk;
    // lanes, contacts first, then joints, then raw blocks, each kind from a fixed place on
    std::int32_t *lane_a, *lane_b, *slot_a, *slot_b;
    u32 *lane_partial, *lane_island, *lane_shape, *lane_first, *lane_stride, *lane_head, *lane_count, *points_before;
    float* lane_static;
    float *partial_restart, *partial_residual, *partial_level; // the last: sums on their way up the tree, two arrays of each level
    float *contact, *contact_cold, *contact_extra, *joint, *joint_cold, *raw;
    // islands
    u32 *island_begin, *island_rank, *island_root;
    std::uint8_t* island_bounces;
    Control<float>* control;
    float* trace;
    Tile* tile;

    __device__ u32 joint_base() const { return capacity.contacts; } // of elements and of lanes
    __device__ u32 raw_base() const { return capacity.contacts + capacity.joints; }
};

// Where everything lies if the allocation begins at `base`; returns its size in bytes.
std::size_t carve(const Capacity& capacity, std::size_t scratch_size, std::byte* base, Layout& layout);

} // namespace cairn::gpu
