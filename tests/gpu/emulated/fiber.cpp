#include "fiber.h"
#include "sanitizers.h"
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <sys/mman.h>
#include <unistd.h>
#include <vector>

#if !defined(__x86_64__) || defined(CAIRN_EMULATED_UCONTEXT)
#define CAIRN_EMULATED_UCONTEXT 1
#include <ucontext.h>
#else
#define CAIRN_EMULATED_UCONTEXT 0
#endif

#if !CAIRN_EMULATED_UCONTEXT
// What a call preserves goes on the old stack, and comes from the new one. The rounding mode is the same in all fibers.
extern "C" void cairn_emulated_switch(void** save, void* load);
asm(R"(
    .text
    .p2align 4
    .type cairn_emulated_switch, @function
cairn_emulated_switch:
    pushq %rbp
    pushq %rbx
    pushq %r12
    pushq %r13
    pushq %r14
    pushq %r15
    movq %rsp, (%rdi)
    movq %rsi, %rsp
    popq %r15
    popq %r14
    popq %r13
    popq %r12
    popq %rbx
    popq %rbp
    ret
    .size cairn_emulated_switch, .-cairn_emulated_switch
)");
#endif

namespace cairn_emulated {
namespace {
constexpr size_t stacks_a_slab = 64;
size_t stack_size = CAIRN_ASAN ? 256 * 1024 : 128 * 1024;
size_t made = 0;
Fiber* idle = nullptr;
Fiber* last_made = nullptr; // they live as long as the process
Fiber* left = nullptr;      // the fiber of the last switch, for the one that goes on
Fiber* entered = nullptr;   // the fiber that goes on
void (*starting)() = nullptr;
std::vector<char*> stacks; // not yet used
std::vector<char*> slabs;  // each of stacks_a_slab stacks of slab_stack_size
std::vector<size_t> slab_stack_size;

size_t page() {
    static const size_t bytes = static_cast<size_t>(sysconf(_SC_PAGESIZE));
    return bytes;
}

char* take_stack() {
    if (stacks.empty()) {
        void* slab = mmap(nullptr, stacks_a_slab * stack_size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (slab == MAP_FAILED) {
            std::fprintf(stderr, "cairn_emulated: no room for the stacks of more than %zu threads alive at once\n", made);
            std::abort();
        }
        slabs.push_back(static_cast<char*>(slab));
        slab_stack_size.push_back(stack_size);
        for (size_t i = stacks_a_slab; i-- > 0;) {
            char* stack = static_cast<char*>(slab) + i * stack_size;
            // Past the kernel's limit of mappings (about 30000 threads alive at once) stacks go without a guard.
            (void)mprotect(stack, page(), PROT_NONE);
            stacks.push_back(stack);
        }
    }
    char* stack = stacks.back();
    stacks.pop_back();
    return stack;
}

void arrived() {
#if CAIRN_ASAN
    __sanitizer_finish_switch_fiber(entered->fake_stack, &left->stack, &left->stack_size);
#endif
}

void begin() {
    arrived();
    starting();
    std::abort();
}

Fiber* make(void (*body)()) {
    auto* fiber = new Fiber;
    char* low = take_stack() + page();
    fiber->stack = low;
    fiber->stack_size = stack_size - page();
    starting = body;
#if CAIRN_EMULATED_UCONTEXT
    auto* context = new ucontext_t;
    getcontext(context);
    context->uc_stack.ss_sp = low;
    context->uc_stack.ss_size = fiber->stack_size;
    context->uc_link = nullptr;
    makecontext(context, begin, 0);
    fiber->registers = context;
#else
    void** top = reinterpret_cast<void**>(low + fiber->stack_size) - 2;
    *top = reinterpret_cast<void*>(begin); // where the first switch returns to, above six registers
    fiber->registers = top - 6;
#endif
#if CAIRN_TSAN
    fiber->sanitizer = __tsan_create_fiber(0);
#endif
    made++;
    fiber->made_before = last_made;
    last_made = fiber;
    return fiber;
}
} // namespace

Fiber* take_fiber(void (*body)()) {
    if (!idle)
        return make(body);
    Fiber* fiber = idle;
    idle = fiber->next_idle;
    return fiber;
}

void give_fiber(Fiber* fiber) {
    fiber->next_idle = idle;
    idle = fiber;
}

Fiber& running_fiber() { return *entered; }

void adopt_host_stack(Fiber& host) {
#if CAIRN_TSAN
    host.sanitizer = __tsan_get_current_fiber();
#endif
#if CAIRN_EMULATED_UCONTEXT
    static thread_local ucontext_t context;
    host.registers = &context;
#endif
    (void)host;
}

void switch_fiber(Fiber& from, Fiber& to) {
    left = &from;
    entered = &to;
#if CAIRN_ASAN
    __sanitizer_start_switch_fiber(&from.fake_stack, to.stack, to.stack_size);
#endif
#if CAIRN_TSAN
    __tsan_switch_to_fiber(to.sanitizer, 0);
#endif
#if CAIRN_EMULATED_UCONTEXT
    swapcontext(static_cast<ucontext_t*>(from.registers), static_cast<ucontext_t*>(to.registers));
#else
    cairn_emulated_switch(&from.registers, to.registers);
#endif
    arrived();
}

void use_stack_size(size_t bytes) {
    const size_t rounded = (bytes + page() - 1) / page() * page() + page();
    if (rounded == stack_size)
        return;
    stack_size = rounded;
    stacks.clear();
    idle = nullptr; // their stacks stay mapped: a test sets this once
}

size_t fibers_made() { return made; }

bool in_stack_guard(const void* address) {
    const char* p = static_cast<const char*>(address);
    for (size_t i = 0; i < slabs.size(); i++)
        if (p >= slabs[i] && p < slabs[i] + stacks_a_slab * slab_stack_size[i])
            return static_cast<size_t>(p - slabs[i]) % slab_stack_size[i] < page();
    return false;
}
} // namespace cairn_emulated
