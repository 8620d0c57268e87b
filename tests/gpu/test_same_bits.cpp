// The CUDA backend, every executor of it, gives the CPU's bits: poses, velocities, impulses, residuals, the saved cache, in whatever
// order the device runs its threads. Linked once with the emulated device, once with the real one.
#include "device.h"
#include "methods.h"
#include "same_bits.h"

namespace cairn_test {
namespace {

class SameBits : public EachMethod {
  protected:
    void SetUp() override {
        if (const std::string missing = missing_device(); !missing.empty())
            GTEST_SKIP() << missing;
    }
    void TearDown() override { set_order(0); }
};
CAIRN_EACH_METHOD(SameBits);

class Gpu : public testing::Test {
  protected:
    void SetUp() override {
        if (const std::string missing = missing_device(); !missing.empty())
            GTEST_SKIP() << missing;
    }
};

TEST_P(SameBits, OfEveryExecutorInEveryOrder) {
    for (const std::uint32_t which : {CAIRN_PRESET_DEFAULT, CAIRN_PRESET_PAPER}) {
        const cairn_params params = busy(GetParam(), which);
        const Seen cpu = run(config_of(CAIRN_BACKEND_CPU), params, 60, 3);
        for (const std::uint32_t executor : kExecutors)
            for (int order = 0; order < kOrders; ++order) {
                SCOPED_TRACE(testing::Message() << "preset " << which << ", executor " << executor << ", order " << order);
                set_order(order);
                expect_same(cpu, run(config_of(CAIRN_BACKEND_CUDA, executor), params, 60, 3));
            }
    }
}

TEST_P(SameBits, OfEveryOption) {
    const cairn_params usual = busy(GetParam());
    std::size_t combination = GetParam();
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD})
        for (const std::uint32_t friction : {CAIRN_FRICTION_NONE, CAIRN_FRICTION_CONE, CAIRN_FRICTION_PYRAMID})
            for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
                cairn_params params = usual;
                params.splitting = splitting;
                params.friction_model = friction;
                params.acceleration = acceleration;
                params.joint_warm_start = 0.5;
                params.residual_tolerance = friction == CAIRN_FRICTION_CONE ? 1e-2 : 0;
                params.residual_trace = splitting == CAIRN_SPLIT_POINT;
                SCOPED_TRACE(testing::Message() << splitting << friction << acceleration);
                const Seen cpu = run(config_of(CAIRN_BACKEND_CPU), params, 30, 2);
                ++combination;
                for (const std::uint32_t executor : kExecutors) {
                    SCOPED_TRACE(testing::Message() << "executor " << executor);
                    if (is_quick() || executor == kExecutors[combination % std::size(kExecutors)])
                        expect_same(cpu, run(config_of(CAIRN_BACKEND_CUDA, executor), params, 30, 2));
                }
            }
}

TEST_P(SameBits, OfAnIslandForManyBlocks) { expect_same_frames(busy(GetParam()), 1200, 11); }

// Tables that keep their revision stay on the device; one that changes is sent.
TEST_F(Gpu, RevisionsChangeNoBits) {
    const cairn_params params = busy(CAIRN_METHOD_TJSOFT);
    Seen seen[2];
    for (const bool revised : {false, true}) {
        const Solver solver(config_of(CAIRN_BACKEND_CUDA));
        check(cairn_solver_set_params(solver.get(), &params));
        Scene scene = every_kind(4);
        for (std::uint64_t frame = 0; frame < 4; ++frame) {
            for (Contact& contact : scene.contacts)
                contact.separation = frame < 2 ? 1 : -0.01; // without effect, then with
            if (revised)
                scene.revisions = {0, frame < 2 ? 5u : 6u, 7, 8};
            seen[revised].step(solver, scene);
        }
        seen[revised].cache = solver.save_cache();
    }
    expect_same(seen[0], seen[1]);
}

TEST_F(Gpu, ACacheMovesBetweenBackends) {
    const cairn_params params = busy(CAIRN_METHOD_TJSOFT);
    Solver cpu(config_of(CAIRN_BACKEND_CPU)), gpu(config_of(CAIRN_BACKEND_CUDA)), fresh(config_of(CAIRN_BACKEND_CUDA));
    for (Solver* solver : {&cpu, &gpu, &fresh})
        solver->set(params);
    Heaps scene(30, 3);
    scene.step(cpu);
    const std::vector<char> bytes = cpu.save_cache();
    gpu.load_cache(bytes);
    EXPECT_EQ(gpu.save_cache(), bytes);
    scene.touch();
    Heaps same = scene, cold = scene;
    scene.step(cpu);
    same.step(gpu);
    cold.step(fresh);
    EXPECT_EQ(same.hash(), scene.hash());
    EXPECT_NE(cold.hash(), scene.hash()) << "the warm start makes no difference: this test checks little";
    check(cairn_solver_reset(gpu.get()));
    EXPECT_EQ(gpu.statistics().backend, CAIRN_BACKEND_CUDA);
}

TEST_F(Gpu, RunningOutOfMemorySaysHowMuchAndLeavesTheSolverUsable) {
    Heaps reference(30, 3), scene(30, 3);
    reference.step(Solver(config_of(CAIRN_BACKEND_CPU)));
    const Solver solver(config_of(CAIRN_BACKEND_CUDA));
    const std::uint64_t before = scene.hash();
    Impulses out;
    cairn_status status;
    {
        const NoDeviceMemory none;
        status = scene.try_step(solver, out);
    }
    EXPECT_EQ(status, CAIRN_ERROR_OUT_OF_MEMORY);
    EXPECT_NE(std::string(cairn_last_error()).find("bytes were asked for"), std::string::npos) << cairn_last_error();
    EXPECT_EQ(scene.hash(), before);
    scene.step(solver);
    EXPECT_EQ(scene.hash(), reference.hash());
}

// What a solver tells of its last step is not touched by one that fails: while it runs, or for want of memory.
TEST_F(Gpu, AStepThatFailsLeavesTheLastOne) {
    for (const bool memory : {false, true}) {
        const Solver failing(config_of(CAIRN_BACKEND_CUDA)), spared(config_of(CAIRN_BACKEND_CUDA));
        Heaps scene(30, 3);
        Heaps same = scene;
        scene.step(failing);
        same.step(spared);

        Heaps other(memory ? 3000 : 60, 3);
        other.bodies[5].linear[0] = 1e300; // finite, but beyond what a step can work with
        Impulses out;
        if (memory) {
            const NoDeviceMemory none;
            EXPECT_EQ(other.try_step(failing, out), CAIRN_ERROR_OUT_OF_MEMORY);
        } else
            EXPECT_EQ(other.try_step(failing, out), CAIRN_ERROR_NOT_FINITE);
        EXPECT_EQ(failing.split_counts(), spared.split_counts());
        EXPECT_EQ(failing.save_cache(), spared.save_cache());
        EXPECT_EQ(failing.statistics().contacts, spared.statistics().contacts);
        scene.step(failing);
        same.step(spared);
        EXPECT_EQ(scene.hash(), same.hash());
    }
}

} // namespace
} // namespace cairn_test
