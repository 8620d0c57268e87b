// The C ABI: each entry checks, calls core, and turns what happened into a status. What may be passed is said in cairn.h.
#include <cairn/cairn.h>

#include "check_step.h"
#include "config.h"
#include "cpu/fp_env.h"
#include "cpu/pool.h"
#include "evaluate.h"
#include "gpu/device.h"
#include "params.h"
#include "solver.h"
#include "struct_size.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#if __has_include("cairn_build.h")
#include "cairn_build.h"
#else // built without CMake
#define CAIRN_BUILD __VERSION__
#endif

using namespace cairn::capi;

struct cairn_solver {
    cairn_solver(std::unique_ptr<cairn::Solver> made, const cairn::Config& with)
        : core(std::move(made)), keys(with.hooks), hooks(with.hooks), threads(with.threads) {}
    // A device's solver has no threads on the host: they are started when the caller first wants some.
    cairn::Pool& pool() {
        if (cairn::Pool* of_steps = core->pool())
            return *of_steps;
        if (!own_pool)
            own_pool = std::make_unique<cairn::Pool>(threads, hooks);
        return *own_pool;
    }

    std::unique_ptr<cairn::Solver> core;
    KeySet keys;
    cairn::Hooks hooks;
    std::uint32_t threads;
    std::unique_ptr<cairn::Pool> own_pool;
    bool in_flight = false; // between cairn_solver_step_async and _wait
};

namespace {

static_assert(sizeof(cairn_choice) == 40, "the layout of a choice is fixed for ever");
static_assert(sizeof(cairn_view) == 8 + sizeof(void*) + 8, "the layout of a view is fixed for ever");
static_assert(CAIRN_F32 == static_cast<std::uint32_t>(cairn::Type::f32) && CAIRN_U64 == static_cast<std::uint32_t>(cairn::Type::u64));
static_assert(CAIRN_ISA_AUTO == static_cast<std::uint32_t>(cairn::Isa::automatic) &&
              CAIRN_ISA_AVX512 == static_cast<std::uint32_t>(cairn::Isa::avx512));
static_assert(CAIRN_BACKEND_CUDA == static_cast<std::uint32_t>(cairn::Backend::cuda));
static_assert(CAIRN_METHOD_COUNT == cairn::kMethodCount && CAIRN_METHOD_AUTO == static_cast<std::uint32_t>(cairn::Method::automatic));
static_assert(CAIRN_REASON_SLENDER == static_cast<std::uint32_t>(cairn::Reason::slender));
static_assert(CAIRN_PRESET_PAPER == static_cast<std::uint32_t>(cairn::Preset::paper));
static_assert(CAIRN_SPLIT_MANIFOLD == static_cast<std::uint32_t>(cairn::Splitting::manifold));
static_assert(CAIRN_FRICTION_PYRAMID == static_cast<std::uint32_t>(cairn::Friction::pyramid));
static_assert(CAIRN_ACCELERATION_NESTEROV == static_cast<std::uint32_t>(cairn::Acceleration::nesterov));
static_assert(CAIRN_SAME_AS_SWEEPS == cairn::kSameAsSweeps);

void check_solver(const cairn_solver* solver) {
    if (solver == nullptr)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "solver is NULL: make one with cairn_solver_create");
}

// For every call that must not meet a step in flight.
template <class Solver> auto& core_of(Solver* solver) {
    check_solver(solver);
    if (solver->in_flight)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "solver has a step in flight: call cairn_solver_wait first");
    return *solver->core;
}

void check_pointer(const void* pointer, const char* name) {
    if (pointer == nullptr)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s: the pointer is NULL", name);
}

// The protocol of every call that copies an array out: the count always, the elements if they are wanted and fit.
void copy_out(const void* from, std::size_t count, std::size_t element, void* to, std::size_t capacity, std::size_t* counted,
              const char* name) {
    check_pointer(counted, name);
    *counted = count;
    if (to == nullptr)
        return;
    if (capacity < count)
        refuse(CAIRN_ERROR_BUFFER_TOO_SMALL, "capacity is %zu, but there are %zu %s", capacity, count, name);
    if (count > 0)
        std::memcpy(to, from, count * element);
}

