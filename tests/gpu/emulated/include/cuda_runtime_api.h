// So that a real CUDA's header of this name is never found beside the emulated one.
#pragma once
#include "cuda_runtime.h"
