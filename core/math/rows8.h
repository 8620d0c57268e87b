// Bodies are kept as rows of eight numbers (a velocity, a displacement, half a mass); lanes want columns. These move rows
// picked by index into columns and back: loads and stores of half rows and a 4x4 transpose inside each block of four lanes.
#pragma once
#include "lane.h"

namespace cairn {
inline namespace CAIRN_ISA {

#if CAIRN_LANES > 1
using Quad = float __attribute__((vector_size(16)));
using Wide = float __attribute__((vector_size(4 * CAIRN_LANES)));

CAIRN_HD inline Quad load_quad(const float* from) {
    Quad q;
    std::memcpy(&q, from, sizeof q);
    return q;
}
CAIRN_HD inline void store_quad(const Quad& q, float* to) { std::memcpy(to, &q, sizeof q); }
CAIRN_HD inline Lane lane_of(const Wide& w) { return __builtin_bit_cast(Lane, w); }
CAIRN_HD inline Wide wide_of(const Lane& l) { return __builtin_bit_cast(Wide, l); }

// [row i | row i+4 | row i+8 | row i+12] of the quads at base + 8*index
CAIRN_HD inline Wide stack_rows(const float* base, const std::int32_t* index) {
#if CAIRN_LANES == 4
    return load_quad(base + 8 * static_cast<std::ptrdiff_t>(index[0]));
#elif CAIRN_LANES == 8
    return __builtin_shufflevector(load_quad(base + 8 * static_cast<std::ptrdiff_t>(index[0])),
                                   load_quad(base + 8 * static_cast<std::ptrdiff_t>(index[4])), 0, 1, 2, 3, 4, 5, 6, 7);
#else
    const auto low = __builtin_shufflevector(load_quad(base + 8 * static_cast<std::ptrdiff_t>(index[0])),
                                             load_quad(base + 8 * static_cast<std::ptrdiff_t>(index[4])), 0, 1, 2, 3, 4, 5, 6, 7);
    const auto high = __builtin_shufflevector(load_quad(base + 8 * static_cast<std::ptrdiff_t>(index[8])),
                                              load_quad(base + 8 * static_cast<std::ptrdiff_t>(index[12])), 0, 1, 2, 3, 4, 5, 6, 7);
    return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
#endif
}
CAIRN_HD inline void unstack_rows(const Wide& w, float* base, const std::int32_t* index) {
    for (std::uint32_t block = 0; block < CAIRN_LANES / 4; ++block) {
        Quad q;
        std::memcpy(&q, reinterpret_cast<const char*>(&w) + 16 * block, sizeof q);
        store_quad(q, base + 8 * static_cast<std::ptrdiff_t>(index[4 * block]));
    }
}

#if CAIRN_LANES == 4
CAIRN_HD inline Wide low_pairs(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 0, 4, 1, 5); }
CAIRN_HD inline Wide high_pairs(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 2, 6, 3, 7); }
CAIRN_HD inline Wide low_halves(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 0, 1, 4, 5); }
CAIRN_HD inline Wide high_halves(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 2, 3, 6, 7); }
#elif CAIRN_LANES == 8
CAIRN_HD inline Wide low_pairs(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13); }
CAIRN_HD inline Wide high_pairs(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15); }
CAIRN_HD inline Wide low_halves(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13); }
CAIRN_HD inline Wide high_halves(const Wide& a, const Wide& b) { return __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15); }
#else
CAIRN_HD inline Wide low_pairs(const Wide& a, const Wide& b) {
    return __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
}
CAIRN_HD inline Wide high_pairs(const Wide& a, const Wide& b) {
    return __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
}
CAIRN_HD inline Wide low_halves(const Wide& a, const Wide& b) {
    return __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29);
}
CAIRN_HD inline Wide high_halves(const Wide& a, const Wide& b) {
    return __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31);
}
#endif

CAIRN_HD inline void transpose4(Wide& a, Wide& b, Wide& c, Wide& d) {
    const Wide ab_low = low_pairs(a, b), ab_high = high_pairs(a, b), cd_low = low_pairs(c, d), cd_high = high_pairs(c, d);
    a = low_halves(ab_low, cd_low);
    b = high_halves(ab_low, cd_low);
    c = low_halves(ab_high, cd_high);
    d = high_halves(ab_high, cd_high);
}
CAIRN_HD inline void gather_half(const float* base, const std::int32_t* index, Lane* columns) {
    Wide a = stack_rows(base, index), b = stack_rows(base, index + 1), c = stack_rows(base, index + 2), d = stack_rows(base, index + 3);
    transpose4(a, b, c, d);
    columns[0] = lane_of(a);
    columns[1] = lane_of(b);
    columns[2] = lane_of(c);
    columns[3] = lane_of(d);
}
CAIRN_HD inline void scatter_half(const Lane* columns, float* base, const std::int32_t* index) {
    Wide a = wide_of(columns[0]), b = wide_of(columns[1]), c = wide_of(columns[2]), d = wide_of(columns[3]);
    transpose4(a, b, c, d);
    unstack_rows(a, base, index);
    unstack_rows(b, base, index + 1);
    unstack_rows(c, base, index + 2);
    unstack_rows(d, base, index + 3);
}
#endif

// columns[c] lane i = base[8 * index[i] + c]
CAIRN_HD inline void gather_rows(const Real* base, const std::int32_t* index, Lane (&columns)[8]) {
#if CAIRN_LANES > 1
    gather_half(base, index, columns);
    gather_half(base + 4, index, columns + 4);
#else
    for (int c = 0; c < 8; ++c)
        columns[c] = base[8 * static_cast<std::ptrdiff_t>(*index) + c];
#endif
}
// base[8 * index[i] + c] = columns[c] lane i
CAIRN_HD inline void scatter_rows(const Lane (&columns)[8], Real* base, const std::int32_t* index) {
#if CAIRN_LANES > 1
    scatter_half(columns, base, index);
    scatter_half(columns + 4, base + 4, index);
#else
    for (int c = 0; c < 8; ++c)
        base[8 * static_cast<std::ptrdiff_t>(*index) + c] = columns[c];
#endif
}

} // namespace CAIRN_ISA
} // namespace cairn
