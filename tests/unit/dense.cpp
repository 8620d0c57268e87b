#include "dense.h"

#include <algorithm>
#include <cmath>

namespace cairn_test {

Eigen::Matrix<double, 6, 6> inverse_mass_matrix(const Body& body) {
    Eigen::Matrix<double, 6, 6> w = Eigen::Matrix<double, 6, 6>::Zero();
    const Mat3 r = body.orientation.toRotationMatrix();
    w.topLeftCorner<3, 3>() = (body.linear_factor.cwiseAbs2() * body.inverse_mass).asDiagonal();
    w.bottomRightCorner<3, 3>() =
        body.angular_factor.asDiagonal() * (r * body.inverse_inertia.asDiagonal() * r.transpose()) * body.angular_factor.asDiagonal();
    return w;
}

BiasRule BiasRule::of(const cairn_params& p, double dt) {
    BiasRule rule;
    rule.h = dt / p.substeps;
    rule.soft = p.method == CAIRN_METHOD_PJSOFT || p.method == CAIRN_METHOD_TJSOFT;
    const bool biased = p.method != CAIRN_METHOD_PJNJ;
    rule.baumgarte_contact = biased ? p.contact_baumgarte : 0;
    rule.baumgarte_joint = biased ? p.joint_baumgarte : 0;
    const double limit = p.hertz_limit / rule.h, turn = 2 * std::acos(-1.0);
    const double hertz = std::max(p.contact_hertz, p.contact_hertz_floor / rule.h);
    rule.contact_omega = turn * std::min(hertz, limit);
    rule.contact_omega_static = turn * std::min(hertz * p.static_hertz_scale, limit);
    rule.joint_omega = turn * std::min(p.joint_hertz, limit);
    rule.contact_zeta = p.contact_damping_ratio * hertz / p.contact_hertz;
    rule.joint_zeta = p.joint_damping_ratio;
    return rule;
}

void tangents_of(const Vec3& n, Vec3& t1, Vec3& t2) {
    t1 = (std::abs(n.x()) < 0.5 ? Vec3::UnitX() : Vec3::UnitY()).cross(n).normalized();
    t2 = n.cross(t1);
}

Dense::Dense(const Scene& scene, double h) {
    const auto n = static_cast<Eigen::Index>(scene.bodies.size());
    v_free.resize(6 * n);
    w = Mat::Zero(6 * n, 6 * n);
    j.resize(0, 6 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const Body& body = scene.bodies[static_cast<std::size_t>(i)];
        w.block<6, 6>(6 * i, 6 * i) = inverse_mass_matrix(body);
        Eigen::Matrix<double, 6, 1> wrench;
        wrench << body.force, body.torque;
        v_free.segment<3>(6 * i) = body.linear;
        v_free.segment<3>(6 * i + 3) = body.angular;
        v_free.segment<6>(6 * i) += h * (w.block<6, 6>(6 * i, 6 * i) * wrench);
        if (movable(body))
            v_free.segment<3>(6 * i) += h * scene.gravity;
    }
}

Eigen::Index Dense::new_rows(Eigen::Index count, int block_number, bool is_unilateral) {
    const Eigen::Index first = j.rows(), all = first + count;
    j.conservativeResize(all, Eigen::NoChange);
    j.bottomRows(count).setZero();
    bias.conservativeResize(all);
    gamma.conservativeResize(all);
    bias.tail(count).setZero();
    gamma.tail(count).setZero();
    block.resize(static_cast<std::size_t>(all), block_number);
    unilateral.resize(static_cast<std::size_t>(all), is_unilateral);
    return first;
}

void Dense::set_row(Eigen::Index row, int body, const Vec3& linear, const Vec3& angular) {
    if (body < 0)
        return;
    j.block<1, 3>(row, 6 * body) = linear.transpose();
    j.block<1, 3>(row, 6 * body + 3) = angular.transpose();
}

void Dense::add_contact(const Scene& scene, const Contact& c, const BiasRule& rule, bool friction, int block_number) {
    const Eigen::Index row = new_rows(friction ? 3 : 1, block_number, true);
    // both bodies are pushed at one point, half way between the surfaces
    const Vec3 half = 0.5 * c.separation * c.normal;
    const Vec3 at_a = c.arm_a + half, at_b = c.arm_b - half;
    Vec3 d[3] = {c.normal, {}, {}};
    tangents_of(c.normal, d[1], d[2]);
    for (Eigen::Index i = 0; i < (friction ? 3 : 1); ++i) {
        set_row(row + i, c.a, -d[i], -at_a.cross(d[i]));
        set_row(row + i, c.b, d[i], at_b.cross(d[i]));
        if (i > 0)
            unilateral[static_cast<std::size_t>(row + i)] = false;
    }
    if (c.separation > 0) {
        bias[row] = c.separation / rule.h;
    } else if (rule.soft) {
        const auto fixed = [&](int i) { return i < 0 || !movable(scene.bodies[static_cast<std::size_t>(i)]); };
        const double omega = fixed(c.a) || fixed(c.b) ? rule.contact_omega_static : rule.contact_omega;
        const double damping = 2 * rule.contact_zeta + rule.h * omega;
        bias[row] = c.separation * omega / damping;
        gamma[row] = effective(row) / (rule.h * omega * damping);
    } else {
        bias[row] = rule.baumgarte_contact * c.separation / rule.h;
    }
}

// Locked axes only; the angular errors must be zero (the rows then are a's axes, whatever the joint).
void Dense::add_joint(const Scene& scene, const Joint& joint, const BiasRule& rule, int block_number) {
    const Mat3 axes = frame_world(scene, joint.a, joint.frame_a).toRotationMatrix();
    const auto arm = [&](int i, const Vec3& anchor) {
        return i < 0 ? anchor : Vec3(scene.bodies[static_cast<std::size_t>(i)].orientation * anchor);
    };
    const Vec3 gap = joint_gap(scene, joint), at_b = arm(joint.b, joint.anchor_b), at_a = arm(joint.a, joint.anchor_a) + gap;
    for (int axis = 0; axis < 6; ++axis) {
        if (joint.axes[static_cast<std::size_t>(axis)] != CAIRN_AXIS_LOCKED)
            continue;
        const Eigen::Index row = new_rows(1, block_number, false);
        const Vec3 d = axes.col(axis % 3);
        double error = 0;
        if (axis < 3) {
            // the axes turn with a, so the exact derivative of d . gap has both arms end at b's anchor
            set_row(row, joint.a, -d, -at_a.cross(d));
            set_row(row, joint.b, d, at_b.cross(d));
            error = d.dot(gap);
        } else {
            set_row(row, joint.a, Vec3::Zero(), -d);
            set_row(row, joint.b, Vec3::Zero(), d);
        }
        if (rule.soft) {
            const double damping = 2 * rule.joint_zeta + rule.h * rule.joint_omega;
            bias[row] = error * rule.joint_omega / damping;
            gamma[row] = effective(row) / (rule.h * rule.joint_omega * damping);
        } else {
            bias[row] = rule.baumgarte_joint * error / rule.h;
        }
    }
}

Mat Dense::split(const std::vector<std::uint32_t>& counts) const {
    Mat scaled = w;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const auto at = static_cast<Eigen::Index>(6 * i);
        scaled.block<6, 6>(at, at) *= counts[i];
    }
    Mat d = j * scaled * j.transpose();
    for (Eigen::Index r = 0; r < d.rows(); ++r) {
        for (Eigen::Index c = 0; c < d.cols(); ++c) {
            if (block[static_cast<std::size_t>(r)] != block[static_cast<std::size_t>(c)])
                d(r, c) = 0;
        }
    }
    return d;
}

