// Where one solver starts to be quicker than another as scenes grow.
#pragma once
#include <optional>
#include <vector>

namespace cairn_bench {

struct Pair {
    double size, ours, theirs; // sizes ascend; times in the same unit, > 0
};

// `from`: the size from which on ours takes no longer, up to the largest measured; between two sizes on straight lines in log-log.
// It is the smallest size where ours is never slower at any; none where ours is slower at the largest, or nothing was measured.
struct Crossing {
    std::optional<double> from;
    bool measured = false, everywhere = false; // everywhere: at all sizes, so that it may lie below the smallest
};
Crossing crossingOf(const std::vector<Pair>& pairs);

} // namespace cairn_bench
