// The rows of a step as dense matrices in double, written from the equations alone (paper eq. 6-24), and their exact
// solutions. It shares nothing with the library: this is what the solver is checked against.
//
//   J v + bias + gamma lambda = 0 or its complementarity,  v = v_free + W J^T lambda,  A = J W J^T
#pragma once
#include "scene.h"

#include <optional>

namespace cairn_test {

using Vec = Eigen::VectorXd;
using Mat = Eigen::MatrixXd;

// W = F M^-1 F of one body, in world axes.
Eigen::Matrix<double, 6, 6> inverse_mass_matrix(const Body& body);

// How a method turns a position error into a bias; h is the substep.
struct BiasRule {
    double h = 0;
    bool soft = false;
    double baumgarte_contact = 0, baumgarte_joint = 0;
    double contact_omega = 0, contact_omega_static = 0, contact_zeta = 1, joint_omega = 0, joint_zeta = 1;

    static BiasRule of(const cairn_params& p, double dt);
};

struct Dense {
    Vec v_free;             // 6 a body: linear, angular
    Mat w;                  // block diagonal
    Mat j;                  // rows by 6 bodies
    Vec bias, gamma;        // a row
    std::vector<int> block; // a row: rows of one block have one number
    std::vector<bool> unilateral;

    explicit Dense(const Scene& scene, double h);
    void add_contact(const Scene& scene, const Contact& contact, const BiasRule& rule, bool friction, int block_number);
    void add_joint(const Scene& scene, const Joint& joint, const BiasRule& rule, int block_number);

    Mat a() const { return j * w * j.transpose(); }
    Vec q() const { return j * v_free + bias; }
    Vec velocity(const Vec& lambda) const { return v_free + w * j.transpose() * lambda; }
    // The majoriser: blocks of K_split = n_a J_a W_a J_a^T + n_b J_b W_b J_b^T (paper eq. 19).
    Mat split(const std::vector<std::uint32_t>& counts) const;
    // (A + Gamma) lambda = -q, of least norm where A is singular.
    Vec solve_bilateral() const;
    // 0 <= lambda, w = (A + Gamma) lambda + q >= 0, complementary on unilateral rows; by enumeration.
    std::optional<Vec> solve_lcp() const;
    // Sweeps of lambda+ = lambda - D^-1 (A lambda + q) that shrink every error by `shrink` in the rows that act in the solution
    // `lambda`; none if that is more than `most`.
    std::optional<std::uint32_t> sweeps_needed(const Vec& lambda, const std::vector<std::uint32_t>& counts, double shrink,
                                               std::uint32_t most) const;
    // The largest |(A + Gamma) lambda + q|: not small where the rows contradict each other and have no solution.
    double residual(const Vec& lambda) const { return (a() * lambda + gamma.cwiseProduct(lambda) + q()).cwiseAbs().maxCoeff(); }

  private:
    Eigen::Index new_rows(Eigen::Index count, int block_number, bool is_unilateral);
    void set_row(Eigen::Index row, int body, const Vec3& linear, const Vec3& angular);
    double effective(Eigen::Index row) const { return j.row(row).dot(w * j.row(row).transpose()); }
};

// Two tangents of a normal, any two: the tests that use them look at what does not depend on the choice.
void tangents_of(const Vec3& n, Vec3& t1, Vec3& t2);
// Velocities of a scene in the order of Dense.
Vec velocities(const Scene& scene);

// ---- Random scenes ----

// Bodies that keep their angular velocity, so that a step's velocities are what its sweeps left.
Scene random_bodies(Random& random, int count);
// A tree of joints of random kinds, hung from the world by its first body, and one more that closes a loop.
// `gap`: how far apart the anchors are, in m.
void add_random_joints(Random& random, Scene& scene, double gap);
// Random contacts between random bodies (and the world), in manifolds of one to four points with one normal.
void add_random_contacts(Random& random, Scene& scene, int count, double friction);
// The number of the block that each contact belongs to.
std::vector<int> contact_blocks(const Scene& scene, std::uint32_t splitting);
// n_i of eq. 19: the blocks of a scene's contacts and joints that touch each body.
std::vector<std::uint32_t> block_counts(const Scene& scene, std::uint32_t splitting);

} // namespace cairn_test
