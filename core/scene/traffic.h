// Bytes that a velocity sweep must move, counted from the layout of frame.h: every number that its stages read or write, once each, as
// if nothing stayed in a cache between stages. For measurements; tests/bench/gpu/test_traffic.cpp holds the counts against the sweeps.
#pragma once
#include "frame.h"

namespace cairn {

// What is swept: contact points by kind, their manifolds, joints, and the bodies that can move.
struct Traffic {
    double points[4] = {}; // by ContactKind
    double manifolds = 0, joints = 0, bodies = 0;
    double movable_sides = 0; // of manifolds and joints
    bool pyramid = false, manifold_blocks = false;
    bool reduces = false; // acceleration or a tolerance: islands have records, and sweeps keep the iterate before
};

// Numbers of a point alone, its manifold's and bodies' share left out.
inline unsigned point_numbers(ContactKind kind, bool pyramid, bool reduces) {
    if (kind == ContactKind::smooth) {
        const unsigned fields = 3 + 6 + 3;             // normal, arms; inverse, bias, gamma
        return fields + 1 + 1 + (reduces ? 1 + 1 : 0); // lambda: one buffer read, the other written; the majoriser's, and that one read
    }
    unsigned fields = kFriction + 1; // directions, arms, inverses, bias, gamma, friction
    if (!pyramid)                    // D_12 is the pyramid's
        --fields;
    fields += 3 + 3;
    if (reduces)
        fields += (kLambda - kDnn) + 3;
    if (kind == ContactKind::special || kind == ContactKind::torsional)
        fields += 2; // the slip's target
    if (kind == ContactKind::torsional)
        fields += 4 + 3 + 3 + (reduces ? 2 + 3 : 0); // bounds and inverses; the torque as lambda
    return fields;
}

// Of a joint with free and locked axes only; whichever are free, its block has all of its numbers.
inline unsigned joint_numbers(bool reduces) { return kBlock + 6 + 6 + (reduces ? 6 : 0); }

// `device`: with the indices that a GPU thread reads for itself.
inline double sweep_bytes(const Traffic& t, bool device) {
    constexpr double number = sizeof(float), row = 8 * sizeof(float), index = sizeof(std::uint32_t);
    double points = 0;
    for (std::uint32_t kind = 0; kind < 4; ++kind)
        points += t.points[kind] * point_numbers(static_cast<ContactKind>(kind), t.pyramid, t.reduces);
    // bodies and slots of both sides; on a device also shape, first and stride, which the CPU knows of 16 lanes at once
    double lane = (4 + (device ? 3 : 0)) * index;
    lane += 2 * row;         // both sides' slots are written, ...
    double side = row + row; // ... those that can move read again, and a velocity for each
    double body = 4 * row;   // velocity read and written, mass in two rows
    body += index;           // where its slots begin
    if (t.manifold_blocks)
        side += 2 * row; // the mass (of contacts)
    if (t.reduces) {
        lane += index + 4 * number; // restart and residual: where they go, written, read
        body += 2 * row;            // the iterate
        body += index;              // its island
    }
    return number * (points + t.joints * joint_numbers(t.reduces)) + (t.manifolds + t.joints) * lane + t.movable_sides * side +
           t.bodies * body;
}

} // namespace cairn
