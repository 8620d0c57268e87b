#include "memory.h"
#include "fault.h"
#include "sanitizers.h"
#include "streams.h"
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <map>
#include <sys/mman.h>
#include <utility>

// Without AddressSanitizer: a reserved range of addresses, mapped to an empty file, which faults whatever its protection, so that one
// call opens or closes all allocations and no gap between them. An allocation ends at the end of a page, but for what alignment asks;
// that slack holds a pattern that must stay. Behind it is a gap. Addresses are used again as late as possible.
namespace cairn_emulated {
namespace {
constexpr size_t page = 4096, alignment = 256;
constexpr int slack_pattern = 0xFD;

struct Allocation {
    size_t bytes;
    char* first_page; // null with AddressSanitizer
    size_t mapped;
};
std::map<const char*, Allocation> device_memory, pinned_memory;
char* region = nullptr;
size_t capacity = size_t(8) << 30;
size_t cursor = 0; // where the next allocation is looked for
size_t used = 0;   // nothing is allocated from here on
int empty_file = -1;
int accesses = 0;
bool open = false; // the memory can be touched

size_t round_up(size_t bytes, size_t unit) { return (bytes + unit - 1) / unit * unit; }

void* map_nothing(void* at, size_t bytes, int how) { return mmap(at, bytes, PROT_NONE, MAP_PRIVATE | MAP_NORESERVE | how, empty_file, 0); }

bool map_memory(const Allocation& allocation) {
    return mmap(allocation.first_page, allocation.mapped, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_FIXED,
                -1, 0) != MAP_FAILED;
}

void protect(char* first_page, size_t bytes, bool accessible) {
    if (bytes > 0 && mprotect(first_page, bytes, accessible ? PROT_READ | PROT_WRITE : PROT_NONE) != 0) {
        std::perror("cairn_emulated: mprotect");
        std::abort();
    }
}

bool reserve() {
    if (region)
        return true;
    empty_file = memfd_create("cairn_emulated", MFD_CLOEXEC);
    void* reserved = empty_file < 0 ? MAP_FAILED : map_nothing(nullptr, capacity, 0);
    if (reserved == MAP_FAILED)
        return false;
    region = static_cast<char*>(reserved);
    report_faults_in(region, capacity);
    return true;
}

// Room for `mapped` bytes and a guard page on either side; null if there is none.
char* find_room(size_t mapped) {
    const size_t need = mapped + 2 * page;
    for (int wrapped = 0; wrapped < 2; wrapped++) {
        size_t at = wrapped ? 0 : cursor;
        for (const auto& [address, allocation] : device_memory) {
            const size_t begin = static_cast<size_t>(allocation.first_page - region), end = begin + allocation.mapped;
            if (end <= at)
                continue;
            if (begin >= at + need)
                break;
            at = end;
        }
        if (at + need <= capacity) {
            cursor = at + mapped + page;
            return region + at + page;
        }
    }
    return nullptr;
}

char* allocate(size_t bytes, Allocation& allocation) {
    allocation = {bytes, nullptr, 0};
    if (CAIRN_ASAN) {
        auto* p = static_cast<char*>(std::aligned_alloc(alignment, round_up(bytes, alignment)));
#if CAIRN_ASAN
        if (p) // aligned_alloc wants a multiple of the alignment: what is beyond the bytes asked for is out of bounds too
            __asan_poison_memory_region(p + bytes, round_up(bytes, alignment) - bytes);
#endif
        return p;
    }
    if (!reserve())
        return nullptr;
    allocation.mapped = round_up(bytes, page);
    allocation.first_page = find_room(allocation.mapped);
    if (!allocation.first_page || !map_memory(allocation))
        return nullptr;
    used = std::max(used, static_cast<size_t>(allocation.first_page - region) + allocation.mapped);
    char* p = allocation.first_page + allocation.mapped - round_up(bytes, alignment);
    std::memset(p + bytes, slack_pattern, round_up(bytes, alignment) - bytes);
    return p;
}

void check_slack(const char* p, const Allocation& allocation) {
    if (!allocation.first_page)
        return;
    for (const char* c = p + allocation.bytes; c < allocation.first_page + allocation.mapped; c++)
        if (*c != static_cast<char>(slack_pattern)) {
            std::fprintf(stderr, "cairn_emulated: device code wrote %td bytes past the end of the allocation of %zu bytes at %p\n",
                         c - (p + allocation.bytes), allocation.bytes, static_cast<const void*>(p));
            std::abort();
        }
}

size_t total() { return state.memory_limit ? std::min(state.memory_limit, capacity) : capacity; }

// Of the allocation that holds p or ends at it.
std::map<const char*, Allocation>::const_iterator holder(const std::map<const char*, Allocation>& memory, const char* p) {
    auto next = memory.upper_bound(p);
    if (next == memory.begin())
        return memory.end();
    const auto it = std::prev(next);
    return p < it->first + it->second.bytes ? it : memory.end();
}
} // namespace

Where locate(const void* pointer, size_t bytes) {
    const char* p = static_cast<const char*>(pointer);
    const auto within = [&](const auto& memory, Where where) {
        const auto it = holder(memory, p);
        if (it == memory.end())
            return Where::pageable;
        return bytes <= static_cast<size_t>(it->first + it->second.bytes - p) ? where : Where::nowhere;
    };
    if (const Where where = within(device_memory, Where::device); where != Where::pageable)
        return where;
    if (const Where where = within(pinned_memory, Where::pinned); where != Where::pageable)
        return where;
    return !p || (region && p >= region && p < region + capacity) ? Where::nowhere : Where::pageable;
}

DeviceAccess::DeviceAccess() {
    accesses++;
    if (!std::exchange(open, true))
        protect(region, used, true);
    let_faults_tell(true);
}

DeviceAccess::~DeviceAccess() {
    if (--accesses > 0)
        return;
    let_faults_tell(false);
    for (const auto& [address, allocation] : device_memory)
        check_slack(address, allocation);
    if (state.host_protection) {
        protect(region, used, false);
        open = false;
    }
}

void set_capacity(size_t bytes) {
    const std::lock_guard lock(api_mutex());
    if (!region)
        capacity = round_up(bytes, page);
}
} // namespace cairn_emulated

