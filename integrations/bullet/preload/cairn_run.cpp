// cairn-run: runs a program that is linked to a shared Bullet on Cairn, as it is. Looks first whether that can work, then sets
// the environment and becomes the program.
#include "bullet_library.h"
#include "settings.h"

#include <dlfcn.h>
#include <elf.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <climits>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

using namespace cairn::preload;

namespace {

constexpr const char* kUsage =
    "usage: cairn-run [OPTION]... [--] PROGRAM [ARGUMENT]...\n"
    "\n"
    "Runs PROGRAM with Cairn in the place of its Bullet's btSequentialImpulseConstraintSolver (Bullet " CAIRN_BULLET_VERSION
    ", float or double,\n"
    "as a shared library), and prints at its exit what was solved. The exit status is PROGRAM's; 125: it was not started.\n"
    "\n"
    "  --method NAME      pj, pjnj, pjsoft, tj, tjsoft (default), or stock: Bullet's own solver, measured alike\n"
    "  --preset NAME      default or paper\n"
    "  --iterations N     of a whole step; without these two the preset follows the program's btContactSolverInfo\n"
    "  --substeps N\n"
    "  --threads N        0, the default: as many as the process may use\n"
    "  --stats            also bodies and contacts, penetration, joint gaps, residuals\n"
    "  --quiet            print nothing at exit\n"
    "  --late             PROGRAM is a script, or loads Bullet later in a plugin: do not look for Bullet beforehand\n"
    "\n"
    "The options become CAIRN_METHOD, CAIRN_PRESET, CAIRN_ITERATIONS, CAIRN_SUBSTEPS, CAIRN_THREADS and CAIRN_STATS. CAIRN_BACKEND=cuda\n"
    "runs it on a GPU.\n";

constexpr int kNotStarted = 125;

[[noreturn]] void refuse(const std::string& reason) {
    std::fprintf(stderr, "cairn-run: %s\n", reason.c_str());
    std::exit(kNotStarted);
}

// ---- Files -----------------------------------------------------------------------------------------------------------

bool isFile(const std::string& path) {
    struct stat about;
    return stat(path.c_str(), &about) == 0 && S_ISREG(about.st_mode);
}

std::string realPath(const std::string& path) {
    char* real = realpath(path.c_str(), nullptr);
    const std::string result = real != nullptr ? real : path;
    std::free(real);
    return result;
}

std::string fileName(const std::string& path) { return path.substr(path.rfind('/') + 1); }

// As execvp() looks for it.
std::string findProgram(const std::string& name) {
    if (name.find('/') != std::string::npos)
        return isFile(name) ? name : "";
    std::istringstream folders(std::getenv("PATH") != nullptr ? std::getenv("PATH") : "/usr/bin:/bin");
    for (std::string folder; std::getline(folders, folder, ':');) {
        const std::string path = (folder.empty() ? "." : folder) + "/" + name;
        if (isFile(path) && access(path.c_str(), X_OK) == 0)
            return path;
    }
    return "";
}

std::string read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

// The preload library: beside this program in a build, in the library folder of an installation.
std::string findPreload() {
    char self[PATH_MAX];
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self);
    const std::string folder = length > 0 ? std::string(self, static_cast<std::size_t>(length)) : std::string();
    for (const char* where : {"", CAIRN_LIBRARIES "/"}) {
        const std::string path = folder.substr(0, folder.rfind('/') + 1) + where + "libcairn_bullet_preload.so";
        if (isFile(path))
            return realPath(path);
    }
    refuse("libcairn_bullet_preload.so is not where it was installed");
}

// ---- Can it work? ----------------------------------------------------------------------------------------------------

struct Library {
    std::string name, path;
};

// What the dynamic linker would load, by asking it, as ldd does.
std::vector<Library> librariesOf(const std::string& program) {
    int ends[2];
    if (pipe(ends) != 0)
        refuse("no pipe");
    const pid_t child = fork();
    if (child < 0)
        refuse("no process to list the program's libraries");
    if (child == 0) {
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        setenv("LD_TRACE_LOADED_OBJECTS", "1", 1);
        unsetenv("LD_PRELOAD");
        execl(program.c_str(), program.c_str(), static_cast<char*>(nullptr));
        _exit(127);
    }
    close(ends[1]);
    std::string text;
    char buffer[4096];
    for (ssize_t got; (got = ::read(ends[0], buffer, sizeof buffer)) > 0;)
        text.append(buffer, static_cast<std::size_t>(got));
    close(ends[0]);
    waitpid(child, nullptr, 0); // or the program would find a child that it does not know
    std::vector<Library> libraries;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) { // "\tlibm.so.6 => /lib/libm.so.6 (0x...)"
        const std::size_t arrow = line.find(" => "), first = line.find_first_not_of(" \t");
        if (arrow == std::string::npos || first == std::string::npos)
            continue;
        const std::string path = line.substr(arrow + 4, line.find(" (", arrow) - arrow - 4);
        libraries.push_back({line.substr(first, arrow - first), path});
    }
    return libraries;
}

bool holdsBullet(const std::string& path) { return read(path).find("35btSequentialImpulseConstraintSolver") != std::string::npos; }

