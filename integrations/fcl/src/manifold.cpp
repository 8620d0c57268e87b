#include "manifold.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace cairn {
namespace fcl {
namespace {

// A face's normal is preferred to a direction that gives up to this share, or this part of the smaller shape's size, more distance.
constexpr double kFaceShare = 0.05;
constexpr double kFaceSlack = 1e-3;
constexpr double kFaceSlope = 0.98;   // cosine: within 11 degrees
constexpr double kParallel = 0.1;     // sine between segments below which they touch along a line
constexpr std::size_t kCompared = 16; // points whose quadrilaterals are compared, all of them

using Polygon = std::vector<Vector3>;

// The part of a convex polygon (or segment, or point) where along . x <= offset.
Polygon cut(const Polygon& polygon, const Vector3& along, double offset, double tolerance) {
    Polygon kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vector3 &from = polygon[i], &to = polygon[(i + 1) % polygon.size()];
        const double start = along.dot(from) - offset, end = along.dot(to) - offset;
        if (start <= tolerance)
            kept.push_back(from);
        if ((start <= tolerance) != (end <= tolerance))
            kept.push_back(from + (to - from) * (start / (start - end)));
    }
    return kept;
}

// The part of `polygon` that lies over `face`, seen along n.
Polygon over(Polygon polygon, const Polygon& face, const Vector3& n, double tolerance) {
    Vector3 middle = Vector3::Zero();
    for (const Vector3& corner : face)
        middle += corner;
    middle /= static_cast<double>(face.size());
    for (std::size_t i = 0; i < face.size(); ++i) {
        Vector3 side = (face[(i + 1) % face.size()] - face[i]).cross(n);
        const double norm = side.norm();
        if (!(norm > tolerance))
            continue;
        side /= norm;
        if (side.dot(middle - face[i]) > 0)
            side = -side;
        polygon = cut(polygon, side, side.dot(face[i]), tolerance);
    }
    return polygon;
}

class Maker {
  public:
    Maker(const Core& a, const Core& b, const Direction& best, double margin) : m_a(a), m_b(b), m_best(best), m_margin(margin) {
        m_size = std::min(a.size, b.size);
    }

    std::vector<Point> make() {
        if (m_a.solid == Solid::halfSpace || m_b.solid == Solid::halfSpace) {
            onHalfSpace();
            return std::move(m_points);
        }
        m_n = m_best.normal;
        Vector3 normalA, normalB;
        if (!m_a.isPoint() && !m_b.isPoint())
            preferFace();
        const Polygon featureA = featureTowards(m_a, m_n, normalA);
        const Polygon featureB = featureTowards(m_b, -m_n, normalB);
        if (featureA.size() == 1 || featureB.size() == 1)
            ; // the deepest point is all there is
        else if (featureA.size() == 2 && featureB.size() == 2)
            segments(featureA, featureB);
        else if (featureB.size() == 2 || (featureA.size() > 2 && normalA.dot(m_n) >= -normalB.dot(m_n) - 1e-3))
            clip(featureA, normalA, featureB, true);
        else
            clip(featureB, normalB, featureA, false);
        deepestIsThere();
        return std::move(m_points);
    }

    std::vector<Point> makeOverTriangle() {
        m_n = m_best.normal;
        Vector3 normal;
        clip(m_a.vertices, m_n, featureTowards(m_b, -m_n, normal), true);
        return std::move(m_points);
    }

  private:
    void onHalfSpace() {
        const bool aIsHalfSpace = m_a.solid == Solid::halfSpace;
        const Core& shape = aIsHalfSpace ? m_b : m_a;
        const Core& halfSpace = aIsHalfSpace ? m_a : m_b;
        m_n = m_best.normal;
        Vector3 normal;
        const Vector3 down = -halfSpace.planeNormal;
        for (const Vector3& corner : featureTowards(shape, down, normal)) {
            const Vector3 point = corner + shape.radius * down;
            const double height = halfSpace.planeNormal.dot(point) - halfSpace.planeOffset;
            if (height <= m_margin)
                m_points.push_back(Point{aIsHalfSpace ? Vector3(point + height * down) : point, m_n, height});
        }
        deepestIsThere();
    }