using namespace cairn_emulated;

cudaError_t cudaMalloc(void** pointer, size_t size) {
    return api_call([&] {
        if (!pointer)
            return cudaErrorInvalidValue;
        if (capture_forbids_waiting())
            return cudaErrorStreamCaptureUnsupported;
        *pointer = nullptr;
        if (size == 0)
            return cudaSuccess;
        const size_t in_use = state.counters.device_bytes;
        if (counts_out(state.fail_allocation) || size > total() || in_use > total() - size)
            return cudaErrorMemoryAllocation;
        Allocation allocation;
        char* p = allocate(size, allocation);
        if (!p)
            return cudaErrorMemoryAllocation;
        std::memset(p, 0xFF, size);
        if (!open)
            protect(allocation.first_page, allocation.mapped, false);
        device_memory.emplace(p, allocation);
        state.counters.allocations++;
        state.counters.device_bytes += size;
        *pointer = p;
        return cudaSuccess;
    });
}

cudaError_t cudaFree(void* pointer) {
    return api_release([&] {
        if (!pointer)
            return cudaSuccess;
        if (capture_forbids_waiting())
            return cudaErrorStreamCaptureUnsupported;
        const auto it = device_memory.find(static_cast<const char*>(pointer));
        if (it == device_memory.end())
            return cudaErrorInvalidValue;
        const cudaError_t error = finish_all();
        const Allocation allocation = it->second;
        if (allocation.first_page) {
            protect(allocation.first_page, allocation.mapped, true);
            check_slack(it->first, allocation);
            map_nothing(allocation.first_page, allocation.mapped, MAP_FIXED);
        } else {
            std::free(pointer);
        }
        state.counters.frees++;
        state.counters.device_bytes -= allocation.bytes;
        device_memory.erase(it);
        return error;
    });
}

cudaError_t cudaHostAlloc(void** pointer, size_t size, unsigned int flags) {
    return api_call([&] {
        if (!pointer || flags > 7)
            return cudaErrorInvalidValue;
        if (capture_forbids_waiting())
            return cudaErrorStreamCaptureUnsupported;
        *pointer = nullptr;
        if (size == 0)
            return cudaSuccess;
        if (counts_out(state.fail_host_allocation))
            return cudaErrorMemoryAllocation;
        // malloc: with AddressSanitizer it ends exactly where it was asked to
        auto* p = static_cast<char*>(CAIRN_ASAN ? std::malloc(size) : std::aligned_alloc(page, round_up(size, page)));
        if (!p)
            return cudaErrorMemoryAllocation;
        std::memset(p, 0xFF, size);
        pinned_memory.emplace(p, Allocation{size, nullptr, 0});
        state.counters.host_allocations++;
        *pointer = p;
        return cudaSuccess;
    });
}
cudaError_t cudaMallocHost(void** pointer, size_t size, unsigned int flags) { return cudaHostAlloc(pointer, size, flags); }

cudaError_t cudaFreeHost(void* pointer) {
    return api_release([&] {
        if (!pointer)
            return cudaSuccess;
        if (capture_forbids_waiting())
            return cudaErrorStreamCaptureUnsupported;
        const auto it = pinned_memory.find(static_cast<const char*>(pointer));
        if (it == pinned_memory.end())
            return cudaErrorInvalidValue;
        const cudaError_t error = finish_all();
        std::free(pointer);
        pinned_memory.erase(it);
        state.counters.host_frees++;
        return error;
    });
}

cudaError_t cudaMemGetInfo(size_t* free, size_t* total_bytes) {
    return api_call([&] {
        *total_bytes = total();
        *free = total() - std::min(total(), state.counters.device_bytes);
        return cudaSuccess;
    });
}

cudaError_t cudaPointerGetAttributes(cudaPointerAttributes* attributes, const void* pointer) {
    return api_call([&] {
        void* p = const_cast<void*>(pointer);
        switch (locate(pointer, 1)) {
        case Where::device:
            *attributes = {cudaMemoryTypeDevice, 0, p, nullptr};
            break;
        case Where::pinned:
            *attributes = {cudaMemoryTypeHost, 0, p, p};
            break;
        default:
            *attributes = {cudaMemoryTypeUnregistered, -1, nullptr, p};
            break;
        }
        return cudaSuccess;
    });
}
