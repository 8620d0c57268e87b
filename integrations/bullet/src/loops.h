// Loops over what a step gathers and scatters, on the solver's threads.
#pragma once
#include <cairn/cairn.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace cairn {
namespace bullet {

template <std::size_t bytes> void prefetch(const void* address) {
#if defined(__GNUC__)
    for (std::size_t at = 0; at < bytes; at += 64)
        __builtin_prefetch(static_cast<const char*>(address) + at);
#else
    (void)address;
#endif
}

class Loops {
  public:
    // NULL: none, everything runs on the caller.
    explicit Loops(cairn_solver* solver = nullptr) : m_solver(solver) {}

    // body(i) for i in 0 ... count - 1, in pieces of `grain` neighbours. No order among the pieces; it must not throw.
    template <class Body> void each(std::size_t count, std::size_t grain, const Body& body) const {
        struct Loop {
            const Body& body;
            std::size_t count, grain;
            static void piece(void* argument, uint32_t index) {
                const Loop& loop = *static_cast<const Loop*>(argument);
                const std::size_t begin = index * loop.grain, end = std::min(begin + loop.grain, loop.count);
                for (std::size_t i = begin; i < end; ++i)
                    loop.body(i);
            }
        } loop = {body, count, grain};
        const uint32_t pieces = static_cast<uint32_t>((count + grain - 1) / grain);
        if (m_solver && cairn_solver_parallel_for(m_solver, pieces, &Loop::piece, &loop) == CAIRN_OK)
            return;
        for (uint32_t i = 0; i < pieces; ++i) // refused before anything ran
            Loop::piece(&loop, i);
    }

    // Likewise; fetch(i) asks for what body(i) will read, `ahead` calls before it. What is gathered lies scattered over the heap, and was
    // last seen before the sweeps.
    template <std::size_t ahead, class Fetch, class Body>
    void each(std::size_t count, std::size_t grain, const Fetch& fetch, const Body& body) const {
        each(count, grain, [&](std::size_t i) {
            if (i + ahead < count)
                fetch(i + ahead);
            body(i);
        });
    }

  private:
    cairn_solver* m_solver;
};

} // namespace bullet
} // namespace cairn
