// Control over the emulated CUDA runtime, for tests.
//
// What is emulated: gpu/*.cu compile unchanged as C++ and run in the calling process, one thread of the grid at a time.
//   - A stream is a queue. Nothing runs until the host waits (a synchronisation, a blocking copy, a second query), so a host that
//     forgets to wait sees stale data, and one that overwrites pinned memory too early sends the wrong bytes.
//   - Device memory cannot be touched by the host: it is inaccessible except while queued work runs. Fresh device, pinned and
//     shared memory is 0xFF throughout: NaNs, and indices out of range.
//   - Threads run up to a barrier, one after another, in an order that tests choose. A kernel whose result depends on the order
//     has a race. A kernel that breaks the rules of barriers aborts with a text that names kernel, block and thread.
//   - Several host threads may call; one mutex lets one in at a time, so they never run truly at once.
// Not emulated: warps, spinning on memory until another block changes it, races within one thread's stretch between barriers,
// launch bounds, the device's own use of pageable host memory (it works here and would not there).
#pragma once
#include "cuda_runtime.h"
#include <string>

namespace cairn_emulated {
// Back to the defaults: device, orders, counters, failures. Only when no stream has work; what was allocated stays.
void reset();

// --- the device ---
struct Properties {
    std::string name = "Emulated CUDA device";
    int compute_major = 9, compute_minor = 0;
    int multiprocessors = 4;
    int threads_per_block = 1024, threads_per_multiprocessor = 2048, blocks_per_multiprocessor = 32;
    int registers_per_multiprocessor = 65536, registers_per_thread = 64; // the second is what every kernel is said to use
    size_t shared_per_block = 48 * 1024, shared_per_block_optin = 227 * 1024, shared_per_multiprocessor = 228 * 1024;
    size_t shared_reserved_per_block = 1024;
    int l2_bytes = 16 * 1024 * 1024;
    bool cooperative_launch = true, cluster_launch = true;
    int driver_version = 13000;
};
void set_device(const Properties& properties);
enum class Presence { device, no_device, no_driver };
void set_presence(Presence presence);

// --- orders ---
// Of the blocks of a launch, of the threads in every interval between barriers, and of the independent nodes of a graph.
enum class Order { forward, reversed, shuffled };
void set_order(Order order, unsigned long long seed = 1);
// Of streams that nothing orders. lazy: only what the host waits for runs. eager: work runs as it is enqueued.
// others_first: before what the host waits for, everything else that was enqueued.
enum class StreamOrder { lazy, eager, others_first };
void set_stream_order(StreamOrder order);

// --- memory and failures ---
// The address range reserved for device memory; before the first allocation. Not with AddressSanitizer, which uses malloc.
void set_capacity(size_t bytes);
void set_memory_limit(size_t bytes);           // what cudaMemGetInfo calls the total; 0: the capacity
void fail_allocation(unsigned n);              // the n-th next cudaMalloc fails; 0: none
void fail_host_allocation(unsigned n);         // the n-th next allocation of pinned memory fails; 0: none
void fail_work(unsigned n, cudaError_t error); // the n-th next operation of a stream breaks the device, as a bad address would:
                                               // every call returns the error until reset(); 0: none
void set_stack_size(size_t bytes);             // of a thread; 128 KiB (with AddressSanitizer 256 KiB)

// Closing and opening device memory costs about 0.1 us a page and 2 us an allocation, twice for each wait. Long runs may do without.
void set_host_protection(bool on);

struct Counters {
    size_t allocations, frees, host_allocations, host_frees; // successful ones
    size_t device_bytes;                                     // allocated now
    size_t launches;                                         // kernels enqueued or captured, cub's functions included
    size_t graph_launches;
    size_t kernels_run, barriers;                           // barriers: once for each block or grid that passes one
    size_t bytes_to_device, bytes_to_host, bytes_on_device; // of copies that ran
    size_t host_syncs;                                      // calls that made the host wait, of whatever kind
    size_t queries;
};
Counters counters();
void reset_counters();

// Whether any stream holds work that has not run.
bool work_is_pending();
} // namespace cairn_emulated
