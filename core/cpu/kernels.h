// One entry for each instruction set that kernels.cpp is compiled for.
#pragma once
#include "../scene/frame.h"

namespace cairn {
#define CAIRN_DECLARE_KERNELS(isa, real)                                                                                                   \
    namespace kernels_##isa {                                                                                                              \
        void run_stage(Stage, const Frame<real>&, std::uint32_t begin, std::uint32_t end);                                                 \
    }
CAIRN_DECLARE_KERNELS(scalar, float)
CAIRN_DECLARE_KERNELS(sse2, float)
CAIRN_DECLARE_KERNELS(avx2, float)
CAIRN_DECLARE_KERNELS(avx512, float)
CAIRN_DECLARE_KERNELS(f64, double)
#undef CAIRN_DECLARE_KERNELS
} // namespace cairn
