// The Python modules cairn._bullet (Bullet's float library) and cairn._bullet64 (its double library): one source, compiled
// twice. Arrays leave as float64 whatever Bullet computes in.
#include "bullet_module_world.h"
#include "choices.h"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstring>
#include <limits>
#include <stdexcept>

namespace py = pybind11;
using cairn_bullet::BodySettings;
using cairn_bullet::JointKind;
using cairn_bullet::JointSettings;
using cairn_bullet::Mat3;
using cairn_bullet::Quat;
using cairn_bullet::Six;
using cairn_bullet::Vec3;
using cairn_bullet::World;

namespace {

py::array_t<double> array(const std::vector<double>& values, py::ssize_t columns) {
    py::array_t<double> result({static_cast<py::ssize_t>(values.size()) / columns, columns});
    if (!values.empty())
        std::memcpy(result.mutable_data(), values.data(), values.size() * sizeof(double));
    return result;
}

template <class T> py::array_t<T> flat(const std::vector<T>& values) {
    return py::array_t<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

void check(cairn_status status) {
    if (status != CAIRN_OK)
        throw std::runtime_error(cairn_last_error());
}

cairn::bullet::ConstraintSolver& behind(const World& world) {
    if (!world.cairn())
        throw std::runtime_error("this world runs a stock solver; make one with solver='cairn'");
    return *world.cairn();
}

// One call of `visit(name, field)` for every field that a caller may set.
template <class Params, class Visit> void eachParam(Params& p, Visit visit) {
    visit("method", p.method);
    visit("iterations", p.iterations);
    visit("substeps", p.substeps);
    visit("position_iterations", p.position_iterations);
    visit("restitution_iterations", p.restitution_iterations);
    visit("splitting", p.splitting);
    visit("friction_model", p.friction_model);
    visit("acceleration", p.acceleration);
    visit("residual_trace", p.residual_trace);
    visit("contact_warm_start", p.contact_warm_start);
    visit("joint_warm_start", p.joint_warm_start);
    visit("relax_share", p.relax_share);
    visit("contact_baumgarte", p.contact_baumgarte);
    visit("joint_baumgarte", p.joint_baumgarte);
    visit("contact_hertz", p.contact_hertz);
    visit("contact_damping_ratio", p.contact_damping_ratio);
    visit("joint_hertz", p.joint_hertz);
    visit("joint_damping_ratio", p.joint_damping_ratio);
    visit("hertz_limit", p.hertz_limit);
    visit("static_hertz_scale", p.static_hertz_scale);
    visit("max_push_speed", p.max_push_speed);
    visit("restitution_threshold", p.restitution_threshold);
    visit("residual_tolerance", p.residual_tolerance);
    visit("contact_hertz_floor", p.contact_hertz_floor);
    visit("tolerance", p.tolerance);
}

py::dict paramsOf(const World& world) {
    py::dict result;
    eachParam(behind(world).params(), [&](const char* name, const auto& field) { result[name] = field; });
    return result;
}

// A dict of fields of cairn_params, over the default preset of its method; or the bytes of the struct itself.
void setParams(World& world, const py::object& given) {
    cairn::bullet::ConstraintSolver& solver = behind(world);
    cairn_params params = {};
    if (py::isinstance<py::bytes>(given)) {
        const std::string bytes = given.cast<std::string>();
        if (bytes.size() != sizeof params)
            throw std::invalid_argument("cairn_params has " + std::to_string(sizeof params) + " bytes here, not " +
                                        std::to_string(bytes.size()));
        std::memcpy(&params, bytes.data(), sizeof params);
    } else {
        const py::dict fields = given.cast<py::dict>();
        params.struct_size = sizeof params;
        const std::uint32_t method = fields.contains("method") ? fields["method"].cast<std::uint32_t>() : solver.params().method;
        check(cairn_params_preset(method, CAIRN_PRESET_DEFAULT, &params));
        std::size_t used = 0;
        eachParam(params, [&](const char* name, auto& field) {
            if (fields.contains(name)) {
                field = fields[name].cast<std::decay_t<decltype(field)>>();
                ++used;
            }
        });
        if (used != fields.size()) {
            const py::dict known = paramsOf(world);
            for (const auto& item : fields)
                if (!known.contains(item.first))
                    throw std::invalid_argument("cairn_params has no field '" + item.first.cast<std::string>() + "'");
        }
    }
    if (solver.setParams(params) != CAIRN_OK)
        throw std::invalid_argument(solver.lastError());
}

py::dict statisticsOf(const World& world) {
    const cairn_statistics s = behind(world).statistics();
    py::dict d;
#define CAIRN_ENTRY(name) d[#name] = s.name
    CAIRN_ENTRY(bodies);
    CAIRN_ENTRY(contacts);
    CAIRN_ENTRY(manifolds);
    CAIRN_ENTRY(joints);
    CAIRN_ENTRY(rows);
    CAIRN_ENTRY(islands);
    CAIRN_ENTRY(substeps);
    CAIRN_ENTRY(iterations);
    CAIRN_ENTRY(position_iterations);
    CAIRN_ENTRY(relax_iterations);
    CAIRN_ENTRY(restitution_iterations);
    CAIRN_ENTRY(warm_started);
    CAIRN_ENTRY(rotation_clamped);
    CAIRN_ENTRY(threads);
    CAIRN_ENTRY(instructions);
    CAIRN_ENTRY(backend);
    CAIRN_ENTRY(time_total);
    CAIRN_ENTRY(time_pack);
    CAIRN_ENTRY(time_build);
    CAIRN_ENTRY(time_sweep);
    CAIRN_ENTRY(time_position);
    CAIRN_ENTRY(time_integrate);
    CAIRN_ENTRY(time_finish);
    CAIRN_ENTRY(kinetic_energy_change);
    CAIRN_ENTRY(residual);
#undef CAIRN_ENTRY
    return d;
}

py::array_t<double> residualTrace(const World& world) {
    cairn_solver* solver = behind(world).handle();
    std::size_t count = 0;
    check(cairn_solver_residual_trace(solver, nullptr, 0, &count));
    py::array_t<double> values(static_cast<py::ssize_t>(count));
    if (count > 0)
        check(cairn_solver_residual_trace(solver, values.mutable_data(), count, &count));
    return values;
}

py::dict choicesOf(const World& world) {
    cairn_solver* solver = behind(world).handle();
    std::size_t count = 0;
    check(cairn_solver_choices(solver, nullptr, 0, &count));
    std::vector<cairn_choice> found(count);
    check(cairn_solver_choices(solver, found.data(), count, &count));
    return cairn_python::columns_of(found);
}

py::dict contactsOf(const World& world) {
    const cairn_bullet::ContactColumns c = world.contacts();
    py::dict d;
    d["body_a"] = flat(c.bodyA);
    d["body_b"] = flat(c.bodyB);
    d["separation"] = flat(c.separation);
    d["position"] = array(c.position, 3);
    d["normal"] = array(c.normal, 3);
    d["impulse"] = flat(c.impulse);
    d["friction_impulse"] = array(c.frictionImpulse, 3);
    return d;
}

JointKind kindOf(const std::string& name) {
    if (name == "ball")
        return JointKind::ball;
    if (name == "hinge")
        return JointKind::hinge;
    if (name == "slider")
        return JointKind::slider;
    if (name == "fixed")
        return JointKind::fixed;
    throw std::invalid_argument("there is no joint '" + name + "'; there are ball, hinge, slider and fixed, and add_six_dof()");
}

// The keyword arguments that every shape takes, in one place.
template <class Function, class... Shape>
void defineShape(py::class_<World>& type, const char* name, Function function, const char* doc, const Shape&... shape) {
    type.def(name, function, shape..., py::kw_only(), py::arg("mass"), py::arg("inertia") = py::none(), py::arg("position") = Vec3{0, 0, 0},
             py::arg("orientation") = Quat{0, 0, 0, 1}, py::arg("linear_velocity") = Vec3{0, 0, 0},
             py::arg("angular_velocity") = Vec3{0, 0, 0}, py::arg("friction") = 0.5, py::arg("restitution") = 0.0, py::arg("group") = 0,
             py::arg("force") = Vec3{0, 0, 0}, doc);
}

} // namespace

PYBIND11_MODULE(CAIRN_BULLET_MODULE_NAME, m) {
    m.doc() = "Worlds of the real libbullet, with its own solvers or with Cairn behind it. Used through cairn.bullet.";
    m.attr("PRECISION") = sizeof(btScalar) == sizeof(double) ? 64 : 32;
    m.attr("BULLET_VERSION") = btGetVersion();

    py::class_<World> world(m, "World", py::module_local(),
                            "A btDiscreteDynamicsWorld. SI units; body indices are in the order of adding; -1 is the world.");
    world.def(py::init([](const Vec3& gravity, const std::string& solver, const py::object& params, std::uint32_t threads,
                          std::uint32_t instructions, std::uint32_t precision, bool sleeping) {
                  cairn_config config = {};
                  config.struct_size = sizeof config;
                  config.threads = threads;
                  config.instructions = instructions;
                  config.precision = precision;
                  auto made = std::make_unique<World>(gravity, solver, config, sleeping);
                  if (!params.is_none())
                      setParams(*made, params);
                  return made;
              }),
              py::arg("gravity") = Vec3{0, -9.81, 0}, py::arg("solver") = "pgs", py::arg("params") = py::none(), py::kw_only(),
              py::arg("threads") = 0, py::arg("instructions") = CAIRN_ISA_AUTO, py::arg("precision") = 32, py::arg("sleeping") = false);

    defineShape(
        world, "add_box",
        [](World& w, const Vec3& size, double mass, const std::optional<Vec3>& inertia, const Vec3& position, const Quat& orientation,
           const Vec3& linear, const Vec3& angular, double friction, double restitution, int group, const Vec3& force) {
            return w.addBox(size, {mass, inertia, position, orientation, linear, angular, friction, restitution, group, force});
        },
        "A box; returns its index.", py::arg("half_extents"));
    defineShape(
        world, "add_sphere",
        [](World& w, double radius, double mass, const std::optional<Vec3>& inertia, const Vec3& position, const Quat& orientation,
           const Vec3& linear, const Vec3& angular, double friction, double restitution, int group, const Vec3& force) {
            return w.addSphere(radius, {mass, inertia, position, orientation, linear, angular, friction, restitution, group, force});
        },
        "A sphere; returns its index.", py::arg("radius"));
    defineShape(
        world, "add_capsule",
        [](World& w, double radius, double halfLength, double mass, const std::optional<Vec3>& inertia, const Vec3& position,
           const Quat& orientation, const Vec3& linear, const Vec3& angular, double friction, double restitution, int group,
           const Vec3& force) {
            return w.addCapsule(radius, halfLength,
                                {mass, inertia, position, orientation, linear, angular, friction, restitution, group, force});
        },
        "A capsule about y; half_length is the cylinder's. Returns its index.", py::arg("radius"), py::arg("half_length"));
    defineShape(
        world, "add_hull",
        [](World& w, const std::vector<Vec3>& points, double mass, const std::optional<Vec3>& inertia, const Vec3& position,
           const Quat& orientation, const Vec3& linear, const Vec3& angular, double friction, double restitution, int group,
           const Vec3& force) {
            return w.addHull(points, {mass, inertia, position, orientation, linear, angular, friction, restitution, group, force});
        },
        "The convex hull of points about the centre of mass, along the principal axes. Returns its index.", py::arg("points"));
    defineShape(
        world, "add_plane",
        [](World& w, const Vec3& normal, double offset, double mass, const std::optional<Vec3>& inertia, const Vec3& position,
           const Quat& orientation, const Vec3& linear, const Vec3& angular, double friction, double restitution, int group,
           const Vec3& force) {
            return w.addPlane(normal, offset, {mass, inertia, position, orientation, linear, angular, friction, restitution, group, force});
        },
        "The half space normal . x <= offset in the body's axes; mass must be 0. Returns its index.", py::arg("normal"), py::arg("offset"));

    world.def(
        "add_joint",
        [](World& w, const std::string& kind, int bodyA, int bodyB, const Vec3& anchor, const Mat3& axes, double motorSpeed,
           double motorForce, double lower, double upper, const std::optional<Vec3>& anchorB) {
            JointSettings joint = {kindOf(kind), bodyA, bodyB, anchor, anchorB.value_or(anchor), axes, {}, {}, {}, {}};
            const std::size_t freeAxis = joint.kind == JointKind::slider ? 0 : 5;
            joint.lower[freeAxis] = lower;
            joint.upper[freeAxis] = upper;
            joint.motorSpeed[freeAxis] = motorSpeed;
            joint.motorForce[freeAxis] = motorForce;
            return w.addJoint(joint);
        },
        py::arg("kind"), py::arg("body_a"), py::arg("body_b"), py::arg("anchor"), py::arg("axes"), py::kw_only(),
        py::arg("motor_speed") = 0.0, py::arg("motor_force") = 0.0, py::arg("lower") = -std::numeric_limits<double>::infinity(),
        py::arg("upper") = std::numeric_limits<double>::infinity(), py::arg("anchor_b") = py::none(),
        "A ball, hinge (about z), slider (along x) or fixed joint. axes: 9 numbers, the frame's world axes as columns of a matrix\n"
        "given row by row; anchor: a world point; both where the bodies are now. anchor_b: b's, where that is another point: the\n"
        "joint then starts with an error. Coordinates and motors: of b relative to a.\n"
        "The two bodies no longer collide. Returns the joint's index.");
    world.def(
        "add_six_dof",
        [](World& w, int bodyA, int bodyB, const Vec3& anchor, const Mat3& axes, const Six& lower, const Six& upper, const Six& motorSpeed,
           const Six& motorForce) {
            return w.addJoint({JointKind::sixDof, bodyA, bodyB, anchor, anchor, axes, lower, upper, motorSpeed, motorForce});
        },
        py::arg("body_a"), py::arg("body_b"), py::arg("anchor"), py::arg("axes"), py::arg("lower"), py::arg("upper"), py::kw_only(),
        py::arg("motor_speed") = Six{}, py::arg("motor_force") = Six{},
        "A btGeneric6DofConstraint. Of tx ty tz rx ry rz: lower = upper locks, lower > upper frees. Returns its index.");

    world.def("step", &World::step, py::arg("dt"), py::arg("substeps") = 1, py::call_guard<py::gil_scoped_release>(),
              "stepSimulation(dt, 0), or stepSimulation(dt, substeps, dt / substeps). RuntimeError if Cairn refuses the step.");
    world.def_property_readonly("body_count", &World::bodyCount);
    world.def(
        "poses",
        [](const World& w) {
            py::array_t<double> result({static_cast<py::ssize_t>(w.bodyCount()), py::ssize_t{7}});
            w.poses(result.mutable_data());
            return result;
        },
        "[bodies, 7]: position, m; orientation x, y, z, w.");
    world.def(
        "velocities",
        [](const World& w) {
            py::array_t<double> result({static_cast<py::ssize_t>(w.bodyCount()), py::ssize_t{6}});
            w.velocities(result.mutable_data());
            return result;
        },
        "[bodies, 6]: linear, m/s; angular, rad/s.");
    world.def("set_velocity", &World::setVelocity, py::arg("body"), py::arg("linear"), py::arg("angular"));
    world.def("remove_body", &World::removeBody, py::arg("body"),
              "Take a body out of the world. It keeps its index and last pose, at rest. ValueError if a joint holds it.");
    world.def("contacts", &contactsOf,
              "Contact points that the last internal step found at its start: body_a, body_b, separation (m), position (m, on a),\n"
              "normal (from a to b), impulse (N s), friction_impulse (N s, on b).");
    world.def(
        "joint_errors", [](const World& w) { return array(w.jointErrors(), 2); },
        "[joints, 2]: what each joint lets slip of what it should hold, m and rad, in double from the poses now.");
    world.def_property("iterations", &World::iterations, &World::setIterations, "Of the stock solvers.");
    world.def_property("split_impulse", &World::splitImpulse, &World::setSplitImpulse, "Of the stock solvers.");
    world.def_property_readonly(
        "last_status", [](const World& w) { return w.cairn() ? w.cairn()->lastStatus() : CAIRN_OK; }, "cairn_status of the last step.");
    world.def_property_readonly("solver_seconds", &World::solverSeconds, "Of the last step, solver with gather and scatter.");
    world.def_property_readonly("step_seconds", &World::stepSeconds, "Of the last step, everything.");
    world.def_property("params", &paramsOf, &setParams, "cairn_params as a dict; set from a dict or from the struct's bytes.");
    world.def("statistics", &statisticsOf, "cairn_statistics of the last step.");
    world.def("choices", &choicesOf, "What the method auto did with every island in the last step.");
    world.def("residual_trace", &residualTrace, "Residual of every velocity sweep of the last step, if params asked for it.");
}
