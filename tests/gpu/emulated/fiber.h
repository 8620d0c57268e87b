// Fibers: stacks of their own between which one host thread switches. They are pooled and never end; an idle one waits inside its
// body for the next use.
#pragma once
#include <cstddef>

namespace cairn_emulated {
struct Fiber {
    void* registers = nullptr; // where its registers lie on its stack, or its ucontext_t
    const void* stack = nullptr;
    size_t stack_size = 0;
    void* fake_stack = nullptr; // AddressSanitizer's
    void* sanitizer = nullptr;  // ThreadSanitizer's
    Fiber* next_idle = nullptr;
    Fiber* made_before = nullptr;
};

// An idle fiber, or a new one that begins body(), which must never return.
Fiber* take_fiber(void (*body)());
void give_fiber(Fiber* fiber);
Fiber& running_fiber(); // the one whose stack this is
// Goes on in `to`; comes back when something switches to `from`.
void switch_fiber(Fiber& from, Fiber& to);
// Before the first switch away from the host's own stack.
void adopt_host_stack(Fiber& host);

void use_stack_size(size_t bytes); // of fibers made from now on
size_t fibers_made();
// Whether an address lies in the guard below a fiber's stack.
bool in_stack_guard(const void* address);
} // namespace cairn_emulated