void begin(cairn_solver* solver, const cairn_step* step, const cairn_results* results) {
    cairn::Solver& core = core_of(solver);
    const cairn::FpEnvironment environment; // the checks compute too
    cairn::Input input;
    cairn::Output output;
    check_step(step, results, core.device(), solver->keys, input, output);
    core.begin(input, output);
}

void finish(cairn_solver* solver) {
    const cairn::FpEnvironment environment;
    try {
        solver->core->finish();
    } catch (const cairn::RefusedOnDevice& refused) {
        check_elements(refused.input, solver->keys, true); // the same text as for host memory
        throw;
    }
}

cairn_statistics to_c(const cairn::Statistics& s) {
    cairn_statistics c = {};
    c.bodies = s.bodies;
    c.contacts = s.contacts;
    c.manifolds = s.manifolds;
    c.joints = s.joints;
    c.rows = s.rows;
    c.islands = s.islands;
    c.substeps = s.substeps;
    c.iterations = s.iterations;
    c.position_iterations = s.position_iterations;
    c.relax_iterations = s.relax_iterations;
    c.restitution_iterations = s.restitution_iterations;
    c.warm_started = s.warm_started;
    c.rotation_clamped = s.rotation_clamped;
    c.threads = s.threads;
    c.instructions = static_cast<std::uint32_t>(s.isa);
    c.backend = static_cast<std::uint32_t>(s.backend);
    c.executor = s.executor;
    c.time_total = s.time_total;
    c.time_pack = s.time_pack;
    c.time_build = s.time_build;
    c.time_sweep = s.time_sweep;
    c.time_position = s.time_position;
    c.time_integrate = s.time_integrate;
    c.time_finish = s.time_finish;
    c.kinetic_energy_change = s.kinetic_energy_change;
    c.residual = s.residual;
    c.time_upload = s.time_upload;
    c.time_download = s.time_download;
    return c;
}

} // namespace

const char* cairn_last_error(void) { return last_error(); }

const char* cairn_status_name(cairn_status status) {
    switch (status) {
    case CAIRN_OK:
        return "ok";
    case CAIRN_ERROR_INVALID_ARGUMENT:
        return "invalid argument";
    case CAIRN_ERROR_INVALID_DATA:
        return "invalid data";
    case CAIRN_ERROR_STRUCT_SIZE:
        return "struct size";
    case CAIRN_ERROR_BUFFER_TOO_SMALL:
        return "buffer too small";
    case CAIRN_ERROR_OUT_OF_MEMORY:
        return "out of memory";
    case CAIRN_ERROR_UNSUPPORTED:
        return "unsupported";
    case CAIRN_ERROR_NOT_FINITE:
        return "not finite";
    case CAIRN_ERROR_INTERNAL:
        return "internal error";
    default:
        return nullptr;
    }
}

const char* cairn_method_name(uint32_t method) { return method < cairn::kMethodCount ? cairn::kMethods[method].name : nullptr; }

const char* cairn_reason_text(uint32_t reason) { return reason < cairn::kReasonCount ? cairn::kSchedules[reason].why : nullptr; }

cairn_status cairn_get_info(cairn_info* info) {
    return guarded([&] {
        static const std::string& cuda = *new std::string(cairn::gpu::cuda_state()); // never deleted: callers keep the pointer
        cairn_info filled = {};
        filled.abi_version = CAIRN_ABI_VERSION;
        filled.version[0] = CAIRN_VERSION_MAJOR;
        filled.version[1] = CAIRN_VERSION_MINOR;
        filled.version[2] = CAIRN_VERSION_PATCH;
        filled.instructions = static_cast<std::uint32_t>(cairn::Solver::widest());
        filled.build = CAIRN_BUILD;
        filled.cuda = cuda.c_str();
        write_struct(info, filled);
    });
}

cairn_status cairn_params_preset(uint32_t method, uint32_t preset, cairn_params* params) {
    return guarded([&] { write_struct(params, to_c(check_preset(method, preset))); });
}

