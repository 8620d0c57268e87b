// Finds a key that two elements of a table share.
#pragma once
#include "elements.h"
#include "memory.h"

#include <cstdint>

namespace cairn::capi {

// A set of 64-bit keys by open addressing. Its memory is kept from step to step. A table's keys are added part by part, in order;
// while they ascend, nothing needs to be remembered.
class KeySet {
  public:
    explicit KeySet(const Hooks& hooks) : slots_(hooks) {}

    void start(std::size_t count);
    // Refuses a key other than 0 that an element before has.
    void add(const Array& part);

  private:
    void insert(const Array& part);

    Buffer<std::uint64_t> slots_;
    std::size_t count_ = 0;
    std::uint64_t last_ = 0;
    bool ascending_ = true;
};

} // namespace cairn::capi
