// What a contact may have beside Coulomb's cone and a rigid surface: rolling and spinning friction, elliptic friction, a moving
// surface, a spring and damper of its own. Closed formulas, and the law that a converged step obeys.
#include "dense.h"
#include "methods.h"
#include "shapes.h"

#include <gtest/gtest.h>

#include <functional>

namespace cairn_test {
namespace {

constexpr double kGravity = 9.81, kRadius = 0.25;

class ContactFeatures : public EachMethod {
  protected:
    cairn_params params() const {
        cairn_params p = preset(GetParam());
        p.substeps = std::min(p.substeps, 4u);
        p.iterations = 80;
        return p;
    }
};
CAIRN_EACH_METHOD(ContactFeatures);

// Steps with new contacts that `change` has edited; `after` sees what each step gave.
void run(Scene& scene, const cairn_params& params, int frames, const std::function<void(Scene&)>& touch,
         const std::function<void(Contact&)>& change, const std::function<void(const Impulses&)>& after = {}) {
    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < frames; ++frame) {
        scene.contacts.clear();
        touch(scene);
        for (Contact& c : scene.contacts)
            change(c);
        const Impulses out = scene.step(solver);
        if (after)
            after(out);
    }
}

Scene on_ground(const Body& body, double dt = 1.0 / 240) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -kGravity);
    scene.dt = dt;
    scene.add(body);
    return scene;
}
void touch_ground(Scene& scene) { touch_sphere(scene, 0, kRadius, Plane{}, 0.8); }

// Friction F and the torque mu_r N slow the ball down: m a = -F, I a / r = F r - mu_r N, so a = -5/7 mu_r g / r, to rest.
TEST_P(ContactFeatures, ARollingBallIsSlowedDown) {
    const double coefficient = 0.02, speed = 2, slowing = 5.0 / 7 * coefficient * kGravity / kRadius;
    for (const double heading : {0.0, 0.7}) {
        const Vec3 ahead(std::cos(heading), std::sin(heading), 0);
        Body ball = Body::sphere(3, kRadius, {0, 0, kRadius});
        ball.linear = speed * ahead;
        ball.angular = Vec3::UnitZ().cross(ahead) * speed / kRadius;
        Scene scene = on_ground(ball);
        run(scene, params(), 240, touch_ground, [&](Contact& c) { c.rolling_friction = coefficient; });
        EXPECT_NEAR(scene.bodies[0].linear.dot(ahead), speed - slowing, 0.01 * slowing);
        EXPECT_NEAR(scene.bodies[0].linear.dot(Vec3::UnitZ().cross(ahead)), 0, 1e-4);
        run(scene, params(), 720, touch_ground, [&](Contact& c) { c.rolling_friction = coefficient; });
        EXPECT_NEAR(scene.bodies[0].linear.norm(), 0, 1e-4);
        EXPECT_NEAR(scene.bodies[0].position.dot(ahead), speed * speed / (2 * slowing), 0.01);
    }
}

// A ball on a slope rests where tan(angle) < mu_r / r, else it rolls with 5/7 (g sin(angle) - mu_r g cos(angle) / r).
TEST_P(ContactFeatures, ABallRestsOnASlopeUpToAnAngle) {
    const double angle = 0.1, critical = kRadius * std::tan(angle);
    for (const double share : {1.2, 0.6}) {
        const double coefficient = share * critical;
        Scene scene = on_ground(Body::sphere(3, kRadius, {0, 0, kRadius}));
        scene.gravity = kGravity * Vec3(std::sin(angle), 0, -std::cos(angle));
        run(scene, params(), 240, touch_ground, [&](Contact& c) { c.rolling_friction = coefficient; });
        const double pull = kGravity * (std::sin(angle) - coefficient * std::cos(angle) / kRadius);
        if (share > 1)
            EXPECT_LT(scene.bodies[0].linear.norm(), 1e-4) << "creeps";
        else
            EXPECT_NEAR(scene.bodies[0].linear.x(), 5.0 / 7 * pull, 0.01 * pull);
    }
}

