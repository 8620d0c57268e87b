#include "pool.h"

#include "fp_env.h"

#include <algorithm>
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
        for (std::uint32_t i = 1; i < threads_; ++i)
            workers_.emplace_back([this, i] { work(i); });
    } catch (const std::system_error&) { // fewer threads than asked for: results are the same
        threads_ = static_cast<std::uint32_t>(workers_.size()) + 1;
    }
}

Pool::~Pool() {
    stop_ = true;
    generation_.fetch_add(1, std::memory_order_release);
    generation_.notify_all();
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
    parts_ = parts;
    pending_.store(static_cast<std::uint32_t>(workers_.size()), std::memory_order_relaxed);
    generation_.fetch_add(1, std::memory_order_release);
    generation_.notify_all();
    part(argument, 0);
    const auto done = [&] { return pending_.load(std::memory_order_acquire) == 0; };
    while (!spin_until(done))
        std::this_thread::yield();
}

void Pool::work(std::uint32_t index) {
    const FpEnvironment environment;
    std::uint32_t seen = 0;
    for (;;) {
        const auto called = [&] { return generation_.load(std::memory_order_acquire) != seen; };
        while (!spin_until(called))
            generation_.wait(seen, std::memory_order_acquire);
        ++seen;
        if (stop_)
            return;
        if (index < parts_)
            part_(argument_, index);
        pending_.fetch_sub(1, std::memory_order_release);
    }
}

} // namespace cairn
