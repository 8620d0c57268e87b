#include "status.h"

#include "solver.h"

#include <cstdarg>
#include <cstdio>
#include <exception>
#include <new>

namespace cairn::capi {

namespace {

// A plain array, so that even "out of memory" finds room for its text.
thread_local char error_text[kTextSize] = "";

cairn_status keep(cairn_status status, const char* prefix, const char* text) {
    std::snprintf(error_text, sizeof error_text, "%s%s", prefix, text);
    return status;
}

} // namespace

void refuse(cairn_status status, const char* format, ...) {
    Refusal refusal{status, {}};
    std::va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(refusal.text, sizeof refusal.text, format, arguments);
    va_end(arguments);
    throw refusal;
}

cairn_status status_of_current_exception() noexcept {
    try {
        throw;
    } catch (const Refusal& refusal) {
        return keep(refusal.status, "", refusal.text);
    } catch (const NotFinite& error) {
        return keep(CAIRN_ERROR_NOT_FINITE, "", error.what());
    } catch (const Unsupported& error) {
        return keep(CAIRN_ERROR_UNSUPPORTED, "", error.what());
    } catch (const OutOfDeviceMemory& error) {
        return keep(CAIRN_ERROR_OUT_OF_MEMORY, "", error.what());
    } catch (const std::bad_alloc&) {
        return keep(CAIRN_ERROR_OUT_OF_MEMORY, "", "out of memory: nothing was changed, and the solver stays usable");
    } catch (const std::exception& error) {
        return keep(CAIRN_ERROR_INTERNAL, "internal error in Cairn, please report it: ", error.what());
    } catch (...) {
        return keep(CAIRN_ERROR_INTERNAL, "internal error in Cairn, please report it: ", "an exception of an unknown type");
    }
}

const char* last_error() noexcept { return error_text; }

} // namespace cairn::capi
