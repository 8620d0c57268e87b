// Bodies of FCL's shapes that Cairn moves: an engine of a page, for tests.
#pragma once
#include "shapes.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>

#include <gtest/gtest.h>

#include <cstring>

namespace fcl_test {

constexpr double kDt = 1.0 / 60;

struct Body {
    Vector3d position, linear, angular;
    double orientation[4]; // x, y, z, w
    double inverseMass;
    Vector3d inverseInertia;
};

class World {
  public:
    explicit World(const Vector3d& gravity = Vector3d(0, -9.81, 0), uint32_t threads = 1) : m_gravity(gravity) {
        cairn_config config = {};
        config.struct_size = sizeof config;
        config.threads = threads;
        EXPECT_EQ(cairn_solver_create(&config, &m_solver), CAIRN_OK) << cairn_last_error();
        bodies.reserve(1000);
    }
    ~World() { cairn_solver_destroy(m_solver); }
    World(const World&) = delete;
    World& operator=(const World&) = delete;

    // Density 1000 kg/m^3; the shape's axes must be principal.
    Body& add(const Geometry& shape, const Vector3d& position, const Quaterniond& q = Quaterniond::Identity()) {
        Vector3d moments = 1000 * shape->computeMomentofInertia().diagonal();
        if (shape->getNodeType() == ::fcl::GEOM_CONVEX)
            moments *= shape->computeVolume(); // FCL 0.7 gives those of a unit mass there
        bodies.push_back(Body{position,
                              Vector3d::Zero(),
                              Vector3d::Zero(),
                              {q.x(), q.y(), q.z(), q.w()},
                              1 / (1000 * shape->computeVolume()),
                              moments.cwiseInverse()});
        m_objects.push_back(std::make_unique<Object>(shape));
        m_moving.push_back(m_objects.back().get());
        contacts.attach(m_objects.back().get(), {static_cast<int32_t>(bodies.size()) - 1});
        m_manager.registerObject(m_objects.back().get());
        return bodies.back();
    }
    void addFloor(const Geometry& shape = floorAt(0)) {
        m_objects.push_back(std::make_unique<Object>(shape));
        contacts.attach(m_objects.back().get(), {CAIRN_WORLD, 1});
        if (shape->getNodeType() != ::fcl::GEOM_HALFSPACE)
            m_manager.registerObject(m_objects.back().get());
    }

    void step(int count = 1) {
        for (int i = 0; i < count; ++i)
            stepOnce();
    }
    cairn_statistics statistics() const {
        cairn_statistics s = {};
        s.struct_size = sizeof s;
        EXPECT_EQ(cairn_solver_get_statistics(m_solver, &s), CAIRN_OK);
        return s;
    }
    double deepest() const {
        double most = 0;
        for (const cairn::fcl::Contact& contact : contacts.contacts())
            most = std::max(most, -contact.separation);
        return most;
    }
    // FNV-1a of all poses and velocities.
    uint64_t hash() const {
        uint64_t value = 14695981039346656037u;
        for (const Body& body : bodies) {
            unsigned char bytes[sizeof(Body)];
            std::memcpy(bytes, &body, sizeof bytes);
            for (const unsigned char byte : bytes)
                value = (value ^ byte) * 1099511628211u;
        }
        return value;
    }

    std::vector<Body> bodies;
    cairn::fcl::Contacts contacts;

  private:
    static cairn_view view(void* data) {
        cairn_view v = {};
        v.data = data;
        v.stride = sizeof(Body);
        v.type = CAIRN_F64;
        return v;
    }

    void stepOnce() {
        for (std::size_t i = 0; i < bodies.size(); ++i) {
            const double* q = bodies[i].orientation;
            m_moving[i]->setTransform(Quaterniond(q[3], q[0], q[1], q[2]), bodies[i].position);
            m_moving[i]->computeAABB();
        }
        m_manager.update();
        contacts.find(m_manager);
        const cairn_contacts touching = contacts.table();
        cairn_bodies table = {};
        table.struct_size = sizeof table;
        table.count = static_cast<uint32_t>(bodies.size());
        cairn_results results = {};
        results.struct_size = sizeof results;
        Body& first = bodies.front();
        table.position = results.position = view(first.position.data());
        table.orientation = results.orientation = view(first.orientation);
        table.linear_velocity = results.linear_velocity = view(first.linear.data());
        table.angular_velocity = results.angular_velocity = view(first.angular.data());
        table.inverse_mass = view(&first.inverseMass);
        table.inverse_inertia = view(first.inverseInertia.data());
        cairn_step step = {};
        step.struct_size = sizeof step;
        step.dt = kDt;
        for (int i = 0; i < 3; ++i)
            step.gravity[i] = m_gravity[i];
        step.bodies = &table;
        step.contacts = &touching;
        ASSERT_EQ(cairn_solver_step(m_solver, &step, &results), CAIRN_OK) << cairn_last_error();
    }

    Vector3d m_gravity;
    cairn_solver* m_solver = nullptr;
    std::vector<std::unique_ptr<Object>> m_objects;
    std::vector<Object*> m_moving;
    ::fcl::DynamicAABBTreeCollisionManagerd m_manager;
};

} // namespace fcl_test
