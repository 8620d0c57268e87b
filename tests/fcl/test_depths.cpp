// Signed distances against closed forms and against a search by brute force.
#include "shapes.h"

#include <gtest/gtest.h>

#include <utility>

namespace {

using namespace fcl_test;
using cairn::fcl::signedDistance;

constexpr double kExact = 1e-12; // m: rounding
constexpr double kPi = 3.14159265358979323846;

double between(const Geometry& a, const Transform3d& poseA, const Geometry& b, const Transform3d& poseB, double margin = 10) {
    const Object first(a, poseA), second(b, poseB);
    const double distance = signedDistance(first, second, margin);
    EXPECT_NEAR(signedDistance(second, first, margin), distance, kExact) << "depends on the order";
    return distance;
}

TEST(Depths, Spheres) {
    EXPECT_NEAR(between(sphere(0.5), at({1, 2, 3}), sphere(0.3), at({1, 2.6, 3})), -0.2, kExact);
    EXPECT_NEAR(between(sphere(0.5), at({0, 0, 0}), sphere(0.25), at({2, 3, 6})), 7 - 0.75, kExact);
    EXPECT_NEAR(between(sphere(0.5), at({0, 0, 0}), sphere(0.25), at({0, 0, 0})), -0.75, kExact) << "centres coincide";
}

TEST(Depths, BoxOnAHalfSpace) {
    for (const double angle : {0.0, 0.3, kPi / 4}) {
        const double lowest = (std::cos(angle) * 0.6 + std::sin(angle) * 0.4) / 2;
        EXPECT_NEAR(between(box(0.4, 0.6, 0.8), at({5, 0.25, 7}, turn(angle, {0, 0, 1})), floorAt(0), at({0, 0, 0})), 0.25 - lowest,
                    kExact);
    }
    // A half space turns and moves with its object: this one is below x = 2.
    EXPECT_NEAR(between(box(1, 1, 1), at({2.4, 0, 0}), floorAt(1), at({1, 0, 0}, turn(-kPi / 2, {0, 0, 1}))), -0.1, kExact);
}

TEST(Depths, CapsuleOnAHalfSpace) {
    EXPECT_NEAR(between(capsule(0.2, 1), at({0, 0.5, 0}, turn(0.7, {1, 0, 0})), floorAt(0), at({0, 0, 0})), 0.3 - 0.5 * std::sin(0.7),
                kExact);
    EXPECT_NEAR(between(capsule(0.2, 1), at({0, 0.5, 0}, turn(kPi / 2, {1, 0, 0})), floorAt(0), at({0, 0, 0})), -0.2, kExact);
}

TEST(Depths, APlaneHasTwoSides) {
    const Geometry plane = std::make_shared<::fcl::Planed>(Vector3d(0, 1, 0), 0.0);
    EXPECT_NEAR(between(sphere(0.5), at({0, 0.4, 0}), plane, at({0, 0, 0})), -0.1, kExact);
    EXPECT_NEAR(between(sphere(0.5), at({0, -0.4, 0}), plane, at({0, 0, 0})), -0.1, kExact);
}

TEST(Depths, Boxes) {
    // Faces: the least of three overlaps.
    EXPECT_NEAR(between(box(1, 1, 1), at({0, 0, 0}), box(1, 1, 1), at({0.1, 0.95, -0.2})), -0.05, kExact);
    // Crossed edges: one along x + z in the plane y = 0.7, the other across it, each box standing on an edge.
    const double reach = std::sqrt(0.5);
    const Transform3d lower = at({0, 0, 0}, turn(kPi / 4, {0, 0, 1})), upper = at({0.1, 2 * reach - 0.01, 0.1}, turn(kPi / 4, {1, 0, 0}));
    EXPECT_NEAR(between(box(1, 1, 3), lower, box(3, 1, 1), upper), -0.01, kExact);
    // Apart corner to corner: the distance of the corners.
    EXPECT_NEAR(between(box(1, 1, 1), at({0, 0, 0}), box(1, 1, 1), at({1.3, 1.4, 2.2})), std::sqrt(0.3 * 0.3 + 0.4 * 0.4 + 1.2 * 1.2),
                kExact);
}

TEST(Depths, SphereAndCapsuleAgainstABox) {
    const double third = 1 / std::sqrt(3.0);
    EXPECT_NEAR(between(sphere(0.2), at({0.5 + 0.1 * third, 0.5 + 0.1 * third, 0.5 + 0.1 * third}), box(1, 1, 1), at({0, 0, 0})), -0.1,
                kExact);
    EXPECT_NEAR(between(sphere(0.2), at({0.45, 0.1, 0}), box(1, 1, 1), at({0, 0, 0})), -0.25, kExact) << "the centre is inside";
    // A capsule across a box's edge, its axis 0.15 from the edge.
    const Transform3d across = at({0.5 + 0.15 * std::sqrt(0.5), 0.5 + 0.15 * std::sqrt(0.5), 0}, turn(kPi / 2, {1, 1, 0}));
    EXPECT_NEAR(between(capsule(0.2, 1), across, box(1, 1, 1), at({0, 0, 0})), -0.05, kExact);
    // One that lies on it, and one that stands on it.
    EXPECT_NEAR(between(capsule(0.2, 0.6), at({0, 0.69, 0}), box(1, 1, 1), at({0, 0, 0})), -0.01, kExact);
    EXPECT_NEAR(between(capsule(0.2, 0.6), at({0, 0, 0.99}), box(1, 1, 1), at({0, 0, 0})), -0.01, kExact);
}

TEST(Depths, Capsules) {
    EXPECT_NEAR(between(capsule(0.2, 1), at({0, 0, 0}), capsule(0.3, 1), at({0.1, 0.4, 0.2}, turn(kPi / 2, {0, 1, 0}))), -0.1, kExact);
    EXPECT_NEAR(between(capsule(0.2, 1), at({0, 0, 0}), capsule(0.3, 1), at({0, 0.3, 0.4})), -0.2, kExact) << "side by side";
    EXPECT_NEAR(between(capsule(0.2, 1), at({0, 0, 0}), capsule(0.3, 1), at({0, 0.3, 1.4})), 0, kExact) << "end to end";
}

TEST(Depths, MeshesAreTheShapesTheyDescribe) {
    Dice dice(1);
    for (int i = 0; i < 50; ++i) {
        const Transform3d a = at(dice.vector(0.1), dice.turn()), b = at(dice.vector(0.6), dice.turn());
        const double exact = between(box(0.4, 0.5, 0.6), a, box(0.7, 0.5, 0.4), b);
        EXPECT_NEAR(between(boxMesh(0.4, 0.5, 0.6, true), a, boxMesh(0.7, 0.5, 0.4, false), b), exact, kExact);
        EXPECT_NEAR(between(boxMesh(0.4, 0.5, 0.6, true), a, floorAt(0.1), b), between(box(0.4, 0.5, 0.6), a, floorAt(0.1), b), kExact);
    }
}

// The search by brute force finds a direction in which two shapes are that far apart, so it is never above the truth; nor may ours be
// below it, and where it converges they agree.
TEST(Depths, NoDirectionPartsShapesFurther) {
    const std::vector<std::pair<const char*, Geometry>> shapes = {{"box", box(0.4, 0.6, 0.8)},
                                                                  {"sphere", sphere(0.4)},
                                                                  {"capsule", capsule(0.2, 0.6)},
                                                                  {"mesh", boxMesh(0.5, 0.7, 0.6, true)},
                                                                  {"prism", prism(7, 0.4, 0.5)}};
    for (std::size_t i = 0; i < shapes.size(); ++i)
        for (std::size_t j = i; j < shapes.size(); ++j) {
            Dice dice(static_cast<unsigned>(100 * i + j));
            int agree = 0;
            const int count = 20;
            for (int k = 0; k < count; ++k) {
                const Object a(shapes[i].second, at(dice.vector(0.1), dice.turn())), b(shapes[j].second, at(dice.vector(0.7), dice.turn()));
                const double ours = signedDistance(a, b, 10), searched = searchedDistance(a, b);
                EXPECT_GE(ours, searched - 1e-12) << shapes[i].first << " and " << shapes[j].first << ", pose " << k;
                agree += ours < searched + 1e-4;
            }
            EXPECT_GE(agree, count / 2) << shapes[i].first << " and " << shapes[j].first;
        }
}

TEST(Depths, CurvedSolidsToAShareOfTheirSize) {
    const Geometry cylinder = std::make_shared<::fcl::Cylinderd>(0.3, 0.7), ellipsoid = std::make_shared<::fcl::Ellipsoidd>(0.3, 0.4, 0.5),
                   cone = std::make_shared<::fcl::Coned>(0.4, 0.7);
    EXPECT_NEAR(between(cylinder, at({0, 0.35 - 0.01, 0}, turn(kPi / 2, {1, 0, 0})), floorAt(0), at({0, 0, 0})), -0.01, kExact)
        << "upright";
    EXPECT_NEAR(between(cylinder, at({0, 0.29, 0}), floorAt(0), at({0, 0, 0})), -0.01, kExact) << "lying";
    EXPECT_NEAR(between(ellipsoid, at({0, 0.39, 0}), floorAt(0), at({0, 0, 0})), -0.01, kExact);
    EXPECT_NEAR(between(cone, at({0, 0, 0.85}), box(1, 1, 1), at({0, 0, 0.01})), -0.01, 1e-6) << "base on a face";
    Dice dice(7);
    for (int i = 0; i < 20; ++i)
        for (const Geometry& curved : {cylinder, ellipsoid}) {
            const Object a(curved, at(dice.vector(0.1), dice.turn())), b(box(0.4, 0.6, 0.8), at(dice.vector(0.7), dice.turn()));
            EXPECT_GE(signedDistance(a, b, 10), searchedDistance(a, b) - 0.01);
        }
}

TEST(Depths, FarFromTheOriginNothingIsLost) {
    const Vector3d far(1e5, -2e5, 3e5);
    const Transform3d a = at({0, 0, 0}, turn(0.4, {1, 2, 3})), b = at({0.25, 0.5, 0.5}, turn(1.4, {3, 1, 1}));
    Transform3d farA = a, farB = b;
    farA.translation() += far;
    farB.translation() += far;
    EXPECT_NEAR(between(box(1, 1, 1), farA, capsule(0.2, 1), farB), between(box(1, 1, 1), a, capsule(0.2, 1), b), kExact);
}

} // namespace
