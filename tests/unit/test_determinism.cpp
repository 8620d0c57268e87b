// Results depend on the input alone: not on threads, instruction set, task hook, where the scene is, or what else is solved.
#include "busy.h"
#include "methods.h"

#include <atomic>
#include <thread>

namespace cairn_test {
namespace {

class Determinism : public EachMethod {};
CAIRN_EACH_METHOD(Determinism);

constexpr int kEdge = 6; // one heap of all that follow

std::uint64_t run(const Solver& solver, const cairn_params& params, int balls = 150, int frames = 6) {
    check(cairn_solver_set_params(solver.get(), &params));
    Heaps scene(balls, kEdge);
    std::uint64_t hash = 0;
    for (int frame = 0; frame < frames; ++frame) {
        scene.touch();
        const Impulses out = scene.step(solver);
        hash = hash * 31 + scene.hash();
        for (const double p : out.contact)
            hash = hash * 31 + static_cast<std::uint64_t>(p * 1e12);
        for (const double r : solver.residual_trace())
            hash = hash * 31 + static_cast<std::uint64_t>(r * 1e12);
    }
    EXPECT_GT(scene.contacts.size(), static_cast<std::size_t>(balls)) << "hardly anything touches: this test checks little";
    return hash;
}

TEST_P(Determinism, ResultsDoNotDependOnThreads) {
    for (const std::uint32_t which : {CAIRN_PRESET_DEFAULT, CAIRN_PRESET_PAPER}) {
        const std::uint64_t one = run(Solver(32, 1), busy(GetParam(), which));
        for (const std::uint32_t threads : {2u, 3u, 7u})
            EXPECT_EQ(run(Solver(32, threads), busy(GetParam(), which)), one) << threads << " threads";
        EXPECT_EQ(run(Solver(32, 1), busy(GetParam(), which)), one) << "a second run differs";
    }
}

TEST_P(Determinism, ResultsDoNotDependOnTheInstructionSet) {
    int sets = 0;
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD}) {
        for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
            cairn_params params = busy(GetParam());
            params.splitting = splitting;
            params.acceleration = acceleration;
            const std::uint64_t scalar = run(Solver(32, 1, CAIRN_ISA_SCALAR), params);
            for (const std::uint32_t isa : {CAIRN_ISA_SSE2, CAIRN_ISA_AVX2, CAIRN_ISA_AVX512}) {
                cairn_config config{};
                config.struct_size = sizeof config;
                config.threads = 1;
                config.instructions = isa;
                cairn_solver* probe = nullptr;
                const cairn_status status = cairn_solver_create(&config, &probe);
                cairn_solver_destroy(probe);
                if (status == CAIRN_ERROR_UNSUPPORTED)
                    continue; // this machine lacks it
                ASSERT_EQ(status, CAIRN_OK);
                const Solver solver(32, 1, isa);
                EXPECT_EQ(run(solver, params), scalar) << "CAIRN_ISA " << isa;
                EXPECT_EQ(solver.statistics().instructions, isa);
                ++sets;
            }
        }
    }
    RecordProperty("instruction_sets", sets / 4);
}

TEST_P(Determinism, OddSizedScenesAgreeBetweenInstructionSets) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        std::vector<std::uint64_t> hashes;
        for (const std::uint32_t isa : {CAIRN_ISA_SCALAR, CAIRN_ISA_AUTO}) {
            Scene scene = every_kind(seed);
            const Solver solver(32, 2, isa);
            const cairn_params params = busy(GetParam());
            check(cairn_solver_set_params(solver.get(), &params));
            for (int frame = 0; frame < 3; ++frame)
                scene.step(solver);
            hashes.push_back(scene.hash());
        }
        EXPECT_EQ(hashes[0], hashes[1]) << "seed " << seed;
    }
}

// ---- An engine's own tasks ----
struct Tasks {
    std::atomic<int> calls{0}, largest{0};
    bool threaded = false;
};
void run_tasks(void* user, std::uint32_t count, cairn_task task, void* argument) {
    Tasks& tasks = *static_cast<Tasks*>(user);
    ++tasks.calls;
    tasks.largest = std::max(tasks.largest.load(), static_cast<int>(count));
    if (!tasks.threaded) {
        for (std::uint32_t i = count; i-- > 0;)
            task(argument, i); // last first: no task may wait for another
        return;
    }
    std::vector<std::thread> threads;
    for (std::uint32_t i = 0; i < count; ++i)
        threads.emplace_back(task, argument, i);
    for (std::thread& t : threads)
        t.join();
}

