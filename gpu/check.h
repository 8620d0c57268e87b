// What capi checks in host memory, for tables on the device: whether each element is good. What is wrong with a bad one capi says, on
// a copy.
#pragma once
#include "pack.h"

namespace cairn::gpu {

// Bits of Report::bad_input, in the order in which capi goes through the tables.
constexpr u32 kBadBodies = 1, kBadContacts = 2, kBadJoints = 4, kBadRows = 8;

// Queues the checks of the tables of `input` that are on the device; its columns all are. The report must be cleared.
void check_tables(const Layout& layout, const Input& input, cudaStream_t stream);

} // namespace cairn::gpu
