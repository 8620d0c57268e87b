// A product of second-order cones, x0 >= |x1|, of one or three dimensions, and the scaling of Nesterov and Todd between two points of it.
#pragma once
#include <Eigen/Core>

#include <vector>

namespace cairn::reference {

struct Cones {
    struct One {
        Eigen::Index begin, size;
    };
    std::vector<One> each;
    Eigen::Index size = 0;

    void add(Eigen::Index dimension) {
        each.push_back({size, dimension});
        size += dimension;
    }
    // e: 1 at the axis of each.
    Eigen::VectorXd identity() const;
    // Jordan algebra: x ∘ y, and y with l ∘ y = x.
    Eigen::VectorXd product(const Eigen::VectorXd& x, const Eigen::VectorXd& y) const;
    Eigen::VectorXd quotient(const Eigen::VectorXd& l, const Eigen::VectorXd& x) const;
    // How far one may go from x, inside, along d: infinity if for ever.
    double step(const Eigen::VectorXd& x, const Eigen::VectorXd& d) const;
};

// Symmetric W with W x = W^-1 z, by blocks of at most 3 x 3.
struct Scaling {
    Scaling(const Cones& cones, const Eigen::VectorXd& x, const Eigen::VectorXd& z);
    Eigen::VectorXd times(const Eigen::VectorXd& x) const { return apply(block, x); }
    Eigen::VectorXd solve(const Eigen::VectorXd& x) const { return apply(inverse, x); }
    // m + W^2
    void add_square(Eigen::MatrixXd& m) const;

  private:
    using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
    Eigen::VectorXd apply(const std::vector<Block>& blocks, const Eigen::VectorXd& x) const;
    const Cones& cones_;
    std::vector<Block> block, inverse;
};

} // namespace cairn::reference