// Balls piled up in a pyramid roll off each other at once; rolling friction holds them.
TEST_P(ContactFeatures, APyramidOfBallsStandsOnRollingFriction) {
    for (const double coefficient : {0.0, 0.05}) {
        Scene scene;
        scene.gravity = Vec3(0, 0, -kGravity);
        for (int layer = 0; layer < 4; ++layer)
            for (int i = 0; i < 4 - layer; ++i)
                for (int k = 0; k < 4 - layer; ++k)
                    scene.add(Body::sphere(1, kRadius, kRadius * Vec3(2 * i + layer, 2 * k + layer, 1 + std::sqrt(2.0) * layer)));
        const Vec3 top = scene.bodies.back().position;
        const auto touch = [](Scene& s) {
            const int count = static_cast<int>(s.bodies.size());
            for (int i = 0; i < count; ++i) {
                touch_sphere(s, i, kRadius, Plane{}, 0.5);
                for (int k = i + 1; k < count; ++k)
                    touch_spheres(s, i, k, kRadius, kRadius, 0.5);
            }
        };
        run(scene, preset(GetParam()), 200, touch, [&](Contact& c) { c.rolling_friction = coefficient; });
        double fastest = 0;
        for (const Body& body : scene.bodies)
            fastest = std::max(fastest, body.linear.norm());
        if (coefficient > 0) {
            EXPECT_LT(fastest, 1e-3);
            EXPECT_LT((scene.bodies.back().position - top).norm(), 0.02 * kRadius);
        } else {
            EXPECT_GT(fastest, 0.1) << "it stands anyway: this test checks little";
        }
    }
}

// The torque mu_s N stops a spin in I w / (mu_s N), and takes nothing else with it.
TEST_P(ContactFeatures, ASpinningBallStops) {
    const double mass = 3, coefficient = 0.01, inertia = 0.4 * mass * kRadius * kRadius, spin = 5;
    Body ball = Body::sphere(mass, kRadius, {0, 0, kRadius});
    ball.angular = Vec3(0, 0, spin);
    Scene scene = on_ground(ball);
    double impulse = 0;
    const auto count = [&](const Impulses& out) { impulse += out.torsion.empty() ? 0 : out.torsion_of(0).z(); };
    const double rate = coefficient * mass * kGravity / inertia;
    run(
        scene, params(), 120, touch_ground, [&](Contact& c) { c.spinning_friction = coefficient; }, count);
    EXPECT_NEAR(scene.bodies[0].angular.z(), spin - 0.5 * rate, 0.01 * rate);
    EXPECT_NEAR(impulse, inertia * (scene.bodies[0].angular.z() - spin), 1e-4 * inertia * spin) << "what is reported is what it did";
    run(
        scene, params(), 240, touch_ground, [&](Contact& c) { c.spinning_friction = coefficient; }, count);
    EXPECT_NEAR(scene.bodies[0].angular.norm(), 0, 1e-4);
    EXPECT_NEAR(impulse, -inertia * spin, 1e-4 * inertia * spin);
    EXPECT_LT(scene.bodies[0].linear.norm(), 1e-5);
}

