// What a step costs on the GPU, beside the CPU and stock Bullet: see --help.
#include "gpu_bench.h"

#include <exception>
#include <stdexcept>

int main(int argc, char** argv) {
    using namespace cairn_bench;
    try {
        const Options options = parsed(std::vector<std::string>(argv + 1, argv + argc));
        if (options.help) {
            std::fputs(kHelp, stdout);
            return 0;
        }
        Report report;
        return run(options, stdout, report);
    } catch (const std::invalid_argument& error) {
        std::fprintf(stderr, "cairn_gpu_bench: %s\n", error.what());
        return 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "cairn_gpu_bench: %s\n", error.what());
        return 1;
    }
}
