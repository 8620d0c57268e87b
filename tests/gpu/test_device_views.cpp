// Views of device memory, steps in two calls, and the caller's stream.
#include "device_world.h"

#include <emulated.h>

#include <memory>

namespace {

struct Destroy {
    void operator()(cairn_solver* solver) const { cairn_solver_destroy(solver); }
};
using Solver = std::unique_ptr<cairn_solver, Destroy>;

Solver make(std::uint32_t backend, void* stream = nullptr) {
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.backend = backend;
    config.stream = stream;
    cairn_solver* solver = nullptr;
    EXPECT_EQ(cairn_solver_create(&config, &solver), CAIRN_OK) << cairn_last_error();
    return Solver(solver);
}
std::string last_error() { return cairn_last_error(); }
bool same_state(const SmallWorld& a, const SmallWorld& b) {
    return std::memcmp(a.bodies, b.bodies, sizeof a.bodies) == 0 && std::memcmp(a.contacts, b.contacts, sizeof a.contacts) == 0 &&
           std::memcmp(a.joints, b.joints, sizeof a.joints) == 0 && std::memcmp(a.rows, b.rows, sizeof a.rows) == 0;
}

// A world that stays on the device, stepped there, has the CPU's bits; and nothing but a request and a report crosses.
TEST(DeviceViews, AWorldThatStaysOnTheDevice) {
    for (const Where where : {Where::all, Where::even, Where::odd}) {
        const Solver cpu = make(CAIRN_BACKEND_CPU), gpu = make(CAIRN_BACKEND_CUDA);
        SmallWorld expected, world;
        DeviceWorld on_device(world, where);
        for (int frame = 0; frame < 5; ++frame) {
            ASSERT_EQ(cairn_solver_step(cpu.get(), &expected.step, &expected.results), CAIRN_OK) << last_error();
            cairn_emulated::reset_counters();
            ASSERT_EQ(cairn_solver_step(gpu.get(), &on_device.step, &on_device.results), CAIRN_OK) << last_error();
            if (where == Where::all) {
                EXPECT_LT(cairn_emulated::counters().bytes_to_device, 2048u);
                EXPECT_LT(cairn_emulated::counters().bytes_to_host, 512u);
            }
        }
        on_device.fetch();
        EXPECT_TRUE(same_state(world, expected)) << static_cast<int>(where);
    }
}

TEST(DeviceViews, WhatIsNotThereIsRefused) {
    const Solver cpu = make(CAIRN_BACKEND_CPU), gpu = make(CAIRN_BACKEND_CUDA);
    SmallWorld world;
    world.contact_table.friction.device = CAIRN_DEVICE; // of host memory
    const std::string before = world.bytes();
    EXPECT_EQ(cairn_solver_step(gpu.get(), &world.step, &world.results), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(last_error().find("contacts.friction: device is CAIRN_DEVICE, but its elements at 0x"), std::string::npos) << last_error();
    EXPECT_NE(last_error().find("are host memory"), std::string::npos) << last_error();
    EXPECT_EQ(cairn_solver_step(cpu.get(), &world.step, &world.results), CAIRN_ERROR_UNSUPPORTED);
    EXPECT_NE(last_error().find("this solver runs on the CPU"), std::string::npos) << last_error();
    EXPECT_TRUE(world.bytes() == before);
}

TEST(DeviceViews, ABodyThatIsLostChangesNothing) {
    for (const Where where : {Where::all, Where::even, Where::odd}) {
        const Solver gpu = make(CAIRN_BACKEND_CUDA);
        SmallWorld world;
        world.bodies[2].linear_velocity[0] = 1e300; // finite, but beyond what a step can work with
        const std::string before = world.bytes();
        DeviceWorld on_device(world, where);
        EXPECT_EQ(cairn_solver_step(gpu.get(), &on_device.step, &on_device.results), CAIRN_ERROR_NOT_FINITE);
        on_device.fetch();
        EXPECT_TRUE(world.bytes() == before) << static_cast<int>(where);
    }
}

TEST(Async, TwoCallsDoWhatOneDoes) {
    for (const std::uint32_t backend : {CAIRN_BACKEND_CPU, CAIRN_BACKEND_CUDA}) {
        const Solver one = make(backend), two = make(backend);
        SmallWorld expected, world;
        for (int frame = 0; frame < 3; ++frame) {
            ASSERT_EQ(cairn_solver_step(one.get(), &expected.step, &expected.results), CAIRN_OK);
            {
                const cairn_step step = world.step; // the structs need not last
                const cairn_results results = world.results;
                ASSERT_EQ(cairn_solver_step_async(two.get(), &step, &results), CAIRN_OK) << last_error();
            }
            ASSERT_EQ(cairn_solver_wait(two.get()), CAIRN_OK) << last_error();
            EXPECT_TRUE(same_state(world, expected));
        }
    }
}

TEST(Async, EveryOtherCallIsRefusedMeanwhile) {
    for (const std::uint32_t backend : {CAIRN_BACKEND_CPU, CAIRN_BACKEND_CUDA}) {
        const Solver solver = make(backend);
        EXPECT_EQ(cairn_solver_wait(solver.get()), CAIRN_OK) << "nothing in flight";
        SmallWorld world;
        ASSERT_EQ(cairn_solver_step_async(solver.get(), &world.step, &world.results), CAIRN_OK);
        cairn_params params = {};
        params.struct_size = sizeof params;
        cairn_statistics statistics = {};
        statistics.struct_size = sizeof statistics;
        std::size_t count = 0;
        const auto refused = [](cairn_status status) {
            EXPECT_EQ(status, CAIRN_ERROR_INVALID_ARGUMENT);
            EXPECT_NE(last_error().find("in flight: call cairn_solver_wait"), std::string::npos) << last_error();
        };
        refused(cairn_solver_step(solver.get(), &world.step, &world.results));
        refused(cairn_solver_step_async(solver.get(), &world.step, &world.results));
        refused(cairn_solver_get_params(solver.get(), &params));
        refused(cairn_solver_set_params(solver.get(), &params));
        refused(cairn_solver_get_statistics(solver.get(), &statistics));
        refused(cairn_solver_residual_trace(solver.get(), nullptr, 0, &count));
        refused(cairn_solver_split_counts(solver.get(), nullptr, 0, &count));
        refused(cairn_solver_reset(solver.get()));
        refused(cairn_solver_save_cache(solver.get(), nullptr, 0, &count));
        refused(cairn_solver_load_cache(solver.get(), &count, sizeof count));
        EXPECT_EQ(cairn_solver_wait(solver.get()), CAIRN_OK);
        EXPECT_EQ(cairn_solver_get_statistics(solver.get(), &statistics), CAIRN_OK);
        EXPECT_EQ(statistics.bodies, 3u);
    }
}

TEST(Async, HostResultsComeWithWait) {
    const Solver solver = make(CAIRN_BACKEND_CUDA);
    SmallWorld world;
    const std::string before = world.bytes();
    ASSERT_EQ(cairn_solver_step_async(solver.get(), &world.step, &world.results), CAIRN_OK);
    EXPECT_TRUE(world.bytes() == before);
    ASSERT_EQ(cairn_solver_wait(solver.get()), CAIRN_OK);
    EXPECT_FALSE(world.bytes() == before);
}

TEST(Async, ABadElementOnTheDeviceShowsInWait) {
    const Solver solver = make(CAIRN_BACKEND_CUDA);
    SmallWorld world;
    world.contacts[3].restitution = 1.5;
    DeviceWorld on_device(world);
    ASSERT_EQ(cairn_solver_step_async(solver.get(), &on_device.step, &on_device.results), CAIRN_OK);
    EXPECT_EQ(cairn_solver_wait(solver.get()), CAIRN_ERROR_INVALID_DATA);
    EXPECT_NE(last_error().find("contacts.restitution[3] is 1.5"), std::string::npos) << last_error();
    EXPECT_EQ(cairn_solver_wait(solver.get()), CAIRN_OK) << "that step is over";
    world.contacts[3].restitution = 0; // and one in host memory before anything is queued
    world.joints[1].lower[1] = 2;
    EXPECT_EQ(cairn_solver_step_async(solver.get(), &world.step, &world.results), CAIRN_ERROR_INVALID_DATA);
    EXPECT_EQ(cairn_solver_wait(solver.get()), CAIRN_OK) << "none is in flight";
}

TEST(Async, ASolverMayBeDestroyedInFlight) {
    Solver solver = make(CAIRN_BACKEND_CUDA);
    SmallWorld world;
    ASSERT_EQ(cairn_solver_step_async(solver.get(), &world.step, &world.results), CAIRN_OK);
    solver.reset();
    EXPECT_FALSE(cairn_emulated::work_is_pending());
}

// What the caller has queued on its stream happens before the step, and what it queues afterwards sees the results: nobody waits.
TEST(Stream, TheCallersOrdersTheStep) {
    cairn_emulated::set_stream_order(cairn_emulated::StreamOrder::lazy);
    cudaStream_t stream = nullptr;
    succeed(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
    {
        const Solver cpu = make(CAIRN_BACKEND_CPU), gpu = make(CAIRN_BACKEND_CUDA, stream);
        SmallWorld expected, world;
        DeviceWorld on_device(world);
        expected.bodies[3].linear_velocity[0] = 0.25;
        const double speed = 0.25;
        double x[2] = {};
        auto* const velocity = static_cast<std::byte*>(on_device.bodies.linear_velocity.data) + 3 * on_device.bodies.linear_velocity.stride;
        succeed(cudaMemcpyAsync(velocity, &speed, sizeof speed, cudaMemcpyHostToDevice, stream));
        ASSERT_EQ(cairn_solver_step_async(gpu.get(), &on_device.step, &on_device.results), CAIRN_OK) << last_error();
        succeed(cudaMemcpyAsync(x, velocity, sizeof speed, cudaMemcpyDeviceToHost, stream));
        succeed(cudaStreamSynchronize(stream));
        ASSERT_EQ(cairn_solver_step(cpu.get(), &expected.step, &expected.results), CAIRN_OK);
        EXPECT_EQ(x[0], expected.bodies[3].linear_velocity[0]);
        ASSERT_EQ(cairn_solver_wait(gpu.get()), CAIRN_OK) << last_error();
        on_device.fetch();
        EXPECT_TRUE(same_state(world, expected));
    }
    succeed(cudaStreamDestroy(stream));
    cairn_emulated::reset();
}

TEST(Stream, NeedsTheCudaBackend) {
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.backend = CAIRN_BACKEND_CPU;
    config.stream = &config;
    cairn_solver* solver = nullptr;
    EXPECT_EQ(cairn_solver_create(&config, &solver), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(last_error().find("config.stream is set"), std::string::npos) << last_error();
}

} // namespace
