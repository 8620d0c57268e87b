// The floating-point environment that results are defined in: round to nearest, subnormals kept, no traps.
#pragma once
#include <cstdint>

#if defined(__SSE2__)
#include <immintrin.h>
#elif !defined(__aarch64__)
#include <cfenv>
#endif

namespace cairn {

// Set for the life of the object on the thread that makes it, then what was before is restored, exception flags included. Every
// entry that computes holds one, and every thread that runs a task of a step, the caller's own threads too.
class FpEnvironment {
  public:
    FpEnvironment(const FpEnvironment&) = delete;
    FpEnvironment& operator=(const FpEnvironment&) = delete;

#if defined(__SSE2__)
    FpEnvironment() : saved_(_mm_getcsr()) { _mm_setcsr(0x1f80); } // the reset value: nearest, all masked, no FTZ, no DAZ
    ~FpEnvironment() { _mm_setcsr(saved_); }

  private:
    unsigned saved_;
#elif defined(__aarch64__)
    FpEnvironment() {
        asm volatile("mrs %0, fpcr" : "=r"(saved_));
        asm volatile("msr fpcr, %0" : : "r"(std::uint64_t{0})); // nearest, no FZ, no traps
    }
    ~FpEnvironment() { asm volatile("msr fpcr, %0" : : "r"(saved_)); }

  private:
    std::uint64_t saved_ = 0;
#else
    FpEnvironment() {
        std::fegetenv(&saved_);
        std::fesetenv(FE_DFL_ENV);
    }
    ~FpEnvironment() { std::fesetenv(&saved_); }

  private:
    std::fenv_t saved_;
#endif
};

} // namespace cairn
