// A text for the faults that the emulator provokes: the host in device memory, a kernel out of bounds, a stack too small.
#pragma once
#include "include/cuda_runtime.h"

namespace cairn_emulated {
void report_faults_in(const char* region, size_t bytes); // of device memory; installs the handler, once
void let_faults_tell(bool device_runs);
void name_running_kernel(const Kernel* kernel); // null: none
// Called by a thread before it runs kernels: a fault for want of stack needs another stack.
void prepare_thread_for_faults();
} // namespace cairn_emulated
