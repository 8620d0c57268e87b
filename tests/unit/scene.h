// A scene as plain arrays, and a solver that throws: what every test is written with. It uses the C ABI and nothing else,
// so that the same tests serve as conformance tests of any device.
#pragma once
#include <cairn/cairn.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace cairn_test {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class T> constexpr std::uint32_t type_of();
template <> constexpr std::uint32_t type_of<float>() { return CAIRN_F32; }
template <> constexpr std::uint32_t type_of<double>() { return CAIRN_F64; }
template <> constexpr std::uint32_t type_of<std::int32_t>() { return CAIRN_I32; }
template <> constexpr std::uint32_t type_of<std::uint32_t>() { return CAIRN_U32; }
template <> constexpr std::uint32_t type_of<std::uint64_t>() { return CAIRN_U64; }

template <class T> cairn_view view_of(const std::vector<T>& values) {
    cairn_view view{};
    view.data = values.empty() ? nullptr : const_cast<T*>(values.data()); // the library does not write inputs
    view.type = type_of<T>();
    return view;
}

// What a call failed with, as an exception: a test that does not expect it then fails with the library's own text.
struct Error : std::runtime_error {
    cairn_status status;
    explicit Error(cairn_status s) : std::runtime_error(std::string(cairn_status_name(s)) + ": " + cairn_last_error()), status(s) {}
};
inline void check(cairn_status status) {
    if (status != CAIRN_OK)
        throw Error(status);
}

struct Body {
    Vec3 position = Vec3::Zero();
    Quat orientation = Quat::Identity();
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    double inverse_mass = 1;
    Vec3 inverse_inertia = Vec3::Ones();
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
    Vec3 linear_factor = Vec3::Ones(), angular_factor = Vec3::Ones();
    std::uint32_t flags = 0;

    static Body box(double mass, const Vec3& half, const Vec3& position);
    static Body sphere(double mass, double radius, const Vec3& position);
};

inline Body Body::box(double mass, const Vec3& half, const Vec3& position) {
    Body body;
    body.position = position;
    body.inverse_mass = 1 / mass;
    const Vec3 s = half.cwiseProduct(half);
    body.inverse_inertia = 3 / mass * Vec3(1 / (s.y() + s.z()), 1 / (s.z() + s.x()), 1 / (s.x() + s.y()));
    return body;
}
inline Body Body::sphere(double mass, double radius, const Vec3& position) {
    Body body;
    body.position = position;
    body.inverse_mass = 1 / mass;
    body.inverse_inertia = Vec3::Constant(2.5 / (mass * radius * radius));
    return body;
}

struct Contact {
    int a = CAIRN_WORLD, b = CAIRN_WORLD;
    Vec3 normal = Vec3::UnitZ(), arm_a = Vec3::Zero(), arm_b = Vec3::Zero();
    double separation = 0, friction = 0, restitution = 0;
    Vec3 tangent = Vec3::Zero();
    std::uint64_t key = 0;
    std::uint32_t flags = 0;
    Eigen::Vector2d friction_scale = Eigen::Vector2d::Ones();
    Vec3 surface_velocity = Vec3::Zero();
    double rolling_friction = 0, spinning_friction = 0, stiffness = 0, damping = 0;
};

using Axes = std::array<std::uint32_t, 6>;
inline Axes axes_of(std::uint32_t joint) {
    Axes axes;
    check(cairn_joint_axes(joint, axes.data()));
    return axes;
}

struct Joint {
    int a = CAIRN_WORLD, b = CAIRN_WORLD;
    Vec3 anchor_a = Vec3::Zero(), anchor_b = Vec3::Zero();
    Quat frame_a = Quat::Identity(), frame_b = Quat::Identity();
    Axes axes{};
    std::array<double, 6> lower{}, upper{}, motor_speed{}, motor_force{};
    std::uint64_t key = 0;
    std::uint32_t rotation = CAIRN_ROTATION_BY_AXES;
    std::array<double, 6> target{}, stiffness{}, damping{}, rate{kInfinity, kInfinity, kInfinity, kInfinity, kInfinity, kInfinity};
    double max_force = kInfinity;
};

struct Row {
    int a = CAIRN_WORLD, b = CAIRN_WORLD;
    Eigen::Matrix<double, 6, 1> jacobian_a = Eigen::Matrix<double, 6, 1>::Zero(), jacobian_b = jacobian_a;
    double rhs = 0, lower = -kInfinity, upper = kInfinity, compliance = 0;
    int friction_index = -1;
    double friction = 0;
    std::uint32_t block = 0;
    std::uint64_t key = 0;
};

