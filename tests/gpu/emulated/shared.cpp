// Shared memory of blocks. Without AddressSanitizer a slot's last byte but alignment is followed by an inaccessible page, and what
// is before and behind, up to the alignment, holds a pattern that must stay.
#include "memory.h"
#include "sanitizers.h"
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <sys/mman.h>
#include <vector>

namespace cairn_emulated {
namespace {
constexpr size_t page = 4096, alignment = 16, before_it = 64;
constexpr int pattern = 0xFD;
std::map<size_t, std::vector<char*>> idle_slots; // by their accessible bytes

size_t round_up(size_t bytes, size_t unit) { return (bytes + unit - 1) / unit * unit; }
} // namespace

Shared take_shared(size_t bytes) {
    Shared shared;
    shared.bytes = bytes;
    if (CAIRN_ASAN) {
        shared.address = std::malloc(bytes);
        std::memset(shared.address, 0xFF, bytes);
        return shared;
    }
    shared.slot_bytes = round_up(bytes + before_it, page);
    auto& idle = idle_slots[shared.slot_bytes];
    if (idle.empty()) {
        void* slot = mmap(nullptr, shared.slot_bytes + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (slot == MAP_FAILED || mprotect(static_cast<char*>(slot) + shared.slot_bytes, page, PROT_NONE) != 0) {
            std::fprintf(stderr, "cairn_emulated: no room for a block's shared memory\n");
            std::abort();
        }
        idle.push_back(static_cast<char*>(slot));
    }
    shared.slot = idle.back();
    idle.pop_back();
    char* end = shared.slot + shared.slot_bytes;
    char* address = end - round_up(bytes, alignment);
    std::memset(address - before_it, pattern, before_it);
    std::memset(address, 0xFF, bytes);
    std::memset(address + bytes, pattern, static_cast<size_t>(end - (address + bytes)));
    shared.address = address;
    return shared;
}

void give_shared(const Shared& shared) {
    if (CAIRN_ASAN)
        std::free(shared.address);
    else
        idle_slots[shared.slot_bytes].push_back(shared.slot);
}

void allow_shared(const Shared& shared, bool allowed) {
#if CAIRN_ASAN
    if (allowed)
        __asan_unpoison_memory_region(shared.address, shared.bytes);
    else
        __asan_poison_memory_region(shared.address, shared.bytes);
#else
    mprotect(shared.slot, shared.slot_bytes, allowed ? PROT_READ | PROT_WRITE : PROT_NONE);
#endif
}

bool shared_is_intact(const Shared& shared) {
    if (!shared.slot)
        return true;
    const char* address = static_cast<const char*>(shared.address);
    for (const char* c = address - before_it; c < shared.slot + shared.slot_bytes; c = c + 1 == address ? address + shared.bytes : c + 1)
        if (*c != static_cast<char>(pattern))
            return false;
    return true;
}
} // namespace cairn_emulated
