#include "keys.h"

#include <bit>

namespace cairn::capi {

namespace {

bool ascending(const Array& keys) {
    std::uint64_t last = 0;
    for (std::size_t i = 0; i < keys.count; ++i) {
        const std::uint64_t key = keys.column.key(i);
        if (key <= last)
            return false;
        last = key;
    }
    return true;
}

// The finaliser of MurmurHash3: engines pack small numbers into their keys, so every bit must reach every other.
std::uint64_t mix(std::uint64_t key) {
    key = (key ^ (key >> 33)) * 0xff51afd7ed558ccdu;
    key = (key ^ (key >> 33)) * 0xc4ceb9fe1a85ec53u;
    return key ^ (key >> 33);
}

[[noreturn]] void refuse_duplicate(const Array& keys, std::size_t later) {
    std::size_t first = 0;
    while (keys.column.key(first) != keys.column.key(later))
        ++first;
    refuse(CAIRN_ERROR_INVALID_DATA, "%s.key[%zu] is %s, as is %s.key[%zu]: keys other than 0 must be unique", keys.table, later,
           value_of(keys, later).text, keys.table, first);
}

} // namespace

void KeySet::check_unique(const Array& keys) {
    if (!keys.present() || ascending(keys))
        return;
    const std::size_t size = std::bit_ceil(2 * keys.count);
    slots_.resize_filled(size, 0);
    for (std::size_t i = 0; i < keys.count; ++i) {
        const std::uint64_t key = keys.column.key(i);
        if (key == 0)
            continue;
        std::size_t at = static_cast<std::size_t>(mix(key)) & (size - 1);
        while (slots_[at] != 0 && slots_[at] != key)
            at = (at + 1) & (size - 1);
        if (slots_[at] == key)
            refuse_duplicate(keys, i);
        slots_[at] = key;
    }
}

} // namespace cairn::capi