TEST(Hooks, ParallelForGivesTheSameBits) {
    const cairn_params params = busy(CAIRN_METHOD_TJSOFT);
    const std::uint64_t expected = run(Solver(32, 1), params, 150, 2);
    for (const bool threaded : {false, true}) {
        Tasks tasks;
        tasks.threaded = threaded;
        cairn_config config{};
        config.struct_size = sizeof config;
        config.threads = 3;
        config.user = &tasks;
        config.parallel_for = run_tasks;
        EXPECT_EQ(run(Solver(config), params, 150, 2), expected);
        EXPECT_GT(tasks.calls, 0) << "the hook was never called";
        EXPECT_LE(tasks.largest, 3);
        EXPECT_GT(tasks.largest, 1) << "all work in one task";
    }
}

struct Memory {
    std::int64_t live = 0, bytes = 0, calls = 0;
    std::int64_t refuse_after = -1;
    bool mismatch = false;
    std::vector<std::pair<void*, std::pair<std::size_t, std::size_t>>> blocks;
};
void* take(void* user, std::size_t bytes, std::size_t alignment) {
    Memory& memory = *static_cast<Memory*>(user);
    if (memory.refuse_after >= 0 && memory.calls >= memory.refuse_after)
        return nullptr;
    ++memory.calls;
    const std::size_t rounded = (std::max<std::size_t>(bytes, 1) + alignment - 1) / alignment * alignment;
    void* block = std::aligned_alloc(std::max(alignment, sizeof(void*)), std::max(rounded, sizeof(void*)));
    ++memory.live;
    memory.bytes += static_cast<std::int64_t>(bytes);
    memory.blocks.push_back({block, {bytes, alignment}});
    return block;
}
void give(void* user, void* block, std::size_t bytes, std::size_t alignment) {
    Memory& memory = *static_cast<Memory*>(user);
    const auto at = std::find_if(memory.blocks.begin(), memory.blocks.end(), [&](const auto& b) { return b.first == block; });
    if (at == memory.blocks.end() || at->second != std::pair(bytes, alignment)) {
        memory.mismatch = true;
        return;
    }
    memory.blocks.erase(at);
    --memory.live;
    memory.bytes -= static_cast<std::int64_t>(bytes);
    std::free(block);
}
cairn_config with_memory(Memory& memory) {
    cairn_config config{};
    config.struct_size = sizeof config;
    config.threads = 1;
    config.user = &memory;
    config.allocate = take;
    config.release = give;
    return config;
}

TEST(Hooks, AllocatorIsBalanced) {
    Memory memory;
    const cairn_params params = busy(CAIRN_METHOD_TJSOFT);
    const std::uint64_t expected = run(Solver(32, 1), params, 60, 3);
    {
        const Solver solver(with_memory(memory));
        check(cairn_solver_set_params(solver.get(), &params));
        Heaps scene(60, kEdge);
        scene.step(solver);
        EXPECT_GT(memory.calls, 0);
        const std::int64_t calls = memory.calls;
        Heaps again(60, kEdge);
        again.step(solver);
        EXPECT_EQ(memory.calls, calls) << "the same scene again takes more memory";
    }
    EXPECT_EQ(memory.live, 0);
    EXPECT_EQ(memory.bytes, 0);
    EXPECT_FALSE(memory.mismatch) << "released with another size or alignment than it was taken with";
    EXPECT_EQ(run(Solver(with_memory(memory)), params, 60, 3), expected);
    EXPECT_EQ(memory.live, 0);
}

TEST(Hooks, RunningOutOfMemoryLeavesTheSolverUsable) {
    const cairn_params params = busy(CAIRN_METHOD_TJSOFT);
    Heaps reference(40, kEdge);
    const Solver healthy(32, 1);
    check(cairn_solver_set_params(healthy.get(), &params));
    reference.step(healthy);
    bool refused = false;
    for (std::int64_t allowed = 0; allowed < 200; ++allowed) {
        Memory memory;
        memory.refuse_after = allowed;
        const cairn_config config = with_memory(memory);
        cairn_solver* raw = nullptr;
        const cairn_status created = cairn_solver_create(&config, &raw);
        cairn_solver_destroy(raw);
        ASSERT_EQ(memory.live, 0);
        if (created != CAIRN_OK) {
            ASSERT_EQ(created, CAIRN_ERROR_OUT_OF_MEMORY);
            ASSERT_EQ(raw, nullptr);
            continue;
        }
        memory.calls = 0;
        {
            const Solver solver(config);
            check(cairn_solver_set_params(solver.get(), &params));
            Heaps scene(40, kEdge);
            const std::uint64_t before = scene.hash();
            Impulses out;
            const cairn_status status = scene.try_step(solver, out);
            if (status == CAIRN_OK)
                break;
            refused = true;
            ASSERT_EQ(status, CAIRN_ERROR_OUT_OF_MEMORY);
            ASSERT_EQ(scene.hash(), before) << "wrote before it failed";
            memory.refuse_after = -1;
            scene.step(solver);
            ASSERT_EQ(scene.hash(), reference.hash());
        }
        ASSERT_EQ(memory.live, 0);
    }
    EXPECT_TRUE(refused);
}

