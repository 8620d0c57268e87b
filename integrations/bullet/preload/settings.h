// The settings of a program that knows nothing of Cairn: environment variables, which cairn-run sets from its options.
//   CAIRN_METHOD      pj, pjnj, pjsoft, tj, tjsoft (default), or stock: Bullet's own solver, measured
//   CAIRN_PRESET      default, paper
//   CAIRN_ITERATIONS  of a whole step; given or not, the other parameters are the preset's
//   CAIRN_SUBSTEPS
//   CAIRN_THREADS     0: as many as the process may use
//   CAIRN_STATS       0: nothing is printed at exit; 1: all; else a line
#pragma once
#include <cairn/cairn.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

namespace cairn {
namespace preload {

struct Settings {
    bool stock = false;
    uint32_t method = CAIRN_METHOD_TJSOFT;
    uint32_t preset = CAIRN_PRESET_DEFAULT;
    bool own = false; // parameters were given: the world's btContactSolverInfo does not move them
    cairn_params params = {};
    cairn_config config = {};
    bool summary = true;
    bool all = false; // the whole report, with residuals
};

inline const char* variable(const char* name) {
    const char* value = std::getenv(name);
    return value && *value ? value : nullptr;
}

// false if the variable is set and is no whole number of 32 bits; `given` tells whether it is set.
inline bool readNumber(const char* name, uint32_t& number, bool& given, std::string& why) {
    const char* text = variable(name);
    given = text != nullptr;
    if (!text)
        return true;
    char* end = nullptr;
    errno = 0;
    const unsigned long long value = std::strtoull(text, &end, 10);
    if (*text < '0' || *text > '9' || *end != '\0' || errno != 0 || value > 0xffffffffull) {
        why = std::string(name) + " is \"" + text + "\": must be a whole number";
        return false;
    }
    number = static_cast<uint32_t>(value);
    return true;
}

// false: `why` says which variable is wrong. Whether the parameters fit together is cairn_solver_set_params()'s to say.
inline bool readSettings(Settings& settings, std::string& why) {
    settings = Settings();
    settings.params.struct_size = sizeof settings.params;
    settings.config.struct_size = sizeof settings.config;
    if (const char* stats = variable("CAIRN_STATS")) {
        settings.summary = std::strcmp(stats, "0") != 0;
        settings.all = std::strcmp(stats, "1") == 0;
    }
    if (const char* method = variable("CAIRN_METHOD")) {
        settings.stock = std::strcmp(method, "stock") == 0;
        uint32_t found = 0;
        while (!settings.stock && found < CAIRN_METHOD_COUNT && std::strcmp(method, cairn_method_name(found)) != 0)
            ++found;
        if (found == CAIRN_METHOD_COUNT) {
            why = std::string("CAIRN_METHOD is \"") + method + "\": must be pj, pjnj, pjsoft, tj, tjsoft, auto or stock";
            return false;
        }
        settings.method = settings.stock ? settings.method : found;
    }
    if (const char* preset = variable("CAIRN_PRESET")) {
        if (std::strcmp(preset, "paper") == 0) {
            settings.preset = CAIRN_PRESET_PAPER;
        } else if (std::strcmp(preset, "default") != 0) {
            why = std::string("CAIRN_PRESET is \"") + preset + "\": must be default or paper";
            return false;
        }
    }
    if (cairn_params_preset(settings.method, settings.preset, &settings.params) != CAIRN_OK) {
        why = cairn_last_error();
        return false;
    }
    bool iterations = false, substeps = false, threads = false;
    if (!readNumber("CAIRN_ITERATIONS", settings.params.iterations, iterations, why) ||
        !readNumber("CAIRN_SUBSTEPS", settings.params.substeps, substeps, why) ||
        !readNumber("CAIRN_THREADS", settings.config.threads, threads, why))
        return false;
    settings.own = iterations || substeps;
    settings.params.residual_trace = settings.all ? 1 : 0;
    return true;
}

} // namespace preload
} // namespace cairn
