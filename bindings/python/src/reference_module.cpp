// The Python module `cairn._reference`: core/reference over NumPy arrays. cairn/reference.py says what it does.
#include <bilateral_problem.h>
#include <contact_problem.h>
#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>

namespace py = pybind11;
using cairn::reference::ContactProblem;
using cairn::reference::Residual;

namespace {

py::dict to_dict(const Residual& residual) {
    py::dict dict;
    dict["natural_map"] = residual.natural_map;
    dict["relative"] = residual.relative;
    return dict;
}

py::dict evaluate(Eigen::MatrixXd w, Eigen::VectorXd q, Eigen::VectorXd mu, const Eigen::VectorXd& impulse) {
    const ContactProblem problem{std::move(w), std::move(q), std::move(mu)};
    check(problem);
    return to_dict(cairn::reference::evaluate(problem, impulse));
}

py::dict solve(Eigen::MatrixXd w, Eigen::VectorXd q, Eigen::VectorXd mu, double tolerance) {
    const ContactProblem problem{std::move(w), std::move(q), std::move(mu)};
    cairn::reference::Solution solution;
    {
        const py::gil_scoped_release release;
        solution = cairn::reference::solve(problem, tolerance);
    }
    py::dict dict = to_dict(solution.residual);
    dict["impulse"] = solution.impulse;
    dict["convex_problems"] = solution.convex_problems;
    dict["interior_steps"] = solution.interior_steps;
    dict["newton_steps"] = solution.newton_steps;
    return dict;
}

py::dict solve_joints(Eigen::SparseMatrix<double> jacobian, Eigen::SparseMatrix<double> inverse_mass, Eigen::VectorXd free_velocity,
                      Eigen::VectorXd rhs, Eigen::VectorXd compliance, double tolerance) {
    const cairn::reference::BilateralProblem problem{std::move(jacobian), std::move(inverse_mass), std::move(free_velocity), std::move(rhs),
                                                     std::move(compliance)};
    cairn::reference::BilateralSolution solution;
    {
        const py::gil_scoped_release release;
        solution = cairn::reference::solve(problem, tolerance);
    }
    py::dict dict;
    dict["impulse"] = solution.impulse;
    dict["velocity"] = solution.velocity;
    dict["residual"] = solution.residual;
    dict["refinements"] = solution.refinements;
    return dict;
}

} // namespace

PYBIND11_MODULE(_reference, module) {
    module.doc() = "Cairn's reference solver over NumPy arrays; use the package `cairn.reference` instead.";
    module.def("evaluate", &evaluate, py::arg("W"), py::arg("q"), py::arg("mu"), py::arg("impulse"));
    module.def("solve", &solve, py::arg("W"), py::arg("q"), py::arg("mu"), py::arg("tolerance"));
    module.def("solve_joints", &solve_joints, py::arg("jacobian"), py::arg("inverse_mass"), py::arg("free_velocity"), py::arg("rhs"),
               py::arg("compliance"), py::arg("tolerance"));
}
