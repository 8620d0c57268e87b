#include "options.h"

#include "../program.h"

namespace cairn_bench::bullet {

const char* const kHelp = R"(usage: cairn_bullet_bench [OPTION]...

What a step costs behind Bullet, whole and in parts, with Bullet's own solver and with Cairn's in turn, on a wall and a pile. Both begin from
the state that the stock solver has settled; Cairn runs on one thread and on all. Sleeping is off.

  --quality          instead, how well they do in the same time: stock PGS at several numbers of iterations, and Cairn's preset `default`
                     with as many substeps as fit into stock's median solver time. First the times are matched, in turn, which needs a quiet
                     machine for some minutes; then the runs, of which a table grows for an hour
  --quick            less settling, fewer steps
  --scenes A,B       of wall, pile; both by default
  --sizes N,N        bodies (1000,8000)
  --iterations N,N   of stock, for --quality (10,50,300); else stock has 10
  --threads N        of Cairn (all)
  --steps N          timed, of which the median counts (20; 7 with --quick); of a run of --quality (600; 120)
  --settle N         steps before (wall 20, pile 250; 10, 60 with --quick); --quality begins at the start
  --json FILE        write all of it to FILE, after each measurement
  --markdown FILE    the table of --quality as a page, likewise
  --help

examples:
  cairn_bullet_bench --quick
  cairn_bullet_bench --scenes wall --sizes 8000 --steps 50
  cairn_bullet_bench --quality --sizes 1000 --json quality.json --markdown quality.md

Exit status: 0, 1 if a solver failed or Cairn's bits depend on the number of threads, 2 if the options are wrong.
)";

namespace {

template <class T> std::vector<T> numbers(const std::string& option, const std::string& list) {
    std::vector<T> found;
    for (const std::string& part : parts(list))
        found.push_back(number<T>(option, part, 1));
    return found;
}

std::vector<std::string> scenesOf(const std::string& list) {
    const std::vector<std::string> found = parts(list);
    for (const std::string& scene : found)
        if (scene != "wall" && scene != "pile")
            throw std::invalid_argument("--scenes takes wall and pile, not \"" + scene + "\"");
    return found;
}

} // namespace

Options parsed(const std::vector<std::string>& arguments) {
    Options options;
    options.command = joined(arguments);
    for (const auto& [option, text] : pairsOf(arguments, {"--help", "-h", "--quick", "--quality"})) {
        if (option == "--help" || option == "-h") {
            options.help = true;
            return options;
        }
        if (option == "--quick" || option == "--quality") {
            (option == "--quick" ? options.quick : options.quality) = true;
            continue;
        }
        if (option == "--scenes")
            options.scenes = scenesOf(text);
        else if (option == "--sizes")
            options.sizes = numbers<std::size_t>(option, text);
        else if (option == "--iterations")
            options.iterations = numbers<std::uint32_t>(option, text);
        else if (option == "--threads")
            options.threads = number<std::uint32_t>(option, text, 0);
        else if (option == "--steps")
            options.steps = number<int>(option, text, 1);
        else if (option == "--settle")
            options.settle = number<int>(option, text, 0);
        else if ((option == "--json" || option == "--markdown") && !text.empty())
            (option == "--json" ? options.json : options.markdown) = text;
        else
            throw std::invalid_argument(option == "--json" || option == "--markdown" ? option + " takes a file's name"
                                                                                     : "unknown option " + option + "; see --help");
    }
    if (!options.markdown.empty() && !options.quality)
        throw std::invalid_argument("--markdown is for --quality");
    return options;
}

} // namespace cairn_bench::bullet
