// What surrounds a step: the caller's floating-point environment, its allocator and its hooks, and numbers that overflow.
#include "small_world.h"

#include <cfenv>
#include <map>
#include <new>
#include <utility>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace {

// A caller's allocator that counts, and fails from the call on that it is told.
struct Memory {
    std::map<void*, std::pair<size_t, size_t>> live;
    long calls = 0, fail_from = -1;

    static void* allocate(void* user, size_t bytes, size_t alignment) {
        Memory& memory = *static_cast<Memory*>(user);
        if (memory.fail_from >= 0 && memory.calls >= memory.fail_from)
            return nullptr;
        ++memory.calls;
        void* const made = ::operator new(bytes, std::align_val_t(alignment));
        memory.live[made] = {bytes, alignment};
        return made;
    }
    static void release(void* user, void* made, size_t bytes, size_t alignment) {
        Memory& memory = *static_cast<Memory*>(user);
        const auto found = memory.live.find(made);
        ASSERT_NE(found, memory.live.end()) << "released twice, or never allocated";
        EXPECT_EQ(found->second, std::make_pair(bytes, alignment));
        ::operator delete(made, std::align_val_t(alignment));
        memory.live.erase(found);
    }
};

cairn_config config_for(Memory& memory) {
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.threads = 1;
    config.user = &memory;
    config.allocate = Memory::allocate;
    config.release = Memory::release;
    return config;
}

} // namespace

TEST(Environment, OfTheFloatingPointUnitIsSetAndRestored) {
    SmallWorld plain, odd;
    cairn_solver *first = nullptr, *second = nullptr;
    ASSERT_EQ(cairn_solver_create(nullptr, &first), CAIRN_OK);
    ASSERT_EQ(cairn_solver_create(nullptr, &second), CAIRN_OK);
    ASSERT_EQ(cairn_solver_step(first, &plain.step, &plain.results), CAIRN_OK) << cairn_last_error();
    ASSERT_EQ(std::fesetround(FE_UPWARD), 0);
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() | 0x8040u); // flush to zero, denormals are zero
    const unsigned before = _mm_getcsr();
#endif
    const cairn_status status = cairn_solver_step(second, &odd.step, &odd.results);
#if defined(__SSE2__)
    const unsigned after = _mm_getcsr();
    _mm_setcsr(after & ~0x8040u);
    EXPECT_EQ(before, after);
#endif
    EXPECT_EQ(std::fegetround(), FE_UPWARD);
    std::fesetround(FE_TONEAREST);
    EXPECT_EQ(status, CAIRN_OK);
    EXPECT_EQ(std::memcmp(plain.bodies, odd.bodies, sizeof plain.bodies), 0);
    cairn_solver_destroy(first);
    cairn_solver_destroy(second);
}

TEST(Environment, EveryFailingAllocationIsReportedAndHarmless) {
    Memory memory;
    SmallWorld expected;
    {
        const cairn_config config = config_for(memory);
        cairn_solver* solver = nullptr;
        ASSERT_EQ(cairn_solver_create(&config, &solver), CAIRN_OK) << cairn_last_error();
        ASSERT_EQ(cairn_solver_step(solver, &expected.step, &expected.results), CAIRN_OK) << cairn_last_error();
        cairn_solver_destroy(solver);
    }
    EXPECT_TRUE(memory.live.empty());
    const long needed = memory.calls;
    ASSERT_GT(needed, 0);
    for (long fail = 0; fail < needed; ++fail) {
        memory.calls = 0;
        memory.fail_from = fail;
        const cairn_config config = config_for(memory);
        cairn_solver* solver = nullptr;
        SmallWorld world;
        const std::string before = world.bytes();
        cairn_status status = cairn_solver_create(&config, &solver);
        if (status == CAIRN_OK) {
            status = cairn_solver_step(solver, &world.step, &world.results);
            EXPECT_TRUE(world.bytes() == before);
            memory.fail_from = -1; // the solver stays usable
            EXPECT_EQ(cairn_solver_step(solver, &world.step, &world.results), CAIRN_OK) << cairn_last_error();
            EXPECT_EQ(std::memcmp(world.bodies, expected.bodies, sizeof world.bodies), 0) << "allocation " << fail;
        }
        EXPECT_EQ(status, CAIRN_ERROR_OUT_OF_MEMORY) << "allocation " << fail;
        cairn_solver_destroy(solver);
        EXPECT_TRUE(memory.live.empty());
    }
}

