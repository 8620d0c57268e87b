#include "subject.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

namespace cairn_bench {
namespace {

void check(cairn_status status) {
    if (status != CAIRN_OK)
        throw Failure(status, cairn_last_error());
}

template <class T> cairn_view viewOf(const std::vector<T>& values, std::uint32_t type) {
    cairn_view view{};
    if (!values.empty())
        view.data = const_cast<T*>(values.data()); // read only, where it is an input
    view.type = type;
    return view;
}
cairn_view floats(const std::vector<float>& values) { return viewOf(values, CAIRN_F32); }

cairn_config configOf(std::uint32_t backend, std::uint32_t executor, std::uint32_t threads) {
    cairn_config config{};
    config.struct_size = sizeof config;
    config.backend = backend;
    config.executor = executor;
    config.threads = threads;
    return config;
}

class CairnSubject final : public Subject {
  public:
    CairnSubject(const World& world, const cairn_params& params, std::uint32_t backend, std::uint32_t executor, std::uint32_t threads)
        : m_position(world.position), m_orientation(world.orientation), m_linear(world.linearVelocity), m_angular(world.angularVelocity) {
        const cairn_config config = configOf(backend, executor, threads);
        cairn_solver* solver = nullptr;
        check(cairn_solver_create(&config, &solver));
        m_solver.reset(solver);
        check(cairn_solver_set_params(solver, &params));

        m_bodies.struct_size = sizeof m_bodies;
        m_bodies.count = static_cast<std::uint32_t>(world.bodies());
        m_bodies.position = floats(world.position);
        m_bodies.orientation = floats(world.orientation);
        m_bodies.linear_velocity = floats(world.linearVelocity);
        m_bodies.angular_velocity = floats(world.angularVelocity);
        m_bodies.inverse_mass = floats(world.inverseMass);
        m_bodies.inverse_inertia = floats(world.inverseInertia);
        m_contacts.struct_size = sizeof m_contacts;
        m_contacts.count = static_cast<std::uint32_t>(world.points());
        m_contacts.body_a = viewOf(world.bodyA, CAIRN_I32);
        m_contacts.body_b = viewOf(world.bodyB, CAIRN_I32);
        m_contacts.normal = floats(world.normal);
        m_contacts.arm_a = floats(world.armA);
        m_contacts.arm_b = floats(world.armB);
        m_contacts.separation = floats(world.separation);
        m_contacts.friction = floats(world.friction);
        m_joints.struct_size = sizeof m_joints;
        m_joints.count = static_cast<std::uint32_t>(world.joints());
        m_joints.body_a = viewOf(world.jointA, CAIRN_I32);
        m_joints.body_b = viewOf(world.jointB, CAIRN_I32);
        m_joints.anchor_a = floats(world.anchorA);
        m_joints.anchor_b = floats(world.anchorB);
        m_joints.axes = viewOf(world.axes, CAIRN_U32);
        m_step.struct_size = sizeof m_step;
        m_step.dt = world.dt;
        m_step.gravity[1] = world.gravity;
        m_step.bodies = &m_bodies;
        m_step.contacts = &m_contacts;
        m_step.joints = &m_joints;
        m_results.struct_size = sizeof m_results;
        m_results.position = floats(m_position);
        m_results.orientation = floats(m_orientation);
        m_results.linear_velocity = floats(m_linear);
        m_results.angular_velocity = floats(m_angular);
        m_statistics.struct_size = sizeof m_statistics;
    }

    Spent step() override {
        const auto start = std::chrono::steady_clock::now();
        check(cairn_solver_step(m_solver.get(), &m_step, &m_results));
        Spent spent;
        spent.total = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        check(cairn_solver_get_statistics(m_solver.get(), &m_statistics));
        const cairn_statistics& s = m_statistics;
        spent.upload = s.time_upload;
        spent.build = s.time_pack;
        spent.iterations = s.time_build + s.time_sweep + s.time_position + s.time_integrate; // a device has them all in time_sweep
        spent.finish = s.time_finish;
        spent.download = s.time_download;
        return spent;
    }

    Done done() const override {
        const cairn_statistics& s = m_statistics;
        constexpr const char* executors[] = {"", "block", "grid", "graph"};
        Done done;
        done.bodies = s.bodies;
        done.points = s.contacts;
        done.manifolds = s.manifolds;
        done.joints = s.joints;
        done.rows = s.rows;
        done.islands = s.islands;
        done.iterations = s.iterations;
        done.substeps = s.substeps;
        done.positionIterations = s.position_iterations;
        done.threads = s.threads;
        done.executor = s.executor < 4 ? executors[s.executor] : "unknown";
        return done;
    }

    double fastest() const override {
        double square = 0;
        for (std::size_t i = 0; i < m_linear.size(); i += 3)
            square = std::max(square, static_cast<double>(m_linear[i] * m_linear[i] + m_linear[i + 1] * m_linear[i + 1] +
                                                          m_linear[i + 2] * m_linear[i + 2]));
        return std::sqrt(square);
    }

    std::uint64_t hash() const override { // FNV-1a
        std::uint64_t hash = 0xcbf29ce484222325u;
        for (const std::vector<float>* values : {&m_position, &m_orientation, &m_linear, &m_angular})
            for (const float value : *values) {
                std::uint32_t bits;
                std::memcpy(&bits, &value, sizeof bits);
                hash = (hash ^ bits) * 0x100000001b3u;
            }
        return hash;
    }

  private:
    struct Destroy {
        void operator()(cairn_solver* solver) const { cairn_solver_destroy(solver); }
    };
    std::unique_ptr<cairn_solver, Destroy> m_solver;
    std::vector<float> m_position, m_orientation, m_linear, m_angular; // results
    cairn_bodies m_bodies{};
    cairn_contacts m_contacts{};
    cairn_joints m_joints{};
    cairn_step m_step{};
    cairn_results m_results{};
    cairn_statistics m_statistics{};
};

} // namespace

std::optional<std::string> gpuIsMissing() {
    const cairn_config config = configOf(CAIRN_BACKEND_CUDA, CAIRN_EXECUTOR_AUTO, 1);
    cairn_solver* solver = nullptr;
    const cairn_status status = cairn_solver_create(&config, &solver);
    cairn_solver_destroy(solver);
    if (status == CAIRN_OK)
        return std::nullopt;
    cairn_info info{};
    info.struct_size = sizeof info;
    if (status == CAIRN_ERROR_UNSUPPORTED && cairn_get_info(&info) == CAIRN_OK)
        return info.cuda;
    return cairn_last_error();
}

std::unique_ptr<Subject> cairnSubject(const World& world, const cairn_params& params, std::uint32_t backend, std::uint32_t executor,
                                      std::uint32_t threads) {
    return std::make_unique<CairnSubject>(world, params, backend, executor, threads);
}

} // namespace cairn_bench