// Between two bodies friction of rotation acts on both: angular momentum stays.
TEST(Torsion, ActsAndReactsAlike) {
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD})
        for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
            Random random(11);
            Scene scene;
            for (int i = 0; i < 4; ++i) {
                Body body = random_body(random);
                body.flags = CAIRN_BODY_NO_GYROSCOPIC;
                scene.add(body);
            }
            add_random_contacts(random, scene, 30, 0.5);
            std::erase_if(scene.contacts, [](const Contact& c) { return c.a < 0 || c.b < 0; });
            for (Contact& c : scene.contacts) {
                c.rolling_friction = uniform(random, 0, 0.2);
                c.spinning_friction = uniform(random, 0, 0.2);
            }
            const Scene start = scene;
            const Solver solver(64);
            cairn_params params = plain(CAIRN_METHOD_PJ, 20);
            params.splitting = splitting;
            params.acceleration = acceleration;
            check(cairn_solver_set_params(solver.get(), &params));
            const Impulses out = scene.step(solver);
            Vec3 turned = Vec3::Zero();
            for (std::size_t i = 0; i < scene.contacts.size(); ++i)
                turned += out.torsion_of(i);
            EXPECT_GT(turned.norm(), 1e-3) << "hardly any torque: this test checks little";
            Vec3 before = Vec3::Zero(), after = Vec3::Zero(); // at the poses of the start, where the arms are
            for (std::size_t i = 0; i < start.bodies.size(); ++i) {
                const Body& b = start.bodies[i];
                const Mat3 inertia = inertia_world(b);
                before += b.position.cross(b.linear) / b.inverse_mass + inertia * b.angular;
                after += b.position.cross(scene.bodies[i].linear) / b.inverse_mass + inertia * scene.bodies[i].angular;
            }
            EXPECT_LT((after - before).norm(), 1e-12);
        }
}

// A box on a belt slips for v / (mu g) and v^2 / (2 mu g), then rides along.
TEST_P(ContactFeatures, ABoxOnABeltReachesItsSpeed) {
    const Vec3 half(0.5, 0.4, 0.2), belt(1.2, -0.9, 0);
    const double mu = 0.5, time = belt.norm() / (mu * kGravity);
    for (const std::uint32_t friction : {CAIRN_FRICTION_CONE, CAIRN_FRICTION_PYRAMID}) {
        Scene scene = on_ground(Body::box(3, half, {0, 0, half.z()}));
        cairn_params p = params();
        p.friction_model = friction;
        const auto touch = [&](Scene& s) { touch_box(s, 0, half, Plane{}, mu); };
        const auto run_belt = [&](Contact& c) {
            c.surface_velocity = belt + Vec3(0, 0, 7); // along the normal it says nothing
            c.tangent = belt;
        };
        const int frames = static_cast<int>(0.5 * time / scene.dt);
        run(scene, p, frames, touch, run_belt);
        const double reached = mu * kGravity * frames * scene.dt;
        EXPECT_LT((scene.bodies[0].linear - reached * belt.normalized()).norm(), 0.01 * reached);
        run(scene, p, 240 - frames, touch, run_belt);
        EXPECT_LT((scene.bodies[0].linear - belt).norm(), 2e-3);
        const Vec3 way = belt * (1 - 0.5 * time);
        EXPECT_LT((scene.bodies[0].position - way - Vec3(0, 0, half.z())).norm(), 0.02);
    }
}

// A plate on a free sledge whose surface moves: the two part with the belt's speed, momentum stays.
TEST(Belt, PushesBothBodies) {
    Scene scene;
    const Vec3 half(0.4, 0.4, 0.1);
    scene.add(Body::box(4, half, {0, 0, 0}));
    scene.add(Body::box(1, half, {0, 0, 2 * half.z()}));
    for (Body& body : scene.bodies)
        body.inverse_inertia.setZero(); // or the couple of the two would tip them
    scene.bodies[1].force = Vec3(0, 0, -50);
    scene.bodies[0].force = Vec3(0, 0, 50);
    const Vec3 belt(0.5, 0, 0);
    const auto touch = [&](Scene& s) {
        for (const double x : {-0.4, 0.4})
            for (const double y : {-0.4, 0.4}) {
                Contact c;
                c.a = 0;
                c.b = 1;
                c.arm_a = Vec3(x, y, half.z());
                c.arm_b = s.bodies[0].position + c.arm_a - s.bodies[1].position;
                c.arm_b.z() = -half.z();
                c.separation = s.bodies[1].position.z() - s.bodies[0].position.z() - 2 * half.z();
                c.friction = 0.8;
                c.key = s.contacts.size() + 1;
                s.contacts.push_back(c);
            }
    };
    run(scene, preset(CAIRN_METHOD_TJSOFT), 10, touch, [&](Contact& c) { c.surface_velocity = belt; });
    EXPECT_NEAR((scene.bodies[1].linear - scene.bodies[0].linear).x(), belt.x(), 1e-3);
    EXPECT_NEAR(scene.linear_momentum().x(), 0, 1e-5);
}

