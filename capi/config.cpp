#include "config.h"

#include "gpu/device.h"
#include "struct_size.h"

#include <cstdlib>
#include <cstring>

namespace cairn::capi {

namespace {

constexpr std::uint32_t kMostThreads = 1024;
constexpr const char* kIsaNames[] = {"CAIRN_ISA_AUTO", "CAIRN_ISA_SCALAR", "CAIRN_ISA_SSE2", "CAIRN_ISA_AVX2", "CAIRN_ISA_AVX512"};

void check_instructions(const cairn_config& config) {
    if (config.instructions > CAIRN_ISA_AVX512)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.instructions is %u: must be one of CAIRN_ISA_..., 0 ... %u", config.instructions,
               CAIRN_ISA_AVX512);
    const auto widest = static_cast<std::uint32_t>(Solver::widest());
    if (config.instructions > widest)
        refuse(CAIRN_ERROR_UNSUPPORTED,
               "config.instructions is %s, which this processor or build lacks: the widest here is %s; CAIRN_ISA_AUTO takes it",
               kIsaNames[config.instructions], kIsaNames[widest]);
    if (config.precision == 64 && config.instructions > CAIRN_ISA_SCALAR)
        refuse(CAIRN_ERROR_UNSUPPORTED,
               "config.instructions is %s, but precision 64 is scalar: use CAIRN_ISA_AUTO or CAIRN_ISA_SCALAR with it",
               kIsaNames[config.instructions]);
}

} // namespace

namespace {

// What CAIRN_BACKEND_AUTO stands for. An environment variable, so that a program can be tried on a GPU as it is.
Backend backend_of(const cairn_config& config) {
    if (config.backend != CAIRN_BACKEND_AUTO)
        return static_cast<Backend>(config.backend);
    const char* const wish = std::getenv("CAIRN_BACKEND");
    if (wish == nullptr || *wish == '\0' || std::strcmp(wish, "auto") == 0 || std::strcmp(wish, "cpu") == 0)
        return Backend::cpu;
    if (std::strcmp(wish, "cuda") != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "the environment variable CAIRN_BACKEND is \"%.100s\": must be auto, cpu or cuda", wish);
    if (config.precision == 64 || config.instructions != CAIRN_ISA_AUTO)
        return Backend::cpu; // what only the CPU has was asked for
    return Backend::cuda;
}

} // namespace

Config check_config(const cairn_config* given) {
    const cairn_config config = given == nullptr ? cairn_config{} : read_struct(given, cairn_config{});
    if (config.backend > CAIRN_BACKEND_CUDA)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.backend is %u: must be one of CAIRN_BACKEND_..., 0 ... %u", config.backend,
               CAIRN_BACKEND_CUDA);
    if (config.executor > CAIRN_EXECUTOR_GRAPH)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.executor is %u: must be one of CAIRN_EXECUTOR_..., 0 ... %u", config.executor,
               CAIRN_EXECUTOR_GRAPH);
    if (config.threads > kMostThreads)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.threads is %u: must be 1 ... %u, or 0 for as many as the process may use",
               config.threads, kMostThreads);
    if (config.precision != 0 && config.precision != 32 && config.precision != 64)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.precision is %u: must be 32 or 64, or 0 for 32", config.precision);
    check_instructions(config);
    if (config.reserved != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.reserved is %u: must be 0", config.reserved);
    if ((config.allocate == nullptr) != (config.release == nullptr))
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.%s is NULL, but config.%s is not: pass both or neither",
               config.allocate == nullptr ? "allocate" : "release", config.allocate == nullptr ? "release" : "allocate");
    if (config.reserved_2 != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.reserved_2 is %u: must be 0", config.reserved_2);
    const Backend backend = backend_of(config);
    if (config.stream != nullptr && backend != Backend::cuda)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "config.stream is set, but the solver would run on the CPU: pass CAIRN_BACKEND_CUDA with it");
    if (backend == Backend::cuda) {
        const char* const asker =
            config.backend == CAIRN_BACKEND_CUDA ? "config.backend is CAIRN_BACKEND_CUDA" : "CAIRN_BACKEND=cuda is set";
        if (config.precision == 64)
            refuse(CAIRN_ERROR_UNSUPPORTED, "%s, but precision 64 runs on the CPU only: use precision 32, or CAIRN_BACKEND_CPU", asker);
        if (!gpu::available())
            refuse(CAIRN_ERROR_UNSUPPORTED, "%s, but %s. Use CAIRN_BACKEND_AUTO or _CPU", asker, gpu::cuda_state().c_str());
    }
    Config checked;
    checked.backend = backend;
    checked.executor = config.executor;
    checked.threads = config.threads;
    checked.isa = static_cast<Isa>(config.instructions);
    checked.double_precision = config.precision == 64;
    checked.stream = config.stream;
    checked.hooks = {config.user, config.log, config.parallel_for, config.allocate, config.release};
    return checked;
}

} // namespace cairn::capi