    void preferFace() {
        const Direction found = m_best;
        const double slack = std::max(kFaceShare * std::abs(found.distance), kFaceSlack * m_size);
        double least = found.distance - slack;
        const auto consider = [&](const Vector3& n) {
            if (n.dot(found.normal) < kFaceSlope)
                return;
            const double distance = distanceAlong(m_a, m_b, n);
            if (distance > least + 1e-9 * m_size) {
                least = distance;
                m_n = n;
                m_best = Direction{n, distance};
            }
        };
        for (const Vector3& normal : m_a.normals)
            consider(normal);
        for (const Vector3& normal : m_b.normals)
            consider(-normal);
        for (const Core* core : {&m_a, &m_b})
            if (core->solid == Solid::cylinder || core->solid == Solid::cone) {
                consider(core->axes.col(2));
                consider(-core->axes.col(2));
            }
    }

    void add(const Vector3& coreA, const Vector3& coreB) {
        const double separation = m_n.dot(coreB - coreA) - m_a.radius - m_b.radius;
        if (separation <= m_margin)
            m_points.push_back(Point{coreA + m_a.radius * m_n, m_n, separation});
    }

    // Points of `incident` over `reference`, with their feet along n in the reference's plane.
    void clip(const Polygon& reference, const Vector3& plane, const Polygon& incident, bool referenceIsA) {
        const double slope = m_n.dot(plane);
        for (const Vector3& point : over(incident, reference, m_n, 1e-9 * m_size)) {
            const Vector3 foot = point + m_n * (plane.dot(reference.front() - point) / slope);
            if (referenceIsA)
                add(foot, point);
            else
                add(point, foot);
        }
    }

    // Two capsules, or the side lines of cylinders: the ends of the stretch where they run beside each other, or where they cross.
    void segments(const Polygon& a, const Polygon& b) {
        const Vector3 u = a[1] - a[0], v = b[1] - b[0];
        if (u.cross(v).norm() < kParallel * u.norm() * v.norm()) {
            const double uu = u.squaredNorm();
            const double first = u.dot(b[0] - a[0]) / uu, second = u.dot(b[1] - a[0]) / uu;
            const double low = std::max(0.0, std::min(first, second)), high = std::min(1.0, std::max(first, second));
            if (high - low > 1e-6)
                for (const double s : {low, high})
                    add(a[0] + s * u, b[0] + v * ((s - first) / (second - first)));
        }
    }

    // Clipping along a face may miss the deepest point where the faces tilt: edges that cross, a corner beside a face.
    void deepestIsThere() {
        double least = m_margin;
        for (const Point& point : m_points)
            least = std::min(least, point.separation);
        if (m_points.empty() || least > m_best.distance + 1e-3 * m_size)
            single();
    }

    void single() {
        if (m_best.distance > m_margin)
            return;
        Vector3 onA;
        const bool aHasPoint = m_a.solid != Solid::halfSpace && (m_a.isPoint() || m_b.solid == Solid::halfSpace);
        const bool bHasPoint = m_b.solid != Solid::halfSpace && (m_b.isPoint() || m_a.solid == Solid::halfSpace);
        if (aHasPoint) {
            onA = furthest(m_a, m_n);
        } else if (bHasPoint) {
            onA = furthest(m_b, -m_n) - m_best.distance * m_n;
        } else {
            Vector3 normal;
            const Polygon featureA = featureTowards(m_a, m_n, normal), featureB = featureTowards(m_b, -m_n, normal);
            if (featureA.size() == 1)
                onA = featureA.front() + m_a.radius * m_n;
            else if (featureB.size() == 1)
                onA = featureB.front() - (m_b.radius + m_best.distance) * m_n;
            else
                onA = crossing(featureA, featureB) + m_a.radius * m_n;
        }
        m_points.push_back(Point{onA, m_n, m_best.distance});
    }

