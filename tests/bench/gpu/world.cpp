#include "world.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace cairn_bench {
namespace {

using Vec = std::array<double, 3>;
constexpr double kDensity = 100, kFriction = 0.5; // kg/m^3; of a contact
constexpr double kHalf = 0.1;                     // m: of the boxes, and the spheres' radius
constexpr std::size_t kX = 0, kY = 1, kZ = 2;

class Builder {
  public:
    explicit Builder(std::string name) { m_world.name = std::move(name); }
    World take() { return std::move(m_world); }

    std::size_t box(const Vec& centre, const Vec& half, double mass) {
        const Vec square{half[0] * half[0], half[1] * half[1], half[2] * half[2]};
        return body(centre, half, mass, false,
                    {3 / (mass * (square[1] + square[2])), 3 / (mass * (square[2] + square[0])), 3 / (mass * (square[0] + square[1]))});
    }
    std::size_t sphere(const Vec& centre, double radius, double mass) {
        const double inertia = 2.5 / (mass * radius * radius);
        return body(centre, {radius, radius, radius}, mass, true, {inertia, inertia, inertia});
    }

    // b stands at a's positive side along `axis`. Nothing if their extents across it do not meet.
    void touch(std::size_t a, std::size_t b, std::size_t axis) {
        const Vec xa = centre(a), xb = centre(b), ha = half(a), hb = half(b);
        if (m_world.round[a] && m_world.round[b])
            return touchSpheres(a, b);
        const double faceA = xa[axis] + ha[axis], faceB = xb[axis] - hb[axis];
        Vec low{}, high{};
        for (std::size_t i = 0; i < 3; ++i) {
            low[i] = std::max(xa[i] - ha[i], xb[i] - hb[i]);
            high[i] = std::min(xa[i] + ha[i], xb[i] + hb[i]);
            if (m_world.round[a] || m_world.round[b])
                low[i] = high[i] = (m_world.round[a] ? xa : xb)[i];
            if (i != axis && low[i] > high[i])
                return;
        }
        patch(static_cast<std::int32_t>(a), xa, b, axis, faceA, faceB, low, high);
    }
    // The world's plane y = 0.
    void touchFloor(std::size_t b) {
        const Vec x = centre(b), h = half(b);
        Vec low = x, high = x;
        for (std::size_t i = 0; i < 3 && !m_world.round[b]; ++i) {
            low[i] -= h[i];
            high[i] += h[i];
        }
        patch(-1, {0, 0, 0}, b, kY, 0, x[kY] - h[kY], low, high);
    }
    // A hinge about z at a world point.
    void hinge(std::int32_t a, std::int32_t b, const Vec& point) {
        m_world.jointA.push_back(a);
        m_world.jointB.push_back(b);
        for (std::size_t i = 0; i < 3; ++i) {
            m_world.anchorA.push_back(static_cast<float>(point[i] - (a < 0 ? 0 : centre(static_cast<std::size_t>(a))[i])));
            m_world.anchorB.push_back(static_cast<float>(point[i] - centre(static_cast<std::size_t>(b))[i]));
        }
        for (const std::uint32_t locked : {1u, 1u, 1u, 1u, 1u, 0u})
            m_world.axes.push_back(locked);
    }

  private:
    std::size_t body(const Vec& centre, const Vec& half, double mass, bool round, const Vec& inverseInertia) {
        for (std::size_t i = 0; i < 3; ++i) {
            m_world.position.push_back(static_cast<float>(centre[i]));
            m_world.half.push_back(static_cast<float>(half[i]));
            m_world.inverseInertia.push_back(static_cast<float>(inverseInertia[i]));
            m_world.linearVelocity.push_back(0);
            m_world.angularVelocity.push_back(0);
            m_world.orientation.push_back(0);
        }
        m_world.orientation.push_back(1);
        m_world.inverseMass.push_back(static_cast<float>(1 / mass));
        m_world.round.push_back(round ? 1 : 0);
        return m_world.bodies() - 1;
    }
    // As they were rounded: contacts must fit the bodies as the solver sees them.
    Vec centre(std::size_t i) const { return {at(m_world.position, i, 0), at(m_world.position, i, 1), at(m_world.position, i, 2)}; }
    Vec half(std::size_t i) const { return {at(m_world.half, i, 0), at(m_world.half, i, 1), at(m_world.half, i, 2)}; }
    static double at(const std::vector<float>& values, std::size_t i, std::size_t c) { return static_cast<double>(values[3 * i + c]); }

