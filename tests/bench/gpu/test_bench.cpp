// The program itself, small, on the emulated device; and what it computes from times.
#include "gpu_bench.h"

#include <emulated.h>
#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

namespace cairn_bench {
namespace {

TEST(CrossingOfTimes, BetweenTwoSizes) {
    // ours flat, theirs growing with size: they meet where theirs is 1
    const Crossing found = crossingOf({{10, 1, 0.1}, {100, 1, 0.5}, {1000, 1, 5}});
    ASSERT_TRUE(found.from.has_value());
    EXPECT_NEAR(*found.from, 100 * std::pow(10.0, std::log(2.0) / std::log(10.0)), 1e-9);
    EXPECT_FALSE(found.everywhere);
}
TEST(CrossingOfTimes, AtAMeasuredSize) { EXPECT_NEAR(crossingOf({{10, 2, 1}, {100, 2, 2}, {1000, 2, 9}}).from.value(), 100, 1e-9); }
TEST(CrossingOfTimes, ALeadThatIsLostDoesNotCount) {
    const Crossing found = crossingOf({{10, 1, 2}, {100, 4, 2}, {1000, 1, 2}, {10000, 1, 8}});
    EXPECT_NEAR(found.from.value(), 100 * std::sqrt(std::sqrt(10.0)) * std::sqrt(std::sqrt(10.0)), 1e-9); // log 2 above, log 2 below
    EXPECT_FALSE(crossingOf({{10, 1, 2}, {100, 3, 2}}).from.has_value());
}
TEST(CrossingOfTimes, EverywhereAndNothing) {
    const Crossing ahead = crossingOf({{10, 1, 2}, {100, 1, 2}});
    EXPECT_TRUE(ahead.everywhere);
    EXPECT_EQ(ahead.from, 10);
    const Crossing nothing = crossingOf({});
    EXPECT_FALSE(nothing.measured || nothing.everywhere || nothing.from.has_value());
}

TEST(Medians, OfOddAndEven) {
    EXPECT_EQ(spreadOf({3, 1, 2}).median, 2);
    EXPECT_EQ(spreadOf({4, 1, 2, 3}).median, 2.5);
    EXPECT_EQ(spreadOf({3, 1, 2}).least, 1);
    EXPECT_EQ(spreadOf({3, 1, 2}).most, 3);
}

TEST(CommandLine, IsRead) {
    const Options options = parsed({"--most-bodies", "50", "--quick", "--only=pile,worlds", "--executor", "all", "--runs", "4"});
    EXPECT_EQ(options.mostBodies, 50u);
    EXPECT_EQ(options.runs, 4); // over --quick's, wherever that stands
    EXPECT_EQ(options.executors.size(), 4u);
    EXPECT_EQ(options.only, (std::vector<std::string>{"pile", "worlds"}));
    for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--runs", "0"},
                                                  {"--runs", "x"},
                                                  {"--runs"},
                                                  {"--only", "heap"},
                                                  {"--executor", "cpu"},
                                                  {"--json"},
                                                  {"--nonsense", "1"},
                                                  {"--seconds", "-1"}})
        EXPECT_THROW(parsed(wrong), std::invalid_argument) << wrong[0];
}
TEST(Cases, GoFromSmallToLargeUpToTheCap) {
    Options options = parsed({"--most-bodies", "2000", "--most-worlds", "20"});
    std::set<std::pair<std::string, std::size_t>> seen;
    std::size_t last = 0;
    for (const Case& found : casesOf(options)) {
        if (found.group == "scenes") {
            EXPECT_EQ(found.make().bodies(), found.bodies) << found.name;
            continue;
        }
        EXPECT_GE(found.bodies, last);
        last = found.bodies;
        EXPECT_TRUE(seen.insert({found.group, found.bodies}).second);
    }
    for (const std::size_t bodies : {10u, 30u, 100u, 300u, 1000u, 2000u})
        EXPECT_TRUE(seen.count({"stack", bodies}) && seen.count({"pile", bodies})) << bodies;
    for (const std::size_t count : {1u, 4u, 16u})
        EXPECT_TRUE(seen.count({"worlds", count * kBodiesOfAWorld})) << count;
    EXPECT_EQ(seen.size(), 15u);
}

// Runs the program with its table in a string.
struct Ran {
    int status;
    Report report;
    std::string table, json;
};
Ran ran(std::vector<std::string> arguments) {
    const std::string file = testing::TempDir() + "bench_" + testing::UnitTest::GetInstance()->current_test_info()->name() + ".json";
    arguments.insert(arguments.end(), {"--json", file});
    Ran result;
    std::FILE* const table = std::tmpfile();
    result.status = run(parsed(arguments), table, result.report);
    std::rewind(table);
    for (int c = std::fgetc(table); c != EOF; c = std::fgetc(table))
        result.table += static_cast<char>(c);
    std::fclose(table);
    std::ifstream stream(file);
    std::ostringstream text;
    text << stream.rdbuf();
    result.json = text.str();
    std::remove(file.c_str());
    return result;
}
const std::vector<std::string> kSmall = {"--runs",        "1", "--iterations", "10", "--most-bodies", "12",
                                         "--most-worlds", "4", "--threads",    "1"};

