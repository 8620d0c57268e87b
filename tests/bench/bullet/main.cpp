// What a step costs behind Bullet, whole and in parts, beside Bullet's own solver; and how good it is in the same time: see --help.
#include "../json.h"
#include "../machine.h"
#include "../program.h"
#include "../progress.h"
#include "measure.h"

#include <cstdio>
#include <exception>
#include <fstream>
#include <thread>

namespace cairn_bench::bullet {
namespace {

struct Report {
    std::string cpu, build, bullet, when, command;
    unsigned cores = 0;
    bool complete = false;
    std::vector<Speed> speed;
    std::vector<Quality> quality;
};

void describe(Report& report, const Options& options) {
    cairn_info info = {};
    info.struct_size = sizeof info;
    if (cairn_get_info(&info) != CAIRN_OK)
        throw std::runtime_error(cairn_last_error());
    report.cpu = processor();
    report.cores = std::thread::hardware_concurrency();
    report.build = info.build;
    report.bullet = bulletDescription() + ", one thread";
    report.when = now();
    report.command = "cairn_bullet_bench" + options.command;
}

std::string json(const Report& report) {
    Json to;
    to.open('{');
    to.key("cpu").value(report.cpu);
    to.key("cores").value(report.cores);
    to.key("build").value(report.build);
    to.key("bullet").value(report.bullet);
    to.key("when").value(report.when);
    to.key("command").value(report.command);
    to.key("complete").value(report.complete);
    to.key("speed").open('[');
    for (const Speed& speed : report.speed) {
        to.line();
        to.open('{');
        to.key("scene").value(speed.scene);
        to.key("bodies").value(speed.bodies);
        to.key("solver").value(speed.solver);
        to.key("threads").value(speed.threads);
        to.key("points").value(speed.points);
        to.key("step_ms").value(1e3 * speed.times.step);
        to.key("solver_ms").value(1e3 * speed.times.solver);
        to.key("share").value(speed.times.solver / speed.times.step);
        to.key("gather_ms").value(1e3 * speed.times.gather);
        to.key("scatter_ms").value(1e3 * speed.times.scatter);
        to.key("sweeps_ms").value(1e3 * speed.times.sweeps);
        to.key("gather_ms_least").value(1e3 * speed.least.gather);
        to.key("scatter_ms_least").value(1e3 * speed.least.scatter);
        char hash[20];
        std::snprintf(hash, sizeof hash, "%016llx", static_cast<unsigned long long>(speed.hash));
        to.key("hash").value(hash);
        to.close('}');
    }
    to.close(']');
    to.key("quality").open('[');
    for (const Quality& quality : report.quality) {
        to.line();
        to.open('{');
        to.key("scene").value(quality.scene);
        to.key("bodies").value(quality.bodies);
        to.key("solver").value(quality.solver);
        to.key("iterations").value(quality.iterations);
        to.key("substeps").value(quality.substeps);
        to.key("solver_ms").value(quality.solver_ms);
        to.key("worst_penetration_m").value(quality.worstDepth);
        to.key("mean_penetration_m").value(quality.meanDepth);
        to.key("drift_m").value(quality.drift);
        to.key("rms_speed_m_s").value(quality.speed);
        to.close('}');
    }
    to.close(']');
    to.close('}');
    return to.text();
}

std::string machineLine(const Report& report) {
    return report.cpu + ", " + std::to_string(report.cores) + " cores; " + report.build + "; Bullet " + report.bullet + "; " + report.when;
}

std::string qualityRow(const Quality& quality) {
    char text[256];
    const std::string iterations = std::to_string(quality.substeps) + " x " + std::to_string(quality.iterations / quality.substeps);
    std::snprintf(text, sizeof text, "| %s | %zu | %s %s | %.2f | %.2f | %.3f | %.2f | %.2f |\n", quality.scene.c_str(), quality.bodies,
                  quality.solver.c_str(), quality.substeps > 1 ? iterations.c_str() : std::to_string(quality.iterations).c_str(),
                  quality.solver_ms, 1e3 * quality.worstDepth, 1e3 * quality.meanDepth, 1e3 * quality.drift, 1e3 * quality.speed);
    return text;
}
constexpr char kQualityHead[] =
    "| scene | bodies | solver, iterations | solver ms | worst depth mm | mean depth mm | drift mm | speed mm/s |\n"
    "|---|---|---|---|---|---|---|---|\n";

std::string markdown(const Report& report) {
    std::string text = "# Stock Bullet and Cairn in the same solver time\n\n" + machineLine(report) + "; `" + report.command + "`.\n\n";
    text += report.complete ? "" : "Not complete.\n\n";
    text += kQualityHead;
    for (const Quality& quality : report.quality)
        text += qualityRow(quality);
    return text;
}

// By way of a second file, so that what is there is never half of it.
void save(const Report& report, const Options& options) {
    cairn_bench::save(json(report), options.json);
    cairn_bench::save(markdown(report), options.markdown);
}

void printHead(const Report& report, const Options& options) {
    std::printf("%s\n", machineLine(report).c_str());
    if (options.quality) {
        std::printf("%s", kQualityHead);
        return;
    }
    std::printf("Medians in ms. gather, scatter: Bullet's state into the solver, results back (stock's gather also builds its rows).\n\n"
                "%-6s %7s  %-18s %8s %9s %9s %6s %8s %8s %9s\n",
                "", "bodies", "solver", "points", "step", "solver", "share", "gather", "scatter", "sweeps");
}

void print(const Speed& speed) {
    const std::string solver =
        speed.solver == "stock" ? "stock, 10" : "cairn, " + std::to_string(speed.threads) + (speed.threads == 1 ? " thread" : " threads");
    const StepTimes& times = speed.times;
    std::printf("%-6s %7zu  %-18s %8zu %9.3f %9.3f %5.0f%% %8.3f %8.3f %9.3f\n", speed.scene.c_str(), speed.bodies, solver.c_str(),
                speed.points, 1e3 * times.step, 1e3 * times.solver, 100 * times.solver / times.step, 1e3 * times.gather,
                1e3 * times.scatter, 1e3 * times.sweeps);
}

void runSpeed(Report& report, const Options& options) {
    const Progress progress(options.sizes.size() * options.scenes.size());
    std::size_t done = 0;
    const Told told = [&](const std::string& what) { progress.show(done, what); };
    for (const std::size_t bodies : options.sizes)
        for (const std::string& scene : options.scenes) {
            const std::vector<Speed> found = measureSpeed(scene, bodies, options, told);
            report.speed.insert(report.speed.end(), found.begin(), found.end());
            ++done;
            report.complete = done == options.sizes.size() * options.scenes.size();
            progress.clear();
            for (const Speed& speed : found)
                print(speed);
            std::fflush(stdout);
            save(report, options);
        }
}

void runQuality(Report& report, const Options& options) {
    const std::size_t pairs = options.sizes.size() * options.scenes.size() * options.iterations.size();
    const Progress progress(2 * pairs);
    std::size_t done = 0;
    const Told told = [&](const std::string& what) { progress.show(done, what); };
    std::vector<Pair> matched;
    for (const std::size_t bodies : options.sizes)
        for (const std::string& scene : options.scenes)
            for (const std::uint32_t iterations : options.iterations) {
                matched.push_back(matchTimes(scene, bodies, iterations, options, told));
                ++done;
            }
    progress.clear();
    std::fprintf(stderr, "times are matched: the machine may be used again\n");
    for (Pair& pair : matched) {
        measureQuality(pair, options, told);
        report.quality.insert(report.quality.end(), pair.begin(), pair.end());
        ++done;
        report.complete = done == 2 * pairs;
        progress.clear();
        for (const Quality& quality : pair)
            std::printf("%s", qualityRow(quality).c_str());
        std::fflush(stdout);
        save(report, options);
    }
}

void run(const Options& options) {
    Report report;
    describe(report, options);
    save(report, options);
    printHead(report, options);
    std::fflush(stdout);
    if (options.quality)
        runQuality(report, options);
    else
        runSpeed(report, options);
}

} // namespace
} // namespace cairn_bench::bullet

int main(int argc, char** argv) {
    using namespace cairn_bench::bullet;
    try {
        const Options options = parsed(std::vector<std::string>(argv + 1, argv + argc));
        if (options.help)
            std::fputs(kHelp, stdout);
        else
            run(options);
        return 0;
    } catch (const std::invalid_argument& error) {
        std::fprintf(stderr, "cairn_bullet_bench: %s\n", error.what());
        return 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "cairn_bullet_bench: %s\n", error.what());
        return 1;
    }
}
