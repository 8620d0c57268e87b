// Frictional contact problems, solved to rounding: what the solver's own answers are measured against. Double precision, dense, for
// problems of up to some hundred contacts; shares no code with the solver.
#pragma once
#include <Eigen/Core>

namespace cairn::reference {

// In local form, as FCLIB has it: u = W r + q with the contacts' relative velocities u and impulses r, normal first, then two tangents.
// Coulomb's law is K ∋ r ⟂ u + mu |u_t| n ∈ K* (De Saxcé and Feng 1998) with the friction cones K.
struct ContactProblem {
    Eigen::MatrixXd W;  // [3 n, 3 n] Delassus operator, symmetric and positive semidefinite, 1/kg
    Eigen::VectorXd q;  // [3 n] m/s
    Eigen::VectorXd mu; // [n] >= 0

    Eigen::Index contacts() const { return mu.size(); }
};

struct Residual {
    double natural_map; // |r - P_K(r - (u + mu |u_t| n))|, as the numbers come, N s and m/s mixed
    double relative;    // the same with r sqrt(D) and u / sqrt(D), D = trace(W_ii) / 3 of each contact, over |q / sqrt(D)|: no unit
};

struct Solution {
    Eigen::VectorXd impulse; // r; where W is singular one of many
    Residual residual;
    int convex_problems = 0, interior_steps = 0, newton_steps = 0;
};

// Throws std::invalid_argument for sizes that do not fit, a number that is not finite, mu < 0, W not symmetric or a contact between
// bodies that cannot move.
void check(const ContactProblem& problem);

Residual evaluate(const ContactProblem& problem, const Eigen::VectorXd& impulse);

// Until residual.relative <= tolerance, or no more progress is made (about 1e-15). With |u_t| held fixed the problem is convex: a
// primal-dual interior-point method with Nesterov-Todd scaling solves it, the slip is updated (Acary, Cadoux, Lemarechal and Malick 2011),
// and from there a semismooth Newton method on the natural map, damped as Levenberg and Marquardt, goes to rounding.
Solution solve(const ContactProblem& problem, double tolerance = 1e-12);

} // namespace cairn::reference