// Impulses of a step, as cairn_results documents them.
struct Impulses {
    std::vector<double> contact, friction, torsion, joint, joint_linear, joint_angular, row;
    Vec3 friction_of(std::size_t i) const { return {friction[3 * i], friction[3 * i + 1], friction[3 * i + 2]}; }
    Vec3 torsion_of(std::size_t i) const { return {torsion[3 * i], torsion[3 * i + 1], torsion[3 * i + 2]}; }
};

class Solver {
  public:
    explicit Solver(std::uint32_t precision = 32, std::uint32_t threads = 1, std::uint32_t isa = CAIRN_ISA_AUTO) {
        cairn_config config{};
        config.struct_size = sizeof config;
        config.precision = precision;
        config.threads = threads;
        config.instructions = isa;
        check(cairn_solver_create(&config, &solver_));
    }
    explicit Solver(const cairn_config& config) { check(cairn_solver_create(&config, &solver_)); }
    ~Solver() { cairn_solver_destroy(solver_); }
    Solver(const Solver&) = delete;
    Solver& operator=(const Solver&) = delete;

    cairn_solver* get() const { return solver_; }
    void set(const cairn_params& params) { check(cairn_solver_set_params(solver_, &params)); }
    cairn_statistics statistics() const {
        cairn_statistics s{};
        s.struct_size = sizeof s;
        check(cairn_solver_get_statistics(solver_, &s));
        return s;
    }
    std::vector<double> residual_trace() const {
        std::size_t count = 0;
        check(cairn_solver_residual_trace(solver_, nullptr, 0, &count));
        std::vector<double> values(count);
        if (count != 0)
            check(cairn_solver_residual_trace(solver_, values.data(), count, &count));
        return values;
    }
    std::vector<std::uint32_t> split_counts() const {
        std::size_t count = 0;
        check(cairn_solver_split_counts(solver_, nullptr, 0, &count));
        std::vector<std::uint32_t> values(count);
        if (count != 0)
            check(cairn_solver_split_counts(solver_, values.data(), count, &count));
        return values;
    }
    std::vector<char> save_cache() const {
        std::size_t size = 0;
        check(cairn_solver_save_cache(solver_, nullptr, 0, &size));
        std::vector<char> bytes(size);
        if (size != 0)
            check(cairn_solver_save_cache(solver_, bytes.data(), size, &size));
        return bytes;
    }
    void load_cache(const std::vector<char>& bytes) { check(cairn_solver_load_cache(solver_, bytes.data(), bytes.size())); }

  private:
    cairn_solver* solver_ = nullptr;
};

inline cairn_params preset(std::uint32_t method, std::uint32_t preset = CAIRN_PRESET_DEFAULT) {
    cairn_params params{};
    params.struct_size = sizeof params;
    check(cairn_params_preset(method, preset, &params));
    return params;
}

// Nothing but velocity sweeps: no warm start, momentum, relaxation, restitution or speed cap. What the laws are stated for.
inline cairn_params plain(std::uint32_t method, std::uint32_t iterations, std::uint32_t substeps = 1) {
    cairn_params p = preset(method, CAIRN_PRESET_PAPER);
    p.iterations = iterations;
    p.substeps = substeps;
    p.position_iterations = 0;
    p.relax_share = 0;
    p.restitution_iterations = 0;
    p.splitting = CAIRN_SPLIT_POINT;
    p.friction_model = CAIRN_FRICTION_CONE;
    p.acceleration = CAIRN_ACCELERATION_NONE;
    p.contact_warm_start = p.joint_warm_start = 0;
    p.contact_baumgarte = p.joint_baumgarte = 0.2;
    p.max_push_speed = kInfinity;
    p.residual_tolerance = 0;
    return p;
}

struct Scene {
    std::vector<Body> bodies;
    std::vector<Contact> contacts;
    std::vector<Joint> joints;
    std::vector<Row> rows;
    std::array<std::uint64_t, 4> revisions{}; // of the tables of bodies, contacts, joints and rows
    Vec3 gravity = Vec3::Zero();
    double dt = 0.016;

