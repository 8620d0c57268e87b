#include "fault.h"
#include "fiber.h"
#include "kernel.h"
#include "sanitizers.h"
#include <csignal>
#include <cstdio>
#include <cstring>
#include <unistd.h>

namespace cairn_emulated {
namespace {
const char* region_begin = nullptr;
size_t region_bytes = 0;
bool running = false;
const Kernel* kernel = nullptr;
struct sigaction before[2];

void handle(int signal, siginfo_t* info, void*) {
    const char* at = static_cast<const char*>(info->si_addr);
    const bool device = at >= region_begin && at < region_begin + region_bytes;
    char text[1024];
    int length = 0;
    if (device && !running)
        length = std::snprintf(text, sizeof text, "cairn_emulated: host code touched device memory at %p\n", info->si_addr);
    else if (running && kernel) // looking up a name is not safe in a handler, but the fault is in a kernel, and all ends here
        length = std::snprintf(text, sizeof text, "cairn_emulated: %s at %p in kernel %s, block (%u, %u, %u), thread (%u, %u, %u)\n",
                               device               ? "access out of the bounds of device memory"
                               : in_stack_guard(at) ? "stack overflow"
                                                    : "bad access (shared memory out of bounds?)",
                               info->si_addr, name_of(*kernel).c_str(), place.block.x, place.block.y, place.block.z, place.thread.x,
                               place.thread.y, place.thread.z);
    if (length > 0)
        (void)!write(STDERR_FILENO, text, std::strlen(text));
    sigaction(signal, &before[signal == SIGBUS], nullptr); // the access is repeated, under whoever was here before
}
} // namespace

void report_faults_in(const char* region, size_t bytes) {
    region_begin = region;
    region_bytes = bytes;
    prepare_thread_for_faults();
}

void let_faults_tell(bool device_runs) { running = device_runs; }
void name_running_kernel(const Kernel* running_kernel) { kernel = running_kernel; }

void prepare_thread_for_faults() {
    if (CAIRN_ASAN || CAIRN_TSAN)
        return; // they have reports of their own
    static thread_local char other_stack[128 * 1024];
    static thread_local bool prepared = false;
    static bool installed = false;
    if (!prepared) {
        stack_t stack{};
        if (sigaltstack(nullptr, &stack) == 0 && (stack.ss_flags & SS_DISABLE)) {
            stack.ss_flags = 0;
            stack.ss_sp = other_stack;
            stack.ss_size = sizeof other_stack;
            sigaltstack(&stack, nullptr);
        }
        prepared = true;
    }
    if (!installed) {
        struct sigaction action {};
        action.sa_sigaction = handle;
        action.sa_flags = SA_SIGINFO | SA_ONSTACK;
        sigemptyset(&action.sa_mask);
        sigaction(SIGSEGV, &action, &before[0]);
        sigaction(SIGBUS, &action, &before[1]); // a gap in device memory
        installed = true;
    }
}
} // namespace cairn_emulated
