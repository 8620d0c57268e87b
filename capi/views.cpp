#include "views.h"

#include "gpu/device.h"

#include <algorithm>
#include <limits>
#include <string>

namespace cairn::capi {

namespace {

const char* names_of(Kind kind) {
    switch (kind) {
    case Kind::real:
        return "CAIRN_F32 or CAIRN_F64";
    case Kind::integer:
        return "CAIRN_I32 or CAIRN_U32";
    default:
        return "CAIRN_U64";
    }
}

bool fits(std::uint32_t type, Kind kind) {
    switch (kind) {
    case Kind::real:
        return type == CAIRN_F32 || type == CAIRN_F64;
    case Kind::integer:
        return type == CAIRN_I32 || type == CAIRN_U32;
    default:
        return type == CAIRN_U64;
    }
}

std::uintptr_t magnitude(std::int64_t stride) {
    const auto bits = static_cast<std::uint64_t>(stride);
    return static_cast<std::uintptr_t>(stride < 0 ? 0 - bits : bits);
}

// Floor of a / b, b > 0.
std::intptr_t floor_div(std::intptr_t a, std::intptr_t b) { return a / b - (a % b < 0 ? 1 : 0); }

// Two rows of elements with one stride: a's element i meets b's element j exactly when
// -length_b < (begin_a - begin_b) + (i - j) stride < length_a reads, seen from b, with k = i - j between its bounds.
bool overlap_with_one_stride(const Extent& a, const Extent& b, std::uintptr_t stride) {
    const auto s = static_cast<std::intptr_t>(stride);
    const auto offset = static_cast<std::intptr_t>(a.begin - b.begin);
    const auto least = -floor_div(offset + static_cast<std::intptr_t>(a.length) - 1, s);   // k s > -(offset + length_a)
    const auto greatest = floor_div(static_cast<std::intptr_t>(b.length) - 1 - offset, s); // k s < length_b - offset
    const auto last_a = static_cast<std::intptr_t>(a.demand.count) - 1, last_b = static_cast<std::intptr_t>(b.demand.count) - 1;
    return std::max(least, -last_b) <= std::min(greatest, last_a);
}

} // namespace

Extent check_view(const cairn_view& view, const Demand& demand) {
    const char *const table = demand.table, *const field = demand.field;
    Extent extent;
    extent.view = &view;
    extent.demand = demand;
    if (view.data == nullptr) {
        if (demand.required && demand.count > 0)
            refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s is absent (data is NULL), but it is required for %zu elements", table, field,
                   demand.count);
        return extent;
    }
    if (!fits(view.type, demand.kind))
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s: type is %u, must be %s", table, field, view.type, names_of(demand.kind));
    if (view.device > CAIRN_DEVICE)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s: device is %u, must be CAIRN_HOST (0) or CAIRN_DEVICE (1)", table, field, view.device);
    if (view.device == CAIRN_DEVICE && demand.device == kHostOnly)
        refuse(CAIRN_ERROR_UNSUPPORTED, "%s.%s: device is CAIRN_DEVICE, but cairn_evaluate reads host memory alone: pass a copy there",
               table, field);
    if (view.device == CAIRN_DEVICE && demand.device < 0)
        refuse(CAIRN_ERROR_UNSUPPORTED,
               "%s.%s: device is CAIRN_DEVICE, but this solver runs on the CPU: pass host memory (CAIRN_HOST), or make the solver with "
               "CAIRN_BACKEND_CUDA",
               table, field);
    if (demand.count == 0)
        return extent;

    const std::size_t size = size_of(static_cast<Type>(view.type));
    const std::size_t length = demand.components * size;
    const auto address = reinterpret_cast<std::uintptr_t>(view.data);
    if (address % size != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s: data is %p, must be aligned to its type (%zu bytes)", table, field, view.data, size);
    const std::int64_t stride = view.stride == 0 ? static_cast<std::int64_t>(length) : view.stride;
    const std::uintptr_t step = magnitude(stride);
    if (step % size != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s: stride is %lld bytes, must be a multiple of its type's %zu bytes", table, field,
               static_cast<long long>(stride), size);
    if (demand.count > 1 && step < length)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT,
               "%s.%s: stride is %lld bytes, but an element has %zu, so that elements overlap: strides are in bytes, 0 means packed", table,
               field, static_cast<long long>(stride), length);

    std::uintptr_t span = 0, highest = 0;
    bool outside = __builtin_mul_overflow(step, static_cast<std::uintptr_t>(demand.count - 1), &span);
    outside = outside || span > static_cast<std::uintptr_t>(std::numeric_limits<std::intptr_t>::max());
    outside = outside || (stride < 0 ? span > address : __builtin_add_overflow(address, span, &highest));
    if (!outside) {
        extent.begin = stride < 0 ? address - span : address;
        outside = __builtin_add_overflow(extent.begin, span + length, &extent.end);
    }
    if (outside)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s: %zu elements %lld bytes apart do not fit the address space", table, field,
               demand.count, static_cast<long long>(stride));
    if (view.device == CAIRN_DEVICE)
        for (const std::uintptr_t at : {extent.begin, extent.end - 1})
            if (const std::string place = gpu::not_on_device(reinterpret_cast<const void*>(at), demand.device); !place.empty())
                refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s: device is CAIRN_DEVICE, but its elements at %p %s", table, field,
                       reinterpret_cast<const void*>(at), place.c_str());
    extent.present = true;
    extent.stride = step;
    extent.signed_stride = static_cast<std::ptrdiff_t>(stride);
    extent.length = length;
    return extent;
}

bool overlap(const Extent& a, const Extent& b) {
    if (!a.present || !b.present || a.end <= b.begin || b.end <= a.begin)
        return false;
    if (a.demand.count == 1 || b.demand.count == 1 || a.stride == b.stride)
        return overlap_with_one_stride(a, b, a.demand.count == 1 ? b.stride : a.stride);
    // Both ascend, so one walk over the two meets every pair that could touch.
    for (std::uintptr_t at_a = a.begin, at_b = b.begin; at_a < a.end && at_b < b.end;) {
        if (at_a + a.length <= at_b)
            at_a += a.stride;
        else if (at_b + b.length <= at_a)
            at_b += b.stride;
        else
            return true;
    }
    return false;
}

bool identical(const Extent& a, const Extent& b) {
    return a.present && b.present && a.begin == b.begin && a.view->type == b.view->type && a.length == b.length &&
           a.demand.count == b.demand.count && (a.demand.count == 1 || a.signed_stride == b.signed_stride);
}

} // namespace cairn::capi
