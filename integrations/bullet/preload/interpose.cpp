// libcairn_bullet_preload.so: in a program that is linked to a shared Bullet, puts Cairn in the place of every
// btSequentialImpulseConstraintSolver. Loaded with LD_PRELOAD (cairn-run does that), its definitions of that class's functions
// come before Bullet's, and Bullet's own table of virtual functions points to them.
//
// It takes over objects whose class is exactly btSequentialImpulseConstraintSolver. Classes derived from it (NNCG, MLCP, the
// multibody solver, a program's own) reach the same solveGroup(): those go on to Bullet's definition, and are counted.
//
// No Bullet header is included: which Bullet, in which precision, is seen at the first call, wherever the program has it from (a
// plugin that is loaded late, say), and then the half for it is loaded.
#include "bullet_library.h"
#include "settings.h"
#include "stand_in.h"

#include <cxxabi.h>
#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <typeinfo>
#include <unordered_map>
#include <vector>

using namespace cairn::preload;

#define CAIRN_EXPORT extern "C" __attribute__((visibility("default")))
#define CAIRN_SOLVE_GROUP                                                                                                                  \
    "_ZN35btSequentialImpulseConstraintSolver10solveGroupEPP17btCollisionObjectiPP20btPersistentManifoldiPP17btTypedConstraintiRK19"       \
    "btContactSolverInfoP12btIDebugDrawP12btDispatcher"
#define CAIRN_RESET "_ZN35btSequentialImpulseConstraintSolver5resetEv"
#define CAIRN_DESTROY_COMPLETE "_ZN35btSequentialImpulseConstraintSolverD1Ev"
#define CAIRN_DESTROY_BASE "_ZN35btSequentialImpulseConstraintSolverD2Ev"
#define CAIRN_DESTROY_DELETE "_ZN35btSequentialImpulseConstraintSolverD0Ev"

// A btScalar comes back in the register of a double: a float is its lower half, on x86-64 and AArch64 alike.
CAIRN_EXPORT double cairn_solve_group(void*, void**, int, void**, int, void**, int, const void*, void*, void*) __asm__(CAIRN_SOLVE_GROUP);
CAIRN_EXPORT void cairn_reset(void*) __asm__(CAIRN_RESET);
CAIRN_EXPORT void cairn_destroy_complete(void*) __asm__(CAIRN_DESTROY_COMPLETE);
CAIRN_EXPORT void cairn_destroy_base(void*) __asm__(CAIRN_DESTROY_BASE);
CAIRN_EXPORT void cairn_destroy_delete(void*) __asm__(CAIRN_DESTROY_DELETE);
CAIRN_EXPORT void cairn_step_float(void*, float) __asm__(CAIRN_STEP_FLOAT);
CAIRN_EXPORT void cairn_step_double(void*, double) __asm__(CAIRN_STEP_DOUBLE);

