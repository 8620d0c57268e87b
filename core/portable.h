// Functions that both a CPU thread and a GPU thread run.
#pragma once

#if defined(__CUDACC__)
#define CAIRN_HD __host__ __device__
#define CAIRN_HD_OF_ITS_ARGUMENT _Pragma("nv_exec_check_disable") // before a template: it runs where its argument does
#else
#define CAIRN_HD
#define CAIRN_HD_OF_ITS_ARGUMENT
#endif
