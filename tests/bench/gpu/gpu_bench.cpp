#include "gpu_bench.h"

#include "../machine.h"
#include "../program.h"
#include "../progress.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <thread>

namespace cairn_bench {
namespace {

void describe(Report& report, const Options& options, Machine& machine) {
    cairn_info info{};
    info.struct_size = sizeof info;
    if (const cairn_status status = cairn_get_info(&info); status != CAIRN_OK)
        throw Failure(status, cairn_last_error());
    report.cpu = processor();
    report.cores = std::thread::hardware_concurrency();
    report.build = info.build;
    report.cuda = info.cuda;
    report.driver = nvidiaDriver();
    report.bullet = bulletVersion();
    report.when = now();
    report.command = "cairn_gpu_bench" + options.command;
    machine.bullet = !report.bullet.empty();
    machine.gpuMissing = report.gpuMissing = gpuIsMissing();
    if (machine.gpuMissing)
        report.copyWhy = *machine.gpuMissing;
    else
        report.copy = deviceCopyRate(report.copyWhy);
}

// By way of a second file, so that what is there is never half of it.
} // namespace

int run(const Options& options, std::FILE* table, Report& report) {
    const auto start = std::chrono::steady_clock::now();
    Machine machine;
    describe(report, options, machine);
    save(json(report), options.json);
    printHeader(report, table);
    const std::vector<Case> cases = casesOf(options);
    const Progress progress(cases.size());
    bool failed = false;
    for (std::size_t i = 0; i < cases.size(); ++i) {
        const Case& what = cases[i];
        progress.show(i, what.name + ", " + std::to_string(what.bodies) + " bodies, " + cairn_method_name(what.method));
        const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (options.seconds > 0 && elapsed > options.seconds)
            report.measured.push_back(leftOut(what, options, "time was up (--seconds)"));
        else
            report.measured.push_back(measure(what, options, machine));
        const std::vector<Cell>& cells = report.measured.back().cells;
        failed = failed || std::any_of(cells.begin(), cells.end(), [](const Cell& cell) { return cell.failed; });
        report.complete = i + 1 == cases.size();
        progress.clear();
        printRows(report, report.measured.back(), i == 0, table);
        save(json(report), options.json);
    }
    printCrossings(report, table);
    return failed ? 1 : 0;
}

} // namespace cairn_bench
