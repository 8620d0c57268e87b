#include "direction.h"

#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <cmath>
#include <exception>

namespace cairn {
namespace fcl {
namespace {

constexpr std::size_t kExhaustive = 1000; // pairs of edges up to which all of them are tried: two icosahedra
constexpr double kNear = 0.02;            // of a shape's size: how far from the outermost vertex one is still among its neighbours

struct Neighbours {
    std::vector<Vector3> normals;
    std::vector<std::array<Vector3, 2>> edges; // a lone vertex is an edge of length zero
    std::vector<Vector3> alongs;               // their directions, each once, unit
};

Neighbours neighbours(const Core& core, const Vector3& n, bool all) {
    Neighbours found;
    if (core.solid != Solid::hull)
        return found;
    double top = n.dot(core.vertices.front());
    for (const Vector3& vertex : core.vertices)
        top = std::max(top, n.dot(vertex));
    const auto near = [&](const Vector3& vertex) { return all || n.dot(vertex) >= top - kNear * core.size; };
    if (core.vertices.size() == 1)
        found.edges.push_back({{core.vertices.front(), core.vertices.front()}});
    for (const std::array<int, 2>& edge : core.edges) {
        const Vector3& from = core.vertices[static_cast<std::size_t>(edge[0])];
        const Vector3& to = core.vertices[static_cast<std::size_t>(edge[1])];
        if (!near(from) && !near(to))
            continue;
        found.edges.push_back({{from, to}});
        const double length = (to - from).norm();
        if (length == 0)
            continue;
        const Vector3 along = (to - from) / length;
        const bool known = std::any_of(found.alongs.begin(), found.alongs.end(),
                                       [&](const Vector3& other) { return along.cross(other).squaredNorm() < 1e-20; });
        if (!known)
            found.alongs.push_back(along);
    }
    for (const Vector3& normal : core.normals) {
        if (all) {
            found.normals.push_back(normal);
            continue;
        }
        double plane = normal.dot(core.vertices.front());
        for (const Vector3& vertex : core.vertices)
            plane = std::max(plane, normal.dot(vertex));
        if (std::any_of(core.vertices.begin(), core.vertices.end(),
                        [&](const Vector3& vertex) { return near(vertex) && normal.dot(vertex) >= plane - 1e-6 * core.size; }))
            found.normals.push_back(normal);
    }
    return found;
}

class Search {
  public:
    Search(const Core& a, const Core& b, const Vector3& start, double margin) : m_a(a), m_b(b), m_margin(margin) {
        m_best.normal = start;
        m_best.distance = distanceAlong(a, b, start);
        m_tolerance = 1e-12 * std::min(a.size, b.size);
    }

    Direction run() {
        const bool all = m_a.edges.size() * m_b.edges.size() <= kExhaustive;
        considerBoth(m_b.center - m_a.center);
        for (int round = 0; round < 8; ++round) {
            const double before = m_best.distance;
            const Neighbours a = neighbours(m_a, m_best.normal, all), b = neighbours(m_b, -m_best.normal, all);
            tryPlanes(a, b);
            if (m_best.distance > m_margin)
                break;
            // Where the cores are apart, vertices and edges may be nearest, which have no plane of their own.
            const double radii = m_a.radius + m_b.radius;
            if (all && radii > 0)
                tryNearest(a, b);
            else if (m_best.distance + radii > 0)
                tryNearest(neighbours(m_a, m_best.normal, false), neighbours(m_b, -m_best.normal, false));
            tryAxes(m_a, m_b);
            tryAxes(m_b, m_a);
            if (!(m_best.distance > before + m_tolerance))
                break;
        }
        if (m_a.solid != Solid::hull || m_b.solid != Solid::hull)
            climbFromSeveral();
        return m_best;
    }

  private:
    bool consider(const Vector3& n) {
        const double distance = distanceAlong(m_a, m_b, n);
        if (!(distance > m_best.distance + m_tolerance))
            return false;
        m_best = Direction{n, distance};
        return true;
    }

    void considerBoth(const Vector3& along) {
        const double norm = along.norm();
        if (norm > 1e-9) {
            consider(along / norm);
            consider(-along / norm);
        }
    }

    void tryPlanes(const Neighbours& a, const Neighbours& b) {
        for (const Vector3& normal : a.normals)
            consider(normal);
        for (const Vector3& normal : b.normals)
            consider(-normal);
        for (const Vector3& along : a.alongs)
            for (const Vector3& other : b.alongs)
                considerBoth(along.cross(other));
    }

    void tryNearest(const Neighbours& a, const Neighbours& b) {
        for (const std::array<Vector3, 2>& edge : a.edges)
            for (const std::array<Vector3, 2>& other : b.edges) {
                Vector3 p, q;
                nearestPoints(edge[0], edge[1], other[0], other[1], p, q);
                const double distance = (q - p).norm();
                if (distance > 1e-12 * std::min(m_a.size, m_b.size))
                    consider((q - p) / distance);
            }
    }

