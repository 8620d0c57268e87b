// The Python module cairn._fcl: signed distances of posed shapes from FCL and the front end's search. Used through cairn.fcl.
#include <cairn/fcl.hpp>

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/halfspace.h>
#include <fcl/geometry/shape/sphere.h>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

namespace py = pybind11;
using fcl::Vector3d;
using Geometry = std::shared_ptr<fcl::CollisionGeometryd>;
using Vec3 = std::array<double, 3>;

namespace {

double positive(double value, const char* name) {
    if (!(value > 0 && std::isfinite(value)))
        throw std::invalid_argument(std::string(name) + " must be above 0 and finite, not " + std::to_string(value));
    return value;
}

Vector3d vector(const Vec3& v) { return Vector3d(v[0], v[1], v[2]); }

Geometry makeConvex(const std::vector<Vec3>& points, const std::vector<std::vector<int>>& faces) {
    auto vertices = std::make_shared<std::vector<Vector3d>>();
    double size = 0;
    for (const Vec3& point : points) {
        vertices->push_back(vector(point));
        size = std::max(size, (vertices->back() - vertices->front()).norm());
        if (!vertices->back().allFinite())
            throw std::invalid_argument("vertices[" + std::to_string(vertices->size() - 1) + "] is not finite");
    }
    if (faces.size() < 4)
        throw std::invalid_argument("a convex mesh has at least 4 faces, not " + std::to_string(faces.size()));
    auto coded = std::make_shared<std::vector<int>>();
    for (std::size_t f = 0; f < faces.size(); ++f) {
        const std::vector<int>& face = faces[f];
        const std::string name = "faces[" + std::to_string(f) + "]";
        if (face.size() < 3)
            throw std::invalid_argument(name + " has fewer than 3 vertices");
        for (const int index : face)
            if (index < 0 || static_cast<std::size_t>(index) >= vertices->size())
                throw std::invalid_argument(name + " names vertex " + std::to_string(index) + " of " + std::to_string(vertices->size()));
        const auto corner = [&](std::size_t i) { return (*vertices)[static_cast<std::size_t>(face[i])]; };
        Vector3d area = Vector3d::Zero();
        for (std::size_t i = 2; i < face.size(); ++i)
            area += (corner(i - 1) - corner(0)).cross(corner(i) - corner(0));
        if (!(area.norm() > 1e-12 * size * size))
            throw std::invalid_argument(name + " has no area");
        const Vector3d normal = area.normalized();
        for (std::size_t v = 0; v < vertices->size(); ++v) {
            const double height = normal.dot((*vertices)[v] - corner(0));
            const bool own = std::find(face.begin(), face.end(), static_cast<int>(v)) != face.end();
            if (height > 1e-6 * size || (own && height < -1e-6 * size))
                throw std::invalid_argument(name + " is not a flat face of a convex hull, counter-clockwise from outside: vertices[" +
                                            std::to_string(v) + "] is " + std::to_string(height) + " m above it");
        }
        coded->push_back(static_cast<int>(face.size()));
        coded->insert(coded->end(), face.begin(), face.end());
    }
    return std::make_shared<fcl::Convexd>(vertices, static_cast<int>(faces.size()), coded);
}

class Shapes {
  public:
    int add(Geometry geometry, const fcl::Quaterniond& turn = fcl::Quaterniond::Identity()) {
        m_shapes.push_back({std::make_unique<fcl::CollisionObjectd>(geometry), turn, geometry->getNodeType() == fcl::GEOM_HALFSPACE});
        return static_cast<int>(m_shapes.size()) - 1;
    }

    std::size_t count() const { return m_shapes.size(); }

    // Of all pairs nearer than the margin, in order: first, second, signed distance. poses: [count, 7].
    std::vector<std::tuple<int, int, double>> distances(const double* poses, double margin) {
        std::vector<const fcl::CollisionObjectd*> unbounded;
        fcl::DynamicAABBTreeCollisionManagerd manager;
        for (std::size_t i = 0; i < m_shapes.size(); ++i, poses += 7) {
            Shape& shape = m_shapes[i];
            const fcl::Quaterniond turn(poses[6], poses[3], poses[4], poses[5]);
            shape.object->setTransform(turn.normalized() * shape.turn, Vector3d(poses[0], poses[1], poses[2]));
            shape.object->computeAABB();
            shape.object->setUserData(&shape);
            if (!shape.unbounded)
                manager.registerObject(shape.object.get());
        }
        manager.setup();

        Search search{m_shapes.data(), margin, {}};
        // As in Contacts::find(): pairs nearer than the margin, or, since that comparison is strict, those that overlap.
        if (margin > 0)
            manager.distance(&search, [](fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data, double& least) {
                Search& s = *static_cast<Search*>(data);
                least = s.margin;
                if (a->getAABB().distance(b->getAABB()) <= s.margin)
                    s.take(static_cast<const Shape*>(a->getUserData()), static_cast<const Shape*>(b->getUserData()));
                return false;
            });
        else
            manager.collide(&search, [](fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data) {
                static_cast<Search*>(data)->take(static_cast<const Shape*>(a->getUserData()), static_cast<const Shape*>(b->getUserData()));
                return false;
            });
        for (const Shape& shape : m_shapes)
            for (const Shape& other : m_shapes)
                if (shape.unbounded && !other.unbounded)
                    search.take(&shape, &other);
        std::sort(search.found.begin(), search.found.end());
        return search.found;
    }