    void point(std::int32_t a, std::int32_t b, const Vec& normal, const Vec& armA, const Vec& armB, double separation) {
        m_world.bodyA.push_back(a);
        m_world.bodyB.push_back(b);
        for (std::size_t i = 0; i < 3; ++i) {
            m_world.normal.push_back(static_cast<float>(normal[i]));
            m_world.armA.push_back(static_cast<float>(armA[i]));
            m_world.armB.push_back(static_cast<float>(armB[i]));
        }
        m_world.separation.push_back(static_cast<float>(separation));
        m_world.friction.push_back(static_cast<float>(kFriction));
    }
    // The corners of the rectangle low ... high across `axis`; it may have shrunk to a point.
    void patch(std::int32_t a, const Vec& xa, std::size_t b, std::size_t axis, double faceA, double faceB, const Vec& low,
               const Vec& high) {
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        const Vec xb = centre(b);
        Vec normal{};
        normal[axis] = 1;
        const bool single = !(low[u] < high[u] && low[v] < high[v]);
        for (const auto& [pu, pv] : {std::pair{low[u], low[v]}, {high[u], low[v]}, {high[u], high[v]}, {low[u], high[v]}}) {
            Vec armA{}, armB{};
            armA[axis] = faceA - xa[axis];
            armB[axis] = faceB - xb[axis];
            armA[u] = pu - xa[u];
            armA[v] = pv - xa[v];
            armB[u] = pu - xb[u];
            armB[v] = pv - xb[v];
            point(a, static_cast<std::int32_t>(b), normal, armA, armB, faceB - faceA);
            if (single)
                return;
        }
    }
    void touchSpheres(std::size_t a, std::size_t b) {
        const Vec xa = centre(a), xb = centre(b);
        const Vec d{xb[0] - xa[0], xb[1] - xa[1], xb[2] - xa[2]};
        const double distance = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), ra = half(a)[0], rb = half(b)[0];
        const Vec n{d[0] / distance, d[1] / distance, d[2] / distance};
        point(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), n, {n[0] * ra, n[1] * ra, n[2] * ra},
              {-n[0] * rb, -n[1] * rb, -n[2] * rb}, distance - ra - rb);
    }

    World m_world;
};

constexpr double massOf(const Vec& half) { return 8 * half[0] * half[1] * half[2] * kDensity; }

std::size_t edgeOf(std::size_t bodies) {
    std::size_t edge = 1;
    while ((edge + 1) * (edge + 1) * (edge + 1) <= bodies)
        ++edge;
    return edge;
}

// See bond() in the header; `corner`: where its floor begins.
void addBond(Builder& to, std::size_t bodies, const Vec& corner) {
    constexpr double pitch = 2 * kHalf + 0.005;
    const Vec half{kHalf, kHalf, kHalf};
    const std::size_t edge = edgeOf(bodies), layer = edge * edge;
    std::size_t first = 0;
    for (std::size_t i = 0; i < bodies; ++i) {
        const std::size_t y = i / layer, z = i % layer / edge, x = i % edge;
        const std::size_t turn = y % 4; // shifted along x in layers 1 and 2, along z in 2 and 3 of each four
        const double dx = turn == 1 || turn == 2 ? pitch / 4 : 0, dz = turn >= 2 ? pitch / 4 : 0;
        const Vec centre{corner[0] + kHalf + static_cast<double>(x) * pitch + dx, kHalf + static_cast<double>(y) * 2 * kHalf,
                         corner[2] + kHalf + static_cast<double>(z) * pitch + dz};
        const std::size_t b = to.box(centre, half, massOf(half));
        if (i == 0)
            first = b;
        if (y == 0) {
            to.touchFloor(b);
            continue;
        }
        const std::size_t below = first + i - layer;
        to.touch(below, b, kY);
        // turn 1 has moved along +x, so it also stands on the next in x; 2: +z, 3: -x, 0: -z
        if (turn == 1 && x + 1 < edge)
            to.touch(below + 1, b, kY);
        else if (turn == 2 && z + 1 < edge)
            to.touch(below + edge, b, kY);
        else if (turn == 3 && x > 0)
            to.touch(below - 1, b, kY);
        else if (turn == 0 && z > 0)
            to.touch(below - edge, b, kY);
    }
}