// ---- Translation ----
TEST_P(Determinism, TenKilometresAwayNothingChanges) {
    const Vec3 far(10000, -7000, 5000);
    const Solver here(32, 1), there(32, 1);
    const cairn_params params = busy(GetParam());
    check(cairn_solver_set_params(here.get(), &params));
    check(cairn_solver_set_params(there.get(), &params));
    Heaps near_scene(40, kEdge), far_scene(40, kEdge, far);
    // one is also tied to the world, by a joint whose anchor is a world point
    near_scene.join(CAIRN_WORLD, 39, near_scene.bodies[39].position, axes_of(CAIRN_JOINT_BALL));
    far_scene.join(CAIRN_WORLD, 39, far_scene.bodies[39].position, axes_of(CAIRN_JOINT_BALL));
    double worst = 0;
    for (int frame = 0; frame < 10; ++frame) {
        near_scene.touch();
        far_scene.touch();
        ASSERT_EQ(near_scene.contacts.size(), far_scene.contacts.size());
        near_scene.step(here);
        far_scene.step(there);
        for (std::size_t i = 0; i < near_scene.bodies.size(); ++i) {
            worst = std::max(worst, (far_scene.bodies[i].position - far - near_scene.bodies[i].position).norm());
        }
    }
    RecordProperty("worst_difference_m", std::to_string(worst));
    EXPECT_LT(worst, 2e-5); // rounding of the contacts' arms (1e-12), grown by 10 frames of collisions in float
}

// ---- Islands ----
Scene island(int which) {
    Heaps scene(which == 0 ? 20 : 33, kEdge, Vec3(3.0 * which, 0, 0));
    const auto shift = static_cast<std::uint64_t>(which) << 40;
    for (Contact& c : scene.contacts)
        c.key += shift;
    for (Joint& j : scene.joints)
        j.key += shift;
    return scene;
}
void append(Scene& world, const Scene& part) {
    const int offset = static_cast<int>(world.bodies.size());
    world.gravity = part.gravity;
    const auto moved = [&](int i) { return i < 0 ? i : i + offset; };
    for (const Body& body : part.bodies)
        world.bodies.push_back(body);
    for (Contact c : part.contacts) {
        c.a = moved(c.a);
        c.b = moved(c.b);
        world.contacts.push_back(c);
    }
    for (Joint j : part.joints) {
        j.a = moved(j.a);
        j.b = moved(j.b);
        world.joints.push_back(j);
    }
}

TEST_P(Determinism, SplittingTheWorldInTwoCallsChangesNothing) {
    for (const double tolerance : {0.0, 1e-3}) {
        for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
            cairn_params params = busy(GetParam());
            params.acceleration = acceleration;
            params.residual_tolerance = tolerance;
            params.iterations = 60;
            Scene first = island(0), second = island(1), together, swapped;
            append(together, first);
            append(together, second);
            append(swapped, second);
            append(swapped, first);
            const Solver solvers[4]{Solver(32, 1), Solver(32, 1), Solver(32, 1), Solver(32, 1)};
            for (const Solver& s : solvers)
                check(cairn_solver_set_params(s.get(), &params));
            for (int frame = 0; frame < 2; ++frame) { // the second with the first's warm start
                first.step(solvers[0]);
                second.step(solvers[1]);
                together.step(solvers[2]);
                swapped.step(solvers[3]);
            }
            const std::size_t n = first.bodies.size();
            Scene again_first, again_second, swapped_first, swapped_second;
            again_first.bodies.assign(together.bodies.begin(), together.bodies.begin() + static_cast<std::ptrdiff_t>(n));
            again_second.bodies.assign(together.bodies.begin() + static_cast<std::ptrdiff_t>(n), together.bodies.end());
            swapped_first.bodies.assign(swapped.bodies.end() - static_cast<std::ptrdiff_t>(n), swapped.bodies.end());
            swapped_second.bodies.assign(swapped.bodies.begin(), swapped.bodies.end() - static_cast<std::ptrdiff_t>(n));
            EXPECT_EQ(again_first.hash(), first.hash());
            EXPECT_EQ(again_second.hash(), second.hash());
            EXPECT_EQ(swapped_first.hash(), first.hash()) << "the order of unrelated bodies matters";
            EXPECT_EQ(swapped_second.hash(), second.hash()) << "the order of unrelated bodies matters";
        }
    }
}

} // namespace
} // namespace cairn_test
