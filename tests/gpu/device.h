// What the laws of test_same_bits.cpp ask of the device that they run on; test_emulated_device.cpp or test_real_device.cpp answers.
#pragma once
#include <string>

namespace cairn_test {

// Why the laws cannot run here; empty if they can.
std::string missing_device();

// Whether it is quick enough for every combination; else each executor takes a third of them.
bool is_quick();

// In which order the emulated device runs its threads: 0 forward, 1 reversed, 2 shuffled. A real one has its own, by chance.
inline constexpr int kOrders = 3;
void set_order(int order);

// While it lives, no more memory can be had of the device.
class NoDeviceMemory {
  public:
    NoDeviceMemory();
    ~NoDeviceMemory();
    NoDeviceMemory(const NoDeviceMemory&) = delete;
    NoDeviceMemory& operator=(const NoDeviceMemory&) = delete;
};

} // namespace cairn_test