Vec Dense::solve_bilateral() const {
    Mat m = a();
    m.diagonal() += gamma;
    return m.completeOrthogonalDecomposition().solve(-q());
}

std::optional<Vec> Dense::solve_lcp() const {
    Mat m = a();
    m.diagonal() += gamma;
    const Vec rhs = q();
    const Eigen::Index n = m.rows();
    const double scale = 1 + rhs.cwiseAbs().maxCoeff();
    std::vector<Eigen::Index> free, bounded;
    for (Eigen::Index i = 0; i < n; ++i)
        (unilateral[static_cast<std::size_t>(i)] ? bounded : free).push_back(i);
    for (std::size_t set = 0; set < (std::size_t{1} << bounded.size()); ++set) {
        std::vector<Eigen::Index> active = free;
        for (std::size_t k = 0; k < bounded.size(); ++k) {
            if ((set >> k) & 1u)
                active.push_back(bounded[k]);
        }
        Vec lambda = Vec::Zero(n);
        if (!active.empty()) {
            const Mat sub = m(active, active);
            const Vec x = sub.completeOrthogonalDecomposition().solve(-rhs(active));
            if ((sub * x + rhs(active)).cwiseAbs().maxCoeff() > 1e-11 * scale)
                continue;
            for (std::size_t k = 0; k < active.size(); ++k)
                lambda[active[k]] = x[static_cast<Eigen::Index>(k)];
        }
        const Vec residual = m * lambda + rhs;
        const bool feasible = std::all_of(bounded.begin(), bounded.end(),
                                          [&](Eigen::Index i) { return lambda[i] > -1e-11 * scale && residual[i] > -1e-11 * scale; });
        if (feasible)
            return lambda;
    }
    return std::nullopt;
}

std::optional<std::uint32_t> Dense::sweeps_needed(const Vec& lambda, const std::vector<std::uint32_t>& counts, double shrink,
                                                  std::uint32_t most) const {
    std::vector<Eigen::Index> active;
    for (Eigen::Index i = 0; i < lambda.size(); ++i) {
        if (!unilateral[static_cast<std::size_t>(i)] || lambda[i] > 1e-9)
            active.push_back(i);
    }
    if (active.empty())
        return 50;
    Mat m = a(), d = split(counts);
    m.diagonal() += gamma;
    d.diagonal() += gamma;
    const Mat m_active = m(active, active), d_active = d(active, active);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Mat> pencil(m_active, d_active, Eigen::EigenvaluesOnly);
    double slowest = 1;
    for (const double e : pencil.eigenvalues()) {
        if (e > 1e-9)
            slowest = std::min(slowest, e); // what is smaller is A's null space, where nothing is to be done
    }
    const double sweeps = slowest >= 1 ? 1 : std::log(shrink) / std::log1p(-slowest);
    if (!(sweeps < most))
        return std::nullopt;
    return static_cast<std::uint32_t>(sweeps) + 50;
}

