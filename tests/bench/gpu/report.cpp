#include "report.h"

#include "../json.h"

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

namespace cairn_bench {
namespace {

const char* nameOf(Who who) { return who == Who::cpu ? "cpu" : who == Who::gpu ? "gpu" : "stock"; }
const char* executorName(std::uint32_t executor) {
    constexpr const char* names[] = {"auto", "block", "grid", "graph"};
    return names[executor];
}
std::optional<std::string> optional(const std::string& text) { return text.empty() ? std::nullopt : std::optional(text); }
std::optional<double> scaled(const std::optional<double>& value, double factor) {
    return value ? std::optional(*value * factor) : std::nullopt;
}
std::optional<double> perIteration(const Cell& cell) {
    return cell.iterations && cell.done.iterations > 0 ? std::optional(*cell.iterations / cell.done.iterations) : std::nullopt;
}
std::optional<double> perPoint(const Cell& cell) {
    return cell.bytes && cell.done.points > 0 ? std::optional(*cell.bytes / cell.done.points) : std::nullopt;
}
std::optional<double> shareOfCopy(const Report& report, const Cell& cell) {
    if (cell.who != Who::gpu || !cell.bytesRate || !report.copy)
        return std::nullopt;
    return *cell.bytesRate / report.copy->bytesPerSecond;
}
// Stock Bullet, without SOLVER_USE_2_FRICTION_DIRECTIONS, has one row of friction to a point.
const char* frictionOf(const Cell& cell) { return cell.who == Who::stock ? "one direction" : "cone"; }

void writeCell(Json& to, const Report& report, const Cell& cell) {
    constexpr double ms = 1e3;
    to.line();
    to.open('{');
    to.key("solver").value(nameOf(cell.who));
    if (cell.who == Who::gpu)
        to.key("executor_asked_for").value(executorName(cell.forced));
    to.key("not_measured").value(optional(cell.notMeasured));
    if (cell.notMeasured.empty()) {
        const Done& done = cell.done;
        to.key("runs").value(cell.runs);
        to.key("ms").value(ms * cell.total.median);
        to.key("ms_least").value(ms * cell.total.least);
        to.key("ms_most").value(ms * cell.total.most);
        to.key("upload_ms").value(scaled(cell.upload, ms));
        to.key("build_ms").value(scaled(cell.build, ms));
        to.key("iterations_ms").value(scaled(cell.iterations, ms));
        to.key("finish_ms").value(scaled(cell.finish, ms));
        to.key("download_ms").value(scaled(cell.download, ms));
        to.key("us_per_iteration").value(scaled(perIteration(cell), 1e6));
        to.key("iterations").value(done.iterations);
        to.key("substeps").value(done.substeps);
        to.key("position_iterations").value(done.positionIterations);
        to.key("points").value(done.points);
        to.key("rows").value(done.rows);
        to.key("manifolds").value(done.manifolds);
        to.key("joints").value(done.joints);
        to.key("islands").value(done.islands);
        to.key("friction").value(frictionOf(cell));
        to.key("executor").value(optional(done.executor));
        to.key("threads").value(done.threads);
        to.key("bytes_per_iteration").value(cell.bytes);
        to.key("bytes_per_point_iteration").value(perPoint(cell));
        to.key("gigabytes_per_second").value(scaled(cell.bytesRate, 1e-9));
        to.key("share_of_copy_bandwidth").value(shareOfCopy(report, cell));
        to.key("same_bits_as_cpu").value(cell.sameBits);
        to.key("fastest_body_m_s").value(cell.fastest);
    }
    to.close('}');
}

void writeCrossing(Json& to, const Report& report, const std::string& group, Who other) {
    const Crossing crossing = crossingIn(report, group, other);
    to.open('{');
    to.key("measured").value(crossing.measured);
    to.key("from_bodies").value(crossing.from);
    to.key("everywhere").value(crossing.everywhere);
    to.close('}');
}

constexpr const char* kGrowing[] = {"stack", "pile", "worlds"};

// A cell of the table, "-" where there is none.
void print(std::FILE* to, const std::optional<double>& value, double factor, int width, int digits) {
    if (value)
        std::fprintf(to, " %*.*f", width, digits, *value * factor);
    else
        std::fprintf(to, " %*s", width, "-");
}

} // namespace

Crossing crossingIn(const Report& report, const std::string& group, Who other) {
    std::vector<Pair> pairs;
    for (const Measured& measured : report.measured) {
        if (measured.what.group != group)
            continue;
        const Cell *ours = nullptr, *theirs = nullptr;
        for (const Cell& cell : measured.cells) {
            if (!cell.notMeasured.empty())
                continue;
            if (cell.who == Who::gpu && cell.forced == CAIRN_EXECUTOR_AUTO)
                ours = &cell;
            if (cell.who == other)
                theirs = &cell;
        }
        if (ours && theirs)
            pairs.push_back({static_cast<double>(measured.bodies), ours->total.median, theirs->total.median});
    }
    return crossingOf(pairs);
}

std::string json(const Report& report) {
    Json to;
    to.open('{');
    to.line();
    to.key("format").value(1);
    to.line();
    to.key("cpu").value(report.cpu);
    to.key("cores").value(std::size_t{report.cores});
    to.line();
    to.key("build").value(report.build);
    to.line();
    to.key("cuda").value(report.cuda);
    to.line();
    to.key("nvidia_driver").value(optional(report.driver));
    to.line();
    to.key("bullet").value(optional(report.bullet));
    to.line();
    to.key("copy_gigabytes_per_second").value(report.copy ? std::optional(1e-9 * report.copy->bytesPerSecond) : std::optional<double>());
    to.key("copy_not_measured").value(optional(report.copyWhy));
    to.line();
    to.key("when").value(report.when);
    to.key("command").value(report.command);
    to.key("complete").value(report.complete);
    to.line();
    to.key("conditions")
        .value("preset paper, cold; medians; solvers in turn on the same tables in 32-bit floats; all tables sent in each step, poses and "
               "velocities fetched");
    to.line();
    to.key("crossings").open('{');
    for (const char* group : kGrowing) {
        to.key(group).open('{');
        for (const Who other : {Who::cpu, Who::stock}) {
            to.key(nameOf(other));
            writeCrossing(to, report, group, other);
        }
        to.close('}');
    }
    to.close('}');
    to.line();
    to.key("measured").open('[');
    for (const Measured& measured : report.measured) {
        to.line();
        to.open('{');
        to.key("group").value(measured.what.group);
        to.key("scene").value(measured.what.name);
        to.key("bodies").value(measured.bodies);
        to.key("worlds").value(measured.what.worlds);
        to.key("points").value(measured.points);
        to.key("joints").value(measured.joints);
        to.key("method").value(cairn_method_name(measured.what.method));
        to.key("iterations").value(measured.what.iterations);
        to.key("solvers").open('[');
        for (const Cell& cell : measured.cells)
            writeCell(to, report, cell);
        to.close(']');
        to.close('}');
    }
    to.close(']');
    to.close('}');
    return to.text();
}

void printHeader(const Report& report, std::FILE* to) {
    std::fprintf(to, "%s, %u cores; %s; Bullet %s\n%s %s\n", report.cpu.c_str(), report.cores, report.build.c_str(),
                 report.bullet.empty() ? "not built in" : report.bullet.c_str(), report.gpuMissing ? "GPU: not measured:" : "CUDA",
                 report.gpuMissing.value_or(report.cuda).c_str());
    if (!report.driver.empty())
        std::fprintf(to, "%s\n", report.driver.c_str());
    if (report.copy)
        std::fprintf(to, "A copy within the GPU's memory moves %.0f GB/s, reading and writing, over %zu MiB.\n",
                     1e-9 * report.copy->bytesPerSecond, report.copy->bytes >> 20);
    else if (!report.gpuMissing)
        std::fprintf(to, "Copy bandwidth of the GPU: not measured: %s\n", report.copyWhy.c_str());
    std::fprintf(
        to, "Preset paper, cold; medians in ms; solvers in turn on the same tables, all sent in each step, poses and velocities fetched.\n"
            "build: packing, on the CPU with all it does before the iterations; what the parts leave of the step is checks and waiting.\n"
            "rows: of a point 3 in Cairn, friction a cone; 2 in stock Bullet, friction along one direction.\n"
            "B/point: bytes that an iteration moves for a point, counted from the layout; GB/s: these through the iterations.\n\n");
    std::fflush(to);
}

void printRows(const Report& report, const Measured& measured, bool first, std::FILE* to) {
    const Case& what = measured.what;
    const std::string name = what.group == "worlds" ? std::to_string(what.worlds) + " " + what.name : what.name;
    if (first)
        std::fprintf(to, "%-12s %8s %9s %-7s %-19s %9s %8s %8s %9s %8s %8s %8s %7s %7s %6s %8s\n", "", "bodies", "points", "method",
                     "solver", "step", "upload", "build", "iterate", "finish", "download", "us/iter", "B/point", "GB/s", "copy", "rows");
    for (const Cell& cell : measured.cells) {
        std::string solver = cell.who == Who::cpu ? "CPU" : cell.who == Who::stock ? "stock Bullet" : "GPU";
        if (cell.who == Who::gpu)
            solver += std::string(" ") + executorName(cell.forced);
        if (cell.who == Who::gpu && cell.forced == CAIRN_EXECUTOR_AUTO && !cell.done.executor.empty())
            solver += ", " + cell.done.executor;
        if (cell.who == Who::cpu && cell.notMeasured.empty())
            solver += ", " + std::to_string(cell.done.threads) + " threads";
        std::fprintf(to, "%-12s %8zu %9zu %-7s %-19s", name.c_str(), measured.bodies, measured.points,
                     cell.who == Who::stock ? "pgs" : cairn_method_name(what.method), solver.c_str());
        if (!cell.notMeasured.empty()) {
            const bool known = cell.notMeasured == report.gpuMissing; // it heads the table
            std::fprintf(to, " not measured%s%s\n", known ? "" : ": ", known ? "" : cell.notMeasured.c_str());
            continue;
        }
        print(to, cell.total.median, 1e3, 9, 3);
        print(to, cell.upload, 1e3, 8, 3);
        print(to, cell.build, 1e3, 8, 3);
        print(to, cell.iterations, 1e3, 9, 3);
        print(to, cell.finish, 1e3, 8, 3);
        print(to, cell.download, 1e3, 8, 3);
        print(to, perIteration(cell), 1e6, 8, 2);
        print(to, perPoint(cell), 1, 7, 0);
        print(to, cell.bytesRate, 1e-9, 7, 1);
        print(to, shareOfCopy(report, cell), 1, 6, 2);
        std::fprintf(to, " %8u%s\n", cell.done.rows, cell.sameBits.value_or(true) ? "" : "  OTHER BITS THAN THE CPU'S");
    }
    std::fflush(to);
}

void printCrossings(const Report& report, std::FILE* to) {
    std::fprintf(to, "\n");
    for (const char* group : kGrowing) {
        if (std::none_of(report.measured.begin(), report.measured.end(), [&](const Measured& m) { return m.what.group == group; }))
            continue; // not asked for
        for (const Who other : {Who::cpu, Who::stock}) {
            const char* name = other == Who::cpu ? "CPU" : "stock Bullet";
            const Crossing crossing = crossingIn(report, group, other);
            std::fprintf(to, "%-6s the GPU is ahead of %s ", group, name);
            if (!crossing.measured)
                std::fprintf(to, "from: not measured\n");
            else if (!crossing.from)
                std::fprintf(to, "nowhere up to the largest measured\n");
            else
                std::fprintf(to, "from %.0f bodies%s\n", *crossing.from, crossing.everywhere ? ", the smallest measured, or fewer" : "");
        }
    }
}

} // namespace cairn_bench
