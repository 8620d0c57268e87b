#include "point_keys.h"

#include <algorithm>

namespace cairn {
namespace fcl {

void PointKeys::match(const Pair& pair, std::vector<Place>& places, double reach) {
    Remembered& remembered = m_pairs[pair];
    const std::vector<Place>& old = remembered.places;
    std::vector<bool> taken(old.size(), false);
    const bool lone = places.size() == 1 && old.size() == 1;
    for (Place& place : places) {
        std::size_t best = old.size();
        double nearest = reach * reach;
        for (std::size_t i = 0; i < old.size(); ++i) {
            if (taken[i])
                continue;
            const double distance = std::min((place.onA - old[i].onA).squaredNorm(), (place.onB - old[i].onB).squaredNorm());
            if (lone || distance < nearest) {
                nearest = distance;
                best = i;
            }
        }
        if (best < old.size()) {
            taken[best] = true;
            place.key = old[best].key;
        } else {
            place.key = m_nextKey++;
        }
    }
    remembered.places = places;
    remembered.step = m_step;
}

void PointKeys::endStep() {
    for (auto entry = m_pairs.begin(); entry != m_pairs.end();) {
        if (entry->second.step != m_step)
            entry = m_pairs.erase(entry);
        else
            ++entry;
    }
}

void PointKeys::forget(uint32_t object) {
    for (auto entry = m_pairs.begin(); entry != m_pairs.end();) {
        if (entry->first.first == object || entry->first.second == object)
            entry = m_pairs.erase(entry);
        else
            ++entry;
    }
}

} // namespace fcl
} // namespace cairn