namespace {

constexpr const char* kClass = "35btSequentialImpulseConstraintSolver"; // as typeid gives it
using SolveGroup = double (*)(void*, void**, int, void**, int, void**, int, const void*, void*, void*);
using OfThis = void (*)(void*);

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// ---- What is known ---------------------------------------------------------------------------------------------------

struct Series { // of one figure a step
    std::vector<float> values;
    void add(double value) { values.push_back(static_cast<float>(value)); }
    double most() const { return values.empty() ? 0 : static_cast<double>(*std::max_element(values.begin(), values.end())); }
    double median() {
        if (values.empty())
            return 0;
        const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
        std::nth_element(values.begin(), middle, values.end());
        return static_cast<double>(*middle);
    }
};

struct Bullet { // a Bullet library in this process
    std::string name;
    const StandIn* half = nullptr; // NULL: not taken over
    std::string why;
};

struct Instance { // a solver of the program's
    const Bullet* bullet = nullptr;
    void* solver = nullptr;          // NULL: left to Bullet, which is measured
    SolveGroup solveGroup = nullptr; // Bullet's
};

struct State {
    std::mutex mutex;
    Settings settings;
    std::string badSettings;
    std::map<const void*, Bullet> bullets; // by the address of their solveGroup()
    std::unordered_map<const void*, Instance> instances;
    std::map<std::string, uint64_t> leftToBullet; // calls, by class
    std::string noSolver;                         // why none could be made
    uint64_t solvers = 0;
    uint64_t steps = 0;
    double solverSeconds = 0;
    double stepSeconds = 0;
    Record total = {};
    // Of the step at hand (of all worlds that step at once).
    Record step = {};
    double stepSolverSeconds = 0;
    bool solved = false;
    int stepping = 0; // calls of Bullet's step that are under way
    Series residual, deepest, widest, milliseconds;
};

// Never destroyed: the program's solvers may outlive every order of destruction.
State& state() {
    static State& made = *[] {
        State* fresh = new State;
        if (!readSettings(fresh->settings, fresh->badSettings))
            std::fprintf(stderr, "cairn: %s; Bullet's own solver goes on\n", fresh->badSettings.c_str());
        return fresh;
    }();
    return made;
}

const void* const* tableOf(const void* object) { return *static_cast<const void* const* const*>(object); }

const char* className(const void* object) { return static_cast<const std::type_info*>(tableOf(object)[-1])->name(); }

bool isExactly(const void* object) { return std::strcmp(className(object), kClass) == 0; }

// Bullet's definition of a function: that of the library that the object's class lives in, or the next one after ours.
void* original(const char* name, const void* object, const void* ours) {
    void* found = nullptr;
    Dl_info info;
    if (dladdr(tableOf(object), &info) != 0 && info.dli_fname != nullptr) {
        if (void* library = dlopen(info.dli_fname, RTLD_LAZY | RTLD_NOLOAD)) {
            found = dlsym(library, name);
            dlclose(library);
        }
    }
    if (found == nullptr || found == ours)
        found = dlsym(RTLD_NEXT, name);
    return found == ours ? nullptr : found;
}

// ---- Bullet's library, and the half for it ---------------------------------------------------------------------------

std::string fileOf(const void* address) {
    Dl_info info;
    if (dladdr(address, &info) == 0 || info.dli_fname == nullptr)
        return "";
    char* real = realpath(info.dli_fname, nullptr);
    const std::string path = real != nullptr ? real : info.dli_fname;
    std::free(real);
    return path;
}

const StandIn* loadHalf(const std::string& precision, std::string& why) {
    const std::string self = fileOf(reinterpret_cast<const void*>(&loadHalf)),
                      path = halfPath(self.substr(0, self.rfind('/') + 1), precision);
    if (path.empty()) {
        why = halfName(precision) + " is not there: Cairn was built without Bullet's headers for this precision";
        return nullptr;
    }
    void* library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* symbol = library != nullptr ? dlsym(library, kStandInSymbol) : nullptr;
    if (symbol == nullptr) {
        why = dlerror();
        return nullptr;
    }
    return reinterpret_cast<StandInFunction>(symbol)();
}

// Called with the mutex held.
const Bullet& bulletOf(const void* solveGroup) {
    const auto known = state().bullets.find(solveGroup);
    if (known != state().bullets.end())
        return known->second;
    Bullet& bullet = state().bullets[solveGroup];
    const std::string path = fileOf(solveGroup);
    bullet.name = path.substr(path.rfind('/') + 1);
    if (!state().badSettings.empty()) {
        bullet.why = state().badSettings;
        return bullet;
    }
    if (state().bullets.size() > 1) {
        bullet.why = "a second Bullet in this process";
        return bullet;
    }
    // The half's references are met by what is global, so make the program's Bullet that, and the libraries that it needs.
    void* library = dlopen(path.c_str(), RTLD_LAZY | RTLD_NOLOAD | RTLD_GLOBAL);
    if (library == nullptr) {
        bullet.why = "it is not a shared library of its own";
        return bullet;
    }
    const char* const precision = precisionOf(library);
    if (precision == nullptr) {
        bullet.why = "cannot tell its precision";
        return bullet;
    }
    if (!isOurVersion(bullet.name)) {
        bullet.why = "Cairn was built for Bullet " CAIRN_BULLET_VERSION;
        return bullet;
    }
    if (dlsym(library, CAIRN_SOLVE_GROUP) != solveGroup) {
        bullet.why = "its solveGroup() is another library's";
        return bullet;
    }
    bullet.half = loadHalf(precision, bullet.why);
    return bullet;
}

// ---- Instances -------------------------------------------------------------------------------------------------------

// What stands in for the program's solver; made at its first use.
Instance& instanceOf(void* object) {
    State& s = state();
    const std::lock_guard<std::mutex> lock(s.mutex);
    const auto known = s.instances.find(object);
    if (known != s.instances.end())
        return known->second; // stays where it is when others come and go
    Instance& instance = s.instances[object];
    ++s.solvers;
    instance.solveGroup = reinterpret_cast<SolveGroup>(original(CAIRN_SOLVE_GROUP, object, reinterpret_cast<void*>(&cairn_solve_group)));
    instance.bullet = &bulletOf(reinterpret_cast<const void*>(instance.solveGroup));
    if (instance.bullet->half == nullptr || s.settings.stock)
        return instance;
    const char* why = "";
    instance.solver = instance.bullet->half->create(&why);
    if (instance.solver == nullptr)
        s.noSolver = why;
    return instance;
}

void forget(void* object) {
    Instance gone;
    {
        const std::lock_guard<std::mutex> lock(state().mutex);
        const auto known = state().instances.find(object);
        if (known == state().instances.end())
            return;
        gone = known->second;
        state().instances.erase(known);
    }
    if (gone.solver != nullptr)
        gone.bullet->half->destroy(gone.solver);
}

// With the mutex held.
void endStep(State& s, double seconds) {
    if (!s.solved) // a world without such a solver
        return;
    ++s.steps;
    s.stepSeconds += seconds;
    add(s.total, s.step);
    if (s.settings.all) {
        s.residual.add(s.step.residual);
        s.deepest.add(s.step.deepest);
        s.widest.add(s.step.widest);
        s.milliseconds.add(1e3 * s.stepSolverSeconds);
    }
    s.step = Record();
    s.stepSolverSeconds = 0;
    s.solved = false;
}

void count(const Record& record, double seconds) {
    State& s = state();
    const std::lock_guard<std::mutex> lock(s.mutex);
    add(s.step, record);
    s.solverSeconds += seconds;
    s.stepSolverSeconds += seconds;
    s.solved = true;
    if (s.stepping == 0) // a world that steps in its own way
        endStep(s, 0);
}

template <class Scalar> void step(void* world, Scalar dt, const char* name, void (*ours)(void*, Scalar)) {
    const auto next = reinterpret_cast<void (*)(void*, Scalar)>(original(name, world, reinterpret_cast<void*>(ours)));
    State& s = state();
    {
        const std::lock_guard<std::mutex> lock(s.mutex);
        ++s.stepping;
    }
    const double begin = now();
    next(world, dt);
    const double seconds = now() - begin;
    const std::lock_guard<std::mutex> lock(s.mutex);
    --s.stepping;
    endStep(s, seconds);
}

void callNext(const char* name, void* object, void (*ours)(void*)) {
    if (const auto next = reinterpret_cast<OfThis>(original(name, object, reinterpret_cast<void*>(ours))))
        next(object);
}

// ---- The report ------------------------------------------------------------------------------------------------------

std::string readable(const std::string& type) {
    int status = 0;
    char* name = abi::__cxa_demangle(type.c_str(), nullptr, nullptr, &status);
    const std::string text = name != nullptr ? name : type;
    std::free(name);
    return text;
}

double each(uint64_t sum, uint64_t steps) { return static_cast<double>(sum) / static_cast<double>(steps); }

void reportSteps(State& s) {
    const double steps = static_cast<double>(s.steps);
    const bool cairn = s.total.solves > 0;
    char what[160];
    if (cairn)
        std::snprintf(what, sizeof what, "%s, %u iterations in %u substep%s", cairn_method_name(s.total.method), s.total.iterations,
                      s.total.substeps, s.total.substeps == 1 ? "" : "s");
    else
        std::snprintf(what, sizeof what, "Bullet's own solver");
    const auto count = static_cast<unsigned long long>(s.steps);
    const double solver = 1e3 * s.solverSeconds / steps;
    if (s.stepSeconds > 0)
        std::fprintf(stderr, "cairn: %s: %llu steps, solver %.3f ms of %.3f ms a step (%.0f %%)\n", what, count, solver,
                     1e3 * s.stepSeconds / steps, 100 * s.solverSeconds / s.stepSeconds);
    else
        std::fprintf(stderr, "cairn: %s: %llu solves of %.3f ms\n", what, count, solver);
    if (s.total.failures > 0)
        std::fprintf(stderr, "cairn: %llu solves were refused: the bodies of those steps moved without constraints\n",
                     static_cast<unsigned long long>(s.total.failures));
    if (!s.settings.all)
        return;
    std::fprintf(stderr, "  solvers          %llu\n", static_cast<unsigned long long>(s.solvers));
    if (cairn)
        std::fprintf(stderr, "  a step           %.2f solves, %.1f bodies, %.1f contacts, %.1f joints, %.1f rows\n",
                     each(s.total.solves, s.steps), each(s.total.bodies, s.steps), each(s.total.contacts, s.steps),
                     each(s.total.joints, s.steps), each(s.total.rows, s.steps));
    std::fprintf(stderr, "  solver           median %.3f ms, longest %.3f ms\n", s.milliseconds.median(), s.milliseconds.most());
    std::fprintf(stderr, "  deepest contact  median %.3f mm, worst %.3f mm\n", 1e3 * s.deepest.median(), 1e3 * s.deepest.most());
    std::fprintf(stderr, "  widest joint gap median %.3f mm, worst %.3f mm (ball and hinge)\n", 1e3 * s.widest.median(),
                 1e3 * s.widest.most());
    if (cairn)
        std::fprintf(stderr, "  residual         median %.2e, worst %.2e sqrt(J), of the last sweep\n", s.residual.median(),
                     s.residual.most());
}

__attribute__((destructor)) void report() {
    State& s = state();
    const std::lock_guard<std::mutex> lock(s.mutex);
    if (!s.settings.summary)
        return;
    for (const auto& entry : s.bullets)
        if (!entry.second.why.empty())
            std::fprintf(stderr, "cairn: Bullet's own solver was left in place: %s: %s\n", entry.second.name.c_str(),
                         entry.second.why.c_str());
    if (!s.noSolver.empty())
        std::fprintf(stderr, "cairn: Bullet's own solver was left in place: %s\n", s.noSolver.c_str());
    if (s.steps > 0)
        reportSteps(s);
    for (const auto& entry : s.leftToBullet)
        std::fprintf(stderr, "cairn: %llu calls of solveGroup of %s were left to Bullet\n", static_cast<unsigned long long>(entry.second),
                     readable(entry.first).c_str());
    const char* pid = variable("CAIRN_RUN_PID"); // the program itself, not one that it has started
    if (s.solvers == 0 && s.leftToBullet.empty() && pid != nullptr && std::to_string(getpid()) == pid)
        std::fprintf(stderr, "cairn: no btSequentialImpulseConstraintSolver was called\n");
}

} // namespace

