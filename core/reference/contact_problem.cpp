#include "contact_problem.h"

#include "cones.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace cairn::reference {

namespace {

using Eigen::Index, Eigen::Matrix3d, Eigen::MatrixXd, Eigen::Vector2d, Eigen::Vector3d, Eigen::VectorXd;

// P_K of one contact's cone, and where it is smooth its derivative.
Vector3d project(const Vector3d& y, double mu, Matrix3d* derivative = nullptr) {
    const Vector2d t = y.tail<2>();
    const double length = t.norm();
    if (derivative)
        derivative->setZero();
    if (length <= mu * y[0]) {
        if (derivative)
            derivative->setIdentity();
        return y;
    }
    if (mu * length <= -y[0])
        return Vector3d::Zero();
    const double normal = (y[0] + mu * length) / (1 + mu * mu);
    const Vector2d along = t / length;
    if (derivative) {
        const double share = 1 / (1 + mu * mu);
        (*derivative)(0, 0) = share;
        derivative->block<1, 2>(0, 1) = mu * share * along.transpose();
        derivative->block<2, 1>(1, 0) = mu * share * along;
        derivative->block<2, 2>(1, 1) =
            mu * mu * share * along * along.transpose() + mu * normal / length * (Eigen::Matrix2d::Identity() - along * along.transpose());
    }
    return {normal, mu * normal * along[0], mu * normal * along[1]};
}

// The problem in variables without unit: r = scale x, so that W_ii has trace 3, and |q| = 1.
struct Scaled {
    ContactProblem problem;
    VectorXd root; // sqrt(D) by row
    double size;   // |q / sqrt(D)|

    explicit Scaled(const ContactProblem& given) : root(given.q.size()) {
        const Index n = given.contacts();
        for (Index i = 0; i < n; ++i)
            root.segment<3>(3 * i).setConstant(std::sqrt(given.W.block<3, 3>(3 * i, 3 * i).trace() / 3));
        const VectorXd inverse = root.cwiseInverse();
        size = given.q.cwiseProduct(inverse).norm();
        problem.W = inverse.asDiagonal() * (0.5 * (given.W + given.W.transpose())) * inverse.asDiagonal();
        problem.q = given.q.cwiseProduct(inverse) / (size > 0 ? size : 1);
        problem.mu = given.mu;
    }
    VectorXd to_scaled(const VectorXd& r) const { return r.cwiseProduct(root) / (size > 0 ? size : 1); }
    VectorXd from_scaled(const VectorXd& x) const { return x.cwiseQuotient(root) * size; }
};

// r - P_K(r - (u + mu |u_t| n)); with its derivative if wanted.
VectorXd natural_map(const ContactProblem& p, const VectorXd& r, MatrixXd* derivative = nullptr) {
    const VectorXd u = p.W * r + p.q;
    VectorXd map(r.size());
    if (derivative)
        derivative->setIdentity(r.size(), r.size());
    for (Index i = 0; i < p.contacts(); ++i) {
        const Index at = 3 * i;
        const double mu = p.mu[i], slip = u.segment<2>(at + 1).norm();
        Vector3d y = r.segment<3>(at) - u.segment<3>(at);
        y[0] -= mu * slip;
        Matrix3d dp;
        map.segment<3>(at) = r.segment<3>(at) - project(y, mu, derivative ? &dp : nullptr);
        if (!derivative)
            continue;
        Eigen::Matrix<double, 3, Eigen::Dynamic> dy = -p.W.middleRows<3>(at);
        if (slip > 0)
            dy.row(0) -= mu * (u[at + 1] / slip * p.W.row(at + 1) + u[at + 2] / slip * p.W.row(at + 2));
        dy.middleCols<3>(at) += Matrix3d::Identity();
        derivative->middleRows<3>(at) -= dp * dy;
    }
    return map;
}

// min 1/2 x'Wx + (q + mu s n)'x over the cones, the slip s given: a Lorentz cone in (mu x_n, x_t); without friction x_n alone.
class ConvexProblem {
  public:
    explicit ConvexProblem(const ContactProblem& p) : p_(p) {
        for (Index i = 0; i < p.contacts(); ++i) {
            const bool frictional = p.mu[i] > 0;
            cones_.add(frictional ? 3 : 1);
            row_.push_back(3 * i);
            scale_.push_back(frictional ? 1 / p.mu[i] : 1);
            for (Index c = 1; frictional && c < 3; ++c) {
                row_.push_back(3 * i + c);
                scale_.push_back(1);
            }
        }
        const Index size = cones_.size;
        matrix_.resize(size, size);
        for (Index j = 0; j < size; ++j)
            for (Index i = 0; i < size; ++i)
                matrix_(i, j) = scale_[at(i)] * p.W(row_[at(i)], row_[at(j)]) * scale_[at(j)];
        x_ = z_ = cones_.identity();
    }

