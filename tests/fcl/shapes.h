// Shapes, poses and support functions for tests. The support functions are written anew here, or they would check nothing.
#pragma once
#include <cairn/fcl.hpp>

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/cone.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/ellipsoid.h>
#include <fcl/geometry/shape/halfspace.h>
#include <fcl/geometry/shape/plane.h>
#include <fcl/geometry/shape/sphere.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <vector>

namespace fcl_test {

using ::fcl::Quaterniond;
using ::fcl::Transform3d;
using ::fcl::Vector3d;
using Object = ::fcl::CollisionObjectd;
using Geometry = std::shared_ptr<::fcl::CollisionGeometryd>;

inline Transform3d at(const Vector3d& position, const Quaterniond& turn = Quaterniond::Identity()) {
    Transform3d pose = Transform3d::Identity();
    pose.translation() = position;
    pose.linear() = turn.toRotationMatrix();
    return pose;
}

inline Quaterniond turn(double angle, const Vector3d& axis) { return Quaterniond(Eigen::AngleAxisd(angle, axis.normalized())); }

inline Geometry box(double x, double y, double z) { return std::make_shared<::fcl::Boxd>(x, y, z); }
inline Geometry sphere(double radius) { return std::make_shared<::fcl::Sphered>(radius); }
inline Geometry capsule(double radius, double length) { return std::make_shared<::fcl::Capsuled>(radius, length); } // along z
inline Geometry floorAt(double height) { return std::make_shared<::fcl::Halfspaced>(Vector3d(0, 1, 0), height); }

inline std::shared_ptr<::fcl::Convexd> convex(std::vector<Vector3d> vertices, const std::vector<std::vector<int>>& faces) {
    auto coded = std::make_shared<std::vector<int>>();
    for (const std::vector<int>& face : faces) {
        coded->push_back(static_cast<int>(face.size()));
        coded->insert(coded->end(), face.begin(), face.end());
    }
    return std::make_shared<::fcl::Convexd>(std::make_shared<const std::vector<Vector3d>>(std::move(vertices)),
                                            static_cast<int>(faces.size()), coded);
}

// A box as a mesh; its faces cut in triangles, or not.
inline std::shared_ptr<::fcl::Convexd> boxMesh(double x, double y, double z, bool triangles) {
    std::vector<Vector3d> vertices;
    for (int i = 0; i < 8; ++i)
        vertices.push_back(Vector3d((i & 1) ? x : -x, (i & 2) ? y : -y, (i & 4) ? z : -z) / 2);
    std::vector<std::vector<int>> faces = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    if (triangles) {
        std::vector<std::vector<int>> cut;
        for (const std::vector<int>& f : faces) {
            cut.push_back({f[0], f[1], f[2]});
            cut.push_back({f[0], f[2], f[3]});
        }
        faces = cut;
    }
    return convex(vertices, faces);
}

// A prism of n sides about z.
inline std::shared_ptr<::fcl::Convexd> prism(int n, double radius, double length) {
    std::vector<Vector3d> vertices;
    std::vector<int> top, bottom;
    std::vector<std::vector<int>> faces;
    for (int i = 0; i < n; ++i) {
        const double angle = 2 * 3.14159265358979323846 * i / n;
        for (const double z : {-length / 2, length / 2})
            vertices.push_back(Vector3d(radius * std::cos(angle), radius * std::sin(angle), z));
        const int next = (i + 1) % n;
        faces.push_back({2 * i, 2 * next, 2 * next + 1, 2 * i + 1});
        top.push_back(2 * i + 1);
        bottom.insert(bottom.begin(), 2 * i);
    }
    faces.push_back(top);
    faces.push_back(bottom);
    return convex(vertices, faces);
}

// max over the shape of n . x, in the shape's own frame.
inline double support(const ::fcl::CollisionGeometryd& geometry, const Vector3d& n) {
    switch (geometry.getNodeType()) {
    case ::fcl::GEOM_BOX:
        return static_cast<const ::fcl::Boxd&>(geometry).side.cwiseProduct(n.cwiseAbs()).sum() / 2;
    case ::fcl::GEOM_SPHERE:
        return static_cast<const ::fcl::Sphered&>(geometry).radius;
    case ::fcl::GEOM_CAPSULE: {
        const auto& shape = static_cast<const ::fcl::Capsuled&>(geometry);
        return shape.radius + shape.lz / 2 * std::abs(n.z());
    }
    case ::fcl::GEOM_CYLINDER: {
        const auto& shape = static_cast<const ::fcl::Cylinderd&>(geometry);
        return shape.radius * std::hypot(n.x(), n.y()) + shape.lz / 2 * std::abs(n.z());
    }
    case ::fcl::GEOM_CONE: {
        const auto& shape = static_cast<const ::fcl::Coned&>(geometry);
        return std::max(shape.lz / 2 * n.z(), shape.radius * std::hypot(n.x(), n.y()) - shape.lz / 2 * n.z());
    }
    case ::fcl::GEOM_ELLIPSOID:
        return static_cast<const ::fcl::Ellipsoidd&>(geometry).radii.cwiseProduct(n).norm();
    default: {
        double best = -1e300;
        for (const Vector3d& vertex : static_cast<const ::fcl::Convexd&>(geometry).getVertices())
            best = std::max(best, vertex.dot(n));
        return best;
    }
    }
}

// min over b of n . x - max over a of n . x.
inline double separationAlong(const Object& a, const Object& b, const Vector3d& n) {
    return n.dot(b.getTranslation() - a.getTranslation()) - support(*a.collisionGeometry(), a.getTransform().linear().transpose() * n) -
           support(*b.collisionGeometry(), b.getTransform().linear().transpose() * -n);
}

// The signed distance by brute force: the largest separation over a grid of directions, the best of them refined by ever smaller steps.
// Never above the true one.
inline double searchedDistance(const Object& a, const Object& b) {
    struct Try {
        double distance;
        Vector3d n;
    };
    std::vector<Try> tries;
    constexpr int kDirections = 2000;
    for (int i = 0; i < kDirections; ++i) { // a spiral over the sphere
        const double z = 1 - (2 * i + 1.0) / kDirections, angle = i * 2.399963229728653;
        const Vector3d n(std::sqrt(1 - z * z) * std::cos(angle), std::sqrt(1 - z * z) * std::sin(angle), z);
        tries.push_back({separationAlong(a, b, n), n});
    }
    std::sort(tries.begin(), tries.end(), [](const Try& p, const Try& q) { return p.distance > q.distance; });
    double best = tries.front().distance;
    for (std::size_t i = 0; i < 10; ++i) {
        Try t = tries[i];
        double step = 0.05;
        for (int tried = 0; tried < 400 && step > 1e-9; ++tried) {
            bool better = false;
            const Vector3d u = t.n.unitOrthogonal(), v = t.n.cross(u);
            for (int k = 0; k < 8 && !better; ++k) {
                const Vector3d n =
                    (t.n + step * (std::cos(k * 0.7853981633974483) * u + std::sin(k * 0.7853981633974483) * v)).normalized();
                const double distance = separationAlong(a, b, n);
                if (distance > t.distance) {
                    t = Try{distance, n};
                    better = true;
                }
            }
            if (!better)
                step /= 2;
        }
        best = std::max(best, t.distance);
    }
    return best;
}

class Dice {
  public:
    explicit Dice(unsigned seed) : m_engine(seed) {}
    double in(double low, double high) { return low + (high - low) * static_cast<double>(m_engine() >> 8) / 16777216.0; }
    Vector3d vector(double size) {
        const double x = in(-size, size), y = in(-size, size), z = in(-size, size);
        return Vector3d(x, y, z);
    }
    Quaterniond turn() {
        for (;;) {
            const double w = in(-1, 1), x = in(-1, 1), y = in(-1, 1), z = in(-1, 1);
            const Quaterniond q(w, x, y, z);
            if (q.squaredNorm() < 1 && q.squaredNorm() > 0.01)
                return q.normalized();
        }
    }

  private:
    std::mt19937 m_engine;
};

} // namespace fcl_test
