#include "options.h"

#include "../program.h"

#include <algorithm>
#include <stdexcept>

namespace cairn_bench {

const char* const kHelp = R"(usage: cairn_gpu_bench [OPTION]...

What a step costs on the GPU, on the CPU with all its threads, and in stock Bullet's solver, on the same tables in the same run:
the paper's scenes under the five methods, and scenes that grow. Where there is no GPU it says why and leaves those cells unmeasured.

  --quick           every tenfold size, fewer runs, the CPU up to 100 000 bodies, nothing begun after 110 s
  --json FILE       write all of it to FILE, after each measurement
  --only A,B        of scenes, stack, pile, worlds; all by default
  --runs N          steps that are timed, of which the median counts (9; fewer, but at least 3, where they take long)
  --iterations N    of a step of the paper's scenes (300); what grows has 30
  --threads N       of the CPU (all)
  --most-bodies N   size to which stack and pile grow (1000000)
  --most-worlds N   number to which worlds of 20 bodies grow (65536)
  --most-cpu N      bodies that the CPU is given at most (1000000)
  --most-stock N    bodies that stock Bullet is given at most (8000)
  --executor NAME   of the GPU: auto, block, grid, graph, or all of them side by side (auto)
  --seconds S       begin no further measurement after S seconds; what is left is marked so (none)
  --help

examples:
  cairn_gpu_bench --quick
  cairn_gpu_bench --json gpu.json --executor all
  cairn_gpu_bench --only scenes --runs 3
  cairn_gpu_bench --only stack,pile --most-bodies 10000 --json small.json

Exit status: 0, 1 if a solver failed or GPU and CPU gave different bits, 2 if the options are wrong.
)";

namespace {

std::vector<std::uint32_t> executorsOf(const std::string& name) {
    const std::vector<std::string> names = {"auto", "block", "grid", "graph"};
    if (name == "all")
        return {CAIRN_EXECUTOR_AUTO, CAIRN_EXECUTOR_BLOCK, CAIRN_EXECUTOR_GRID, CAIRN_EXECUTOR_GRAPH};
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
        throw std::invalid_argument("--executor takes auto, block, grid, graph or all, not \"" + name + "\"");
    return {static_cast<std::uint32_t>(found - names.begin())};
}

std::vector<std::string> groupsOf(const std::string& list) {
    const std::vector<std::string> all = Options().only;
    const std::vector<std::string> groups = parts(list);
    for (const std::string& group : groups)
        if (std::find(all.begin(), all.end(), group) == all.end())
            throw std::invalid_argument("--only takes some of scenes,stack,pile,worlds, not \"" + group + "\"");
    return groups;
}

} // namespace

Options parsed(const std::vector<std::string>& arguments) {
    Options options;
    // First, so that what else is given may undo parts of it.
    if (std::find(arguments.begin(), arguments.end(), "--quick") != arguments.end()) {
        options.quick = true;
        options.runs = 5;
        options.mostCpu = 100000;
        options.seconds = 110;
    }
    options.command = joined(arguments);
    for (const auto& [option, text] : pairsOf(arguments, {"--help", "-h", "--quick"})) {
        if (option == "--quick")
            continue;
        if (option == "--help" || option == "-h") {
            options.help = true;
            continue;
        }
        if (option == "--json" && !text.empty())
            options.json = text;
        else if (option == "--only")
            options.only = groupsOf(text);
        else if (option == "--executor")
            options.executors = executorsOf(text);
        else if (option == "--runs")
            options.runs = number<int>(option, text, 1);
        else if (option == "--iterations")
            options.iterations = number<std::uint32_t>(option, text, 10); // tj has ten substeps
        else if (option == "--threads")
            options.threads = number<std::uint32_t>(option, text, 0);
        else if (option == "--most-bodies")
            options.mostBodies = number<std::size_t>(option, text, 1);
        else if (option == "--most-worlds")
            options.mostWorlds = number<std::size_t>(option, text, 1);
        else if (option == "--most-cpu")
            options.mostCpu = number<std::size_t>(option, text, 0);
        else if (option == "--most-stock")
            options.mostStock = number<std::size_t>(option, text, 0);
        else if (option == "--seconds")
            options.seconds = number<double>(option, text, 0);
        else
            throw std::invalid_argument(option == "--json" ? "--json takes a file's name" : "unknown option " + option + "; see --help");
    }
    return options;
}

} // namespace cairn_bench
