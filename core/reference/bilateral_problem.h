// Joints alone, solved to rounding: equality rows over bodies, by a sparse LDL^T. Double precision; shares no code with the solver.
#pragma once
#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace cairn::reference {

// J v + compliance lambda = rhs,   v = v_free + M^-1 J^T lambda
struct BilateralProblem {
    Eigen::SparseMatrix<double> jacobian;     // [m, n]
    Eigen::SparseMatrix<double> inverse_mass; // [n, n] M^-1, symmetric and positive semidefinite
    Eigen::VectorXd free_velocity;            // [n]
    Eigen::VectorXd rhs;                      // [m] target of J v
    Eigen::VectorXd compliance;               // [m] >= 0
};

struct BilateralSolution {
    Eigen::VectorXd impulse;  // lambda; where rows depend on each other one of many
    Eigen::VectorXd velocity; // v, the only one
    double residual = 0;      // the largest |J v + compliance lambda - rhs|; not small where rows contradict each other
    int refinements = 0;
};

// Throws std::invalid_argument for sizes that do not fit, a number that is not finite or compliance < 0.
void check(const BilateralProblem& problem);

// A lambda = rhs - J v_free with A = J M^-1 J^T + compliance, its rows scaled to a diagonal of 1. Rows that depend on each other leave A
// singular, so A + 1e-11 is factored, and lambda refined with the residual of A itself (the proximal point method) for as long as that
// falls, at most to `tolerance` of what it was at the start.
BilateralSolution solve(const BilateralProblem& problem, double tolerance = 1e-14);

} // namespace cairn::reference