    int add(const Body& body) {
        bodies.push_back(body);
        return static_cast<int>(bodies.size()) - 1;
    }
    // A joint at a world point, its axes those of `frame` in the world, at rest in the bodies' present poses.
    Joint& join(int a, int b, const Vec3& point, const Axes& axes, const Quat& frame = Quat::Identity());

    // Steps once and takes the new poses and velocities. Throws Error.
    Impulses step(const Solver& solver) {
        Impulses out;
        const cairn_status status = try_step(solver, out);
        check(status);
        return out;
    }
    cairn_status try_step(const Solver& solver, Impulses& out);

    Vec3 linear_momentum() const;
    Vec3 angular_momentum(const Vec3& about = Vec3::Zero()) const;
    double kinetic_energy() const;
    double potential_energy() const;
    // FNV-1a over the bits of all poses and velocities.
    std::uint64_t hash() const;
};

inline Vec3 anchor_world(const Scene& scene, int body, const Vec3& anchor) {
    if (body < 0)
        return anchor;
    const Body& b = scene.bodies[static_cast<std::size_t>(body)];
    return b.position + b.orientation * anchor;
}
inline Quat frame_world(const Scene& scene, int body, const Quat& frame) {
    return body < 0 ? frame : scene.bodies[static_cast<std::size_t>(body)].orientation * frame;
}
// Distance between the two anchors of a joint.
inline Vec3 joint_gap(const Scene& scene, const Joint& joint) {
    return anchor_world(scene, joint.b, joint.anchor_b) - anchor_world(scene, joint.a, joint.anchor_a);
}

inline Joint& Scene::join(int a, int b, const Vec3& point, const Axes& axes, const Quat& frame) {
    Joint joint;
    joint.a = a;
    joint.b = b;
    joint.axes = axes;
    const auto local = [&](int i, Vec3& anchor, Quat& f) {
        if (i < 0) {
            anchor = point;
            f = frame;
            return;
        }
        const Body& body = bodies[static_cast<std::size_t>(i)];
        anchor = body.orientation.conjugate() * (point - body.position);
        f = body.orientation.conjugate() * frame;
    };
    local(a, joint.anchor_a, joint.frame_a);
    local(b, joint.anchor_b, joint.frame_b);
    joints.push_back(joint);
    return joints.back();
}

inline Mat3 inertia_world(const Body& body) {
    const Mat3 r = body.orientation.toRotationMatrix();
    return r * body.inverse_inertia.cwiseInverse().asDiagonal() * r.transpose();
}
inline bool movable(const Body& body) { return body.inverse_mass > 0; }

inline Vec3 Scene::linear_momentum() const {
    Vec3 sum = Vec3::Zero();
    for (const Body& b : bodies) {
        if (movable(b))
            sum += b.linear / b.inverse_mass;
    }
    return sum;
}
inline Vec3 Scene::angular_momentum(const Vec3& about) const {
    Vec3 sum = Vec3::Zero();
    for (const Body& b : bodies) {
        if (movable(b))
            sum += (b.position - about).cross(b.linear) / b.inverse_mass + inertia_world(b) * b.angular;
    }
    return sum;
}
inline double Scene::kinetic_energy() const {
    double sum = 0;
    for (const Body& b : bodies) {
        if (movable(b))
            sum += 0.5 * b.linear.squaredNorm() / b.inverse_mass + 0.5 * b.angular.dot(inertia_world(b) * b.angular);
    }
    return sum;
}
inline double Scene::potential_energy() const {
    double sum = 0;
    for (const Body& b : bodies) {
        if (movable(b))
            sum -= gravity.dot(b.position) / b.inverse_mass;
    }
    return sum;
}
inline std::uint64_t Scene::hash() const {
    std::uint64_t h = 0xcbf29ce484222325u;
    const auto mix = [&](const double* values, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) {
            std::uint64_t bits;
            std::memcpy(&bits, values + i, sizeof bits);
            h = (h ^ bits) * 0x100000001b3u;
        }
    };
    for (const Body& b : bodies) {
        mix(b.position.data(), 3);
        mix(b.orientation.coeffs().data(), 4);
        mix(b.linear.data(), 3);
        mix(b.angular.data(), 3);
    }
    return h;
}

// A view over a member of an array of structs: element type T, the member at `first`.
template <class Struct, class T> cairn_view member_view(const std::vector<Struct>& array, const T* first) {
    cairn_view view{};
    if (array.empty())
        return view;
    view.data = const_cast<T*>(first); // written only where it is also a result
    view.stride = sizeof(Struct);
    view.type = type_of<T>();
    return view;
}

