// Functions that both a CPU thread and a GPU thread run.
#pragma once

#if defined(__CUDACC__)
#define CAIRN_HD __host__ __device__
#define CAIRN_HD_OF_ITS_ARGUMENT _Pragma("nv_exec_check_disable") // before a template: it runs where its argument does
#elif defined(CAIRN_INLINE_ALL) && defined(__GNUC__)
// The kernels are small functions of vectors, which are slow to pass. Left to itself GCC stops inlining them as the file grows.
#define CAIRN_HD __attribute__((always_inline))
#define CAIRN_HD_OF_ITS_ARGUMENT
#else
#define CAIRN_HD
#define CAIRN_HD_OF_ITS_ARGUMENT
#endif
