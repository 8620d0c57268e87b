// The rule of struct_size: a shorter struct gets defaults for the fields it lacks, a longer one must be zero in the part
// that this library does not know.
#pragma once
#include "status.h"

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace cairn::capi {

// Where a struct may have ended in some version: at multiples of 4 bytes up to `from`, then every `each` bytes. Any other
// size would cut a field in two.
struct FieldGrid {
    std::size_t from, each;
};
template <class Struct> struct Layout;
template <> struct Layout<cairn_bodies> {
    static constexpr const char* name = "cairn_bodies";
    static constexpr FieldGrid grid{offsetof(cairn_bodies, position), sizeof(cairn_view)};
};
template <> struct Layout<cairn_contacts> {
    static constexpr const char* name = "cairn_contacts";
    static constexpr FieldGrid grid{offsetof(cairn_contacts, body_a), sizeof(cairn_view)};
};
template <> struct Layout<cairn_joints> {
    static constexpr const char* name = "cairn_joints";
    static constexpr FieldGrid grid{offsetof(cairn_joints, body_a), sizeof(cairn_view)};
};
template <> struct Layout<cairn_rows> {
    static constexpr const char* name = "cairn_rows";
    static constexpr FieldGrid grid{offsetof(cairn_rows, body_a), sizeof(cairn_view)};
};
template <> struct Layout<cairn_results> {
    static constexpr const char* name = "cairn_results";
    static constexpr FieldGrid grid{offsetof(cairn_results, position), sizeof(cairn_view)};
};
template <> struct Layout<cairn_step> {
    static constexpr const char* name = "cairn_step";
    static constexpr FieldGrid grid{offsetof(cairn_step, dt), sizeof(double)};
};
template <> struct Layout<cairn_params> {
    static constexpr const char* name = "cairn_params";
    static constexpr FieldGrid grid{offsetof(cairn_params, contact_warm_start), sizeof(double)};
};
template <> struct Layout<cairn_config> {
    static constexpr const char* name = "cairn_config";
    static constexpr FieldGrid grid{offsetof(cairn_config, user), sizeof(void*)};
};
template <> struct Layout<cairn_statistics> {
    static constexpr const char* name = "cairn_statistics";
    static constexpr FieldGrid grid{offsetof(cairn_statistics, time_total), sizeof(double)};
};
template <> struct Layout<cairn_evaluation> {
    static constexpr const char* name = "cairn_evaluation";
    static constexpr FieldGrid grid{offsetof(cairn_evaluation, penetration), sizeof(double)};
};
template <> struct Layout<cairn_info> {
    static constexpr const char* name = "cairn_info";
    static constexpr FieldGrid grid{offsetof(cairn_info, build), sizeof(const char*)};
};

// No version of any struct comes near it; a size beyond it is an uninitialised one, and its "tail" is not ours to read.
constexpr std::size_t kLargestStruct = 4096;

// The caller's struct_size, checked.
template <class Struct> std::size_t checked_size(const Struct* given) {
    using L = Layout<Struct>;
    if (given == nullptr)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s: the pointer is NULL", L::name);
    std::uint32_t size = 0;
    std::memcpy(&size, given, sizeof size);
    const bool cuts = size <= L::grid.from ? size % 4 != 0 : size < sizeof(Struct) && (size - L::grid.from) % L::grid.each != 0;
    if (size < sizeof size || size > kLargestStruct || cuts)
        refuse(CAIRN_ERROR_STRUCT_SIZE, "%s: struct_size is %u, which is impossible: set it to sizeof(%s), here %zu", L::name, size,
               L::name, sizeof(Struct));
    const unsigned char* bytes = reinterpret_cast<const unsigned char*>(given);
    for (std::size_t at = sizeof(Struct); at < size; ++at)
        if (bytes[at] != 0)
            refuse(CAIRN_ERROR_STRUCT_SIZE,
                   "%s: struct_size is %u, and byte %zu is set: this library knows the first %zu bytes only; leave newer fields zero",
                   L::name, size, at, sizeof(Struct));
    return size;
}

// A copy of the caller's struct, with `defaults` for what it lacks.
template <class Struct> Struct read_struct(const Struct* given, const Struct& defaults) {
    const std::size_t size = checked_size(given);
    Struct whole = defaults;
    std::memcpy(&whole, given, size < sizeof whole ? size : sizeof whole);
    return whole;
}

// Fills as much of the caller's struct as it has room for; its struct_size stays.
template <class Struct> void write_struct(Struct* given, const Struct& value) {
    const std::size_t size = checked_size(given);
    const std::size_t begin = sizeof(std::uint32_t);
    std::memcpy(reinterpret_cast<unsigned char*>(given) + begin, reinterpret_cast<const unsigned char*>(&value) + begin,
                (size < sizeof value ? size : sizeof value) - begin);
}

} // namespace cairn::capi