TEST(Program, MeasuresAGpu) {
    cairn_emulated::set_memory_limit(std::size_t{16} << 20); // of which a quarter is copied
    std::vector<std::string> arguments = kSmall;
    arguments.insert(arguments.end(), {"--executor", "all"});
    const Ran result = ran(arguments);
    EXPECT_EQ(result.status, 0) << result.table;
    EXPECT_TRUE(result.report.complete);
    ASSERT_TRUE(result.report.copy.has_value()) << result.report.copyWhy;
    std::set<std::string> executors;
    for (const Measured& measured : result.report.measured)
        for (const Cell& cell : measured.cells) {
            if (cell.who == Who::stock)
                continue;
            ASSERT_EQ(cell.notMeasured, "") << measured.what.name;
            EXPECT_EQ(cell.done.bodies, measured.bodies);
            EXPECT_EQ(cell.done.points, measured.points);
            EXPECT_EQ(cell.done.iterations, measured.what.group == "scenes" ? 10u : 30u);
            EXPECT_GT(*cell.iterations, 0);
            EXPECT_LE(*cell.upload + *cell.build + *cell.iterations + *cell.finish + *cell.download, 1.001 * cell.total.most);
            EXPECT_EQ(cell.bytesRate.has_value(), measured.what.method != CAIRN_METHOD_PJNJ);
            if (cell.who == Who::cpu)
                continue;
            EXPECT_EQ(cell.sameBits, true) << measured.what.name;
            EXPECT_TRUE(*cell.upload > 0 && *cell.download > 0);
            executors.insert(cell.done.executor);
        }
    EXPECT_EQ(executors, (std::set<std::string>{"block", "graph", "grid"}));
    for (const char* group : {"stack", "pile", "worlds"})
        EXPECT_TRUE(crossingIn(result.report, group, Who::cpu).measured) << group;
    const std::string share = "\"share_of_copy_bandwidth\": "; // null where it is not known
    std::size_t at = 0, numbers = 0;
    while ((at = result.json.find(share, at)) != std::string::npos)
        numbers += std::isdigit(static_cast<unsigned char>(result.json[at += share.size()])) != 0 ? 1 : 0;
    EXPECT_GT(numbers, 0u) << result.json;
    EXPECT_EQ(result.table.find("OTHER BITS"), std::string::npos);
}

TEST(Program, SaysWhyThereIsNoGpu) {
    cairn_emulated::set_presence(cairn_emulated::Presence::no_driver);
    const Ran result = ran(kSmall);
    EXPECT_EQ(result.status, 0);
    for (const Measured& measured : result.report.measured)
        for (const Cell& cell : measured.cells)
            if (cell.who == Who::gpu) {
                EXPECT_EQ(cell.notMeasured, result.report.cuda);
                EXPECT_NE(cell.notMeasured.find("no NVIDIA driver found"), std::string::npos);
                EXPECT_EQ(cell.total.median, 0); // nothing is made up
            }
    EXPECT_FALSE(result.report.copy.has_value());
    EXPECT_FALSE(crossingIn(result.report, "stack", Who::cpu).measured);
    EXPECT_NE(result.table.find("GPU: not measured: built with CUDA"), std::string::npos) << result.table;
    EXPECT_NE(result.table.find("is ahead of CPU from: not measured"), std::string::npos);
}

TEST(Program, OutOfDeviceMemoryIsACellOfItsOwn) {
    const Case what{"stack", "stack", 12, 1, [] { return bond(12); }};
    cairn_emulated::set_memory_limit(1); // nothing can be had
    const Measured measured = measure(what, parsed({"--runs", "1"}), Machine{});
    EXPECT_EQ(measured.cells[0].notMeasured, "");
    ASSERT_EQ(measured.cells[1].who, Who::gpu);
    EXPECT_NE(measured.cells[1].notMeasured.find("bytes were asked for"), std::string::npos) << measured.cells[1].notMeasured;
    EXPECT_FALSE(measured.cells[1].failed);
}

TEST(Program, StopsWhenTimeIsUp) {
    cairn_emulated::set_memory_limit(std::size_t{16} << 20);
    std::vector<std::string> arguments = kSmall;
    arguments.insert(arguments.end(), {"--seconds", "0.000001"});
    const Ran result = ran(arguments);
    EXPECT_EQ(result.status, 0);
    EXPECT_TRUE(result.report.complete);
    for (const Measured& measured : result.report.measured)
        for (const Cell& cell : measured.cells)
            EXPECT_EQ(cell.notMeasured, "time was up (--seconds)");
}

} // namespace
} // namespace cairn_bench
