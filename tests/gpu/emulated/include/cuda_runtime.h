// CUDA's runtime on a machine without a GPU: gpu/*.cu compile with a C++ compiler against this folder and run in the calling
// process, strictly. emulated.h says what is emulated and how tests control it.
#pragma once
#include "emulated_cuda/device_code.h"
#include "emulated_cuda/host_api.h"
#include "emulated_cuda/launch.h"
