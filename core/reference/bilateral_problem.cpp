#include "bilateral_problem.h"

#include <Eigen/SparseCholesky>

#include <cmath>
#include <stdexcept>
#include <string>

namespace cairn::reference {

namespace {

using Eigen::Index, Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

[[noreturn]] void refuse(const std::string& text) { throw std::invalid_argument(text); }

void check_finite(const VectorXd& values, const char* name) {
    for (Index i = 0; i < values.size(); ++i)
        if (!std::isfinite(values[i]))
            refuse(std::string(name) + "[" + std::to_string(i) + "] is not finite");
}
void check_finite(const Sparse& matrix, const char* name) {
    for (Index outer = 0; outer < matrix.outerSize(); ++outer)
        for (Sparse::InnerIterator it(matrix, outer); it; ++it)
            if (!std::isfinite(it.value()))
                refuse(std::string(name) + "[" + std::to_string(it.row()) + ", " + std::to_string(it.col()) + "] is not finite");
}
void check_size(Index found, Index wanted, const char* name, const char* why) {
    if (found != wanted)
        refuse(std::string(name) + " has " + std::to_string(found) + " elements: must have " + std::to_string(wanted) + ", " + why);
}

} // namespace

void check(const BilateralProblem& p) {
    const Index m = p.jacobian.rows(), n = p.jacobian.cols();
    if (p.inverse_mass.rows() != n || p.inverse_mass.cols() != n)
        refuse("inverse_mass has " + std::to_string(p.inverse_mass.rows()) + " x " + std::to_string(p.inverse_mass.cols()) +
               " elements: must have " + std::to_string(n) + " x " + std::to_string(n) + ", as the jacobian has columns");
    check_size(p.free_velocity.size(), n, "free_velocity", "as the jacobian has columns");
    check_size(p.rhs.size(), m, "rhs", "as the jacobian has rows");
    check_size(p.compliance.size(), m, "compliance", "as the jacobian has rows");
    check_finite(p.jacobian, "jacobian");
    check_finite(p.inverse_mass, "inverse_mass");
    check_finite(p.free_velocity, "free_velocity");
    check_finite(p.rhs, "rhs");
    check_finite(p.compliance, "compliance");
    for (Index i = 0; i < m; ++i)
        if (!(p.compliance[i] >= 0))
            refuse("compliance[" + std::to_string(i) + "] is " + std::to_string(p.compliance[i]) + ": must be >= 0");
    const Sparse skew = p.inverse_mass - Sparse(p.inverse_mass.transpose());
    double largest = 0;
    for (Index outer = 0; outer < p.inverse_mass.outerSize(); ++outer)
        for (Sparse::InnerIterator it(p.inverse_mass, outer); it; ++it)
            largest = std::max(largest, std::abs(it.value()));
    for (Index outer = 0; outer < skew.outerSize(); ++outer)
        for (Sparse::InnerIterator it(skew, outer); it; ++it)
            if (std::abs(it.value()) > 1e-9 * largest)
                refuse("inverse_mass[" + std::to_string(it.row()) + ", " + std::to_string(it.col()) +
                       "] differs from what is across the diagonal: it must be symmetric");
}

BilateralSolution solve(const BilateralProblem& p, double tolerance) {
    constexpr double shift = 1e-11;
    constexpr int most = 200, patience = 4; // refinements in which the residual must halve
    check(p);
    const Index m = p.jacobian.rows();
    BilateralSolution found;
    found.impulse = VectorXd::Zero(m);
    found.velocity = p.free_velocity;
    if (m == 0)
        return found;

    const Sparse spread = p.inverse_mass * Sparse(p.jacobian.transpose()); // M^-1 J^T
    Sparse a = p.jacobian * spread;
    const VectorXd diagonal = VectorXd(a.diagonal()) + p.compliance;
    VectorXd scale(m); // 1 / sqrt(A_ii); rows that nothing answers to stay as they are
    for (Index i = 0; i < m; ++i)
        scale[i] = diagonal[i] > 0 ? 1 / std::sqrt(diagonal[i]) : 1;
    a = scale.asDiagonal() * a * scale.asDiagonal();
    Sparse shifted(m, m);
    shifted.setIdentity();
    for (Index i = 0; i < m; ++i)
        shifted.coeffRef(i, i) = shift + p.compliance[i] * scale[i] * scale[i];
    shifted += a;
    const Eigen::SimplicialLDLT<Sparse> factor(shifted);
    if (factor.info() != Eigen::Success)
        refuse("inverse_mass is not positive semidefinite: J M^-1 J^T has no LDL^T");

    const auto left = [&](const VectorXd& x, VectorXd& velocity) -> VectorXd { // of the rows, scaled
        const VectorXd impulse = scale.cwiseProduct(x);
        velocity = p.free_velocity + spread * impulse;
        return scale.cwiseProduct(p.rhs - p.jacobian * velocity - p.compliance.cwiseProduct(impulse));
    };
    VectorXd x = VectorXd::Zero(m), residual = left(x, found.velocity);
    const double start = residual.norm();
    double best_before = start;
    for (int k = 1; k <= most && residual.norm() > tolerance * start; ++k) {
        VectorXd velocity;
        const VectorXd next = x + factor.solve(residual), next_residual = left(next, velocity);
        if (!(next_residual.norm() < residual.norm()))
            break;
        x = next;
        residual = next_residual;
        found.velocity = velocity;
        found.refinements = k;
        if (k % patience == 0) {
            if (residual.norm() > best_before / 2)
                break;
            best_before = residual.norm();
        }
    }
    found.impulse = scale.cwiseProduct(x);
    found.residual = residual.cwiseQuotient(scale).cwiseAbs().maxCoeff();
    return found;
}

} // namespace cairn::reference
