#include "cache.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace cairn {

namespace {

constexpr std::uint64_t kMagic = 0x3148434e52494143; // "CAIRNCH1"

template <class T> void append(std::vector<std::byte>& to, const T* data, std::size_t count) {
    const auto* bytes = reinterpret_cast<const std::byte*>(data);
    to.insert(to.end(), bytes, bytes + count * sizeof(T));
}
template <class T> std::span<const std::byte> take(std::span<const std::byte> from, T* data, std::size_t count) {
    if (from.size() / sizeof(T) < count)
        throw std::invalid_argument("the warm-start cache ends too early");
    if (count > 0)
        std::memcpy(data, from.data(), count * sizeof(T));
    return from.subspan(count * sizeof(T));
}

} // namespace

std::size_t KeyedValues::home(std::uint64_t key) const {
    return (key * 0x9e3779b97f4a7c15u) >> (64 - std::countr_zero(table_.size())); // Fibonacci hashing
}

void KeyedValues::insert(std::uint64_t key, const double* values) {
    if (key == 0)
        return;
    keys_.push_back(key);
    values_.insert(values_.end(), values, values + width_);
}

void KeyedValues::index() {
    table_.assign(std::bit_ceil(2 * keys_.size() + 2), 0);
    for (std::size_t i = 0; i < keys_.size(); ++i) {
        std::size_t at = home(keys_[i]);
        while (table_[at] != 0)
            at = (at + 1) & (table_.size() - 1);
        table_[at] = static_cast<std::uint32_t>(i + 1);
    }
}

const double* KeyedValues::find(std::uint64_t key) const {
    if (key == 0 || table_.empty())
        return nullptr;
    for (std::size_t at = home(key); table_[at] != 0; at = (at + 1) & (table_.size() - 1))
        if (keys_[table_[at] - 1] == key)
            return values_.data() + static_cast<std::size_t>(table_[at] - 1) * width_;
    return nullptr;
}

void KeyedValues::clear() {
    keys_.clear();
    values_.clear();
    table_.clear();
}

void KeyedValues::save(std::vector<std::byte>& to) const {
    const std::uint64_t size = keys_.size();
    append(to, &size, 1);
    append(to, keys_.data(), keys_.size());
    append(to, values_.data(), values_.size());
}

std::span<const std::byte> KeyedValues::load(std::span<const std::byte> from) {
    std::uint64_t size = 0;
    from = take(from, &size, 1);
    if (size > from.size() / sizeof(std::uint64_t))
        throw std::invalid_argument("the warm-start cache ends too early");
    clear();
    keys_.resize(size);
    from = take(from, keys_.data(), keys_.size());
    if (from.size() / sizeof(double) / width_ < size)
        throw std::invalid_argument("the warm-start cache ends too early");
    values_.resize(size * width_);
    from = take(from, values_.data(), values_.size());
    for (const std::uint64_t key : keys_)
        if (key == 0)
            throw std::invalid_argument("the warm-start cache holds a key of 0");
    for (const double value : values_)
        if (!(std::abs(value) <= 1e30))
            throw std::invalid_argument("the warm-start cache holds a number that is out of range");
    index();
    return from;
}

std::vector<std::byte> WarmStartCache::save() const {
    std::vector<std::byte> bytes;
    append(bytes, &kMagic, 1);
    contacts.save(bytes);
    joints.save(bytes);
    rows.save(bytes);
    return bytes;
}

void WarmStartCache::load(std::span<const std::byte> bytes) {
    std::uint64_t magic = 0;
    bytes = take(bytes, &magic, 1);
    if (magic != kMagic)
        throw std::invalid_argument("these bytes are not a warm-start cache of this version of Cairn");
    WarmStartCache fresh;
    bytes = fresh.contacts.load(bytes);
    bytes = fresh.joints.load(bytes);
    bytes = fresh.rows.load(bytes);
    if (!bytes.empty())
        throw std::invalid_argument("the warm-start cache has bytes left over");
    *this = std::move(fresh);
}

void WarmStartCache::clear() {
    contacts.clear();
    joints.clear();
    rows.clear();
}
void WarmStartCache::index() {
    contacts.index();
    joints.index();
    rows.index();
}

} // namespace cairn