// Velocities of a scene in the order of Dense.
Vec velocities(const Scene& scene) {
    Vec v(static_cast<Eigen::Index>(6 * scene.bodies.size()));
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
        const auto at = static_cast<Eigen::Index>(6 * i);
        v.segment<3>(at) = scene.bodies[i].linear;
        v.segment<3>(at + 3) = scene.bodies[i].angular;
    }
    return v;
}

// ---- Random scenes ----

// Bodies that keep their angular velocity, so that a step's velocities are what its sweeps left.
Scene random_bodies(Random& random, int count) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    for (int i = 0; i < count; ++i) {
        Body body = random_body(random);
        body.flags = CAIRN_BODY_NO_GYROSCOPIC;
        body.force = random_vec(random, 2);
        body.torque = random_vec(random, 0.2);
        scene.add(body);
    }
    return scene;
}

// A tree of joints of random kinds, hung from the world by its first body, and one more that closes a loop.
// `gap`: how far apart the anchors are, in m.
void add_random_joints(Random& random, Scene& scene, double gap) {
    const auto join = [&](int a, int b, std::uint32_t kind) {
        const Vec3 between = 0.5 * (a < 0 ? Vec3::Zero() : scene.bodies[static_cast<std::size_t>(a)].position) +
                             0.5 * scene.bodies[static_cast<std::size_t>(b)].position;
        Joint& joint = scene.join(a, b, between + random_vec(random, 0.3), axes_of(kind), random_quat(random));
        joint.anchor_b += random_vec(random, gap);
    };
    const int count = static_cast<int>(scene.bodies.size());
    for (int i = 0; i < count; ++i) {
        const int parent = i == 0 ? CAIRN_WORLD : static_cast<int>(random() % static_cast<std::uint64_t>(i));
        join(parent, i, static_cast<std::uint32_t>(random() % 4));
    }
    if (count > 2)
        join(0, count - 1, CAIRN_JOINT_BALL);
}

// Random contacts between random bodies (and the world), in manifolds of one to four points with one normal.
void add_random_contacts(Random& random, Scene& scene, int count, double friction) {
    const int bodies = static_cast<int>(scene.bodies.size());
    while (count > 0) {
        const int b = static_cast<int>(random() % static_cast<std::uint64_t>(bodies));
        const int a = static_cast<int>(random() % static_cast<std::uint64_t>(bodies + 1)) - 1;
        if (a == b)
            continue;
        const Vec3 normal = random_unit(random), center_a = a < 0 ? Vec3::Zero() : scene.bodies[static_cast<std::size_t>(a)].position;
        for (int points = std::min(count, 1 + static_cast<int>(random() % 4)); points > 0; --points, --count) {
            Contact c;
            c.a = a;
            c.b = b;
            c.normal = normal;
            c.arm_a = random_vec(random, 0.5);
            c.separation = uniform(random, -0.02, 0.01);
            c.arm_b = center_a + c.arm_a + c.separation * normal - scene.bodies[static_cast<std::size_t>(b)].position;
            c.friction = friction;
            scene.contacts.push_back(c);
        }
    }
}

// The number of the block that each contact belongs to.
std::vector<int> contact_blocks(const Scene& scene, std::uint32_t splitting) {
    std::vector<int> blocks;
    int points = 0;
    for (std::size_t i = 0; i < scene.contacts.size(); ++i) {
        const Contact& c = scene.contacts[i];
        const bool same =
            i > 0 && splitting == CAIRN_SPLIT_MANIFOLD && points < 4 && c.a == scene.contacts[i - 1].a && c.b == scene.contacts[i - 1].b;
        points = same ? points + 1 : 1;
        blocks.push_back(same ? blocks.back() : static_cast<int>(i));
    }
    return blocks;
}

std::vector<std::uint32_t> block_counts(const Scene& scene, std::uint32_t splitting) {
    std::vector<std::uint32_t> counts(scene.bodies.size(), 0);
    const auto count = [&](int i) {
        if (i >= 0)
            ++counts[static_cast<std::size_t>(i)];
    };
    const std::vector<int> blocks = contact_blocks(scene, splitting);
    for (std::size_t i = 0; i < blocks.size(); ++i) {
        if (i > 0 && blocks[i] == blocks[i - 1])
            continue;
        count(scene.contacts[i].a);
        count(scene.contacts[i].b);
    }
    for (const Joint& joint : scene.joints) {
        count(joint.a);
        count(joint.b);
    }
    return counts;
}

} // namespace cairn_test
