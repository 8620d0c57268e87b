// Device memory that the host cannot touch, and pinned host memory.
#pragma once
#include "state.h"

namespace cairn_emulated {
enum class Where { pageable, pinned, device, nowhere };
// Where `bytes` from `pointer` lie; nowhere if they begin in an allocation and leave it, or lie in device memory that is none.
Where locate(const void* pointer, size_t bytes);

// Device memory is accessible while one of these lives.
class DeviceAccess {
  public:
    DeviceAccess();
    ~DeviceAccess();
    DeviceAccess(const DeviceAccess&) = delete;
    DeviceAccess& operator=(const DeviceAccess&) = delete;
};

// One block's shared memory.
struct Shared {
    void* address = nullptr;
    size_t bytes = 0;
    char* slot = nullptr;
    size_t slot_bytes = 0;
};
Shared take_shared(size_t bytes); // all 0xFF; what lies right behind it is out of bounds
void give_shared(const Shared& shared);
void allow_shared(const Shared& shared, bool allowed); // whether threads may touch it: not before its block starts, nor after it ends
bool shared_is_intact(const Shared& shared);           // nothing was written around it
} // namespace cairn_emulated
