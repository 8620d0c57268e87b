// Scenes as plain tables, made without any collision detection: axis-aligned boxes and spheres whose contacts follow from where they
// stand. A face gives four points, a sphere one. All in floats, as an engine would hold them; y is up.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace cairn_bench {

struct World {
    std::string name;
    double dt = 0.016;
    double gravity = -9.81; // m/s^2, along y
    // bodies; half: half extents, of a sphere its radius thrice
    std::vector<float> position, orientation, linearVelocity, angularVelocity, inverseMass, inverseInertia, half;
    std::vector<std::uint8_t> round;
    // contact points, as cairn_contacts has them; body -1 is the world
    std::vector<std::int32_t> bodyA, bodyB;
    std::vector<float> normal, armA, armB, separation, friction;
    // hinges about z
    std::vector<std::int32_t> jointA, jointB;
    std::vector<float> anchorA, anchorB;
    std::vector<std::uint32_t> axes;

    std::size_t bodies() const { return inverseMass.size(); }
    std::size_t points() const { return separation.size(); }
    std::size_t joints() const { return jointA.size(); }
};

// Consecutive points of the same two bodies, at most four: [first, first + count).
struct Manifold {
    std::size_t first, count;
};
std::vector<Manifold> manifoldsOf(const World& world);

// The paper's: `chain` and `overlap` as they start, `stack` settled, its layers touching.
World chain();
World stack();
World overlap();

// `stack` grown: a block of `bodies` boxes as wide as high, in bond: each layer is shifted by a quarter of a box, +x +z -x -z in turn,
// so that a box stands on two (8 points) and everything hangs together. Boxes of a layer do not touch.
World bond(std::size_t bodies);
// Three boxes to a sphere, mixed, on a lattice, each up to 0.5 mm off its place along each axis: 8 points a body.
World pile(std::size_t bodies);
// `count` bonds of kBodiesOfAWorld boxes, each on its own.
constexpr std::size_t kBodiesOfAWorld = 20;
World worlds(std::size_t count);

} // namespace cairn_bench
