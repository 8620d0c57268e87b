// Views of the caller's arrays: what a view may be, and which memory of two views overlaps.
#pragma once
#include "scene/fields.h"
#include "status.h"

#include <cstddef>
#include <cstdint>

namespace cairn::capi {

// What a field asks of its view.
struct Demand {
    const char* table; // "bodies"
    const char* field; // "linear_velocity"
    Kind kind;
    std::size_t components;
    std::size_t count; // elements
    bool required;
    int device; // the CUDA device whose memory it may be; or one of the following
};
constexpr int kCpuSolver = -1; // host memory: the solver runs on the CPU
constexpr int kHostOnly = -2;  // host memory, whatever solvers do

// The memory of a checked view: `count` elements of `length` bytes, lowest address first, `stride` (> 0) apart.
struct Extent {
    const cairn_view* view = nullptr; // which one it is
    Demand demand{};
    std::uintptr_t begin = 0, end = 0;
    std::uintptr_t stride = 0, length = 0;
    std::ptrdiff_t signed_stride = 0; // as given, with packed (0) resolved
    bool present = false;
};

// Type, device, alignment, stride and range of addresses; refuses what does not fit.
Extent check_view(const cairn_view& view, const Demand& demand);

// Whether an element of a and an element of b share a byte. Exact.
bool overlap(const Extent& a, const Extent& b);

// The same elements of the same type in the same order.
bool identical(const Extent& a, const Extent& b);

} // namespace cairn::capi