// ---- In the place of Bullet's ----------------------------------------------------------------------------------------

double cairn_solve_group(void* self, void** bodies, int bodyCount, void** manifolds, int manifoldCount, void** constraints,
                         int constraintCount, const void* info, void* drawer, void* dispatcher) {
    State& s = state();
    if (!isExactly(self)) {
        const auto next = reinterpret_cast<SolveGroup>(original(CAIRN_SOLVE_GROUP, self, reinterpret_cast<void*>(&cairn_solve_group)));
        {
            const std::lock_guard<std::mutex> lock(s.mutex);
            ++s.leftToBullet[className(self)];
        }
        return next(self, bodies, bodyCount, manifolds, manifoldCount, constraints, constraintCount, info, drawer, dispatcher);
    }
    const Instance& instance = instanceOf(self);
    const Group group = {bodies, bodyCount, manifolds, manifoldCount, constraints, constraintCount, info, drawer, dispatcher};
    Record record = {};
    if (s.settings.all && instance.bullet->half != nullptr)
        instance.bullet->half->measure(group, record);
    const double begin = now();
    double result = 0;
    if (instance.solver != nullptr)
        instance.bullet->half->solve(instance.solver, group, record);
    else
        result =
            instance.solveGroup(self, bodies, bodyCount, manifolds, manifoldCount, constraints, constraintCount, info, drawer, dispatcher);
    if (bodyCount + manifoldCount + constraintCount > 0)
        count(record, now() - begin);
    return result;
}

void cairn_reset(void* self) {
    if (isExactly(self)) {
        const Instance& instance = instanceOf(self);
        if (instance.solver != nullptr)
            instance.bullet->half->reset(instance.solver);
    }
    callNext(CAIRN_RESET, self, &cairn_reset);
}

// The next solver may be made at the same address.
void cairn_destroy_complete(void* self) {
    forget(self);
    callNext(CAIRN_DESTROY_COMPLETE, self, &cairn_destroy_complete);
}

void cairn_destroy_base(void* self) {
    forget(self);
    callNext(CAIRN_DESTROY_BASE, self, &cairn_destroy_base);
}

void cairn_destroy_delete(void* self) {
    forget(self);
    callNext(CAIRN_DESTROY_DELETE, self, &cairn_destroy_delete);
}

void cairn_step_float(void* world, float dt) { step(world, dt, CAIRN_STEP_FLOAT, &cairn_step_float); }

void cairn_step_double(void* world, double dt) { step(world, dt, CAIRN_STEP_DOUBLE, &cairn_step_double); }