inline cairn_bodies body_table(const std::vector<Body>& bodies) {
    cairn_bodies t{};
    t.struct_size = sizeof t;
    t.count = static_cast<std::uint32_t>(bodies.size());
    if (bodies.empty())
        return t;
    const Body& b = bodies.front();
    t.position = member_view(bodies, b.position.data());
    t.orientation = member_view(bodies, b.orientation.coeffs().data()); // Eigen keeps x, y, z, w too
    t.linear_velocity = member_view(bodies, b.linear.data());
    t.angular_velocity = member_view(bodies, b.angular.data());
    t.inverse_mass = member_view(bodies, &b.inverse_mass);
    t.inverse_inertia = member_view(bodies, b.inverse_inertia.data());
    t.force = member_view(bodies, b.force.data());
    t.torque = member_view(bodies, b.torque.data());
    t.linear_factor = member_view(bodies, b.linear_factor.data());
    t.angular_factor = member_view(bodies, b.angular_factor.data());
    t.flags = member_view(bodies, &b.flags);
    return t;
}

inline cairn_contacts contact_table(const std::vector<Contact>& contacts) {
    cairn_contacts t{};
    t.struct_size = sizeof t;
    t.count = static_cast<std::uint32_t>(contacts.size());
    if (contacts.empty())
        return t;
    const Contact& c = contacts.front();
    t.body_a = member_view(contacts, &c.a);
    t.body_b = member_view(contacts, &c.b);
    t.normal = member_view(contacts, c.normal.data());
    t.arm_a = member_view(contacts, c.arm_a.data());
    t.arm_b = member_view(contacts, c.arm_b.data());
    t.separation = member_view(contacts, &c.separation);
    t.friction = member_view(contacts, &c.friction);
    t.restitution = member_view(contacts, &c.restitution);
    t.tangent = member_view(contacts, c.tangent.data());
    t.key = member_view(contacts, &c.key);
    t.flags = member_view(contacts, &c.flags);
    // Columns that no contact needs stay absent, as in most programs.
    const auto some = [&](const auto& differs) { return std::any_of(contacts.begin(), contacts.end(), differs); };
    if (some([](const Contact& each) { return each.friction_scale != Eigen::Vector2d::Ones(); }))
        t.friction_scale = member_view(contacts, c.friction_scale.data());
    if (some([](const Contact& each) { return !each.surface_velocity.isZero(0); }))
        t.surface_velocity = member_view(contacts, c.surface_velocity.data());
    if (some([](const Contact& each) { return each.rolling_friction != 0; }))
        t.rolling_friction = member_view(contacts, &c.rolling_friction);
    if (some([](const Contact& each) { return each.spinning_friction != 0; }))
        t.spinning_friction = member_view(contacts, &c.spinning_friction);
    if (some([](const Contact& each) { return each.stiffness != 0; }))
        t.stiffness = member_view(contacts, &c.stiffness);
    if (some([](const Contact& each) { return each.damping != 0; }))
        t.damping = member_view(contacts, &c.damping);
    return t;
}

inline cairn_joints joint_table(const std::vector<Joint>& joints) {
    cairn_joints t{};
    t.struct_size = sizeof t;
    t.count = static_cast<std::uint32_t>(joints.size());
    if (joints.empty())
        return t;
    const Joint& j = joints.front();
    t.body_a = member_view(joints, &j.a);
    t.body_b = member_view(joints, &j.b);
    t.anchor_a = member_view(joints, j.anchor_a.data());
    t.anchor_b = member_view(joints, j.anchor_b.data());
    t.frame_a = member_view(joints, j.frame_a.coeffs().data());
    t.frame_b = member_view(joints, j.frame_b.coeffs().data());
    t.axes = member_view(joints, j.axes.data());
    t.lower = member_view(joints, j.lower.data());
    t.upper = member_view(joints, j.upper.data());
    t.motor_speed = member_view(joints, j.motor_speed.data());
    t.motor_force = member_view(joints, j.motor_force.data());
    t.key = member_view(joints, &j.key);
    t.rotation = member_view(joints, &j.rotation);
    t.target = member_view(joints, j.target.data());
    t.stiffness = member_view(joints, j.stiffness.data());
    t.damping = member_view(joints, j.damping.data());
    t.rate = member_view(joints, j.rate.data());
    t.max_force = member_view(joints, &j.max_force);
    return t;
}

