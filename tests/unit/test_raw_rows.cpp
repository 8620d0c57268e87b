// Raw rows say what native constraints say: a ball joint, a contact with friction, a motor, a spring.
#include "dense.h"
#include "methods.h"

namespace cairn_test {
namespace {

Row row_for(int a, int b, const Vec3& arm_a, const Vec3& arm_b, const Vec3& direction) {
    Row row;
    row.a = a;
    row.b = b;
    row.jacobian_a << -direction, -arm_a.cross(direction);
    row.jacobian_b << direction, arm_b.cross(direction);
    return row;
}

TEST(RawRows, ABallJointWrittenOutIsTheNativeOne) {
    for (const std::uint32_t precision : {32u, 64u}) {
        for (std::uint64_t seed = 1; seed <= 5; ++seed) {
            Random random(seed);
            Scene native = random_bodies(random, 3);
            native.join(0, 1, random_vec(random, 0.3), axes_of(CAIRN_JOINT_BALL), random_quat(random)).anchor_b += random_vec(random, 0.01);
            native.join(CAIRN_WORLD, 0, random_vec(random, 0.3), axes_of(CAIRN_JOINT_BALL));
            Scene raw = native;
            cairn_params params = plain(CAIRN_METHOD_PJ, 4000);
            for (const Joint& joint : native.joints) {
                const Mat3 frame = frame_world(native, joint.a, joint.frame_a).toRotationMatrix();
                const Vec3 at = anchor_world(native, joint.b, joint.anchor_b), gap = joint_gap(native, joint);
                const auto arm = [&](int i) { return i < 0 ? at : Vec3(at - native.bodies[static_cast<std::size_t>(i)].position); };
                for (int i = 0; i < 3; ++i) {
                    Row row = row_for(joint.a, joint.b, arm(joint.a), arm(joint.b), frame.col(i));
                    row.rhs = -params.joint_baumgarte * frame.col(i).dot(gap) / native.dt;
                    raw.rows.push_back(row);
                }
            }
            raw.joints.clear();
            const Solver solver(precision);
            check(cairn_solver_set_params(solver.get(), &params));
            const Impulses of_joints = native.step(solver), of_rows = raw.step(solver);
            const double tolerance = precision == 64 ? 1e-9 : 1e-4;
            EXPECT_LT((velocities(native) - velocities(raw)).cwiseAbs().maxCoeff(), tolerance) << "seed " << seed;
            for (std::size_t i = 0; i < 2; ++i) {
                for (std::size_t k = 0; k < 3; ++k)
                    EXPECT_NEAR(of_joints.joint[6 * i + k], of_rows.row[3 * i + k], 10 * tolerance);
            }
        }
    }
}

// As in recorded contact problems: a normal row and two friction rows that point at it.
TEST(RawRows, FrictionRowsAreAContact) {
    int sliding = 0, sticking = 0;
    for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
        for (std::uint64_t seed = 1; seed <= 8; ++seed) {
            Random random(seed);
            Scene native = random_bodies(random, 3);
            add_random_contacts(random, native, 4, seed % 2 != 0 ? 0.2 : 1.0);
            // one point a pair, so that raw blocks and contacts are split alike
            for (std::size_t i = native.contacts.size(); i-- > 1;) {
                if (native.contacts[i].a == native.contacts[i - 1].a && native.contacts[i].b == native.contacts[i - 1].b) {
                    native.contacts.erase(native.contacts.begin() + static_cast<std::ptrdiff_t>(i));
                }
            }
            Scene raw = native;
            cairn_params params = plain(CAIRN_METHOD_PJ, 20000);
            params.acceleration = acceleration;
            const BiasRule rule = BiasRule::of(params, native.dt);
            for (std::size_t i = 0; i < native.contacts.size(); ++i) {
                const Contact& c = native.contacts[i];
                const Vec3 half = 0.5 * c.separation * c.normal, at_a = c.arm_a + half, at_b = c.arm_b - half;
                Vec3 d[3] = {c.normal, {}, {}};
                tangents_of(c.normal, d[1], d[2]);
                for (int k = 0; k < 3; ++k) {
                    Row row = row_for(c.a, c.b, at_a, at_b, d[k]);
                    row.block = static_cast<std::uint32_t>(i);
                    if (k == 0) {
                        row.lower = 0;
                        row.rhs = -(c.separation > 0 ? 1 : rule.baumgarte_contact) * c.separation / native.dt;
                    } else {
                        row.friction_index = static_cast<int>(3 * i);
                        row.friction = c.friction;
                    }
                    raw.rows.push_back(row);
                }
            }
            raw.contacts.clear();
            const Solver solver(64);
            check(cairn_solver_set_params(solver.get(), &params));
            const Impulses of_contacts = native.step(solver), of_rows = raw.step(solver);
            EXPECT_LT((velocities(native) - velocities(raw)).cwiseAbs().maxCoeff(), 1e-7) << "seed " << seed;
            for (std::size_t i = 0; i < native.contacts.size(); ++i) {
                EXPECT_NEAR(of_contacts.contact[i], of_rows.row[3 * i], 1e-6);
                const double bound = native.contacts[i].friction * of_rows.row[3 * i],
                             size = std::hypot(of_rows.row[3 * i + 1], of_rows.row[3 * i + 2]);
                EXPECT_LE(size, bound + 1e-9);
                EXPECT_NEAR(of_contacts.friction_of(i).norm(), size, 1e-6);
                if (bound > 1e-3)
                    (size > bound - 1e-6 ? sliding : sticking)++;
            }
        }
    }
    EXPECT_GT(sliding, 0);
    EXPECT_GT(sticking, 0);
}

TEST(RawRows, BoundsAreHeldAndReported) {
    for (const std::uint32_t method : {CAIRN_METHOD_PJ, CAIRN_METHOD_TJ}) {
        Scene scene;
        scene.add(Body::sphere(2, 1, Vec3::Zero()));
        Row row;
        row.b = 0;
        row.jacobian_b[0] = 1;
        row.rhs = 5;   // would take 10 N s
        row.upper = 4; // over the whole step
        scene.rows.push_back(row);
        row.jacobian_b.setZero();
        row.jacobian_b[1] = 1;
        row.rhs = -3;
        row.lower = -kInfinity;
        row.upper = kInfinity;
        row.block = 1;
        scene.rows.push_back(row);
        const Solver solver;
        cairn_params params = plain(method, 200);
        params.substeps = method == CAIRN_METHOD_TJ ? 4 : 1;
        check(cairn_solver_set_params(solver.get(), &params));
        const Impulses out = scene.step(solver);
        EXPECT_NEAR(out.row[0], 4, 1e-4);
        EXPECT_NEAR(scene.bodies[0].linear.x(), 2, 1e-4);
        EXPECT_NEAR(out.row[1], -6, 1e-4);
        EXPECT_NEAR(scene.bodies[0].linear.y(), -3, 1e-4);
    }
}

// J v + c lambda = rhs
TEST(RawRows, ComplianceGivesWay) {
    Scene scene;
    scene.add(Body::sphere(2, 1, Vec3::Zero()));
    Row row;
    row.b = 0;
    row.jacobian_b[2] = 3;
    row.rhs = 6;
    row.compliance = 0.7;
    scene.rows.push_back(row);
    const Solver solver(64);
    const cairn_params params = plain(CAIRN_METHOD_PJ, 100);
    check(cairn_solver_set_params(solver.get(), &params));
    const Impulses out = scene.step(solver);
    const double lambda = 6 / (3 * 0.5 * 3 + 0.7);
    EXPECT_NEAR(out.row[0], lambda, 1e-9);
    EXPECT_NEAR(scene.bodies[0].linear.z(), 3 * lambda / 2, 1e-9);
}

// Gears and the like: rows whose two sides are no opposite forces.
TEST(RawRows, AGearTurnsTwoWheelsInRatio) {
    Scene scene;
    scene.add(Body::sphere(1, 0.5, Vec3::Zero()));
    scene.add(Body::sphere(1, 1, {2, 0, 0}));
    scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_HINGE));
    scene.join(CAIRN_WORLD, 1, {2, 0, 0}, axes_of(CAIRN_JOINT_HINGE));
    scene.bodies[0].torque = Vec3(0, 0, 0.3);
    Row row;
    row.a = 0;
    row.b = 1;
    row.jacobian_a[5] = 1;
    row.jacobian_b[5] = 2; // w_a + 2 w_b = 0
    scene.rows.push_back(row);
    const Solver solver;
    const cairn_params params = preset(CAIRN_METHOD_TJSOFT);
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 60; ++frame)
        scene.step(solver);
    EXPECT_GT(scene.bodies[0].angular.z(), 0.5);
    EXPECT_NEAR(scene.bodies[0].angular.z() + 2 * scene.bodies[1].angular.z(), 0, 1e-3);
    const double inertia = 0.4 * 0.25 + 0.4 / 4; // of both, seen from the first
    EXPECT_NEAR(scene.bodies[0].angular.z(), 0.3 / inertia * 60 * scene.dt, 1e-2 * scene.bodies[0].angular.z());
}

} // namespace
} // namespace cairn_test
