#include "keys.h"

#include <algorithm>
#include <bit>

namespace cairn::capi {

namespace {

// The finaliser of MurmurHash3: engines pack small numbers into their keys, so every bit must reach every other.
std::uint64_t mix(std::uint64_t key) {
    key = (key ^ (key >> 33)) * 0xff51afd7ed558ccdu;
    key = (key ^ (key >> 33)) * 0xc4ceb9fe1a85ec53u;
    return key ^ (key >> 33);
}

[[noreturn]] void refuse_duplicate(const Array& keys, std::size_t later) {
    std::size_t earlier = 0;
    while (keys.column.key(earlier) != keys.column.key(later))
        ++earlier;
    refuse(CAIRN_ERROR_INVALID_DATA, "%s.key[%zu] is %s, as is %s.key[%zu]: keys other than 0 must be unique", keys.table, later,
           value_of(keys, later).text, keys.table, earlier);
}

} // namespace

void KeySet::start(std::size_t count) {
    count_ = count;
    last_ = 0;
    ascending_ = true;
}

void KeySet::add(const Array& part) {
    if (!part.present())
        return;
    if (ascending_) {
        std::size_t i = part.first;
        for (; i < part.end && part.column.key(i) > last_; ++i)
            last_ = part.column.key(i);
        if (i == part.end)
            return;
        ascending_ = false;
        slots_.resize_filled(std::bit_ceil(2 * count_), 0);
        Array before = part;
        before.first = 0;
        insert(before);
        return;
    }
    insert(part);
}

void KeySet::insert(const Array& part) {
    constexpr std::size_t ahead = 16; // far enough for the slot's cache line to arrive
    const std::size_t mask = slots_.size() - 1;
    const auto home = [&](std::size_t i) { return static_cast<std::size_t>(mix(part.column.key(i))) & mask; };
    std::size_t homes[ahead];
    for (std::size_t first = part.first; first < part.end; first += ahead) {
        const std::size_t count = std::min(ahead, part.end - first);
        for (std::size_t k = 0; k < count; ++k) {
            homes[k] = home(first + k);
            __builtin_prefetch(&slots_[homes[k]], 1);
        }
        for (std::size_t k = 0; k < count; ++k) {
            const std::uint64_t key = part.column.key(first + k);
            if (key == 0)
                continue;
            std::size_t at = homes[k];
            while (slots_[at] != 0 && slots_[at] != key)
                at = (at + 1) & mask;
            if (slots_[at] == key)
                refuse_duplicate(part, first + k);
            slots_[at] = key;
        }
    }
}

} // namespace cairn::capi