    // Impulses of the problem whose slip is `slip`; starts cold, as a warm start lies too near the boundary.
    VectorXd solve(const VectorXd& slip, int& steps) {
        constexpr int most = 60;
        constexpr double enough = 1e-7; // Newton's method does the rest
        const Index n = p_.contacts(), size = cones_.size;
        VectorXd b(size);
        for (Index i = 0; i < size; ++i)
            b[i] = scale_[at(i)] * (p_.q[row_[at(i)]] + (row_[at(i)] % 3 == 0 ? p_.mu[row_[at(i)] / 3] * slip[row_[at(i)] / 3] : 0.0));
        const VectorXd e = cones_.identity();
        x_ = z_ = e * std::max(b.cwiseAbs().maxCoeff(), 1e-30);
        for (int k = 0; k < most; ++k, ++steps) {
            const VectorXd dual = matrix_ * x_ + b - z_;
            const double gap = x_.dot(z_) / static_cast<double>(n);
            if (gap < enough * enough && dual.norm() < enough)
                break;
            const Scaling scaling(cones_, x_, z_);
            MatrixXd normal = matrix_;
            scaling.add_square(normal);
            const Eigen::LLT<MatrixXd> factor(normal);
            if (factor.info() != Eigen::Success)
                break; // as near as doubles go
            VectorXd dx, dz;
            const auto direction = [&](const VectorXd& wanted) {
                const VectorXd right = scaling.times(wanted) - dual;
                dx = factor.solve(right);
                dx += factor.solve(right - normal * dx);
                dz = scaling.times(wanted - scaling.times(dx));
            };
            const VectorXd point = scaling.times(x_);
            direction(-point);
            const double reach = std::min({1.0, cones_.step(x_, dx), cones_.step(z_, dz)});
            const double predicted = (x_ + reach * dx).dot(z_ + reach * dz) / static_cast<double>(n);
            const double centre = std::pow(std::clamp(predicted / gap, 0.0, 1.0), 3); // Mehrotra
            const VectorXd second = cones_.product(scaling.times(dx), scaling.solve(dz));
            direction(cones_.quotient(point, centre * gap * e - cones_.product(point, point) - second));
            const double length = std::min({1.0, 0.99 * cones_.step(x_, dx), 0.99 * cones_.step(z_, dz)});
            const VectorXd x = x_ + length * dx, z = z_ + length * dz;
            if (!x.allFinite() || !z.allFinite())
                break;
            x_ = x;
            z_ = z;
        }
        VectorXd r = VectorXd::Zero(3 * n);
        for (Index i = 0; i < size; ++i)
            r[row_[at(i)]] = scale_[at(i)] * x_[i];
        return r;
    }

  private:
    static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
    const ContactProblem& p_;
    Cones cones_;
    std::vector<Index> row_; // of the problem, by row of the cones
    std::vector<double> scale_;
    MatrixXd matrix_;
    VectorXd x_, z_;
};

// Newton on |natural map|^2 from r, in place; returns the norm that it ends with.
double polish(const ContactProblem& p, VectorXd& r, double tolerance, int& steps) {
    constexpr int most = 100, patience = 6; // steps in which the norm must halve
    double damping = 1e-10, best_before = std::numeric_limits<double>::infinity();
    MatrixXd derivative;
    VectorXd map = natural_map(p, r, &derivative);
    double norm = map.norm();
    for (int k = 0; k < most && norm > tolerance; ++k, ++steps) {
        if (k % patience == 0) {
            if (norm > best_before / 2)
                break;
            best_before = norm;
        }
        const VectorXd gradient = derivative.transpose() * map;
        const MatrixXd square = derivative.transpose() * derivative;
        VectorXd next, next_map;
        double length = 0;
        for (; damping < 1e4; damping *= 10) {
            MatrixXd damped = square;
            damped.diagonal().array() += damping;
            const VectorXd step = damped.ldlt().solve(-gradient);
            for (length = 1; length > 0.05; length /= 2) {
                next = r + length * step;
                next_map = natural_map(p, next);
                if (next_map.norm() < norm * (1 - 1e-4 * length))
                    break;
            }
            if (length > 0.05)
                break;
        }
        if (!(length > 0.05))
            break;
        if (length == 1)
            damping = std::max(damping / 10, 1e-18);
        r = next;
        map = natural_map(p, r, &derivative);
        norm = map.norm();
    }
    return norm;
}

} // namespace

