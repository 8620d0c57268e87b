// Union-find over bodies.
#pragma once
#include <cstdint>
#include <vector>

namespace cairn {

inline std::uint32_t find_root(std::vector<std::uint32_t>& parent, std::uint32_t i) {
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}
// The smaller index becomes the root, so that islands are numbered by their first body.
inline void unite(std::vector<std::uint32_t>& parent, std::uint32_t i, std::uint32_t j) {
    i = find_root(parent, i);
    j = find_root(parent, j);
    if (i < j)
        parent[j] = i;
    else
        parent[i] = j;
}

} // namespace cairn
