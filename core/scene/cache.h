// Warm starts: the impulses of the last substep, divided by its length, found by the caller's 64-bit keys.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn {

// `width` numbers a key.
class KeyedValues {
  public:
    explicit KeyedValues(std::uint32_t width) : width_(width) {}

    // In the order of insertion; a key of 0 is not kept. Keys are unique, which capi has checked.
    void insert(std::uint64_t key, const double* values);
    // After the last insert. find() before index() finds nothing.
    void index();
    // nullptr if unknown
    const double* find(std::uint64_t key) const;
    void clear();
    std::size_t size() const { return keys_.size(); }
    std::span<const std::uint64_t> keys() const { return keys_; }
    std::span<const double> values() const { return values_; } // `width` a key

    void save(std::vector<std::byte>& to) const;
    // Throws std::invalid_argument if the bytes are not what save() wrote; returns what follows.
    std::span<const std::byte> load(std::span<const std::byte> from);

  private:
    std::size_t home(std::uint64_t key) const;

    std::uint32_t width_;
    std::vector<std::uint64_t> keys_;
    std::vector<double> values_;
    std::vector<std::uint32_t> table_; // open addressing: position + 1, 0 = empty; a power of two, at most half full
};

struct WarmStartCache {
    KeyedValues contacts{4}; // normal; friction as a world vector
    KeyedValues joints{12};  // axes, motors
    KeyedValues rows{1};

    std::vector<std::byte> save() const;
    void load(std::span<const std::byte> bytes);
    void clear();
    void index(); // after the last insert
};

} // namespace cairn