void check(const ContactProblem& p) {
    const Index n = p.contacts();
    const auto refuse = [](const std::string& text) { throw std::invalid_argument(text); };
    if (p.q.size() != 3 * n || p.W.rows() != 3 * n || p.W.cols() != 3 * n)
        refuse("W has " + std::to_string(p.W.rows()) + " x " + std::to_string(p.W.cols()) + " elements and q " +
               std::to_string(p.q.size()) + ": with " + std::to_string(n) + " coefficients mu they must have " + std::to_string(3 * n) +
               " rows");
    for (Index i = 0; i < n; ++i)
        if (!(p.mu[i] >= 0 && std::isfinite(p.mu[i])))
            refuse("mu[" + std::to_string(i) + "] is " + std::to_string(p.mu[i]) + ": must be finite and >= 0");
    for (Index i = 0; i < 3 * n; ++i)
        if (!std::isfinite(p.q[i]))
            refuse("q[" + std::to_string(i) + "] is not finite");
    const double largest = n > 0 ? p.W.cwiseAbs().maxCoeff() : 0;
    for (Index j = 0; j < 3 * n; ++j)
        for (Index i = 0; i < 3 * n; ++i) {
            const std::string where = "W[" + std::to_string(i) + ", " + std::to_string(j) + "]";
            if (!std::isfinite(p.W(i, j)))
                refuse(where + " is not finite");
            if (std::abs(p.W(i, j) - p.W(j, i)) > 1e-9 * largest)
                refuse(where + " is " + std::to_string(p.W(i, j)) + ", and across the diagonal " + std::to_string(p.W(j, i)) +
                       ": W must be symmetric");
        }
    for (Index i = 0; i < n; ++i)
        if (!(p.W.block<3, 3>(3 * i, 3 * i).trace() > 0))
            refuse("contact " + std::to_string(i) + ": the trace of its block of W is not positive: neither of its bodies can move");
}

Residual evaluate(const ContactProblem& problem, const VectorXd& impulse) {
    if (impulse.size() != 3 * problem.contacts())
        throw std::invalid_argument("the impulse has " + std::to_string(impulse.size()) + " elements: must have " +
                                    std::to_string(3 * problem.contacts()));
    const Scaled scaled(problem);
    return {natural_map(problem, impulse).norm(), natural_map(scaled.problem, scaled.to_scaled(impulse)).norm()};
}

Solution solve(const ContactProblem& problem, double tolerance) {
    constexpr int most_problems = 100;
    check(problem);
    Solution found;
    found.impulse = VectorXd::Zero(problem.q.size());
    const Scaled scaled(problem);
    const Index n = problem.contacts();
    if (scaled.size == 0 || n == 0) {
        found.residual = {0, 0};
        return found;
    }
    ConvexProblem convex(scaled.problem);
    VectorXd slip = VectorXd::Zero(n), best;
    double best_norm = std::numeric_limits<double>::infinity();
    while (best_norm > tolerance && found.convex_problems < most_problems) {
        VectorXd x = convex.solve(slip, found.interior_steps);
        ++found.convex_problems;
        const VectorXd u = scaled.problem.W * x + scaled.problem.q;
        double change = 0;
        for (Index i = 0; i < n; ++i) {
            const double now = u.segment<2>(3 * i + 1).norm();
            change = std::max(change, std::abs(now - slip[i]));
            slip[i] = now;
        }
        const double norm = polish(scaled.problem, x, tolerance, found.newton_steps);
        if (norm < best_norm) {
            best_norm = norm;
            best = x;
        }
        if (change < 1e-9 && found.convex_problems > 1)
            break; // the fixed point is reached: more of the same would not help
    }
    found.impulse = scaled.from_scaled(best);
    found.residual = evaluate(problem, found.impulse);
    return found;
}

} // namespace cairn::reference
