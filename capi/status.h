// How a call that cannot go on says so: inside the library by throwing, at its edge as a status and a text for the thread.
#pragma once
#include <cairn/cairn.h>

#include <cstddef>

namespace cairn::capi {

// Long enough for the longest text of the checks, short enough to be thrown without a string of its own.
constexpr std::size_t kTextSize = 512;

struct Refusal {
    cairn_status status;
    char text[kTextSize];
};

[[noreturn]] __attribute__((format(printf, 2, 3))) void refuse(cairn_status status, const char* format, ...);

// To be called in a catch block: keeps the text for cairn_last_error() and gives the status.
cairn_status status_of_current_exception() noexcept;
const char* last_error() noexcept;

// Runs an entry's body; whatever it throws ends here.
template <class Body> cairn_status guarded(Body&& body) noexcept {
    try {
        body();
        return CAIRN_OK;
    } catch (...) {
        return status_of_current_exception();
    }
}

} // namespace cairn::capi
