// The generated scenes are what they say: contacts fit the bodies, every body stands on something, and a solver finds them at rest.
#include "subject.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn_bench {
namespace {

struct Named {
    const char* name;
    World (*make)();
};
void PrintTo(const Named& named, std::ostream* to) { *to << named.name; }

class Worlds : public testing::TestWithParam<Named> {};
INSTANTIATE_TEST_SUITE_P(Generated, Worlds,
                         testing::Values(Named{"stack", stack}, Named{"overlap", overlap}, Named{"chain", chain},
                                         Named{"bond10", [] { return bond(10); }}, Named{"bond700", [] { return bond(700); }},
                                         Named{"pile10", [] { return pile(10); }}, Named{"pile700", [] { return pile(700); }},
                                         Named{"worlds", [] { return worlds(5); }}),
                         [](const auto& of) { return std::string(of.param.name); });

double at(const std::vector<float>& values, std::size_t i, std::size_t c) { return static_cast<double>(values[3 * i + c]); }
double place(const World& world, std::int32_t body, std::size_t c) {
    return body < 0 ? 0 : at(world.position, static_cast<std::size_t>(body), c);
}

// (x_b + arm_b) - (x_a + arm_a) = separation normal, to the rounding of floats.
TEST_P(Worlds, ArmsMeetTheSeparation) {
    const World world = GetParam().make();
    double extent = 1;
    for (const float x : world.position)
        extent = std::max(extent, std::abs(static_cast<double>(x)));
    const double rounding = 4 * extent * static_cast<double>(std::numeric_limits<float>::epsilon());
    for (std::size_t i = 0; i < world.points(); ++i) {
        ASSERT_NE(world.bodyA[i], world.bodyB[i]);
        double square = 0;
        for (std::size_t c = 0; c < 3; ++c) {
            const double gap =
                place(world, world.bodyB[i], c) + at(world.armB, i, c) - place(world, world.bodyA[i], c) - at(world.armA, i, c);
            ASSERT_NEAR(gap, static_cast<double>(world.separation[i]) * at(world.normal, i, c), rounding) << "point " << i;
            square += at(world.normal, i, c) * at(world.normal, i, c);
        }
        ASSERT_NEAR(square, 1, 1e-6);
    }
}

// An arm ends on its body's surface, on the side that the normal says.
TEST_P(Worlds, ArmsEndOnTheSurface) {
    const World world = GetParam().make();
    const auto on_surface = [&](std::int32_t body, const std::vector<float>& arm, std::size_t i, double side) {
        if (body < 0)
            return;
        const std::size_t b = static_cast<std::size_t>(body);
        double along = 0, length = 0;
        for (std::size_t c = 0; c < 3; ++c) {
            ASSERT_LE(std::abs(at(arm, i, c)), at(world.half, b, c) + 2e-6) << "point " << i;
            along += side * at(arm, i, c) * at(world.normal, i, c);
            length += at(arm, i, c) * at(arm, i, c);
        }
        double half = 0;
        for (std::size_t c = 0; c < 3; ++c)
            half += std::abs(at(world.normal, i, c)) * at(world.half, b, c);
        const double radius = at(world.half, b, 0);
        ASSERT_NEAR(along, world.round[b] ? radius : half, 2e-6) << "point " << i;
        if (world.round[b]) {
            ASSERT_NEAR(std::sqrt(length), radius, 2e-6) << "point " << i;
        }
    };
    for (std::size_t i = 0; i < world.points(); ++i) {
        on_surface(world.bodyA[i], world.armA, i, 1);
        on_surface(world.bodyB[i], world.armB, i, -1);
    }
}

// The centre of mass is above the rectangle around the points below it. (Of spheres, and boxes on them: within the pile's disorder.)
TEST_P(Worlds, EveryBodyIsHeld) {
    const World world = GetParam().make();
    struct Rectangle {
        double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    };
    std::vector<Rectangle> under(world.bodies());
    for (std::size_t i = 0; i < world.points(); ++i) {
        if (at(world.normal, i, 1) < 0.9)
            continue;
        Rectangle& r = under[static_cast<std::size_t>(world.bodyB[i])];
        for (const std::size_t k : {0u, 1u}) {
            r.low[k] = std::min(r.low[k], at(world.armB, i, 2 * k));
            r.high[k] = std::max(r.high[k], at(world.armB, i, 2 * k));
        }
    }
    std::vector<bool> hung(world.bodies());
    for (const std::int32_t b : world.jointB)
        hung[static_cast<std::size_t>(b)] = true;
    const double slack = world.name == "pile" ? 0.0011 : 0;
    for (std::size_t b = 0; b < world.bodies(); ++b)
        for (const std::size_t k : {0u, 1u}) {
            ASSERT_TRUE(hung[b] || (under[b].low[k] <= slack && under[b].high[k] >= -slack)) << "body " << b;
        }
}

TEST_P(Worlds, ManifoldsCoverThePoints) {
    const World world = GetParam().make();
    std::size_t next = 0;
    for (const Manifold& manifold : manifoldsOf(world)) {
        ASSERT_EQ(manifold.first, next);
        ASSERT_TRUE(manifold.count == 1 || manifold.count == 4); // a sphere's or a face's
        next += manifold.count;
    }
    EXPECT_EQ(next, world.points());
}

cairn_params defaults(std::uint32_t method) {
    cairn_params params{};
    params.struct_size = sizeof params;
    EXPECT_EQ(cairn_params_preset(method, CAIRN_PRESET_DEFAULT, &params), CAIRN_OK);
    params.iterations = 600;
    return params;
}
constexpr double kFall = 9.81 * 0.016; // m/s: what a step of free fall gives

// As many sweeps as it takes: then nothing moves at a hundredth of what it would have without contacts.
TEST(WorldsAtRest, CairnFindsThemAtRest) {
    for (const World& world : {stack(), bond(20), bond(64), worlds(2)}) {
        const auto subject = cairnSubject(world, defaults(CAIRN_METHOD_PJ), CAIRN_BACKEND_CPU, CAIRN_EXECUTOR_AUTO, 1);
        subject->step();
        EXPECT_LT(subject->fastest(), 0.01 * kFall) << world.name;
    }
}
TEST(WorldsAtRest, StockBulletFindsThemAtRest) {
    for (const World& world : {stack(), bond(20), bond(64), worlds(2)}) {
        const auto subject = stockSubject(world, 2000);
        if (!subject)
            GTEST_SKIP() << "built without Bullet";
        for (int run = 0; run < 2; ++run) { // the second as the first: nothing is left of it
            subject->step();
            EXPECT_LT(subject->fastest(), 0.01 * kFall) << world.name;
        }
        EXPECT_EQ(subject->done().points, world.points());
        EXPECT_EQ(subject->done().iterations, 2000u);
    }
}
// Both let the chain's ball swing by the same, which its joints decide.
TEST(WorldsAtRest, TheChainFallsAlike) {
    const World world = chain();
    const auto ours = cairnSubject(world, defaults(CAIRN_METHOD_TJ), CAIRN_BACKEND_CPU, CAIRN_EXECUTOR_AUTO, 1);
    ours->step();
    EXPECT_EQ(ours->done().joints, 51u);
    EXPECT_GT(ours->fastest(), 0.5 * kFall);
    if (const auto stock = stockSubject(world, 600)) {
        stock->step();
        EXPECT_NEAR(stock->fastest(), ours->fastest(), 0.02 * kFall);
    }
}

TEST(WorldsGrow, IslandsAndPoints) {
    const auto done = [](const World& world) {
        cairn_params params = defaults(CAIRN_METHOD_PJ);
        params.iterations = 1;
        params.relax_share = 0;
        const auto subject = cairnSubject(world, params, CAIRN_BACKEND_CPU, CAIRN_EXECUTOR_AUTO, 1);
        subject->step();
        return subject->done();
    };
    for (const std::size_t bodies : {std::size_t{10}, std::size_t{1000}, std::size_t{20000}}) {
        for (const World& world : {bond(bodies), pile(bodies)}) {
            const Done found = done(world);
            EXPECT_EQ(found.bodies, bodies);
            EXPECT_EQ(found.points, world.points());
            EXPECT_EQ(found.islands, 1u) << world.name << ' ' << bodies;
            if (bodies > 10) {
                EXPECT_NEAR(static_cast<double>(found.points) / static_cast<double>(bodies), 8, 1) << world.name;
            }
        }
    }
    const Done many = done(worlds(7));
    EXPECT_EQ(many.bodies, 7 * kBodiesOfAWorld);
    EXPECT_EQ(many.islands, 7u);
}

} // namespace
} // namespace cairn_bench
