// Finds a key that two elements of a table share.
#pragma once
#include "elements.h"

#include <cstdint>
#include <vector>

namespace cairn::capi {

// A set of 64-bit keys by open addressing. Its memory is kept from step to step.
class KeySet {
  public:
    // Refuses a table in which two elements have the same key other than 0.
    void check_unique(const Array& keys);

  private:
    std::vector<std::uint64_t> slots_;
};

} // namespace cairn::capi