// SplitMix64 (Steele, Lea, Flood 2014).
std::uint64_t mixed(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

} // namespace

std::vector<Manifold> manifoldsOf(const World& world) {
    std::vector<Manifold> found;
    for (std::size_t i = 0; i < world.points(); ++i) {
        const bool same = i > 0 && world.bodyA[i] == world.bodyA[i - 1] && world.bodyB[i] == world.bodyB[i - 1];
        if (same && found.back().count < 4)
            ++found.back().count;
        else
            found.push_back({i, 1});
    }
    return found;
}

World chain() {
    constexpr int links = 50;
    constexpr double spacing = 0.1, mass = 0.009, ratio = 300, radius = 1.25;
    Builder builder("chain");
    for (int i = 0; i < links; ++i) {
        builder.box({(i + 0.5) * spacing, 0, 0}, {0.25 * spacing, 0.45 * spacing, 0.1 * spacing}, mass);
        builder.hinge(i - 1, i, {i * spacing, 0, 0});
    }
    builder.sphere({links * spacing + radius, 0, 0}, radius, ratio * mass);
    builder.hinge(links - 1, links, {links * spacing, 0, 0});
    return builder.take();
}

World stack() {
    constexpr std::size_t side = 5;
    const Vec half{kHalf, kHalf, kHalf};
    Builder builder("stack");
    for (std::size_t y = 0; y < side; ++y)
        for (std::size_t z = 0; z < side; ++z)
            for (std::size_t x = 0; x < side; ++x) {
                const auto place = [](std::size_t i) { return (2 * static_cast<double>(i) + 1) * kHalf; };
                const std::size_t b = builder.box({place(x), place(y), place(z)}, half, massOf(half));
                if (y == 0)
                    builder.touchFloor(b);
                else
                    builder.touch(b - side * side, b, kY);
                if (x > 0)
                    builder.touch(b - 1, b, kX);
                if (z > 0)
                    builder.touch(b - side, b, kZ);
            }
    return builder.take();
}

World overlap() {
    const Vec half{0.325, 0.325, 0.5};
    Builder builder("overlap");
    for (int i = 0; i < 10; ++i) {
        const std::size_t b = builder.box({0, half[1], 0.75 * i}, half, massOf(half));
        builder.touchFloor(b);
        if (i > 0)
            builder.touch(b - 1, b, kZ);
    }
    return builder.take();
}

World bond(std::size_t bodies) {
    Builder builder("stack");
    addBond(builder, bodies, {0, 0, 0});
    return builder.take();
}

World pile(std::size_t bodies) {
    Builder builder("pile");
    const Vec half{kHalf, kHalf, kHalf};
    constexpr double most = 0.0005; // m
    const std::size_t edge = edgeOf(bodies), layer = edge * edge;
    for (std::size_t i = 0; i < bodies; ++i) {
        const std::array<std::size_t, 3> cell{i % edge, i / layer, i % layer / edge};
        Vec centre{};
        std::uint64_t random = mixed(i);
        const bool round = random % 4 == 0;
        for (std::size_t c = 0; c < 3; ++c) {
            random = mixed(random);
            centre[c] = (2 * static_cast<double>(cell[c]) + 1) * kHalf + most * (std::ldexp(static_cast<double>(random >> 11), -52) - 1);
        }
        const std::size_t b = round ? builder.sphere(centre, kHalf, 4.0 / 3 * 3.14159265358979 * kHalf * kHalf * kHalf * kDensity)
                                    : builder.box(centre, half, massOf(half));
        const std::array<std::size_t, 3> stride{1, layer, edge};
        for (const std::size_t axis : {kY, kX, kZ}) {
            if (cell[axis] > 0)
                builder.touch(b - stride[axis], b, axis);
            else if (axis == kY)
                builder.touchFloor(b);
        }
    }
    return builder.take();
}

World worlds(std::size_t count) {
    Builder builder("worlds");
    const std::size_t edge = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(count))));
    for (std::size_t i = 0; i < count; ++i)
        addBond(builder, kBodiesOfAWorld, {static_cast<double>(i % edge), 0, static_cast<double>(i / edge)});
    return builder.take();
}

} // namespace cairn_bench
