// The lane type: one number on a GPU thread and in the reference, a SIMD batch on the CPU.
//
// A file compiled for an instruction set defines CAIRN_ISA (its name), CAIRN_LANES and CAIRN_REAL. Everything inline lives in
// a namespace of that name: otherwise the linker would keep one instruction set's copy for all. Minimum, maximum, clamp and
// absolute value are selects of our own and nothing here is fused or approximated, so that every width gives the same bits.
#pragma once
#ifndef CAIRN_ISA
#define CAIRN_ISA base
#define CAIRN_LANES 1
#define CAIRN_REAL float
#endif

#include "../portable.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#if CAIRN_LANES > 1
#include <experimental/simd>
#endif

namespace cairn {
inline namespace CAIRN_ISA {

using Real = CAIRN_REAL; // what memory holds
constexpr std::uint32_t kLanes = CAIRN_LANES;

CAIRN_HD inline float select(bool m, float a, float b) { return m ? a : b; }
CAIRN_HD inline double select(bool m, double a, double b) { return m ? a : b; }
CAIRN_HD inline float root(float a) { return std::sqrt(a); }
CAIRN_HD inline double root(double a) { return std::sqrt(a); }
CAIRN_HD inline void load(float& a, const float* from) { a = *from; }
CAIRN_HD inline void load(double& a, const double* from) { a = *from; }
CAIRN_HD inline void store(float a, float* to) { *to = a; }
CAIRN_HD inline void store(double a, double* to) { *to = a; }

#if CAIRN_LANES > 1
using Lane = std::experimental::simd<Real, std::experimental::simd_abi::deduce_t<Real, CAIRN_LANES>>;
using Mask = Lane::mask_type;
CAIRN_HD inline Lane select(const Mask& m, const Lane& a, const Lane& b) {
    Lane r = b;
    where(m, r) = a;
    return r;
}
CAIRN_HD inline Lane root(const Lane& a) { return std::experimental::sqrt(a); }
CAIRN_HD inline void load(Lane& a, const Real* from) { a.copy_from(from, std::experimental::vector_aligned); }
CAIRN_HD inline void store(const Lane& a, Real* to) { a.copy_to(to, std::experimental::vector_aligned); }
#else
using Lane = Real;
#endif

// A constant as a lane: rounded once, from double.
template <class F> CAIRN_HD F of(double value) {
    if constexpr (std::is_floating_point_v<F>)
        return static_cast<F>(value);
    else
        return F(static_cast<Real>(value));
}
template <class F> CAIRN_HD F load_as(const Real* from) {
    F a;
    load(a, from);
    return a;
}
template <class F> CAIRN_HD F minimum(F a, F b) { return select(a < b, a, b); }
template <class F> CAIRN_HD F maximum(F a, F b) { return select(a < b, b, a); }
template <class F> CAIRN_HD F clamp(F a, F low, F high) { return minimum(maximum(a, low), high); }
template <class F> CAIRN_HD F absolute(F a) { return select(a < F(0), -a, a); }
// 1/a, and 0 where a is not above `floor` (padding lanes, bodies that cannot move)
template <class F> CAIRN_HD F inverse_or_zero(F a, F floor = F(0)) {
    const auto usable = a > floor;
    return select(usable, F(1) / select(usable, a, F(1)), F(0));
}

} // namespace CAIRN_ISA
} // namespace cairn
