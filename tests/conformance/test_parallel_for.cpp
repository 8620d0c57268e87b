// cairn_solver_parallel_for: each index once, on the solver's threads or the caller's.
#include <cairn/cairn.h>

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <vector>

namespace {

struct Visits {
    explicit Visits(std::size_t count) : seen(count) {}
    static void visit(void* visits, std::uint32_t index) { ++static_cast<Visits*>(visits)->seen[index]; }
    std::vector<std::atomic<int>> seen;
};

TEST(ParallelFor, RunsEachIndexOnce) {
    for (const std::uint32_t threads : {1u, 2u, 5u}) {
        for (const bool hooked : {false, true}) {
            cairn_config config = {};
            config.struct_size = sizeof config;
            config.threads = threads;
            std::uint32_t tasks = 0;
            config.user = &tasks;
            if (hooked)
                config.parallel_for = [](void* user, std::uint32_t count, cairn_task task, void* argument) {
                    *static_cast<std::uint32_t*>(user) += count;
                    for (std::uint32_t i = count; i-- > 0;)
                        task(argument, i);
                };
            cairn_solver* solver = nullptr;
            ASSERT_EQ(cairn_solver_create(&config, &solver), CAIRN_OK) << cairn_last_error();
            for (const std::uint32_t count : {0u, 1u, 4u, 1000u, 70000u}) {
                Visits visits(count);
                tasks = 0;
                ASSERT_EQ(cairn_solver_parallel_for(solver, count, &Visits::visit, &visits), CAIRN_OK) << cairn_last_error();
                for (std::size_t i = 0; i < count; ++i)
                    ASSERT_EQ(visits.seen[i], 1) << "index " << i << " of " << count << " on " << threads << " threads";
                EXPECT_LE(tasks, threads) << "what the hook is promised";
            }
            cairn_solver_destroy(solver);
        }
    }
}

TEST(ParallelFor, RefusesWhatIsMissing) {
    Visits visits(1);
    EXPECT_EQ(cairn_solver_parallel_for(nullptr, 1, &Visits::visit, &visits), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::string(cairn_last_error()).find("solver is NULL"), std::string::npos) << cairn_last_error();
    cairn_solver* solver = nullptr;
    ASSERT_EQ(cairn_solver_create(nullptr, &solver), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_solver_parallel_for(solver, 1, nullptr, &visits), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::string(cairn_last_error()).find("task"), std::string::npos) << cairn_last_error();
    EXPECT_EQ(visits.seen[0], 0);
    cairn_solver_destroy(solver);
}

} // namespace
