// What is measured: something that solves the same step of a world again and again.
#pragma once
#include "world.h"

#include <cairn/cairn.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace cairn_bench {

// Seconds of one step. What a solver does not tell apart is absent; what they leave of `total` is checks, copies and waiting.
struct Spent {
    double total = 0;
    std::optional<double> upload, build, iterations, finish, download;
};

// What it did, in its own words.
struct Done {
    std::uint32_t bodies = 0, points = 0, manifolds = 0, joints = 0, rows = 0, islands = 0;
    std::uint32_t iterations = 0, substeps = 1, positionIterations = 0, threads = 1;
    std::string executor; // of the GPU
};

class Subject {
  public:
    virtual ~Subject() = default;
    virtual Spent step() = 0;
    virtual Done done() const = 0;
    virtual double fastest() const = 0; // m/s: a body's largest speed after a step
    // Of the poses and velocities after a step, by their bits; 0 where they are not Cairn's.
    virtual std::uint64_t hash() const { return 0; }
};

// A call to libcairn that failed: what() is its text.
struct Failure : std::runtime_error {
    Failure(cairn_status status, const std::string& text) : std::runtime_error(text), outOfMemory(status == CAIRN_ERROR_OUT_OF_MEMORY) {}
    bool outOfMemory;
};

// What is missing for the GPU, in libcairn's words; none if it can be used.
std::optional<std::string> gpuIsMissing();

// threads: 0, as many as there are. Throws Failure; so does its step(). The world must outlive it.
std::unique_ptr<Subject> cairnSubject(const World& world, const cairn_params& params, std::uint32_t backend, std::uint32_t executor,
                                      std::uint32_t threads);

// "3.24, SSE rows, floats"; without Bullet nothing, and stockSubject() returns null.
std::string bulletVersion();
// Bullet's btSequentialImpulseConstraintSolver over the very same bodies, points and hinges, cold, its other settings as they come.
std::unique_ptr<Subject> stockSubject(const World& world, int iterations);

} // namespace cairn_bench
