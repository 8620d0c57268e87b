// Everything that a run of the solver shows, to be compared bit by bit between backends.
#pragma once
#include "busy.h"

#include <gtest/gtest.h>

namespace cairn_test {

inline cairn_config config_of(std::uint32_t backend, std::uint32_t executor = CAIRN_EXECUTOR_AUTO) {
    cairn_config config{};
    config.struct_size = sizeof config;
    config.threads = 1;
    config.backend = backend;
    config.executor = executor;
    return config;
}
inline constexpr std::uint32_t kExecutors[] = {CAIRN_EXECUTOR_BLOCK, CAIRN_EXECUTOR_GRID, CAIRN_EXECUTOR_GRAPH};

struct Seen {
    std::vector<std::uint64_t> states;
    std::vector<double> impulses, residuals, energies;
    std::vector<std::uint32_t> counts;
    std::vector<char> cache;

    // Steps once and looks.
    void step(const Solver& solver, Scene& scene) {
        const Impulses out = scene.step(solver);
        states.push_back(scene.hash());
        for (const std::vector<double>* values :
             {&out.contact, &out.friction, &out.torsion, &out.joint, &out.joint_linear, &out.joint_angular, &out.row})
            append(impulses, *values);
        append(residuals, solver.residual_trace());
        const cairn_statistics s = solver.statistics();
        energies.push_back(s.kinetic_energy_change);
        append(counts, {s.bodies, s.contacts, s.manifolds, s.joints, s.rows, s.islands, s.iterations, s.position_iterations,
                        s.relax_iterations, s.restitution_iterations, s.warm_started, s.rotation_clamped});
        append(counts, solver.split_counts());
    }

  private:
    template <class T> static void append(std::vector<T>& to, const std::vector<T>& from) { to.insert(to.end(), from.begin(), from.end()); }
};

// Heaps of 27 balls for some frames, then scenes of every kind of constraint.
inline Seen run(const cairn_config& config, const cairn_params& params, int balls, int frames) {
    Seen seen;
    const Solver solver(config);
    check(cairn_solver_set_params(solver.get(), &params));
    Heaps heaps(balls, 3);
    for (int frame = 0; frame < frames; ++frame) {
        heaps.touch();
        seen.step(solver, heaps);
    }
    EXPECT_GT(heaps.contacts.size(), heaps.bodies.size() / 2) << "hardly anything touches: this test checks little";
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        Scene scene = every_kind(seed);
        seen.step(solver, scene);
    }
    seen.cache = solver.save_cache();
    return seen;
}

inline void expect_same(const Seen& cpu, const Seen& gpu) {
    EXPECT_EQ(gpu.states, cpu.states);
    EXPECT_TRUE(gpu.impulses == cpu.impulses) << "impulses";
    EXPECT_TRUE(gpu.residuals == cpu.residuals) << "residuals";
    EXPECT_TRUE(gpu.energies == cpu.energies) << "energies";
    EXPECT_EQ(gpu.counts, cpu.counts);
    EXPECT_TRUE(gpu.cache == cpu.cache) << "the saved cache";
}

// Heaps give the same frames on the CPU and, by every executor, on the GPU.
inline void expect_same_frames(const cairn_params& params, int balls, int edge) {
    const auto seen = [&](const cairn_config& config) {
        const Solver solver(config);
        check(cairn_solver_set_params(solver.get(), &params));
        Heaps heaps(balls, edge);
        Seen all;
        for (int frame = 0; frame < 2; ++frame) {
            heaps.touch();
            all.step(solver, heaps);
        }
        all.cache = solver.save_cache();
        return all;
    };
    const Seen cpu = seen(config_of(CAIRN_BACKEND_CPU));
    for (const std::uint32_t executor : {CAIRN_EXECUTOR_AUTO, CAIRN_EXECUTOR_BLOCK, CAIRN_EXECUTOR_GRID, CAIRN_EXECUTOR_GRAPH}) {
        SCOPED_TRACE(testing::Message() << "executor " << executor);
        expect_same(cpu, seen(config_of(CAIRN_BACKEND_CUDA, executor)));
    }
}

} // namespace cairn_test
