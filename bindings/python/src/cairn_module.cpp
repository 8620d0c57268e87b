// The Python module `cairn._cairn`: the C interface with arrays and dicts in place of pointers. cairn/solver.py makes it friendly.
#include "cairn_module.h"
#include "choices.h"

#include "scene/traffic.h"

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace cairn_python {
namespace {

// Fields of a struct of numbers, by name.
template <class Struct> struct Number {
    const char* name;
    std::uint32_t Struct::*whole; // one of the two is set
    double Struct::*real;
};
template <class Struct> constexpr Number<Struct> number(const char* name, std::uint32_t Struct::*member) { return {name, member, nullptr}; }
template <class Struct> constexpr Number<Struct> number(const char* name, double Struct::*member) { return {name, nullptr, member}; }

constexpr Number<cairn_params> kParams[] = {
    number("method", &cairn_params::method),
    number("iterations", &cairn_params::iterations),
    number("substeps", &cairn_params::substeps),
    number("position_iterations", &cairn_params::position_iterations),
    number("restitution_iterations", &cairn_params::restitution_iterations),
    number("splitting", &cairn_params::splitting),
    number("friction_model", &cairn_params::friction_model),
    number("acceleration", &cairn_params::acceleration),
    number("residual_trace", &cairn_params::residual_trace),
    number("contact_warm_start", &cairn_params::contact_warm_start),
    number("joint_warm_start", &cairn_params::joint_warm_start),
    number("relax_share", &cairn_params::relax_share),
    number("contact_baumgarte", &cairn_params::contact_baumgarte),
    number("joint_baumgarte", &cairn_params::joint_baumgarte),
    number("contact_hertz", &cairn_params::contact_hertz),
    number("contact_damping_ratio", &cairn_params::contact_damping_ratio),
    number("joint_hertz", &cairn_params::joint_hertz),
    number("joint_damping_ratio", &cairn_params::joint_damping_ratio),
    number("hertz_limit", &cairn_params::hertz_limit),
    number("static_hertz_scale", &cairn_params::static_hertz_scale),
    number("max_push_speed", &cairn_params::max_push_speed),
    number("restitution_threshold", &cairn_params::restitution_threshold),
    number("residual_tolerance", &cairn_params::residual_tolerance),
    number("contact_hertz_floor", &cairn_params::contact_hertz_floor),
    number("tolerance", &cairn_params::tolerance),
};

constexpr Number<cairn_statistics> kStatistics[] = {
    number("bodies", &cairn_statistics::bodies),
    number("contacts", &cairn_statistics::contacts),
    number("manifolds", &cairn_statistics::manifolds),
    number("joints", &cairn_statistics::joints),
    number("rows", &cairn_statistics::rows),
    number("islands", &cairn_statistics::islands),
    number("substeps", &cairn_statistics::substeps),
    number("iterations", &cairn_statistics::iterations),
    number("position_iterations", &cairn_statistics::position_iterations),
    number("relax_iterations", &cairn_statistics::relax_iterations),
    number("restitution_iterations", &cairn_statistics::restitution_iterations),
    number("warm_started", &cairn_statistics::warm_started),
    number("rotation_clamped", &cairn_statistics::rotation_clamped),
    number("threads", &cairn_statistics::threads),
    number("instructions", &cairn_statistics::instructions),
    number("backend", &cairn_statistics::backend),
    number("executor", &cairn_statistics::executor),
    number("time_total", &cairn_statistics::time_total),
    number("time_pack", &cairn_statistics::time_pack),
    number("time_build", &cairn_statistics::time_build),
    number("time_sweep", &cairn_statistics::time_sweep),
    number("time_position", &cairn_statistics::time_position),
    number("time_integrate", &cairn_statistics::time_integrate),
    number("time_finish", &cairn_statistics::time_finish),
    number("kinetic_energy_change", &cairn_statistics::kinetic_energy_change),
    number("residual", &cairn_statistics::residual),
    number("time_upload", &cairn_statistics::time_upload),
    number("time_download", &cairn_statistics::time_download),
};

// Of cairn_evaluation, its indices apart.
constexpr Number<cairn_evaluation> kEvaluation[] = {
    number("bodies", &cairn_evaluation::bodies),
    number("contacts", &cairn_evaluation::contacts),
    number("joints", &cairn_evaluation::joints),
    number("rows", &cairn_evaluation::rows),
    number("penetration", &cairn_evaluation::penetration),
    number("penetration_mean", &cairn_evaluation::penetration_mean),
    number("joint_gap", &cairn_evaluation::joint_gap),
    number("joint_gap_mean", &cairn_evaluation::joint_gap_mean),
    number("joint_angle", &cairn_evaluation::joint_angle),
    number("joint_angle_mean", &cairn_evaluation::joint_angle_mean),
    number("contact_residual", &cairn_evaluation::contact_residual),
    number("joint_residual", &cairn_evaluation::joint_residual),
    number("joint_angular_residual", &cairn_evaluation::joint_angular_residual),
    number("row_residual", &cairn_evaluation::row_residual),
    number("relative_residual", &cairn_evaluation::relative_residual),
    number("complementarity", &cairn_evaluation::complementarity),
    number("coulomb_excess", &cairn_evaluation::coulomb_excess),
    number("momentum", &cairn_evaluation::momentum),
    number("angular_momentum", &cairn_evaluation::angular_momentum),
    number("momentum_total", &cairn_evaluation::momentum_total),
    number("angular_momentum_total", &cairn_evaluation::angular_momentum_total),
    number("kinetic_energy", &cairn_evaluation::kinetic_energy),
};
struct Index {
    const char* name;
    std::int32_t cairn_evaluation::*index;
};
constexpr Index kIndices[] = {
    {"penetration_contact", &cairn_evaluation::penetration_contact},
    {"residual_contact", &cairn_evaluation::residual_contact},
    {"gap_joint", &cairn_evaluation::gap_joint},
    {"angle_joint", &cairn_evaluation::angle_joint},
    {"residual_joint", &cairn_evaluation::residual_joint},
    {"angular_residual_joint", &cairn_evaluation::angular_residual_joint},
    {"residual_row", &cairn_evaluation::residual_row},
    {"momentum_body", &cairn_evaluation::momentum_body},
    {"angular_momentum_body", &cairn_evaluation::angular_momentum_body},
};

template <class Struct, std::size_t N> py::dict to_dict(const Struct& values, const Number<Struct> (&numbers)[N]) {
    py::dict dict;
    for (const auto& n : numbers) {
        dict[n.name] = n.whole ? py::object(py::int_(values.*(n.whole))) : py::object(py::float_(values.*(n.real)));
    }
    return dict;
}

void set_param(cairn_params& params, const std::string& name, const py::handle& value) {
    for (const auto& n : kParams) {
        if (name != n.name) {
            continue;
        }
        try {
            if (n.whole) {
                params.*(n.whole) = value.cast<std::uint32_t>();
            } else {
                params.*(n.real) = value.cast<double>();
            }
        } catch (const py::cast_error&) {
            throw py::type_error(name + " = " + py::repr(value).cast<std::string>() + " is not a " +
                                 (n.whole ? "whole number from 0 to 2^32 - 1" : "number"));
        }
        return;
    }
    std::string names;
    for (const auto& n : kParams) {
        names += (names.empty() ? "" : ", ") + std::string(n.name);
    }
    throw py::type_error("no parameter is called '" + name + "'; there are " + names);
}

class Solver {
  public:
    Solver(std::uint32_t threads, std::uint32_t instructions, std::uint32_t precision, std::uint32_t backend, std::uint32_t executor,
           std::uintptr_t stream)
        : ordering_{stream} {
        cairn_config config = {};
        config.struct_size = sizeof config;
        config.threads = threads;
        config.instructions = instructions;
        config.precision = precision;
        config.backend = backend;
        config.executor = executor;
        config.stream = reinterpret_cast<void*>(stream);
        check(cairn_solver_create(&config, &solver_));
    }
    ~Solver() { cairn_solver_destroy(solver_); } // which waits; then the arrays in flight may go
    Solver(const Solver&) = delete;
    Solver& operator=(const Solver&) = delete;

    void load_preset(std::uint32_t method, std::uint32_t preset, const py::dict& changes) {
        cairn_params params = {};
        params.struct_size = sizeof params;
        check(cairn_params_preset(method, preset, &params));
        change(params, changes);
    }

    void set_params(const py::dict& changes) {
        auto params = get();
        change(params, changes);
    }

    py::dict params() { return to_dict(get(), kParams); }

    void step(double dt, std::array<double, 3> gravity, const py::dict& bodies, const py::dict& contacts, const py::dict& joints,
              const py::dict& rows, const py::dict& out) {
        const BorrowedStep borrowed(dt, gravity, bodies, contacts, joints, rows, out, ordering_);
        call([&] { return cairn_solver_step(solver_, &borrowed.step, &borrowed.results); });
    }

    void step_async(double dt, std::array<double, 3> gravity, const py::dict& bodies, const py::dict& contacts, const py::dict& joints,
                    const py::dict& rows, const py::dict& out) {
        auto borrowed = std::make_unique<BorrowedStep>(dt, gravity, bodies, contacts, joints, rows, out, ordering_);
        call([&] { return cairn_solver_step_async(solver_, &borrowed->step, &borrowed->results); });
        in_flight_ = std::move(borrowed); // not before: a refusal while another is in flight must not drop that one's arrays
    }

    void wait() {
        const auto over = std::move(in_flight_); // its arrays go when the call is over
        call([&] { return cairn_solver_wait(solver_); });
    }

    py::dict statistics() {
        cairn_statistics statistics = {};
        statistics.struct_size = sizeof statistics;
        call([&] { return cairn_solver_get_statistics(solver_, &statistics); });
        return to_dict(statistics, kStatistics);
    }

    py::array_t<double> residual_trace() { return values<double>(cairn_solver_residual_trace); }
    py::array_t<std::uint32_t> split_counts() { return values<std::uint32_t>(cairn_solver_split_counts); }

    py::dict choices() {
        std::vector<cairn_choice> found;
        call([&] {
            std::size_t count = 0;
            cairn_status status = cairn_solver_choices(solver_, nullptr, 0, &count);
            if (count > 0 && status == CAIRN_OK) {
                found.resize(count);
                status = cairn_solver_choices(solver_, found.data(), count, &count);
            }
            return status;
        });
        return columns_of(found);
    }

    void reset() {
        call([&] { return cairn_solver_reset(solver_); });
    }

    py::bytes save_cache() {
        std::vector<char> bytes;
        call([&] {
            std::size_t size = 0;
            cairn_status status = cairn_solver_save_cache(solver_, nullptr, 0, &size);
            if (status == CAIRN_OK || status == CAIRN_ERROR_BUFFER_TOO_SMALL) {
                bytes.resize(size);
                status = cairn_solver_save_cache(solver_, bytes.data(), size, &size);
            }
            return status;
        });
        return py::bytes(bytes.data(), bytes.size());
    }

    void load_cache(const py::bytes& cache) {
        char* data = nullptr;
        py::ssize_t size = 0;
        if (PyBytes_AsStringAndSize(cache.ptr(), &data, &size) != 0) {
            throw py::error_already_set();
        }
        call([&] { return cairn_solver_load_cache(solver_, data, static_cast<std::size_t>(size)); });
    }

  private:
    // One solver serves one thread at a time, and Python's other threads run meanwhile.
    template <class Function> void call(Function function) {
        py::gil_scoped_release release;
        const std::lock_guard<std::mutex> lock(mutex_);
        check(function());
    }

    template <class Value, class Function> py::array_t<Value> values(Function function) {
        std::vector<Value> found;
        call([&] {
            std::size_t count = 0;
            cairn_status status = function(solver_, nullptr, 0, &count);
            if (count > 0 && (status == CAIRN_OK || status == CAIRN_ERROR_BUFFER_TOO_SMALL)) {
                found.resize(count);
                status = function(solver_, found.data(), count, &count);
            }
            return status;
        });
        return py::array_t<Value>(static_cast<py::ssize_t>(found.size()), found.data());
    }

    cairn_params get() {
        cairn_params params = {};
        params.struct_size = sizeof params;
        call([&] { return cairn_solver_get_params(solver_, &params); });
        return params;
    }

    void change(cairn_params& params, const py::dict& changes) {
        for (const auto& item : changes) {
            set_param(params, item.first.cast<std::string>(), item.second);
        }
        call([&] { return cairn_solver_set_params(solver_, &params); });
    }

    Ordering ordering_;
    std::unique_ptr<BorrowedStep> in_flight_;
    cairn_solver* solver_ = nullptr;
    std::mutex mutex_;
};

template <class Value, class Member> py::array_t<Value> column_of(const std::vector<cairn_evaluation>& islands, Member member) {
    py::array_t<Value> column(static_cast<py::ssize_t>(islands.size()));
    for (std::size_t i = 0; i < islands.size(); ++i) {
        column.mutable_at(static_cast<py::ssize_t>(i)) = islands[i].*member;
    }
    return column;
}

// (all as a dict of numbers, the islands as one of arrays, each body's island)
py::tuple evaluate(double dt, std::array<double, 3> gravity, const py::dict& bodies, const py::dict& contacts, const py::dict& joints,
                   const py::dict& rows, const py::dict& results) {
    const BorrowedStep borrowed(dt, gravity, bodies, contacts, joints, rows, results, Ordering{}, "results", false);
    cairn_evaluation whole = {};
    whole.struct_size = sizeof whole;
    std::vector<cairn_evaluation> islands(std::size_t{borrowed.bodies.count} + 1); // no more than bodies
    islands[0].struct_size = sizeof whole;
    py::array_t<std::int32_t> body_island(static_cast<py::ssize_t>(borrowed.bodies.count));
    std::int32_t* const each = body_island.mutable_data();
    std::size_t count = 0;
    {
        const py::gil_scoped_release release;
        check(cairn_evaluate(&borrowed.step, &borrowed.results, &whole, islands.data(), islands.size(), &count, each));
    }
    islands.resize(count);
    py::dict of_all = to_dict(whole, kEvaluation), of_islands;
    for (const auto& n : kEvaluation) {
        of_islands[n.name] = n.whole ? py::object(column_of<std::uint32_t>(islands, n.whole)) : column_of<double>(islands, n.real);
    }
    for (const Index& n : kIndices) {
        of_all[n.name] = whole.*(n.index);
        of_islands[n.name] = column_of<std::int32_t>(islands, n.index);
    }
    return py::make_tuple(of_all, of_islands, body_island);
}

std::string version_text(const std::uint32_t (&version)[3]) {
    return std::to_string(version[0]) + "." + std::to_string(version[1]) + "." + std::to_string(version[2]);
}

py::dict info() {
    cairn_info info = {};
    info.struct_size = sizeof info;
    check(cairn_get_info(&info));
    py::dict dict;
    dict["version"] = version_text(info.version);
    dict["abi_version"] = info.abi_version;
    dict["instructions"] = info.instructions;
    dict["build"] = info.build;
    dict["cuda"] = info.cuda;
    return dict;
}

std::vector<std::string> method_names() {
    std::vector<std::string> names;
    for (std::uint32_t method = 0; cairn_method_name(method); ++method) {
        names.emplace_back(cairn_method_name(method));
    }
    return names;
}

std::vector<std::string> reason_texts() {
    std::vector<std::string> texts;
    for (std::uint32_t reason = 0; cairn_reason_text(reason); ++reason) {
        texts.emplace_back(cairn_reason_text(reason));
    }
    return texts;
}

py::dict preset(std::uint32_t method, std::uint32_t preset) {
    cairn_params params = {};
    params.struct_size = sizeof params;
    check(cairn_params_preset(method, preset, &params));
    return to_dict(params, kParams);
}

std::array<std::uint32_t, 6> joint_axes(std::uint32_t joint) {
    std::array<std::uint32_t, 6> axes = {};
    check(cairn_joint_axes(joint, axes.data()));
    return axes;
}

// Of one velocity sweep; points by kind: torsional, special, frictional, smooth.
double sweep_bytes(const std::array<double, 4>& points, double manifolds, double joints, double bodies, double sides, bool pyramid,
                   bool manifold_blocks, bool reduces) {
    cairn::Traffic traffic;
    for (std::size_t kind = 0; kind < 4; ++kind) {
        traffic.points[kind] = points[kind];
    }
    traffic.manifolds = manifolds;
    traffic.joints = joints;
    traffic.bodies = bodies;
    traffic.movable_sides = sides;
    traffic.pyramid = pyramid;
    traffic.manifold_blocks = manifold_blocks;
    traffic.reduces = reduces;
    return cairn::sweep_bytes(traffic, false);
}

} // namespace
} // namespace cairn_python