cairn_status cairn_joint_axes(uint32_t joint, uint32_t* axes) {
    return guarded([&] {
        constexpr uint32_t free = CAIRN_AXIS_FREE, locked = CAIRN_AXIS_LOCKED;
        constexpr uint32_t presets[][6] = {
            {locked, locked, locked, free, free, free},       // ball
            {locked, locked, locked, locked, locked, free},   // hinge
            {free, locked, locked, locked, locked, locked},   // slider
            {locked, locked, locked, locked, locked, locked}, // fixed
        };
        if (joint > CAIRN_JOINT_FIXED)
            refuse(CAIRN_ERROR_INVALID_ARGUMENT, "joint is %u: must be one of CAIRN_JOINT_..., 0 ... %u", joint, CAIRN_JOINT_FIXED);
        check_pointer(axes, "axes");
        std::memcpy(axes, presets[joint], sizeof presets[joint]);
    });
}

cairn_status cairn_solver_create(const cairn_config* config, cairn_solver** solver) {
    if (solver != nullptr)
        *solver = nullptr;
    return guarded([&] {
        check_pointer(solver, "solver");
        const cairn::Config checked = check_config(config);
        auto made = std::make_unique<cairn_solver>(cairn::Solver::create(checked), checked);
        made->core->params = cairn::preset(cairn::Method::tjsoft, cairn::Preset::best);
        *solver = made.release();
    });
}

void cairn_solver_destroy(cairn_solver* solver) { delete solver; }

cairn_status cairn_solver_set_params(cairn_solver* solver, const cairn_params* params) {
    return guarded([&] {
        cairn::Solver& core = core_of(solver);
        const cairn::Params checked = check_params(params);
        if (checked.method == cairn::Method::automatic && !core.chooses())
            refuse(CAIRN_ERROR_UNSUPPORTED,
                   "params.method is CAIRN_METHOD_AUTO: the CUDA backend does not have it, only CAIRN_BACKEND_CPU");
        core.params = checked;
    });
}

cairn_status cairn_solver_get_params(const cairn_solver* solver, cairn_params* params) {
    return guarded([&] { write_struct(params, to_c(core_of(solver).params)); });
}

cairn_status cairn_solver_step(cairn_solver* solver, const cairn_step* step, const cairn_results* results) {
    return guarded([&] {
        begin(solver, step, results);
        finish(solver);
    });
}

cairn_status cairn_solver_step_async(cairn_solver* solver, const cairn_step* step, const cairn_results* results) {
    return guarded([&] {
        begin(solver, step, results);
        solver->in_flight = true;
    });
}

cairn_status cairn_solver_wait(cairn_solver* solver) {
    return guarded([&] {
        check_solver(solver);
        if (!std::exchange(solver->in_flight, false))
            return;
        finish(solver);
    });
}

cairn_status cairn_solver_get_statistics(const cairn_solver* solver, cairn_statistics* statistics) {
    return guarded([&] { write_struct(statistics, to_c(core_of(solver).statistics())); });
}

cairn_status cairn_solver_residual_trace(const cairn_solver* solver, double* values, size_t capacity, size_t* count) {
    return guarded([&] {
        const std::span<const double> trace = core_of(solver).residual_trace();
        copy_out(trace.data(), trace.size(), sizeof(double), values, capacity, count, "residuals");
    });
}

cairn_status cairn_solver_split_counts(const cairn_solver* solver, uint32_t* values, size_t capacity, size_t* count) {
    return guarded([&] {
        const std::span<const std::uint32_t> counts = core_of(solver).split_counts();
        copy_out(counts.data(), counts.size(), sizeof(std::uint32_t), values, capacity, count, "split counts");
    });
}

cairn_status cairn_solver_choices(const cairn_solver* solver, cairn_choice* values, size_t capacity, size_t* count) {
    return guarded([&] {
        std::vector<cairn_choice> made;
        for (const cairn::Choice& c : core_of(solver).choices())
            made.push_back({c.first_body, c.bodies, static_cast<std::uint32_t>(c.reason), static_cast<std::uint32_t>(c.method), c.substeps,
                            c.iterations, c.swept, c.met ? 1u : 0u, c.residual});
        copy_out(made.data(), made.size(), sizeof(cairn_choice), values, capacity, count, "choices");
    });
}