// Bodies that fly freely, enough of them to be shared out to threads.
struct Swarm {
    static constexpr std::uint32_t count = 1000;
    std::vector<double> position = std::vector<double>(3 * count), orientation = std::vector<double>(4 * count),
                        velocity = std::vector<double>(3 * count), spin = std::vector<double>(3 * count),
                        inverse_mass = std::vector<double>(count, 1), inverse_inertia = std::vector<double>(3 * count, 1);
    cairn_bodies table = {};
    cairn_step step = {};
    cairn_results results = {};

    Swarm() {
        for (std::uint32_t i = 0; i < count; ++i) {
            orientation[4 * i + 3] = 1;
            velocity[3 * i] = 0.001 * i;
        }
        table.struct_size = sizeof table;
        table.count = count;
        table.position = SmallWorld::view(position.data(), 0);
        table.orientation = SmallWorld::view(orientation.data(), 0);
        table.linear_velocity = SmallWorld::view(velocity.data(), 0);
        table.angular_velocity = SmallWorld::view(spin.data(), 0);
        table.inverse_mass = SmallWorld::view(inverse_mass.data(), 0);
        table.inverse_inertia = SmallWorld::view(inverse_inertia.data(), 0);
        step.struct_size = sizeof step;
        step.dt = 0.01;
        step.bodies = &table;
        results.struct_size = sizeof results;
        results.position = table.position;
        results.linear_velocity = table.linear_velocity;
    }
};

TEST(Environment, TheCallersTaskSystemGivesTheSameBits) {
    int calls = 0;
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.threads = 3;
    config.user = &calls;
    config.parallel_for = [](void* user, std::uint32_t count, cairn_task task, void* argument) {
        ++*static_cast<int*>(user);
        for (std::uint32_t i = count; i-- > 0;) // in another order than ours
            task(argument, i);
    };
    cairn_solver *solver = nullptr, *alone = nullptr;
    ASSERT_EQ(cairn_solver_create(&config, &solver), CAIRN_OK) << cairn_last_error();
    ASSERT_EQ(cairn_solver_create(nullptr, &alone), CAIRN_OK) << cairn_last_error();
    Swarm swarm, expected;
    const std::vector<double> before = swarm.position;
    EXPECT_EQ(cairn_solver_step(solver, &swarm.step, &swarm.results), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_solver_step(alone, &expected.step, &expected.results), CAIRN_OK) << cairn_last_error();
    EXPECT_GT(calls, 0);
    EXPECT_NE(swarm.position, before);
    EXPECT_EQ(swarm.position, expected.position);
    cairn_solver_destroy(alone);
    cairn_solver_destroy(solver);
}

TEST(Environment, NumbersThatOverflowAreNotWritten) {
    cairn_solver* solver = nullptr;
    ASSERT_EQ(cairn_solver_create(nullptr, &solver), CAIRN_OK);
    SmallWorld world;
    world.bodies[2].linear_velocity[0] = 1e300;
    const std::string before = world.bytes();
    EXPECT_EQ(cairn_solver_step(solver, &world.step, &world.results), CAIRN_ERROR_NOT_FINITE);
    EXPECT_TRUE(world.bytes() == before);
    EXPECT_STRNE(cairn_last_error(), "");
    SmallWorld fine, expected;
    EXPECT_EQ(cairn_solver_step(solver, &fine.step, &fine.results), CAIRN_OK) << cairn_last_error();
    cairn_solver* fresh = nullptr;
    ASSERT_EQ(cairn_solver_create(nullptr, &fresh), CAIRN_OK);
    EXPECT_EQ(cairn_solver_step(fresh, &expected.step, &expected.results), CAIRN_OK);
    EXPECT_EQ(std::memcmp(fine.bodies, expected.bodies, sizeof fine.bodies), 0);
    cairn_solver_destroy(fresh);
    cairn_solver_destroy(solver);
}