    // A cylinder's or cone's caps and, against edges and vertices, its side.
    void tryAxes(const Core& curved, const Core& other) {
        if (curved.solid != Solid::cylinder && curved.solid != Solid::cone)
            return;
        const Vector3 axis = curved.axes.col(2);
        considerBoth(axis);
        if (other.solid == Solid::cylinder || other.solid == Solid::cone)
            considerBoth(axis.cross(other.axes.col(2)));
        for (const std::array<int, 2>& edge : other.edges)
            considerBoth(axis.cross(other.vertices[static_cast<std::size_t>(edge[1])] - other.vertices[static_cast<std::size_t>(edge[0])]));
        for (const Vector3& vertex : other.vertices) {
            const Vector3 across = vertex - curved.center;
            considerBoth(across - axis.dot(across) * axis);
        }
    }

    // Curved solids have no list of candidates, and EPA may end on the wrong side of one: step uphill over the sphere of directions from
    // the best so far and from the best of a spiral of others.
    void climbFromSeveral() {
        constexpr int kDirections = 64, kStarts = 3;
        constexpr double kGoldenAngle = 2.399963229728653;
        std::vector<Direction> starts;
        for (int i = 0; i < kDirections; ++i) {
            const double z = 1 - (2 * i + 1.0) / kDirections, across = std::sqrt(1 - z * z);
            const Vector3 n(across * std::cos(kGoldenAngle * i), across * std::sin(kGoldenAngle * i), z);
            starts.push_back(Direction{n, distanceAlong(m_a, m_b, n)});
        }
        std::partial_sort(starts.begin(), starts.begin() + kStarts, starts.end(),
                          [](const Direction& p, const Direction& q) { return p.distance > q.distance; });
        Direction best = climb(m_best);
        for (int i = 0; i < kStarts; ++i) {
            const Direction top = climb(starts[static_cast<std::size_t>(i)]);
            if (top.distance > best.distance + 1e-6 * std::min(m_a.size, m_b.size))
                best = top;
        }
        m_best = best;
    }

    Direction climb(Direction top) const {
        constexpr int kAround = 6, kTries = 400;
        double step = 0.1;
        for (int tried = 0; tried < kTries && step > 1e-8; ++tried) {
            const Vector3 u = top.normal.unitOrthogonal(), v = top.normal.cross(u);
            bool better = false;
            for (int i = 0; i < kAround && !better; ++i) {
                const double angle = 6.283185307179586 * i / kAround + tried;
                const Vector3 n = (top.normal + step * (std::cos(angle) * u + std::sin(angle) * v)).normalized();
                const double distance = distanceAlong(m_a, m_b, n);
                better = distance > top.distance + m_tolerance;
                if (better)
                    top = Direction{n, distance};
            }
            if (!better)
                step /= 2;
        }
        return top;
    }

    const Core& m_a;
    const Core& m_b;
    const double m_margin;
    double m_tolerance;
    Direction m_best;
};

} // namespace

double distanceAlong(const Core& a, const Core& b, const Vector3& n) {
    if (b.solid == Solid::halfSpace)
        return b.planeNormal.dot(furthest(a, n)) - b.planeOffset;
    if (a.solid == Solid::halfSpace)
        return a.planeNormal.dot(furthest(b, -n)) - a.planeOffset;
    return n.dot(furthest(b, -n) - furthest(a, n));
}

Direction bestDirection(const Core& a, const Core& b, const Vector3& start, double margin) {
    Vector3 normal = start;
    if (b.solid == Solid::halfSpace)
        normal = -b.planeNormal;
    else if (a.solid == Solid::halfSpace)
        normal = a.planeNormal;
    else
        return Search(a, b, start, margin).run();
    return Direction{normal, distanceAlong(a, b, normal)};
}

Vector3 startDirection(const Geometry& geometry1, const Transform& pose1, const Geometry& geometry2, const Transform& pose2,
                       const Vector3& centers, double margin) {
    Vector3 direction = Vector3::Zero();
    try {
        ::fcl::CollisionResultd overlap;
        ::fcl::collide(&geometry1, pose1, &geometry2, pose2, ::fcl::CollisionRequestd(1, true), overlap);
        if (overlap.numContacts() > 0) {
            direction = overlap.getContact(0).normal;
        } else if (margin > 0) {
            ::fcl::DistanceResultd apart;
            ::fcl::distance(&geometry1, pose1, &geometry2, pose2, ::fcl::DistanceRequestd(true), apart);
            direction = apart.nearest_points[1] - apart.nearest_points[0];
        }
    } catch (const std::exception&) {
        // EPA throws on some degenerate poses: any direction will do to start from.
    }
    for (const Vector3& candidate : {direction, centers, Vector3(0, 1, 0)}) {
        const double norm = candidate.norm();
        if (norm > 0 && std::isfinite(norm))
            return candidate / norm;
    }
    return Vector3(0, 1, 0);
}

// Minimises |p0 + s (p1 - p0) - q0 - t (q1 - q0)| over s and t in 0 ... 1.
void nearestPoints(const Vector3& p0, const Vector3& p1, const Vector3& q0, const Vector3& q1, Vector3& p, Vector3& q) {
    const Vector3 u = p1 - p0, v = q1 - q0, w = p0 - q0;
    const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), uw = u.dot(w), vw = v.dot(w);
    const auto share = [](double numerator, double denominator) {
        return denominator > 0 ? std::min(1.0, std::max(0.0, numerator / denominator)) : 0.0;
    };
    double s = share(uv * vw - vv * uw, uu * vv - uv * uv);
    const double t = share(uv * s + vw, vv);
    s = share(uv * t - uw, uu);
    p = p0 + s * u;
    q = q0 + t * v;
}

} // namespace fcl
} // namespace cairn
