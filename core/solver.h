// The solver: keeps what outlives a step (warm-start cache, threads, buffers) and runs steps.
#pragma once
#include "method/choose.h"
#include "method/params.h"
#include "scene/input.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace cairn {

enum class Backend : std::uint32_t { automatic, cpu, cuda };
enum class Isa : std::uint32_t { automatic, scalar, sse2, avx2, avx512 };

// The hooks are cairn_config's.
struct Hooks {
    void* user = nullptr;
    void (*log)(void*, std::int32_t, const char*) = nullptr;
    void (*parallel_for)(void*, std::uint32_t, void (*)(void*, std::uint32_t), void*) = nullptr;
    void* (*allocate)(void*, std::size_t, std::size_t) = nullptr;
    void (*release)(void*, void*, std::size_t, std::size_t) = nullptr;
};

struct Config {
    std::uint32_t threads = 0; // 0: as many as the process may use
    Isa isa = Isa::automatic;
    bool double_precision = false;
    Backend backend = Backend::automatic;
    std::uint32_t executor = 0; // CAIRN_EXECUTOR_...: how a device runs the schedule
    void* stream = nullptr;     // cairn_config's
    Hooks hooks;
};

struct Statistics {
    std::uint32_t bodies = 0, contacts = 0, manifolds = 0, joints = 0, rows = 0, islands = 0, substeps = 0, iterations = 0;
    std::uint32_t position_iterations = 0, relax_iterations = 0, restitution_iterations = 0, warm_started = 0, rotation_clamped = 0;
    std::uint32_t threads = 0;
    Isa isa = Isa::scalar;
    Backend backend = Backend::cpu;
    std::uint32_t executor = 0;
    double time_upload = 0, time_download = 0;
    double time_total = 0, time_pack = 0, time_build = 0, time_sweep = 0, time_position = 0, time_integrate = 0, time_finish = 0;
    double kinetic_energy_change = 0, residual = 0;
};

// What the method `auto` did with an island.
struct Choice {
    std::uint32_t first_body, bodies;
    Reason reason;
    Method method;
    std::uint32_t substeps, iterations, swept; // iterations: at most
    bool met;
    double residual; // m/s
};

// The solve left the range of numbers: what() names the body. Nothing was written.
struct NotFinite : std::runtime_error {
    using std::runtime_error::runtime_error;
};
// An instruction set that the processor lacks, or a device that is not there.
struct Unsupported : std::runtime_error {
    using std::runtime_error::runtime_error;
};
// A device's memory, or the pinned memory to reach it, does not suffice: what() says how much was asked for.
struct OutOfDeviceMemory : std::bad_alloc {
    OutOfDeviceMemory(const char* kind, std::size_t bytes)
        : text(std::string("out of ") + kind + " memory: " + std::to_string(bytes) +
               " bytes were asked for; nothing was changed, and the solver stays usable") {}
    const char* what() const noexcept override { return text.c_str(); }
    std::string text;
};

// An element of a table on the device is bad: `input` has those tables' columns in host memory, for whoever says what is wrong. It
// lives as long as the solver and its next step. Nothing was written.
struct RefusedOnDevice : std::runtime_error {
    explicit RefusedOnDevice(const Input& copied)
        : std::runtime_error("a check on the device refused an element that the host accepts"), input(copied) {}
    Input input;
};

class Pool;

class Solver {
  public:
    virtual ~Solver() = default;
    // Throws Unsupported, std::bad_alloc.
    static std::unique_ptr<Solver> create(const Config& config);
    static Isa widest();

    Params params;

    // A step: begin() may only queue it, finish() waits. In between the caller's memory is borrowed, and nothing else may be called.
    // Input and params must have been checked. Both throw NotFinite, std::bad_alloc, RefusedOnDevice; then the step is over and
    // nothing was written or changed.
    virtual void begin(const Input& input, const Output& output) = 0;
    virtual void finish() {}
    void step(const Input& input, const Output& output) {
        begin(input, output);
        finish();
    }
    // The CUDA device whose memory views may show; -1: none, host memory only.
    virtual int device() const { return -1; }
    // The threads that its steps run on; NULL: none of the host's.
    virtual Pool* pool() { return nullptr; }
    virtual const Statistics& statistics() const = 0;
    virtual std::span<const double> residual_trace() const = 0;
    virtual std::span<const std::uint32_t> split_counts() const = 0;
    // Whether it has the method `auto`, and what that did in the last step, by island.
    virtual bool chooses() const { return false; }
    virtual std::span<const Choice> choices() const { return {}; }
    virtual void reset() = 0;
    virtual std::vector<std::byte> save_cache() const = 0;
    // Throws std::invalid_argument with what is wrong; then nothing was changed.
    virtual void load_cache(std::span<const std::byte> bytes) = 0;
};

} // namespace cairn