void checkBullet(const Library& bullet, const std::string& preload) {
    if (!isFile(bullet.path))
        refuse(bullet.name + ", which the program needs, is not found: " + bullet.path);
    const std::string name = fileName(realPath(bullet.path));
    if (!isOurVersion(name))
        refuse("the program's Bullet is " + name + ", but Cairn was built for Bullet " CAIRN_BULLET_VERSION);
    void* library = dlopen(bullet.path.c_str(), RTLD_LAZY | RTLD_LOCAL);
    if (library == nullptr)
        refuse(std::string("the program's Bullet does not load: ") + dlerror());
    const char* const precision = precisionOf(library);
    if (precision == nullptr)
        refuse(name + " is neither a Bullet of floats nor one of doubles");
    if (halfPath(preload.substr(0, preload.rfind('/') + 1), precision).empty())
        refuse("the program's Bullet computes in " + std::string(precision) + "s, but Cairn was built without " + halfName(precision));
}

void checkProgram(const std::string& program, const std::string& preload, bool late) {
    struct stat about;
    if (stat(program.c_str(), &about) != 0 || access(program.c_str(), X_OK) != 0)
        refuse(program + " cannot be executed");
    if (((about.st_mode & S_ISUID) != 0 && about.st_uid != getuid()) || ((about.st_mode & S_ISGID) != 0 && about.st_gid != getgid()))
        refuse(program + " runs as another user (setuid), so that the system lets nothing be preloaded");
    std::ifstream file(program, std::ios::binary);
    Elf64_Ehdr header = {};
    file.read(reinterpret_cast<char*>(&header), sizeof header);
    if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0) {
        if (!late)
            refuse(program + " is no program of machine code (a script?): say --late if what it runs is linked to Bullet");
        return;
    }
    std::ifstream ourselves("/proc/self/exe", std::ios::binary);
    Elf64_Ehdr own = {};
    ourselves.read(reinterpret_cast<char*>(&own), sizeof own);
    if (header.e_ident[EI_CLASS] != own.e_ident[EI_CLASS] || header.e_machine != own.e_machine)
        refuse(program + " is for another kind of processor than Cairn's library");
    bool interpreted = false;
    for (unsigned i = 0; i < header.e_phnum; ++i) {
        Elf64_Phdr part = {};
        file.seekg(static_cast<std::streamoff>(header.e_phoff + std::uint64_t{i} * header.e_phentsize));
        file.read(reinterpret_cast<char*>(&part), sizeof part);
        interpreted = interpreted || part.p_type == PT_INTERP;
    }
    if (!interpreted)
        refuse(program + " is linked statically as a whole, so that nothing can be preloaded");

    const std::vector<Library> libraries = librariesOf(program);
    bool found = false;
    for (const Library& library : libraries) {
        if (library.name.compare(0, 17, "libBulletDynamics") == 0) {
            checkBullet(library, preload);
            found = true;
        }
    }
    if (found || late)
        return;
    if (holdsBullet(program))
        refuse(program + " has Bullet linked in statically: only a shared libBulletDynamics can be replaced");
    for (const Library& library : libraries)
        if (isFile(library.path) && holdsBullet(library.path))
            refuse(program + " has Bullet from " + library.path +
                   ", linked in statically: only a shared libBulletDynamics can be replaced");
    refuse(program + " is not linked to a shared Bullet (libBulletDynamics): say --late if it loads it later, in a plugin");
}

// The settings, as the preload library will read them.
void checkSettings() {
    Settings settings;
    std::string why;
    if (!readSettings(settings, why))
        refuse(why);
    cairn_solver* solver = nullptr;
    if (cairn_solver_create(&settings.config, &solver) != CAIRN_OK || cairn_solver_set_params(solver, &settings.params) != CAIRN_OK)
        refuse(cairn_last_error());
    cairn_solver_destroy(solver);
}

} // namespace

int main(int argc, char** argv) {
    bool late = false;
    int at = 1;
    for (; at < argc && argv[at][0] == '-'; ++at) {
        const std::string option = argv[at];
        if (option == "--") {
            ++at;
            break;
        }
        if (option == "--help" || option == "-h") {
            std::fputs(kUsage, stdout);
            return 0;
        }
        if (option == "--late") {
            late = true;
            continue;
        }
        if (option == "--stats" || option == "--quiet") {
            setenv("CAIRN_STATS", option == "--stats" ? "1" : "0", 1);
            continue;
        }
        const std::size_t equals = option.find('=');
        const std::string name = option.substr(0, equals);
        const char* variable = nullptr;
        for (const char* known : {"--method", "--preset", "--iterations", "--substeps", "--threads"})
            if (name == known)
                variable = known + 2;
        if (variable == nullptr)
            refuse("unknown option " + option + "; --help lists them");
        if (equals == std::string::npos && at + 1 == argc)
            refuse(option + " wants a value");
        std::string environment = "CAIRN_";
        for (const char* c = variable; *c != '\0'; ++c)
            environment += static_cast<char>(*c - 'a' + 'A');
        setenv(environment.c_str(), equals == std::string::npos ? argv[++at] : option.c_str() + equals + 1, 1);
    }
    if (at >= argc)
        refuse("no program is given; --help tells more");
    const std::string program = findProgram(argv[at]);
    if (program.empty())
        refuse(std::string(argv[at]) + " is not found");
    checkSettings();
    const std::string preload = findPreload();
    checkProgram(program, preload, late);

    const char* others = std::getenv("LD_PRELOAD");
    setenv("LD_PRELOAD", (preload + (others != nullptr && *others != '\0' ? std::string(":") + others : "")).c_str(), 1);
    setenv("CAIRN_RUN_PID", std::to_string(getpid()).c_str(), 1);
    execv(program.c_str(), argv + at);
    refuse(program + ": " + std::strerror(errno));
}
