// Finds a key that two elements of a table share.
#pragma once
#include "elements.h"
#include "memory.h"

#include <cstdint>

namespace cairn::capi {

// A set of 64-bit keys by open addressing. Its memory is kept from step to step.
class KeySet {
  public:
    explicit KeySet(const Hooks& hooks) : slots_(hooks) {}

    // Refuses a table in which two elements have the same key other than 0.
    void check_unique(const Array& keys);

  private:
    Buffer<std::uint64_t> slots_;
};

} // namespace cairn::capi