// Along an axis of the ellipse each coefficient acts as its own; between them the force is the one that takes most power from
// the slip v: -mu m g S^2 v / |S v|.
TEST_P(ContactFeatures, EllipticFrictionSlowsEachAxisOnItsOwn) {
    const Vec3 half(0.4, 0.4, 0.05);
    const double mu = 0.6, time = 0.05;
    const Eigen::Vector2d scale(1.5, 0.5);
    for (const double heading : {0.0, std::acos(0.0), 0.6, 2.5}) {
        Body box = Body::box(2, half, {0, 0, half.z()});
        const Eigen::Vector2d way(std::cos(heading), std::sin(heading));
        box.linear.head<2>() = 3 * way;
        Scene scene = on_ground(box, 1.0 / 480);
        run(
            scene, params(), static_cast<int>(time / scene.dt + 0.5), [&](Scene& s) { touch_box(s, 0, half, Plane{}, mu); },
            [&](Contact& c) {
                c.tangent = Vec3::UnitX();
                c.friction_scale = scale;
            });
        const Eigen::Vector2d slowed = scene.bodies[0].linear.head<2>() - box.linear.head<2>();
        const Eigen::Vector2d expected = -mu * kGravity * time * scale.cwiseAbs2().cwiseProduct(way) / scale.cwiseProduct(way).norm();
        // the direction of the slip turns while it slows down: by a few per cent here
        EXPECT_LT((slowed - expected).norm(), (heading == 0 || way.x() < 1e-9 ? 0.01 : 0.04) * expected.norm()) << heading;
    }
}

// With 0 along the second axis the box slides there for ever; on the first it holds.
TEST_P(ContactFeatures, FrictionAlongOneDirectionOnly) {
    const Vec3 half(0.4, 0.4, 0.1);
    for (const std::uint32_t friction : {CAIRN_FRICTION_CONE, CAIRN_FRICTION_PYRAMID}) {
        Body box = Body::box(2, half, {0, 0, half.z()});
        box.linear = Vec3(0, 1, 0);
        Scene scene = on_ground(box);
        scene.gravity.x() = 2;
        cairn_params p = params();
        p.friction_model = friction;
        run(
            scene, p, 60, [&](Scene& s) { touch_box(s, 0, half, Plane{}, 0.5); },
            [&](Contact& c) {
                c.tangent = Vec3::UnitX();
                c.friction_scale = Eigen::Vector2d(1, 0);
            });
        EXPECT_NEAR(scene.bodies[0].linear.y(), 1, 1e-5);
        EXPECT_NEAR(scene.bodies[0].linear.x(), 0, 2e-3);
    }
}

