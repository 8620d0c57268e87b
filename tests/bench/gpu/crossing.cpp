#include "crossing.h"

#include <cmath>

namespace cairn_bench {

Crossing crossingOf(const std::vector<Pair>& pairs) {
    Crossing found;
    found.measured = !pairs.empty();
    std::size_t first = pairs.size(); // of those from which on ours is never slower
    while (first > 0 && pairs[first - 1].ours <= pairs[first - 1].theirs)
        --first;
    if (first == pairs.size())
        return found;
    found.everywhere = first == 0;
    if (found.everywhere) {
        found.from = pairs.front().size;
        return found;
    }
    // log(ours / theirs) falls from above zero at `first - 1` to zero or below at `first`
    const auto lead = [&](std::size_t i) { return std::log(pairs[i].ours / pairs[i].theirs); };
    const double share = lead(first - 1) / (lead(first - 1) - lead(first));
    found.from = pairs[first - 1].size * std::pow(pairs[first].size / pairs[first - 1].size, share);
    return found;
}

} // namespace cairn_bench
