// The CUDA backend, every executor of it, gives the CPU's bits: poses, velocities, impulses, residuals, the saved cache, in whatever
// order the device runs its threads.
#include "dense.h"
#include "methods.h"
#include "shapes.h"

#include <emulated.h>

namespace cairn_test {
namespace {

using cairn_emulated::Order;

constexpr double kRadius = 0.1;

cairn_config config_of(std::uint32_t backend, std::uint32_t executor = CAIRN_EXECUTOR_AUTO) {
    cairn_config config{};
    config.struct_size = sizeof config;
    config.threads = 1;
    config.backend = backend;
    config.executor = executor;
    return config;
}

// Everything that a run shows, to be compared bit by bit.
struct Seen {
    std::vector<std::uint64_t> states;
    std::vector<double> impulses, residuals, energies;
    std::vector<std::uint32_t> counts;
    std::vector<char> cache;
    bool operator==(const Seen&) const = default;
};
template <class T> void append(std::vector<T>& to, const std::vector<T>& from) { to.insert(to.end(), from.begin(), from.end()); }

std::vector<char> saved_cache(const Solver& solver) {
    std::size_t size = 0;
    check(cairn_solver_save_cache(solver.get(), nullptr, 0, &size));
    std::vector<char> bytes(size);
    check(cairn_solver_save_cache(solver.get(), bytes.data(), bytes.size(), &size));
    return bytes;
}

// Balls and hinges in several heaps, some bodies on their own, a rolling platform; then a scene of every kind of constraint.
Scene heaps(int count) {
    Random random(5);
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    for (int i = 0; i < count; ++i) {
        const Vec3 cell(i % 3, (i / 3) % 3, (i / 9) % 3), heap(3.0 * (i / 27), 0, 0);
        Body ball = Body::sphere(1 + i % 3, kRadius, heap + Vec3(0, 0, kRadius) + 0.199 * cell + random_vec(random, 0.004));
        ball.orientation = random_quat(random);
        ball.linear = random_vec(random, 0.5) - Vec3(0, 0, i % 2 == 0 ? 1.0 : 0.0);
        ball.angular = random_vec(random, 1);
        if (i % 4 == 0)
            ball.inverse_inertia = ball.inverse_inertia.cwiseProduct(Vec3(1, 0.8, 0.7));
        scene.add(ball);
    }
    for (int i = 0; i + 1 < count; i += 3) {
        const auto at = static_cast<std::size_t>(i);
        Joint& joint = scene.join(i, i + 1, 0.5 * (scene.bodies[at].position + scene.bodies[at + 1].position), axes_of(CAIRN_JOINT_HINGE));
        joint.key = (std::uint64_t{1} << 62) + static_cast<std::uint64_t>(i);
        if (i % 2 == 0) {
            joint.axes[5] = CAIRN_AXIS_LIMITED;
            joint.lower[5] = -0.1;
            joint.upper[5] = 0.1;
        }
    }
    return scene;
}
void touch(Scene& scene) {
    scene.contacts.clear();
    const int count = static_cast<int>(scene.bodies.size());
    for (int i = 0; i < count; ++i) {
        touch_sphere(scene, i, kRadius, Plane{}, 0.4, 0.3);
        for (int j = i + 1; j < count; ++j)
            touch_spheres(scene, i, j, kRadius, kRadius, 0.4);
    }
}

cairn_params short_params(std::uint32_t method, std::uint32_t which) {
    cairn_params params = preset(method, which);
    params.substeps = std::min(params.substeps, 2u);
    params.iterations = 8;
    params.position_iterations = std::min(params.position_iterations, 4u);
    params.relax_share = 0.25;
    params.residual_trace = 1;
    return params;
}

void look(const Scene& scene, const Impulses& out, const Solver& solver, Seen& seen) {
    seen.states.push_back(scene.hash());
    for (const std::vector<double>* values : {&out.contact, &out.friction, &out.joint, &out.row})
        append(seen.impulses, *values);
    append(seen.residuals, solver.residual_trace());
    const cairn_statistics s = solver.statistics();
    seen.energies.push_back(s.kinetic_energy_change);
    append(seen.counts, {s.bodies, s.contacts, s.manifolds, s.joints, s.rows, s.islands, s.iterations, s.position_iterations,
                         s.relax_iterations, s.restitution_iterations, s.warm_started, s.rotation_clamped});
    append(seen.counts, solver.split_counts());
}

Seen run(const cairn_config& config, const cairn_params& params, int balls, int frames) {
    Seen seen;
    const Solver solver(config);
    check(cairn_solver_set_params(solver.get(), &params));
    Scene scene = heaps(balls);
    for (int frame = 0; frame < frames; ++frame) {
        touch(scene);
        look(scene, scene.step(solver), solver, seen);
    }
    EXPECT_GT(scene.contacts.size(), scene.bodies.size() / 2) << "hardly anything touches: this test checks little";
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        Random random(seed);
        Scene odd = random_bodies(random, 4 + static_cast<int>(seed));
        add_random_joints(random, odd, 0.01);
        odd.joints[0].axes = {CAIRN_AXIS_LOCKED,  CAIRN_AXIS_LOCKED,  CAIRN_AXIS_DRIVEN,
                              CAIRN_AXIS_LIMITED, CAIRN_AXIS_LIMITED, CAIRN_AXIS_FREE};
        odd.joints[0].motor_speed[2] = 1;
        odd.joints[0].motor_force[2] = 5;
        add_random_contacts(random, odd, 2 + static_cast<int>(seed * 7), 0.5);
        for (const int target : {0, 1, 0}) {
            Row row;
            row.b = target;
            row.jacobian_b[2] = 1;
            row.lower = -0.1;
            odd.rows.push_back(row);
        }
        for (Body& body : odd.bodies)
            body.flags = 0;
        look(odd, odd.step(solver), solver, seen);
    }
    seen.cache = saved_cache(solver);
    return seen;
}

void expect_same(const Seen& cpu, const Seen& gpu) {
    EXPECT_EQ(gpu.states, cpu.states);
    EXPECT_TRUE(gpu.impulses == cpu.impulses) << "impulses";
    EXPECT_TRUE(gpu.residuals == cpu.residuals) << "residuals";
    EXPECT_TRUE(gpu.energies == cpu.energies) << "energies";
    EXPECT_EQ(gpu.counts, cpu.counts);
    EXPECT_TRUE(gpu.cache == cpu.cache) << "the saved cache";
}

class SameBits : public EachMethod {
  protected:
    void TearDown() override { cairn_emulated::set_order(Order::forward); }
};
CAIRN_EACH_METHOD(SameBits);

TEST_P(SameBits, OfEveryExecutorInEveryOrder) {
    for (const std::uint32_t which : {CAIRN_PRESET_DEFAULT, CAIRN_PRESET_PAPER}) {
        const cairn_params params = short_params(GetParam(), which);
        const Seen cpu = run(config_of(CAIRN_BACKEND_CPU), params, 60, 3);
        for (const std::uint32_t executor : {CAIRN_EXECUTOR_BLOCK, CAIRN_EXECUTOR_GRID, CAIRN_EXECUTOR_GRAPH})
            for (const Order order : {Order::forward, Order::reversed, Order::shuffled}) {
                SCOPED_TRACE(testing::Message()
                             << "preset " << which << ", executor " << executor << ", order " << static_cast<int>(order));
                cairn_emulated::set_order(order, 7);
                expect_same(cpu, run(config_of(CAIRN_BACKEND_CUDA, executor), params, 60, 3));
            }
    }
}

TEST_P(SameBits, OfEveryOption) {
    const cairn_params usual = short_params(GetParam(), CAIRN_PRESET_DEFAULT);
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD})
        for (const std::uint32_t friction : {CAIRN_FRICTION_NONE, CAIRN_FRICTION_CONE, CAIRN_FRICTION_PYRAMID})
            for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
                cairn_params params = usual;
                params.splitting = splitting;
                params.friction_model = friction;
                params.acceleration = acceleration;
                params.joint_warm_start = 0.5;
                params.residual_tolerance = friction == CAIRN_FRICTION_CONE ? 1e-2 : 0;
                params.residual_trace = splitting == CAIRN_SPLIT_POINT;
                SCOPED_TRACE(testing::Message() << splitting << friction << acceleration);
                expect_same(run(config_of(CAIRN_BACKEND_CPU), params, 30, 2), run(config_of(CAIRN_BACKEND_CUDA), params, 30, 2));
            }
}

