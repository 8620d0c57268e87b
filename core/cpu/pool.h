// Threads for loops that take microseconds: workers spin for a while between loops, then sleep. The calling thread works
// too and takes every part that no worker has begun, so that a worker that the system has put aside holds nobody up.
#pragma once
#include "../solver.h"

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace cairn {

class Pool {
  public:
    // threads: 0 = as many as the process may use
    Pool(std::uint32_t threads, const Hooks& hooks);
    ~Pool();
    Pool(const Pool&) = delete;
    Pool& operator=(const Pool&) = delete;

    std::uint32_t threads() const { return threads_; }

    // task(begin, end) over parts of 0 ... count, at least `grain` to a part; returns when all are done.
    template <class Task> void each(std::uint32_t count, std::uint32_t grain, const Task& task) {
        const std::uint32_t wanted = std::min(threads_, count / grain);
        if (wanted < 2) {
            if (count > 0)
                task(0u, count);
            return;
        }
        struct Loop {
            const Task* task;
            std::uint32_t count, parts;
        } loop{&task, count, wanted};
        run(
            wanted,
            [](void* argument, std::uint32_t part) {
                const Loop& l = *static_cast<const Loop*>(argument);
                const auto edge = [&](std::uint32_t p) { return static_cast<std::uint32_t>(std::uint64_t{l.count} * p / l.parts); };
                (*l.task)(edge(part), edge(part + 1));
            },
            &loop);
    }

  private:
    using Part = void (*)(void*, std::uint32_t);
    void run(std::uint32_t parts, Part part, void* argument);
    void work();
    std::uint64_t take_parts(); // the ticket at which none was left

    Hooks hooks_;
    std::uint32_t threads_;
    std::vector<std::thread> workers_;
    // The loop at hand. A part is claimed by raising `ticket_`, which only succeeds while its loop lasts; what the loop is
    // may be read by whoever has claimed a part of it.
    Part part_ = nullptr;
    void* argument_ = nullptr;
    alignas(64) std::atomic<std::uint64_t> ticket_{0}; // generation (32 bits), parts (16), next part (16)
    alignas(64) std::atomic<std::uint32_t> finished_{0};
    std::atomic<bool> stop_{false};
};

} // namespace cairn
