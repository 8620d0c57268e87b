#include "pool.h"

#include "fp_env.h"

#include <algorithm>
#include <new>
#include <system_error>
#ifdef __linux__
#include <sched.h>
#endif

namespace cairn {

namespace {

std::uint32_t available_threads() {
#ifdef __linux__
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0)
        return static_cast<std::uint32_t>(std::max(1, CPU_COUNT(&set)));
#endif
    return std::max(1u, std::thread::hardware_concurrency());
}

void pause() {
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

// About 50 us: longer than any gap between the loops of a step.
constexpr int kSpins = 2000;

template <class Done> bool spin_until(const Done& done) {
    for (int i = 0; i < kSpins; ++i) {
        if (done())
            return true;
        pause();
    }
    return done();
}

} // namespace

Pool::Pool(std::uint32_t threads, const Hooks& hooks) : hooks_(hooks), threads_(threads ? threads : available_threads()) {
    if (hooks_.parallel_for)
        return; // the caller's threads do it
    try {
        workers_.reserve(threads_);
        for (std::uint32_t i = 1; i < threads_; ++i)
            workers_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
        threads_ = static_cast<std::uint32_t>(workers_.size()) + 1; // fewer than asked for: results are the same
    } catch (const std::bad_alloc&) {
        threads_ = static_cast<std::uint32_t>(workers_.size()) + 1;
    }
}

Pool::~Pool() {
    stop_.store(true, std::memory_order_relaxed);
    ticket_.fetch_add(std::uint64_t{1} << 32, std::memory_order_release);
    ticket_.notify_all();
    for (std::thread& worker : workers_)
        worker.join();
}

void Pool::run(std::uint32_t parts, Part part, void* argument) {
    if (hooks_.parallel_for) {
        struct Call {
            Part part;
            void* argument;
        } call{part, argument};
        hooks_.parallel_for(
            hooks_.user, parts,
            [](void* c, std::uint32_t i) {
                const FpEnvironment environment;
                static_cast<Call*>(c)->part(static_cast<Call*>(c)->argument, i);
            },
            &call);
        return;
    }
    part_ = part;
    argument_ = argument;
    finished_.store(0, std::memory_order_relaxed);
    const std::uint64_t generation = (ticket_.load(std::memory_order_relaxed) >> 32) + 1;
    ticket_.store(generation << 32 | std::uint64_t{parts} << 16, std::memory_order_release);
    ticket_.notify_all();
    take_parts();
    const auto done = [&] { return finished_.load(std::memory_order_acquire) == parts; };
    while (!spin_until(done))
        std::this_thread::yield();
}

std::uint64_t Pool::take_parts() {
    std::uint64_t ticket = ticket_.load(std::memory_order_acquire);
    while ((ticket & 0xffff) < (ticket >> 16 & 0xffff)) {
        if (!ticket_.compare_exchange_weak(ticket, ticket + 1, std::memory_order_acq_rel, std::memory_order_acquire))
            continue;
        part_(argument_, static_cast<std::uint32_t>(ticket & 0xffff));
        finished_.fetch_add(1, std::memory_order_release);
        ticket = ticket_.load(std::memory_order_acquire);
    }
    return ticket;
}

void Pool::work() {
    const FpEnvironment environment;
    std::uint64_t seen = 0;
    for (;;) {
        const auto called = [&] { return ticket_.load(std::memory_order_acquire) >> 32 != seen >> 32; };
        while (!spin_until(called)) {
            const std::uint64_t now = ticket_.load(std::memory_order_acquire);
            if (now >> 32 == seen >> 32)
                ticket_.wait(now, std::memory_order_acquire);
        }
        seen = take_parts();
        if (stop_.load(std::memory_order_relaxed)) // after it: the ticket that take_parts saw may be the destructor's
            return;
    }
}

} // namespace cairn