// A body of mass m on springs of k in all rests at depth m g / k; let go at the surface it swings around that with the frequency
// and the damping of m x'' + c x' + k x = 0.
TEST_P(ContactFeatures, ASoftContactIsASpringAndDamper) {
    const Vec3 half(0.3, 0.2, 0.1);
    const double mass = 2, omega = 2 * std::acos(-1.0) * 2, zeta = 0.1;
    const double k = mass * omega * omega / 4; // of each corner
    double c = 2 * zeta * mass * omega / 4;
    const double depth = mass * kGravity / (4 * k);
    const auto touch = [&](Scene& s) { touch_box(s, 0, half, Plane{}, 0.5); };
    const auto soften = [&](Contact& contact) {
        contact.stiffness = k;
        contact.damping = c;
        contact.restitution = 1; // of rigid contacts
    };
    const auto depth_of = [&](const Scene& scene) { return half.z() - scene.bodies[0].position.z(); };
    Scene scene = on_ground(Body::box(mass, half, {0, 0, half.z() - 0.5 * depth}), 1.0 / 1000);
    const double start = -0.5 * depth, damped = omega * std::sqrt(1 - zeta * zeta);
    for (int part = 1; part <= 8; ++part) { // an integration error of order omega h / 2 in the damping ratio
        run(scene, params(), 100, touch, soften);
        const double t = 0.1 * part, decay = std::exp(-zeta * omega * t);
        const double expected = depth + start * decay * (std::cos(damped * t) + zeta / std::sqrt(1 - zeta * zeta) * std::sin(damped * t));
        EXPECT_NEAR(depth_of(scene), expected, 0.03 * depth) << "at " << t;
    }
    // with critical damping it is soon at rest there
    c = 2 * mass * omega / 4;
    scene = on_ground(scene.bodies[0]);
    run(scene, params(), 240, touch, soften);
    EXPECT_NEAR(depth_of(scene), depth, 2e-3 * depth);
    EXPECT_LT(scene.bodies[0].linear.norm(), 1e-3);
}

// A ball that falls on a spring without a damper keeps its energy but for the integration's loss, and is not stopped at the surface.
TEST_P(ContactFeatures, AFallOnASpringIsNoRigidImpact) {
    const double mass = 1, k = 4000, height = 0.2;
    Scene scene = on_ground(Body::sphere(mass, kRadius, {0, 0, kRadius + height}), 1.0 / 2000);
    double lowest = 0, highest = 0;
    const auto touch = [&](Scene& s) {
        touch_ground(s);
        const double gap = s.bodies[0].position.z() - kRadius;
        lowest = std::min(lowest, gap);
        if (lowest < -0.01 && s.bodies[0].linear.z() > 0)
            highest = std::max(highest, gap);
    };
    run(scene, params(), 1100, touch, [&](Contact& c) { c.stiffness = k; });
    const double weight = mass * kGravity / k; // 1/2 k d^2 = m g (height + d)
    EXPECT_NEAR(lowest, -(weight + std::sqrt(weight * weight + 2 * weight * height)), 0.03 * 0.033);
    EXPECT_NEAR(highest, height, 0.12 * height);
}

// A damper alone lets a body sink with m g / c.
TEST_P(ContactFeatures, ADamperAloneYields) {
    const double mass = 2, c = 200;
    Scene scene = on_ground(Body::sphere(mass, kRadius, {0, 0, kRadius - 0.01}));
    run(scene, params(), 120, touch_ground, [&](Contact& contact) { contact.damping = c; });
    EXPECT_NEAR(scene.bodies[0].linear.z(), -mass * kGravity / c, 1e-3 * mass * kGravity / c);
}

