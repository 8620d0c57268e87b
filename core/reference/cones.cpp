#include "cones.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::reference {

namespace {

using Eigen::VectorXd;
using Small = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;

// x0^2 - |x1|^2 without cancellation.
template <class X> double determinant(const X& x) {
    const double rest = x.tail(x.size() - 1).norm();
    return (x[0] - rest) * (x[0] + rest);
}

// The smallest t > 0 with x + t d on the boundary, or infinity.
template <class X, class D> double to_boundary(const X& x, const D& d) {
    constexpr double never = std::numeric_limits<double>::infinity();
    const Eigen::Index rest = x.size() - 1;
    const double a = determinant(d), b = x[0] * d[0] - x.tail(rest).dot(d.tail(rest)), c = determinant(x);
    double found = d[0] < 0 ? -x[0] / d[0] : never; // the axis must not turn
    const double under = b * b - a * c;             // a t^2 + 2 b t + c = 0
    if (under < 0)
        return found;
    const double sum = -(b + std::copysign(std::sqrt(under), b));
    for (const double t : {a != 0 ? sum / a : never, sum != 0 ? c / sum : never})
        if (t > 0)
            found = std::min(found, t);
    return found;
}

} // namespace

VectorXd Cones::identity() const {
    VectorXd e = VectorXd::Zero(size);
    for (const One& one : each)
        e[one.begin] = 1;
    return e;
}

VectorXd Cones::product(const VectorXd& x, const VectorXd& y) const {
    VectorXd out(size);
    for (const One& one : each) {
        const auto a = x.segment(one.begin, one.size), b = y.segment(one.begin, one.size);
        out[one.begin] = a.dot(b);
        out.segment(one.begin + 1, one.size - 1) = a[0] * b.tail(one.size - 1) + b[0] * a.tail(one.size - 1);
    }
    return out;
}

VectorXd Cones::quotient(const VectorXd& l, const VectorXd& x) const {
    VectorXd out(size);
    for (const One& one : each) {
        const auto a = l.segment(one.begin, one.size), b = x.segment(one.begin, one.size);
        const Eigen::Index rest = one.size - 1;
        const double first = (a[0] * b[0] - a.tail(rest).dot(b.tail(rest))) / determinant(a);
        out[one.begin] = first;
        out.segment(one.begin + 1, rest) = (b.tail(rest) - a.tail(rest) * first) / a[0];
    }
    return out;
}

double Cones::step(const VectorXd& x, const VectorXd& d) const {
    double found = std::numeric_limits<double>::infinity();
    for (const One& one : each)
        found = std::min(found, to_boundary(x.segment(one.begin, one.size), d.segment(one.begin, one.size)));
    return found;
}

Scaling::Scaling(const Cones& cones, const VectorXd& x, const VectorXd& z) : cones_(cones) {
    for (const Cones::One& one : cones.each) {
        const auto at = [&](const VectorXd& from) { return Small(from.segment(one.begin, one.size)); };
        const double det_x = std::sqrt(determinant(at(x))), det_z = std::sqrt(determinant(at(z)));
        Small flip = Small::Constant(one.size, -1); // J
        flip[0] = 1;
        const Small xn = at(x) / det_x, zn = at(z) / det_z;
        const Small w = (zn + flip.cwiseProduct(xn)) / (2 * std::sqrt((1 + xn.dot(zn)) / 2));
        Small v = w;
        v[0] += 1;
        v /= std::sqrt(2 * (w[0] + 1));
        const Small u = flip.cwiseProduct(v);
        const double eta = std::sqrt(det_z / det_x);
        const Block j = flip.asDiagonal();
        block.push_back(eta * (2 * v * v.transpose() - j));
        inverse.push_back((2 * u * u.transpose() - j) / eta);
    }
}

void Scaling::add_square(Eigen::MatrixXd& m) const {
    for (std::size_t i = 0; i < block.size(); ++i) {
        const Cones::One& one = cones_.each[i];
        m.block(one.begin, one.begin, one.size, one.size) += block[i] * block[i];
    }
}

VectorXd Scaling::apply(const std::vector<Block>& blocks, const VectorXd& x) const {
    VectorXd out(x.size());
    for (std::size_t i = 0; i < blocks.size(); ++i) {
        const Cones::One& one = cones_.each[i];
        out.segment(one.begin, one.size) = blocks[i] * x.segment(one.begin, one.size);
    }
    return out;
}

} // namespace cairn::reference