TEST(Gpu, ACacheMovesBetweenBackends) {
    const cairn_params params = short_params(CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT);
    const Solver cpu(config_of(CAIRN_BACKEND_CPU)), gpu(config_of(CAIRN_BACKEND_CUDA)), fresh(config_of(CAIRN_BACKEND_CUDA));
    for (const Solver* solver : {&cpu, &gpu, &fresh})
        check(cairn_solver_set_params(solver->get(), &params));
    Scene scene = heaps(30);
    touch(scene);
    scene.step(cpu);
    const std::vector<char> bytes = saved_cache(cpu);
    check(cairn_solver_load_cache(gpu.get(), bytes.data(), bytes.size()));
    EXPECT_EQ(saved_cache(gpu), bytes);
    touch(scene);
    Scene same = scene, cold = scene;
    scene.step(cpu);
    same.step(gpu);
    cold.step(fresh);
    EXPECT_EQ(same.hash(), scene.hash());
    EXPECT_NE(cold.hash(), scene.hash()) << "the warm start makes no difference: this test checks little";
    check(cairn_solver_reset(gpu.get()));
    EXPECT_EQ(gpu.statistics().backend, CAIRN_BACKEND_CUDA);
}

TEST(Gpu, NoAllocationAndOneWaitInASettledStep) {
    for (const std::uint32_t executor : {CAIRN_EXECUTOR_BLOCK, CAIRN_EXECUTOR_GRID, CAIRN_EXECUTOR_GRAPH}) {
        const Solver solver(config_of(CAIRN_BACKEND_CUDA, executor));
        Scene scene = heaps(30);
        touch(scene);
        const std::vector<Contact> contacts = scene.contacts;
        scene.step(solver);
        scene.step(solver); // the cache's second buffer
        cairn_emulated::reset_counters();
        scene.contacts = contacts;
        scene.step(solver);
        const cairn_emulated::Counters counted = cairn_emulated::counters();
        EXPECT_EQ(counted.allocations + counted.host_allocations, 0u) << "executor " << executor;
        EXPECT_EQ(counted.host_syncs, 1u) << "executor " << executor;
        EXPECT_EQ(solver.statistics().executor, executor);
    }
}

TEST(Gpu, RunningOutOfMemorySaysHowMuchAndLeavesTheSolverUsable) {
    Scene reference = heaps(30);
    touch(reference);
    {
        const Solver solver(config_of(CAIRN_BACKEND_CPU));
        reference.step(solver);
    }
    const Solver solver(config_of(CAIRN_BACKEND_CUDA));
    Scene scene = heaps(30);
    touch(scene);
    const std::uint64_t before = scene.hash();
    cairn_emulated::set_memory_limit(1); // nothing more can be had
    Impulses out;
    const cairn_status status = scene.try_step(solver, out);
    cairn_emulated::set_memory_limit(0);
    EXPECT_EQ(status, CAIRN_ERROR_OUT_OF_MEMORY);
    EXPECT_NE(std::string(cairn_last_error()).find("bytes were asked for"), std::string::npos) << cairn_last_error();
    EXPECT_EQ(scene.hash(), before);
    scene.step(solver);
    EXPECT_EQ(scene.hash(), reference.hash());
}

} // namespace
} // namespace cairn_test