PYBIND11_MODULE(_cairn, module) {
    using namespace cairn_python;
    module.doc() = "Cairn's C interface over NumPy arrays; use the package `cairn` instead.";

    static PyObject* error_type = PyErr_NewExceptionWithDoc(
        "cairn.Error", "The library refused or failed a call; `status` is its cairn_status.", PyExc_RuntimeError, nullptr);
    module.attr("Error") = py::handle(error_type);
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            std::rethrow_exception(thrown);
        } catch (const Error& error) {
            py::object value = py::handle(error_type)(error.what());
            value.attr("status") = error.status;
            PyErr_SetObject(error_type, value.ptr());
        }
    });

    module.attr("version") = version_text({CAIRN_VERSION_MAJOR, CAIRN_VERSION_MINOR, CAIRN_VERSION_PATCH});
    module.def("info", &info);
    module.def("method_names", &method_names);
    module.def("reason_texts", &reason_texts);
    module.def("preset", &preset, py::arg("method"), py::arg("preset"));
    module.def("joint_axes", &joint_axes, py::arg("joint"));
    module.def("evaluate", &evaluate, py::arg("dt"), py::arg("gravity"), py::arg("bodies"), py::arg("contacts"), py::arg("joints"),
               py::arg("rows"), py::arg("results"));
    module.def("sweep_bytes", &sweep_bytes, py::arg("points"), py::arg("manifolds"), py::arg("joints"), py::arg("bodies"), py::arg("sides"),
               py::arg("pyramid"), py::arg("manifold_blocks"), py::arg("reduces"),
               "Bytes that a velocity sweep moves, by core/scene/traffic.h. points: torsional, special, frictional, smooth.");
    py::class_<Solver>(module, "Solver")
        .def(py::init<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t, std::uintptr_t>(), py::arg("threads"),
             py::arg("instructions"), py::arg("precision"), py::arg("backend"), py::arg("executor"), py::arg("stream"))
        .def("load_preset", &Solver::load_preset, py::arg("method"), py::arg("preset"), py::arg("changes"))
        .def("set_params", &Solver::set_params, py::arg("changes"))
        .def("params", &Solver::params)
        .def("step", &Solver::step, py::arg("dt"), py::arg("gravity"), py::arg("bodies"), py::arg("contacts"), py::arg("joints"),
             py::arg("rows"), py::arg("out"))
        .def("step_async", &Solver::step_async, py::arg("dt"), py::arg("gravity"), py::arg("bodies"), py::arg("contacts"),
             py::arg("joints"), py::arg("rows"), py::arg("out"))
        .def("wait", &Solver::wait)
        .def("statistics", &Solver::statistics)
        .def("residual_trace", &Solver::residual_trace)
        .def("split_counts", &Solver::split_counts)
        .def("choices", &Solver::choices)
        .def("reset", &Solver::reset)
        .def("save_cache", &Solver::save_cache)
        .def("load_cache", &Solver::load_cache, py::arg("cache"));
}