inline cairn_rows row_table(const std::vector<Row>& rows) {
    cairn_rows t{};
    t.struct_size = sizeof t;
    t.count = static_cast<std::uint32_t>(rows.size());
    if (rows.empty())
        return t;
    const Row& r = rows.front();
    t.body_a = member_view(rows, &r.a);
    t.body_b = member_view(rows, &r.b);
    t.jacobian_a = member_view(rows, r.jacobian_a.data());
    t.jacobian_b = member_view(rows, r.jacobian_b.data());
    t.rhs = member_view(rows, &r.rhs);
    t.lower = member_view(rows, &r.lower);
    t.upper = member_view(rows, &r.upper);
    t.compliance = member_view(rows, &r.compliance);
    t.friction_index = member_view(rows, &r.friction_index);
    t.friction = member_view(rows, &r.friction);
    t.block = member_view(rows, &r.block);
    t.key = member_view(rows, &r.key);
    return t;
}

inline cairn_status Scene::try_step(const Solver& solver, Impulses& out) {
    cairn_bodies body_columns = body_table(bodies);
    cairn_contacts contact_columns = contact_table(contacts);
    cairn_joints joint_columns = joint_table(joints);
    cairn_rows row_columns = row_table(rows);
    body_columns.revision = revisions[0];
    contact_columns.revision = revisions[1];
    joint_columns.revision = revisions[2];
    row_columns.revision = revisions[3];
    cairn_step step{};
    step.struct_size = sizeof step;
    step.dt = dt;
    for (int i = 0; i < 3; ++i)
        step.gravity[i] = gravity[i];
    step.bodies = &body_columns;
    step.contacts = &contact_columns;
    step.joints = &joint_columns;
    step.rows = &row_columns;

    out.contact.assign(contacts.size(), 0);
    out.friction.assign(3 * contacts.size(), 0);
    out.torsion.assign(3 * contacts.size(), 0);
    out.joint.assign(6 * joints.size(), 0);
    out.joint_linear.assign(3 * joints.size(), 0);
    out.joint_angular.assign(3 * joints.size(), 0);
    out.row.assign(rows.size(), 0);
    cairn_results results{};
    results.struct_size = sizeof results;
    results.position = body_columns.position; // in place
    results.orientation = body_columns.orientation;
    results.linear_velocity = body_columns.linear_velocity;
    results.angular_velocity = body_columns.angular_velocity;
    results.contact_impulse = view_of(out.contact);
    results.friction_impulse = view_of(out.friction);
    results.torsion_impulse = view_of(out.torsion);
    results.joint_impulse = view_of(out.joint);
    results.row_impulse = view_of(out.row);
    results.joint_linear = view_of(out.joint_linear);
    results.joint_angular = view_of(out.joint_angular);
    return cairn_solver_step(solver.get(), &step, &results);
}

// ---- Chance ----
using Random = std::mt19937_64;
inline double uniform(Random& random, double low, double high) {
    // not std::uniform_real_distribution, whose numbers depend on the standard library
    return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
}
inline Vec3 random_vec(Random& random, double size) {
    return {uniform(random, -size, size), uniform(random, -size, size), uniform(random, -size, size)};
}
inline Vec3 random_unit(Random& random) {
    for (;;) {
        const Vec3 v = random_vec(random, 1);
        if (v.squaredNorm() > 0.01 && v.squaredNorm() < 1)
            return v.normalized();
    }
}
inline Quat random_quat(Random& random) { return Quat(Eigen::AngleAxisd(uniform(random, -3, 3), random_unit(random))); }
inline Body random_body(Random& random) {
    Body body;
    body.position = random_vec(random, 1);
    body.orientation = random_quat(random);
    body.linear = random_vec(random, 1);
    body.angular = random_vec(random, 1);
    body.inverse_mass = uniform(random, 0.5, 2);
    // principal moments i + j, j + k, k + i of a real body, so that the triangle inequality holds
    const Vec3 s(uniform(random, 0.1, 0.3), uniform(random, 0.1, 0.3), uniform(random, 0.1, 0.3));
    body.inverse_inertia = Vec3(s.y() + s.z(), s.z() + s.x(), s.x() + s.y()).cwiseInverse() * body.inverse_mass;
    return body;
}

} // namespace cairn_test