  private:
    struct Shape {
        std::unique_ptr<fcl::CollisionObjectd> object;
        fcl::Quaterniond turn; // from the shape's axes to FCL's
        bool unbounded;
    };
    struct Search {
        const Shape* first;
        double margin;
        std::vector<std::tuple<int, int, double>> found;

        void take(const Shape* a, const Shape* b) {
            if (a > b)
                std::swap(a, b);
            const double distance = cairn::fcl::signedDistance(*a->object, *b->object, margin);
            if (distance <= margin)
                found.emplace_back(static_cast<int>(a - first), static_cast<int>(b - first), distance);
        }
    };
    std::vector<Shape> m_shapes;
};

} // namespace

PYBIND11_MODULE(_fcl, m) {
    m.doc() = "Signed distances of posed shapes, from FCL. Used through cairn.fcl.";
    py::class_<Shapes>(m, "Shapes", "Shapes in the order of adding; each add_ returns the shape's index. SI units.")
        .def(py::init<>())
        .def("__len__", &Shapes::count)
        .def(
            "add_box",
            [](Shapes& s, const Vec3& half) {
                for (const double h : half)
                    positive(h, "half_extents");
                return s.add(std::make_shared<fcl::Boxd>(2 * vector(half)));
            },
            py::arg("half_extents"))
        .def(
            "add_sphere", [](Shapes& s, double radius) { return s.add(std::make_shared<fcl::Sphered>(positive(radius, "radius"))); },
            py::arg("radius"))
        .def(
            "add_capsule",
            [](Shapes& s, double radius, double halfLength) {
                const fcl::Quaterniond fromYToZ(Eigen::AngleAxisd(-1.5707963267948966, Vector3d::UnitX()));
                return s.add(std::make_shared<fcl::Capsuled>(positive(radius, "radius"), 2 * positive(halfLength, "half_length")),
                             fromYToZ);
            },
            py::arg("radius"), py::arg("half_length"), "About the y axis.")
        .def(
            "add_plane",
            [](Shapes& s, const Vec3& normal, double offset) {
                if (!(std::abs(vector(normal).norm() - 1) < 1e-3) || !std::isfinite(offset))
                    throw std::invalid_argument("a plane's normal must be unit, and its offset finite");
                return s.add(std::make_shared<fcl::Halfspaced>(vector(normal).normalized(), offset));
            },
            py::arg("normal"), py::arg("offset"), "normal . x <= offset is solid.")
        .def(
            "add_convex",
            [](Shapes& s, const std::vector<Vec3>& vertices, const std::vector<std::vector<int>>& faces) {
                return s.add(makeConvex(vertices, faces));
            },
            py::arg("vertices"), py::arg("faces"))
        .def(
            "distances",
            [](Shapes& s, const py::array_t<double, py::array::c_style | py::array::forcecast>& poses, double margin) {
                if (poses.ndim() != 2 || poses.shape(0) != static_cast<py::ssize_t>(s.count()) || poses.shape(1) != 7)
                    throw std::invalid_argument("poses must be [" + std::to_string(s.count()) + ", 7]");
                if (!(margin >= 0 && std::isfinite(margin)))
                    throw std::invalid_argument("margin must be 0 or more and finite, not " + std::to_string(margin));
                const double* data = poses.data();
                for (py::ssize_t i = 0; i < poses.shape(0); ++i) {
                    double square = 0;
                    for (int k = 0; k < 7; ++k) {
                        const double value = data[7 * i + k];
                        if (!std::isfinite(value))
                            throw std::invalid_argument("poses[" + std::to_string(i) + ", " + std::to_string(k) + "] is not finite");
                        square += k > 2 ? value * value : 0;
                    }
                    if (!(std::abs(std::sqrt(square) - 1) < 1e-3))
                        throw std::invalid_argument("poses[" + std::to_string(i) + "] has a quaternion of norm " +
                                                    std::to_string(std::sqrt(square)));
                }
                std::vector<std::tuple<int, int, double>> found;
                {
                    py::gil_scoped_release release;
                    found = s.distances(data, margin);
                }
                const py::ssize_t count = static_cast<py::ssize_t>(found.size());
                py::array_t<std::int64_t> pairs({count, py::ssize_t{2}});
                py::array_t<double> distances(count);
                for (py::ssize_t i = 0; i < count; ++i) {
                    const auto& one = found[static_cast<std::size_t>(i)];
                    pairs.mutable_at(i, 0) = std::get<0>(one);
                    pairs.mutable_at(i, 1) = std::get<1>(one);
                    distances.mutable_at(i) = std::get<2>(one);
                }
                return py::make_tuple(pairs, distances);
            },
            py::arg("poses"), py::arg("margin") = 0.0,
            "poses: [shapes, 7], position (m) and orientation x, y, z, w. Returns pairs [n, 2] of indices, and their signed distances [n]\n"
            "(m, negative inside) as far as these are no more than margin. ValueError for what does not fit.");
}
