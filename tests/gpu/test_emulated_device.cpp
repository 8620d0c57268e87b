// What only an emulated device tells or does: what a step asks of CUDA's runtime, and a device of another kind.
#include "device.h"
#include "same_bits.h"

#include <emulated.h>

namespace cairn_test {

std::string missing_device() { return {}; }
bool is_quick() { return false; }
void set_order(int order) { cairn_emulated::set_order(static_cast<cairn_emulated::Order>(order), 7); }

NoDeviceMemory::NoDeviceMemory() { cairn_emulated::set_memory_limit(1); }
NoDeviceMemory::~NoDeviceMemory() { cairn_emulated::set_memory_limit(0); }

namespace {

class Emulated : public testing::Test {
  protected:
    void TearDown() override { cairn_emulated::reset(); }
};

TEST_F(Emulated, NoAllocationAndOneWaitInASettledStep) {
    for (const std::uint32_t executor : kExecutors) {
        const Solver solver(config_of(CAIRN_BACKEND_CUDA, executor));
        Heaps scene(30, 3);
        scene.step(solver);
        scene.step(solver); // the cache's second buffer
        cairn_emulated::reset_counters();
        scene.step(solver);
        const cairn_emulated::Counters counted = cairn_emulated::counters();
        EXPECT_EQ(counted.allocations + counted.host_allocations, 0u) << "executor " << executor;
        EXPECT_EQ(counted.host_syncs, 1u) << "executor " << executor;
        EXPECT_EQ(solver.statistics().executor, executor);
    }
}

// Bytes that the second of two steps sends.
std::size_t sent_again(Scene scene, const std::array<std::uint64_t, 4>& revisions) {
    const Solver solver(config_of(CAIRN_BACKEND_CUDA));
    scene.revisions = revisions;
    scene.step(solver);
    cairn_emulated::reset_counters();
    scene.step(solver);
    return cairn_emulated::counters().bytes_to_device;
}

TEST_F(Emulated, ATableThatKeepsItsRevisionIsNotSentAgain) {
    const Scene small = every_kind(1), large = every_kind(9);
    const std::size_t everything = sent_again(large, {0, 0, 0, 0});
    const std::size_t counts[] = {large.bodies.size(), large.contacts.size(), large.joints.size(), large.rows.size()};
    // of an element's fields, as scene.h has them: columns of doubles, 32-bit integers, a key
    constexpr std::size_t bytes[] = {8 * 29 + 4, 8 * 15 + 3 * 4 + 8, 8 * 38 + 8 * 4 + 8, 8 * 17 + 4 * 4 + 8};
    for (std::size_t table = 0; table < 4; ++table) {
        std::array<std::uint64_t, 4> revisions{};
        revisions[table] = 3;
        EXPECT_GE(everything - sent_again(large, revisions), counts[table] * bytes[table]) << "table " << table;
    }
    EXPECT_EQ(sent_again(large, {1, 2, 3, 4}), sent_again(small, {1, 2, 3, 4})) << "what is sent then should not depend on the scene";
}

// Where blocks form no clusters, even few of them meet at the barrier of a grid.
TEST_F(Emulated, ADeviceWithoutClustersGivesTheSameBits) {
    cairn_emulated::Properties older;
    older.compute_major = 8;
    older.cluster_launch = false;
    cairn_emulated::set_device(older);
    for (std::uint32_t method = 0; method < CAIRN_METHOD_AUTO; ++method) {
        SCOPED_TRACE(cairn_method_name(method));
        const cairn_params params = busy(method);
        expect_same(run(config_of(CAIRN_BACKEND_CPU), params, 60, 2),
                    run(config_of(CAIRN_BACKEND_CUDA, CAIRN_EXECUTOR_GRID), params, 60, 2));
    }
}

} // namespace
} // namespace cairn_test