// Any converged scene with all of these at once: w = J v+ + bias + gamma lambda obeys each one's law.
TEST(ContactLaws, ConvergedScenesObeyThem) {
    int sliding = 0, sticking = 0, turning = 0, rolling = 0, springs = 0;
    for (std::uint64_t seed = 1; seed <= 24; ++seed) {
        Random random(seed);
        Scene scene = random_bodies(random, 4);
        add_random_contacts(random, scene, 6, seed % 2 != 0 ? 0.3 : 2);
        for (Contact& c : scene.contacts) {
            c.tangent = random_unit(random);
            c.friction_scale = Eigen::Vector2d(uniform(random, 0.3, 2), uniform(random, 0.3, 2));
            c.surface_velocity = random_vec(random, 1);
            c.rolling_friction = uniform(random, 0, 0.2);
            c.spinning_friction = uniform(random, 0, 0.2);
            if (random() % 2 == 0) {
                c.stiffness = uniform(random, 10, 3000);
                c.damping = uniform(random, 0, 50);
            }
        }
        const Scene start = scene;
        const Solver solver(64);
        cairn_params params = plain(CAIRN_METHOD_PJ, 20000);
        params.splitting = seed % 4 < 2 ? CAIRN_SPLIT_POINT : CAIRN_SPLIT_MANIFOLD;
        params.acceleration = seed % 3 == 0 ? CAIRN_ACCELERATION_NESTEROV : CAIRN_ACCELERATION_NONE;
        params.residual_trace = 1;
        check(cairn_solver_set_params(solver.get(), &params));
        const Impulses out = scene.step(solver);
        if (solver.residual_trace().back() > 1e-11)
            continue; // not converged: nothing is claimed
        // what the impulses do to the bodies, and the relative velocities that come of it
        Dense dense(start, start.dt);
        Vec v = dense.v_free;
        const auto push = [&](int body, const Vec3& at, const Vec3& impulse, const Vec3& turn) {
            if (body < 0)
                return;
            Eigen::Matrix<double, 6, 1> wrench;
            wrench << impulse, at.cross(impulse) + turn;
            v.segment<6>(6 * body) += inverse_mass_matrix(start.bodies[static_cast<std::size_t>(body)]) * wrench;
        };
        for (std::size_t i = 0; i < start.contacts.size(); ++i) {
            const Contact& c = start.contacts[i];
            const Vec3 half = 0.5 * c.separation * c.normal, impulse = out.contact[i] * c.normal + out.friction_of(i);
            push(c.a, c.arm_a + half, -impulse, -out.torsion_of(i));
            push(c.b, c.arm_b - half, impulse, out.torsion_of(i));
        }
        EXPECT_LT((velocities(scene) - v).cwiseAbs().maxCoeff(), 1e-8) << "seed " << seed;
        for (std::size_t i = 0; i < start.contacts.size(); ++i) {
            SCOPED_TRACE(testing::Message() << "seed " << seed << ", contact " << i);
            const Contact& c = start.contacts[i];
            const Vec3 half = 0.5 * c.separation * c.normal;
            const auto speed = [&](int body, const Vec3& at) {
                return body < 0 ? Vec3(Vec3::Zero()) : Vec3(v.segment<3>(6 * body) + v.segment<3>(6 * body + 3).cross(at));
            };
            const auto spin = [&](int body) { return body < 0 ? Vec3(Vec3::Zero()) : Vec3(v.segment<3>(6 * body + 3)); };
            const Vec3 u = speed(c.b, c.arm_b - half) - speed(c.a, c.arm_a + half), turn = spin(c.b) - spin(c.a);
            const double load = out.contact[i], h = start.dt;
            double bias = c.separation > 0 ? c.separation / h : params.contact_baumgarte * c.separation / h, gamma = 0;
            if (c.stiffness > 0) {
                // a force k (deformation) + c (its rate), both at the step's end; before it touches, the rate of its own deformation
                gamma = 1 / (h * (c.damping + h * c.stiffness));
                bias = c.separation > 0 ? bias : c.stiffness * c.separation / (c.damping + h * c.stiffness);
                springs += load > 1e-6 ? 1 : 0;
            }
            const double normal = u.dot(c.normal) + bias + gamma * load;
            EXPECT_GE(load, 0);
            EXPECT_GT(normal, -1e-8);
            EXPECT_NEAR(load * normal, 0, 1e-8);
            const Vec3 t1 = (c.tangent - c.normal * c.normal.dot(c.tangent)).normalized(), t2 = c.normal.cross(t1),
                       slip = u - c.surface_velocity;
            const Eigen::Vector2d p(out.friction_of(i).dot(t1) / c.friction_scale.x(), out.friction_of(i).dot(t2) / c.friction_scale.y());
            const Eigen::Vector2d s(slip.dot(t1) * c.friction_scale.x(), slip.dot(t2) * c.friction_scale.y());
            const Vec3 torque = out.torsion_of(i);
            const double twist = torque.dot(c.normal), about = turn.dot(c.normal);
            const Vec3 roll = torque - twist * c.normal, across = turn - about * c.normal;
            EXPECT_NEAR(out.friction_of(i).dot(c.normal), 0, 1e-9);
            EXPECT_LE(p.norm(), c.friction * load + 1e-9);
            EXPECT_LE(std::abs(twist), c.spinning_friction * load + 1e-9);
            EXPECT_LE(roll.norm(), c.rolling_friction * load + 1e-9);
            if (load < 1e-5)
                continue;
            if (p.norm() < c.friction * load - 1e-6) {
                EXPECT_LT(s.norm(), 1e-7) << "sticks, yet slips";
                ++sticking;
            } else if (s.norm() > 1e-6) {
                EXPECT_NEAR(p.dot(s), -p.norm() * s.norm(), 1e-7) << "not the friction that takes most power";
                ++sliding;
            }
            if (std::abs(twist) < c.spinning_friction * load - 1e-6) {
                EXPECT_NEAR(about, 0, 1e-7);
                ++turning;
            } else if (std::abs(about) > 1e-6) {
                EXPECT_LT(twist * about, 0);
            }
            if (roll.norm() < c.rolling_friction * load - 1e-6) {
                EXPECT_LT(across.norm(), 1e-7);
            } else if (across.norm() > 1e-6) {
                EXPECT_NEAR(roll.dot(across), -roll.norm() * across.norm(), 1e-7);
                ++rolling;
            }
        }
    }
    EXPECT_GT(sliding, 10);
    EXPECT_GT(sticking, 5);
    EXPECT_GT(turning, 3);
    EXPECT_GT(rolling, 10);
    EXPECT_GT(springs, 10);
}