cairn_status cairn_solver_reset(cairn_solver* solver) {
    return guarded([&] { core_of(solver).reset(); });
}

cairn_status cairn_solver_save_cache(const cairn_solver* solver, void* bytes, size_t capacity, size_t* size) {
    return guarded([&] {
        const std::vector<std::byte> blob = core_of(solver).save_cache();
        copy_out(blob.data(), blob.size(), 1, bytes, capacity, size, "bytes");
    });
}

cairn_status cairn_solver_load_cache(cairn_solver* solver, const void* bytes, size_t size) {
    return guarded([&] {
        cairn::Solver& core = core_of(solver);
        check_pointer(bytes, "bytes");
        try {
            core.load_cache({static_cast<const std::byte*>(bytes), size});
        } catch (const std::invalid_argument& error) {
            refuse(CAIRN_ERROR_INVALID_DATA, "bytes: %s", error.what());
        }
    });
}

cairn_status cairn_solver_parallel_for(cairn_solver* solver, uint32_t count, cairn_task task, void* argument) {
    return guarded([&] {
        core_of(solver);
        check_pointer(reinterpret_cast<const void*>(task), "task");
        const cairn::FpEnvironment environment; // of the parts that this thread runs
        solver->pool().each(count, 1, [&](std::uint32_t begin, std::uint32_t end) {
            for (std::uint32_t i = begin; i < end; ++i)
                task(argument, i);
        });
    });
}

cairn_status cairn_evaluate(const cairn_step* step, const cairn_results* results, cairn_evaluation* whole, cairn_evaluation* islands,
                            size_t capacity, size_t* island_count, int32_t* body_island) {
    return guarded([&] {
        const cairn::FpEnvironment environment;
        if (whole != nullptr)
            checked_size(whole);
        const std::size_t distance = islands != nullptr && capacity > 0 ? checked_size(islands) : 0;
        KeySet keys(cairn::Hooks{});
        cairn::Input input;
        cairn::Outcome outcome;
        check_evaluation(step, results, keys, input, outcome);
        const cairn::Evaluated found = cairn::evaluate(input, outcome);

        const std::size_t count = found.islands.size();
        if (island_count != nullptr)
            *island_count = count;
        if (islands != nullptr && capacity < count)
            refuse(CAIRN_ERROR_BUFFER_TOO_SMALL, "capacity is %zu, but there are %zu islands", capacity, count);
        if (whole != nullptr)
            write_struct(whole, found.whole);
        for (std::size_t i = 0; islands != nullptr && i < count; ++i) {
            cairn_evaluation island = found.islands[i];
            island.struct_size = static_cast<std::uint32_t>(distance);
            std::byte* const to = reinterpret_cast<std::byte*>(islands) + i * distance;
            std::memset(to, 0, distance); // a newer caller's fields, too
            std::memcpy(to, &island, std::min(distance, sizeof island));
        }
        if (body_island != nullptr && !found.body_island.empty())
            std::memcpy(body_island, found.body_island.data(), found.body_island.size() * sizeof(std::int32_t));
    });
}

const cairn_api* cairn_get_api(uint32_t abi_version) {
    static constexpr cairn_api api = {
        sizeof(cairn_api),
        CAIRN_ABI_VERSION,
        cairn_last_error,
        cairn_status_name,
        cairn_method_name,
        cairn_get_info,
        cairn_params_preset,
        cairn_joint_axes,
        cairn_solver_create,
        cairn_solver_destroy,
        cairn_solver_set_params,
        cairn_solver_get_params,
        cairn_solver_step,
        cairn_solver_get_statistics,
        cairn_solver_residual_trace,
        cairn_solver_split_counts,
        cairn_solver_reset,
        cairn_solver_save_cache,
        cairn_solver_load_cache,
        cairn_solver_step_async,
        cairn_solver_wait,
        cairn_solver_parallel_for,
        cairn_evaluate,
        cairn_reason_text,
        cairn_solver_choices,
    };
    return abi_version == CAIRN_ABI_VERSION ? &api : nullptr;
}
