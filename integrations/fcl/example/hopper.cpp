// A simulation without an engine: FCL finds contacts, Cairn solves them. Boxes, balls, capsules and octahedra fall into a hopper of four
// sloping walls; every second the program prints how fast the fastest still moves, and how deep the deepest overlap is.
#include <cairn/fcl.hpp>

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/halfspace.h>
#include <fcl/geometry/shape/sphere.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <vector>

using fcl::Vector3d;
using Geometry = std::shared_ptr<fcl::CollisionGeometryd>;

struct Body {
    Vector3d position, linear, angular;
    double orientation[4]; // x, y, z, w
    double inverseMass;
    Vector3d inverseInertia;
};

static cairn_view view(void* data) { // of a field of the bodies
    cairn_view v = {};
    v.data = data;
    v.stride = sizeof(Body);
    v.type = CAIRN_F64;
    return v;
}

int main() {
    // An octahedron: x, -x, y, -y, z, -z.
    auto corners = std::make_shared<std::vector<Vector3d>>();
    for (int i = 0; i < 6; ++i)
        corners->push_back(Vector3d::Unit(i / 2) * (i % 2 ? -0.35 : 0.35));
    auto faces = std::make_shared<std::vector<int>>(
        std::vector<int>{3, 0, 2, 4, 3, 2, 1, 4, 3, 1, 3, 4, 3, 3, 0, 4, 3, 2, 0, 5, 3, 1, 2, 5, 3, 3, 1, 5, 3, 0, 3, 5});
    const Geometry shapes[] = {std::make_shared<fcl::Boxd>(0.4, 0.4, 0.4), std::make_shared<fcl::Sphered>(0.25),
                               std::make_shared<fcl::Capsuled>(0.15, 0.4), std::make_shared<fcl::Convexd>(corners, 8, faces)};

    std::vector<Body> bodies;
    std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects;
    fcl::DynamicAABBTreeCollisionManagerd broadphase;
    cairn::fcl::Contacts contacts;
    for (int i = 0; i < 64; ++i) {
        const Geometry& shape = shapes[i % 4];
        const double density = 1000, mass = density * shape->computeVolume(), layer = i / 4;
        // About the shapes' axes, which are principal. Of a Convex FCL 0.7 gives the moments of a mass of 1.
        const bool isConvex = shape->getNodeType() == fcl::GEOM_CONVEX;
        const Vector3d moments = (isConvex ? mass : density) * shape->computeMomentofInertia().diagonal();
        const Vector3d place(0.7 * (i % 2) - 0.35 + 0.01 * layer, 1 + 0.7 * layer, 0.7 * (i / 2 % 2) - 0.35);
        bodies.push_back(Body{place, Vector3d::Zero(), Vector3d::Zero(), {0, 0, 0, 1}, 1 / mass, moments.cwiseInverse()});
        objects.push_back(std::make_unique<fcl::CollisionObjectd>(shape));
        contacts.attach(objects.back().get(), {i, 0.7});
        broadphase.registerObject(objects.back().get());
    }
    for (int i = 0; i < 4; ++i) { // the hopper: half spaces that rise to each side
        const Vector3d out = Vector3d::Unit(i / 2 * 2) * (i % 2 ? 1 : -1);
        objects.push_back(
            std::make_unique<fcl::CollisionObjectd>(std::make_shared<fcl::Halfspaced>((Vector3d::UnitY() - out).normalized(), 0)));
        contacts.attach(objects.back().get(), {CAIRN_WORLD, 0.7}); // FCL's broadphases do not take half spaces
    }
    broadphase.setup();

    cairn_bodies table = {};
    table.struct_size = sizeof table;
    table.count = static_cast<uint32_t>(bodies.size());
    cairn_results results = {};
    results.struct_size = sizeof results;
    table.position = results.position = view(bodies[0].position.data());
    table.orientation = results.orientation = view(bodies[0].orientation);
    table.linear_velocity = results.linear_velocity = view(bodies[0].linear.data());
    table.angular_velocity = results.angular_velocity = view(bodies[0].angular.data());
    table.inverse_mass = view(&bodies[0].inverseMass);
    table.inverse_inertia = view(bodies[0].inverseInertia.data());
    cairn_step step = {};
    step.struct_size = sizeof step;
    step.dt = 1.0 / 60;
    step.gravity[1] = -9.81;
    step.bodies = &table;

    cairn_solver* solver = nullptr;
    cairn_status status = cairn_solver_create(nullptr, &solver);
    double fastest = 0;
    for (int frame = 1; frame <= 600 && status == CAIRN_OK; ++frame) {
        for (std::size_t i = 0; i < bodies.size(); ++i) {
            const double* q = bodies[i].orientation;
            objects[i]->setTransform(fcl::Quaterniond(q[3], q[0], q[1], q[2]), bodies[i].position);
            objects[i]->computeAABB();
        }
        broadphase.update();
        contacts.find(broadphase);
        const cairn_contacts touching = contacts.table();
        step.contacts = &touching;
        status = cairn_solver_step(solver, &step, &results);
        if (frame % 60 == 0) {
            double deepest = 0;
            fastest = 0;
            for (const cairn::fcl::Contact& contact : contacts.contacts())
                deepest = std::max(deepest, -contact.separation);
            for (const Body& body : bodies)
                fastest = std::max(fastest, body.linear.norm());
            std::printf("%2d s: %3u contacts, deepest %5.2f mm, fastest body %6.3f m/s\n", frame / 60, touching.count, 1000 * deepest,
                        fastest);
        }
    }
    if (status != CAIRN_OK)
        std::fprintf(stderr, "Cairn: %s\n", cairn_last_error());
    cairn_solver_destroy(solver);
    return status == CAIRN_OK && fastest < 0.1 ? 0 : 1; // at rest
}