// Contacts without them cost what they did, and do not see that others have them.
TEST_P(ContactFeatures, CostNothingWhereTheyAreNotUsed) {
    const auto step = [&](bool neighbour, bool special, cairn_statistics& statistics) {
        Scene scene = on_ground(Body::sphere(3, kRadius, {0, 0, kRadius - 0.001}));
        scene.bodies[0].linear = Vec3(1, 0, -0.2);
        touch_ground(scene);
        if (neighbour) {
            scene.add(Body::sphere(3, kRadius, {5, 0, kRadius - 0.001}));
            scene.bodies[1].linear = Vec3(1, 0, -0.2);
            touch_sphere(scene, 1, kRadius, Plane{}, 0.8);
            if (special)
                scene.contacts[1].rolling_friction = scene.contacts[1].stiffness = 0.1;
        }
        const Solver solver;
        const cairn_params p = params();
        check(cairn_solver_set_params(solver.get(), &p));
        scene.step(solver);
        statistics = solver.statistics();
        scene.bodies.resize(1);
        return scene.hash();
    };
    cairn_statistics alone{}, beside{}, with{};
    const std::uint64_t hash = step(false, false, alone);
    EXPECT_EQ(step(true, false, beside), hash);
    EXPECT_EQ(step(true, true, with), hash);
    EXPECT_EQ(alone.rows, 3u);
    EXPECT_EQ(beside.rows, 6u);
    EXPECT_EQ(with.rows, 9u);
}

// Without friction there is none of rotation either, and no belt.
TEST(ContactLaws, NoFrictionModelMeansNone) {
    Body ball = Body::sphere(1, kRadius, {0, 0, kRadius});
    ball.linear = Vec3(1, 0, 0);
    ball.angular = Vec3(1, 2, 3);
    Scene scene = on_ground(ball);
    cairn_params p = preset(CAIRN_METHOD_TJSOFT);
    p.friction_model = CAIRN_FRICTION_NONE;
    run(scene, p, 30, touch_ground, [](Contact& c) {
        c.rolling_friction = c.spinning_friction = 1;
        c.surface_velocity = Vec3(3, 3, 3);
    });
    EXPECT_EQ(scene.bodies[0].angular, ball.angular);
    EXPECT_EQ(scene.bodies[0].linear.x(), 1);
}

} // namespace
} // namespace cairn_test
