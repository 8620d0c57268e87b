// Keys for warm starts: which contact point of this step is which of the last one.
//
// FCL keeps nothing between calls. Each pair's points are remembered by their places on the two objects, and a point takes over the
// key of the nearest remembered one that is within reach on either object. A pair that has one point now and had one before keeps
// its key however far it moved: that is how a ball rolls.
#pragma once
#include "core.h"

#include <cstdint>
#include <map>
#include <utility>

namespace cairn {
namespace fcl {

class PointKeys {
  public:
    using Pair = std::pair<uint32_t, uint32_t>; // the objects' numbers

    struct Place {
        Vector3 onA, onB; // m, in the objects' frames
        uint64_t key;
    };

    void beginStep() { ++m_step; }
    // Sets the keys of a pair's points; once a step for each pair.
    void match(const Pair& pair, std::vector<Place>& places, double reach);
    // Forgets the pairs that were not matched in this step.
    void endStep();
    void forget(uint32_t object);

  private:
    struct Remembered {
        uint64_t step = 0;
        std::vector<Place> places;
    };
    std::map<Pair, Remembered> m_pairs;
    uint64_t m_step = 0;
    uint64_t m_nextKey = 1; // 0 means no key
};

} // namespace fcl
} // namespace cairn
