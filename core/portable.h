// Functions that both a CPU thread and a GPU thread run.
#pragma once

#if defined(__CUDACC__)
#define CAIRN_HD __host__ __device__
#else
#define CAIRN_HD
#endif