    // The point of a's rim, or segment, that is nearest to b's when b is moved along n to touch.
    Vector3 crossing(const Polygon& a, const Polygon& b) const {
        const Vector3 shift = (m_best.distance + m_a.radius + m_b.radius) * m_n;
        Vector3 best = a.front();
        double nearest = -1;
        for (std::size_t i = 0; i < a.size(); ++i)
            for (std::size_t j = 0; j < b.size(); ++j) {
                Vector3 p, q;
                nearestPoints(a[i], a[(i + 1) % a.size()], b[j] - shift, b[(j + 1) % b.size()] - shift, p, q);
                const double distance = (q - p).squaredNorm();
                if (nearest < 0 || distance < nearest) {
                    nearest = distance;
                    best = p;
                }
            }
        return best;
    }

    const Core& m_a;
    const Core& m_b;
    Direction m_best;
    const double m_margin;
    double m_size;
    Vector3 m_n;
    std::vector<Point> m_points;
};

// Leaves `count` points that lie far from each other: the deepest, then each time the furthest from those taken.
void thin(std::vector<Point>& points, std::size_t count) {
    std::vector<double> nearest(points.size(), std::numeric_limits<double>::infinity());
    std::vector<bool> taken(points.size(), false);
    std::size_t next = 0;
    for (std::size_t i = 1; i < points.size(); ++i)
        if (points[i].separation < points[next].separation)
            next = i;
    for (std::size_t n = 0; n < count; ++n) {
        taken[next] = true;
        std::size_t furthest = next;
        for (std::size_t i = 0; i < points.size(); ++i) {
            nearest[i] = std::min(nearest[i], (points[i].onA - points[next].onA).squaredNorm());
            if (!taken[i] && (taken[furthest] || nearest[i] > nearest[furthest]))
                furthest = i;
        }
        next = furthest;
    }
    std::vector<Point> kept;
    for (std::size_t i = 0; i < points.size(); ++i)
        if (taken[i])
            kept.push_back(points[i]);
    points.swap(kept);
}

double quadArea(const Vector3& p, const Vector3& q, const Vector3& r, const Vector3& s) {
    // Of the three ways round four points the one without a crossing has the largest area; twice that area is |diagonal x diagonal|.
    return std::max({(r - p).cross(s - q).norm(), (q - p).cross(s - r).norm(), (s - p).cross(r - q).norm()});
}

} // namespace

std::vector<Point> makeManifold(const Core& a, const Core& b, const Direction& best, double margin) {
    return Maker(a, b, best, margin).make();
}

std::vector<Point> overTriangle(const Core& triangle, const Core& shape, const Vector3& n, double margin) {
    return Maker(triangle, shape, Direction{n, distanceAlong(triangle, shape, n)}, margin).makeOverTriangle();
}

void reduceToFour(std::vector<Point>& points, double size) {
    std::vector<Point> apart;
    for (const Point& point : points) {
        Point* twin = nullptr;
        for (Point& other : apart)
            if ((point.onA - other.onA).squaredNorm() < 1e-6 * size * size && point.normal.dot(other.normal) > 0.999)
                twin = &other;
        if (!twin)
            apart.push_back(point);
        else if (point.separation < twin->separation)
            *twin = point;
    }
    points.swap(apart);
    if (points.size() > kCompared)
        thin(points, kCompared);
    const std::size_t count = points.size();
    if (count <= 4)
        return;

    double least = points[0].separation, most = least;
    for (const Point& point : points) {
        least = std::min(least, point.separation);
        most = std::max(most, point.separation);
    }
    const double deep = least + 0.05 * (most - least) + 1e-6 * size;
    // Of areas within a hundredth of each other the first is taken: rounding must not swap the points of a symmetric face.
    std::array<std::size_t, 4> best = {{0, 1, 2, 3}};
    double largest = -1;
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = i + 1; j < count; ++j)
            for (std::size_t k = j + 1; k < count; ++k)
                for (std::size_t l = k + 1; l < count; ++l) {
                    if (points[i].separation > deep && points[j].separation > deep && points[k].separation > deep &&
                        points[l].separation > deep)
                        continue;
                    const double area = quadArea(points[i].onA, points[j].onA, points[k].onA, points[l].onA);
                    if (area > 1.01 * largest) {
                        largest = area;
                        best = {{i, j, k, l}};
                    }
                }
    points = {points[best[0]], points[best[1]], points[best[2]], points[best[3]]};
}

} // namespace fcl
} // namespace cairn
