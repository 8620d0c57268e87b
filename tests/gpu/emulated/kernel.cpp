// A block's threads run one after another up to the next barrier: one interval. A thread that never meets a barrier runs to its end
// on a fiber that then takes the next thread; one that waits keeps the fiber. Blocks that may wait for each other (a cluster's, or
// all of a cooperative launch) form a gang and are alive together.
#include "kernel.h"
#include "fault.h"
#include "fiber.h"
#include "include/cooperative_groups.h"
#include "memory.h"
#include "symbols.h"
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <numeric>

namespace cairn_emulated {
Place place;

namespace {
struct Thread {
    Fiber* fiber = nullptr; // while it waits
    bool started = false;
};
struct Block {
    uint3 index;
    size_t cluster; // in the gang
    unsigned rank;  // in the cluster
    std::vector<Thread> threads;
    std::vector<unsigned> order; // of the threads in this interval
    size_t position;             // in order, of the next thread
    unsigned waiting, exited, a_waiting_thread, an_exited_thread;
    unsigned votes, result;
    Barrier barrier;
    bool started;
    Shared shared;
};
struct Gang {
    std::vector<Block> blocks; // a cluster's in a row; at least `size`, the others for later launches
    size_t size = 0;
};
Gang gang;
const Launch* launched = nullptr;
Block* block = nullptr;
unsigned thread = 0;
Fiber host;

unsigned volume(const dim3& d) { return d.x * d.y * d.z; }
uint3 unfold(size_t i, const dim3& d) {
    const unsigned n = static_cast<unsigned>(i);
    if (d.y == 1 && d.z == 1)
        return {n, 0, 0};
    return {n % d.x, n / d.x % d.y, n / d.x / d.y};
}
bool is_wide(Barrier barrier) { return barrier == Barrier::cluster || barrier == Barrier::grid; }
bool all_exited(const Block& b) { return b.exited == b.threads.size(); }

const char* name_of(Barrier barrier) {
    switch (barrier) {
    case Barrier::none:
        break;
    case Barrier::block:
        return "__syncthreads()";
    case Barrier::block_or:
        return "__syncthreads_or()";
    case Barrier::block_and:
        return "__syncthreads_and()";
    case Barrier::block_count:
        return "__syncthreads_count()";
    case Barrier::cluster:
        return "the cluster's barrier";
    case Barrier::grid:
        return "the grid's barrier";
    }
    return "nothing";
}

[[noreturn]] void fail(const Block& b, unsigned of_thread, const char* text, const char* what = "", unsigned other = 0) {
    const uint3 t = unfold(of_thread, launched->block), u = unfold(other, launched->block);
    char filled[512];
    std::snprintf(filled, sizeof filled, text, what, u.x, u.y, u.z);
    std::fprintf(stderr, "cairn_emulated: kernel %s, block (%u, %u, %u), thread (%u, %u, %u): %s\n", name_of(launched->kernel).c_str(),
                 b.index.x, b.index.y, b.index.z, t.x, t.y, t.z, filled);
    std::abort();
}

[[noreturn]] void fail_outside(const char* what) {
    std::fprintf(stderr, "cairn_emulated: %s outside a kernel\n", what);
    std::abort();
}

void become(unsigned next) {
    thread = next;
    place.thread = unfold(next, launched->block);
}

[[noreturn]] void run_threads();

// From the thread or the host on `self` to the next thread of the interval, or at its end to the host.
void go_on(Fiber& self) {
    Block& b = *block;
    if (b.position == b.order.size()) {
        switch_fiber(self, host);
        return;
    }
    const unsigned next = b.order[b.position];
    Thread& t = b.threads[next];
    if (!t.started) {
        switch_fiber(self, *take_fiber(run_threads));
    } else {
        b.position++;
        become(next);
        switch_fiber(self, *t.fiber);
    }
}

// What every fiber does: threads that have not started, one after another, as long as there are some.
[[noreturn]] void run_threads() {
    Fiber& self = running_fiber();
    for (;;) {
        while (block->position < block->order.size() && !block->threads[block->order[block->position]].started) {
            const unsigned next = block->order[block->position++];
            block->threads[next].started = true;
            become(next);
            launched->kernel.call();
            Block& b = *block;
            if (b.waiting > 0)
                fail(b, thread, "returned while thread (%2$u, %3$u, %4$u) of its block waits at %1$s", name_of(b.barrier),
                     b.a_waiting_thread);
            b.exited++;
            b.an_exited_thread = thread;
        }
        give_fiber(&self);
        go_on(self);
    }
}

void pass_barrier(Block& b) {
    b.result = b.votes;
    b.votes = 0;
    b.waiting = 0;
    b.barrier = Barrier::none;
}

void begin_block(Block& b, size_t rank_in_grid_of_clusters, unsigned rank, size_t cluster_in_gang, bool wide) {
    const dim3& c = launched->cluster;
    const dim3 clusters(launched->grid.x / c.x, launched->grid.y / c.y, launched->grid.z / c.z);
    const uint3 base = unfold(rank_in_grid_of_clusters, clusters), offset = unfold(rank, c);
    b.index = {base.x * c.x + offset.x, base.y * c.y + offset.y, base.z * c.z + offset.z};
    b.cluster = cluster_in_gang;
    b.rank = rank;
    const unsigned n = volume(launched->block);
    b.threads.assign(n, Thread{});
    b.order.resize(n);
    std::iota(b.order.begin(), b.order.end(), 0u);
    if (state.order == Order::reversed)
        std::reverse(b.order.begin(), b.order.end());
    b.waiting = b.exited = b.votes = b.result = 0;
    b.barrier = Barrier::none;
    b.started = false;
    b.shared = take_shared(launched->shared_bytes);
    if (wide && launched->shared_bytes > 0)
        allow_shared(b.shared, false);
}

void run_interval(Block& b, bool wide) {
    if (!b.started && wide && launched->shared_bytes > 0)
        allow_shared(b.shared, true);
    b.started = true;
    block = &b;
    place.block = b.index;
    b.position = 0;
    if (state.order == Order::shuffled)
        for (size_t i = b.order.size(); i > 1; i--)
            std::swap(b.order[i - 1], b.order[random_below(i)]);
    go_on(host);
    if (all_exited(b)) {
        if (!shared_is_intact(b.shared))
            fail(b, thread, "wrote outside its block's dynamic shared memory");
        if (wide && launched->shared_bytes > 0)
            allow_shared(b.shared, false);
    } else if (!is_wide(b.barrier) || (b.barrier == Barrier::cluster && volume(launched->cluster) == 1)) {
        state.counters.barriers++;
        pass_barrier(b);
    }
    block = nullptr;
}

// All of them wait, or have ended. Lets those go on whose barrier is complete.
void release(std::vector<Block*>& runnable) {
    const auto pass = [&](size_t begin, size_t end) {
        state.counters.barriers++;
        for (size_t i = begin; i < end; i++) {
            pass_barrier(gang.blocks[i]);
            runnable.push_back(&gang.blocks[i]);
        }
    };
    const auto wait_at_it = [](Barrier barrier) { return [barrier](const Block& b) { return b.waiting > 0 && b.barrier == barrier; }; };
    const auto at = [](size_t i) { return gang.blocks.begin() + static_cast<std::ptrdiff_t>(i); };
    const size_t blocks = volume(launched->cluster);
    for (size_t i = 0; i < gang.size; i += blocks)
        if (std::all_of(at(i), at(i + blocks), wait_at_it(Barrier::cluster)))
            pass(i, i + blocks);
    if (!runnable.empty())
        return;
    if (std::all_of(at(0), at(gang.size), wait_at_it(Barrier::grid)))
        return pass(0, gang.size);
    const Block& waits = *std::find_if(at(0), at(gang.size), [](const Block& b) { return b.waiting > 0; });
    fail(waits, waits.a_waiting_thread, "waits at %s, to which other blocks never come: they have returned or wait elsewhere",
         name_of(waits.barrier));
}

void run_gang(bool wide) {
    std::vector<Block*> runnable;
    for (size_t i = 0; i < gang.size; i++)
        runnable.push_back(&gang.blocks[i]);
    size_t left = gang.size;
    while (left > 0) {
        if (runnable.empty())
            release(runnable);
        if (state.order == Order::forward) // the last is next
            std::reverse(runnable.begin(), runnable.end());
        while (!runnable.empty()) {
            if (state.order == Order::shuffled)
                std::swap(runnable.back(), runnable[random_below(runnable.size())]);
            Block& b = *runnable.back();
            run_interval(b, wide);
            if (all_exited(b))
                left--;
            if (all_exited(b) || b.waiting > 0)
                runnable.pop_back();
        }
    }
    for (size_t i = 0; i < gang.size; i++) {
        if (wide && launched->shared_bytes > 0)
            allow_shared(gang.blocks[i].shared, true);
        give_shared(gang.blocks[i].shared);
    }
}
} // namespace

std::string name_of(const Kernel& kernel) {
    const std::string name = function_name(kernel.address);
    if (!name.empty())
        return name;
    char address[32];
    std::snprintf(address, sizeof address, " at %p", kernel.address);
    return demangled(kernel.type->name()) + address;
}

void run_kernel(const Launch& launch) {
    launched = &launch;
    name_running_kernel(&launch.kernel);
    place.block_dim = launch.block;
    place.grid_dim = launch.grid;
    adopt_host_stack(host);
    state.counters.kernels_run++;
    const unsigned a_cluster = volume(launch.cluster);
    const size_t clusters = volume(launch.grid) / a_cluster;
    const size_t together = launch.cooperative ? clusters : 1; // clusters in a gang
    const bool wide = together * a_cluster > 1;
    gang.size = together * a_cluster;
    if (gang.blocks.size() < gang.size)
        gang.blocks.resize(gang.size);
    std::vector<size_t> order;
    if (state.order == Order::shuffled && together == 1) {
        order.resize(clusters);
        std::iota(order.begin(), order.end(), size_t(0));
        for (size_t i = clusters; i > 1; i--)
            std::swap(order[i - 1], order[random_below(i)]);
    }
    for (size_t i = 0; i < clusters; i += together) {
        for (size_t j = 0; j < together; j++) {
            const size_t cluster = !order.empty() ? order[i] : state.order == Order::reversed && together == 1 ? clusters - 1 - i : i + j;
            for (unsigned rank = 0; rank < a_cluster; rank++)
                begin_block(gang.blocks[j * a_cluster + rank], cluster, rank, j, wide);
        }
        run_gang(wide);
    }
    name_running_kernel(nullptr);
    launched = nullptr;
}

unsigned wait_at(Barrier barrier, bool vote) {
    if (!block)
        fail_outside("a barrier");
    Block& b = *block;
    if (barrier == Barrier::grid && !launched->cooperative)
        fail(b, thread, "waits at %s in a launch that is not cooperative", name_of(barrier));
    if (b.exited > 0)
        fail(b, thread, "waits at %s, but thread (%u, %u, %u) of its block has returned", name_of(barrier), b.an_exited_thread);
    if (b.waiting > 0 && b.barrier != barrier) {
        char both[128];
        std::snprintf(both, sizeof both, "waits at %s, but thread (%%2$u, %%3$u, %%4$u) of its block waits at %%1$s", name_of(barrier));
        fail(b, thread, both, name_of(b.barrier), b.a_waiting_thread);
    }
    b.barrier = barrier;
    b.waiting++;
    b.a_waiting_thread = thread;
    b.votes += vote;
    Fiber& self = running_fiber();
    b.threads[thread].fiber = &self;
    go_on(self);
    return b.result;
}

void* dynamic_shared() {
    if (!block)
        fail_outside("shared memory");
    return block->shared.address;
}

unsigned thread_rank_in_block() { return place.thread.x + place.block_dim.x * (place.thread.y + place.block_dim.y * place.thread.z); }
unsigned threads_of_block() { return volume(place.block_dim); }
unsigned long long block_rank_in_grid() {
    return place.block.x + 1ull * place.grid_dim.x * (place.block.y + 1ull * place.grid_dim.y * place.block.z);
}
unsigned block_rank_in_cluster() {
    if (!block)
        fail_outside("a cluster");
    return block->rank;
}
unsigned blocks_of_cluster() {
    if (!block)
        fail_outside("a cluster");
    return volume(launched->cluster);
}
bool launch_is_cooperative() { return launched && launched->cooperative; }

void* map_shared(void* address, int rank) {
    if (!block)
        fail_outside("shared memory");
    const std::ptrdiff_t offset = static_cast<char*>(address) - static_cast<char*>(block->shared.address);
    if (offset < 0 || static_cast<size_t>(offset) > block->shared.bytes)
        fail(*block, thread, "maps an address that is not in its block's dynamic shared memory");
    if (rank < 0 || static_cast<unsigned>(rank) >= volume(launched->cluster))
        fail(*block, thread, "maps shared memory of a block that its cluster does not have");
    const Block& other = gang.blocks[block->cluster * volume(launched->cluster) + static_cast<unsigned>(rank)];
    return static_cast<char*>(other.shared.address) + offset;
}
} // namespace cairn_emulated
