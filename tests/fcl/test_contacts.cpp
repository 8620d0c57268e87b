// Contacts of single poses: arms, normals, manifolds, flags, keys, order, refusals.
#include "shapes.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/narrowphase/collision.h>

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <set>
#include <stdexcept>

namespace {

using namespace fcl_test;
using cairn::fcl::Contact;
using cairn::fcl::Contacts;

constexpr double kPi = 3.14159265358979323846;

Vector3d vector(const double (&v)[3]) { return Vector3d(v[0], v[1], v[2]); }

// Objects that are their own bodies, the first at index 0; half spaces belong to the world.
struct Set {
    std::vector<std::unique_ptr<Object>> objects;
    ::fcl::DynamicAABBTreeCollisionManagerd manager;
    Contacts contacts;
    int bodies = 0;

    Object& add(const Geometry& geometry, const Transform3d& pose) {
        objects.push_back(std::make_unique<Object>(geometry, pose));
        const bool world = geometry->getNodeType() == ::fcl::GEOM_HALFSPACE;
        contacts.attach(objects.back().get(), {world ? CAIRN_WORLD : bodies});
        if (!world) {
            manager.registerObject(objects.back().get());
            ++bodies;
        }
        return *objects.back();
    }
    const std::vector<Contact>& find() {
        for (const auto& object : objects)
            object->computeAABB();
        manager.update();
        contacts.find(manager);
        return contacts.contacts();
    }
    Vector3d center(int body) const {
        return body == CAIRN_WORLD ? Vector3d(Vector3d::Zero()) : objects[static_cast<std::size_t>(body)]->getTranslation();
    }
    std::set<uint64_t> keys() const {
        std::set<uint64_t> found;
        for (const Contact& contact : contacts.contacts())
            found.insert(contact.key);
        return found;
    }
    double widest() const { // the longest distance between two points
        double most = 0;
        for (const Contact& p : contacts.contacts())
            for (const Contact& q : contacts.contacts())
                most = std::max(most, (vector(p.armA) - vector(q.armA)).norm());
        return most;
    }
};

bool holds(const Object& object, const Vector3d& point, double tolerance) { // for half spaces and convex shapes
    const Vector3d local = object.getTransform().inverse() * point;
    const ::fcl::CollisionGeometryd& geometry = *object.collisionGeometry();
    if (geometry.getNodeType() == ::fcl::GEOM_HALFSPACE)
        return static_cast<const ::fcl::Halfspaced&>(geometry).signedDistance(local) <= tolerance;
    Dice dice(3);
    for (int i = 0; i < 500; ++i) {
        const Vector3d n = dice.vector(1).normalized();
        if (n.dot(local) > support(geometry, n) + tolerance)
            return false;
    }
    return true;
}

TEST(Contacts, ArmsMeetTheInterfacesPromise) {
    const std::vector<Geometry> shapes = {box(0.4, 0.6, 0.8),
                                          sphere(0.4),
                                          capsule(0.2, 0.6),
                                          boxMesh(0.5, 0.7, 0.6, true),
                                          prism(7, 0.4, 0.5),
                                          std::make_shared<::fcl::Cylinderd>(0.3, 0.7),
                                          std::make_shared<::fcl::Coned>(0.4, 0.7),
                                          std::make_shared<::fcl::Ellipsoidd>(0.3, 0.4, 0.5),
                                          floorAt(0)};
    Dice dice(5);
    int found = 0;
    for (const Geometry& first : shapes)
        for (const Geometry& second : shapes)
            for (int i = 0; i < 10; ++i) {
                if (first->getNodeType() == ::fcl::GEOM_HALFSPACE)
                    continue;
                Set set;
                set.add(first, at(dice.vector(0.2), dice.turn()));
                set.add(second, at(dice.vector(0.6), dice.turn()));
                const double distance = cairn::fcl::signedDistance(*set.objects[0], *set.objects[1], 0.01);
                const std::vector<Contact>& contacts = set.find();
                EXPECT_EQ(contacts.empty(), distance > 0.01);
                EXPECT_LE(contacts.size(), 4u);
                double least = 1;
                for (const Contact& c : contacts) {
                    ++found;
                    EXPECT_NEAR(vector(c.normal).norm(), 1, 1e-12);
                    const Vector3d gap = set.center(c.bodyB) + vector(c.armB) - set.center(c.bodyA) - vector(c.armA);
                    EXPECT_LT((gap - c.separation * vector(c.normal)).norm(), 1e-14);
                    EXPECT_TRUE(holds(*set.objects[0], set.center(c.bodyA) + vector(c.armA), 0.02));
                    EXPECT_LE(c.separation, 0.01);
                    least = std::min(least, c.separation);
                }
                // A face may be preferred to a direction that is a little better.
                if (!contacts.empty()) {
                    EXPECT_NEAR(least, distance, 0.06 * std::abs(distance) + 0.002);
                }
            }
    EXPECT_GT(found, 500);
}

TEST(Contacts, NormalsPointFromAToB) {
    for (const bool turned : {false, true}) {
        Set set;
        set.add(sphere(0.5), at({0, turned ? 0.9 : 0, 0}));
        set.add(box(1, 1, 1), at({0, turned ? 0 : 0.9, 0}));
        ASSERT_EQ(set.find().size(), 1u);
        const Contact& c = set.contacts.contacts()[0];
        EXPECT_EQ(c.bodyA, 0);
        EXPECT_EQ(c.bodyB, 1);
        EXPECT_NEAR(c.normal[1], turned ? -1 : 1, 1e-12);
        EXPECT_NEAR(c.separation, -0.1, 1e-12);
        EXPECT_NEAR(c.armA[1], turned ? -0.5 : 0.5, 1e-12);
        EXPECT_EQ(c.flags, CAIRN_CONTACT_ROUND_A);
    }
}

TEST(Contacts, FlatFacesTouchAtFourCorners) {
    const Geometry shapes[] = {box(1, 1, 1), boxMesh(1, 1, 1, true), boxMesh(1, 1, 1, false), prism(12, 0.7, 1),
                               std::make_shared<::fcl::Cylinderd>(0.7, 1)};
    for (const Geometry& lower : shapes)
        for (const Geometry& upper : shapes) {
            Set set;
            const Quaterniond up = turn(-kPi / 2, {1, 0, 0}); // prisms and cylinders stand along z
            set.add(lower, at({0, 0, 0}, up));
            set.add(upper, at({0, 0.999, 0}, up * turn(0.001, {0, 0, 1})));
            EXPECT_EQ(set.find().size(), 4u);
            EXPECT_GT(set.widest(), 1.2);
            for (const Contact& c : set.contacts.contacts()) {
                EXPECT_NEAR(c.normal[1], 1, 1e-9);
                EXPECT_NEAR(c.separation, -0.001, 1e-9);
            }
        }
    for (const Geometry& shape : shapes) {
        Set set;
        set.add(shape, at({0, 0.499, 0}, turn(-kPi / 2, {1, 0, 0})));
        set.add(floorAt(0), at({0, 0, 0}));
        EXPECT_EQ(set.find().size(), 4u);
        EXPECT_GT(set.widest(), 1.2);
    }
}

TEST(Contacts, OfAnOctagonFourThatSpanTheMost) {
    Set set;
    set.add(box(1, 1, 1), at({0, 0, 0}));
    set.add(box(1, 1, 1), at({0, 0.999, 0}, turn(kPi / 4, {0, 1, 0})));
    ASSERT_EQ(set.find().size(), 4u);
    const std::vector<Contact>& c = set.contacts.contacts();
    // A regular octagon of inradius 1/2: its largest quadrilateral is a square on its circumscribed circle.
    const double radius = 0.5 / std::cos(kPi / 8);
    EXPECT_NEAR((vector(c[2].armA) - vector(c[0].armA)).cross(vector(c[3].armA) - vector(c[1].armA)).norm() / 2, 2 * radius * radius, 1e-9);
}

TEST(Contacts, CapsulesTouchAlongALine) {
    Set set;
    set.add(capsule(0.2, 1), at({0, 0.199, 0}));
    set.add(floorAt(0), at({0, 0, 0}));
    EXPECT_EQ(set.find().size(), 2u);
    EXPECT_NEAR(set.widest(), 1, 1e-9);

    Set pair;
    pair.add(capsule(0.2, 1), at({0, 0, 0}));
    pair.add(capsule(0.2, 1), at({0, 0.399, 0.5}, turn(0.01, {0, 1, 0})));
    EXPECT_EQ(pair.find().size(), 2u);
    EXPECT_NEAR(pair.widest(), 0.5, 0.01);

    Set crossed;
    crossed.add(capsule(0.2, 1), at({0, 0, 0}));
    crossed.add(capsule(0.2, 1), at({0, 0.399, 0.1}, turn(kPi / 2, {0, 1, 0})));
    ASSERT_EQ(crossed.find().size(), 1u);
    EXPECT_NEAR(crossed.contacts.contacts()[0].armA[2], 0.1, 1e-12);
}

TEST(Contacts, MarginAndSpeculation) {
    Set set;
    set.add(box(1, 1, 1), at({0, 0, 0}));
    set.add(box(1, 1, 1), at({0, 1.008, 0}));
    EXPECT_EQ(set.find().size(), 4u);
    EXPECT_NEAR(set.contacts.contacts()[0].separation, 0.008, 1e-12);
    set.contacts.setMargin(0.005);
    EXPECT_EQ(set.find().size(), 0u);
    set.contacts.setMargin(0);
    EXPECT_EQ(set.find().size(), 0u);
    set.objects[1]->setTransform(at({0, 0.999, 0}));
    EXPECT_EQ(set.find().size(), 4u);
}

TEST(Contacts, KeysStayWithMovingPoints) {
    Set set;
    set.add(box(1, 1, 1), at({0, 0, 0}));
    Object& upper = set.add(box(1, 1, 1), at({0, 0.999, 0}));
    set.add(sphere(0.25), at({0.7499, 0, 0}));
    set.find();
    const std::set<uint64_t> before = set.keys();
    EXPECT_EQ(before.size(), 5u);
    EXPECT_EQ(before.count(0), 0u);
    for (int frame = 1; frame <= 40; ++frame) { // slides and turns by a third of its size, the ball climbs beside it
        upper.setTransform(at({0.008 * frame, 0.999, 0}, turn(0.002 * frame, {0, 1, 0})));
        set.objects[2]->setTranslation({0.7499, 0.005 * frame, 0});
        set.find();
        EXPECT_EQ(set.keys(), before) << "frame " << frame;
    }
    upper.setTransform(at({0, 3, 0}));
    set.find();
    upper.setTransform(at({0, 0.999, 0}));
    set.find();
    int again = 0;
    for (const uint64_t key : set.keys())
        again += static_cast<int>(before.count(key));
    EXPECT_EQ(again, 1) << "what parted starts anew, the ball goes on";
}

TEST(Contacts, OrderIsThatOfAttachingWhateverTheBroadphase) {
    std::vector<Contact> found[2];
    for (int way = 0; way < 2; ++way) {
        Dice dice(11);
        std::vector<std::unique_ptr<Object>> objects;
        ::fcl::DynamicAABBTreeCollisionManagerd manager;
        Contacts contacts;
        for (int i = 0; i < 40; ++i)
            objects.push_back(std::make_unique<Object>(i % 2 ? box(0.4, 0.5, 0.6) : capsule(0.2, 0.5), at(dice.vector(0.8), dice.turn())));
        for (int i = 0; i < 40; ++i)
            contacts.attach(objects[static_cast<std::size_t>(i)].get(), {i});
        for (int i = 0; i < 40; ++i)
            manager.registerObject(objects[static_cast<std::size_t>(way ? 39 - i : i)].get());
        manager.setup();
        contacts.find(manager);
        found[way] = contacts.contacts();
    }
    ASSERT_EQ(found[0].size(), found[1].size());
    EXPECT_GT(found[0].size(), 50u);
    EXPECT_EQ(std::memcmp(found[0].data(), found[1].data(), found[0].size() * sizeof(Contact)), 0);
}

TEST(Contacts, FromResultsOfFclsOwn) {
    Set set;
    set.add(box(1, 1, 1), at({0, 0, 0}));
    set.add(boxMesh(1, 1, 1, true), at({0.1, 0.99, 0}, turn(0.3, {0, 1, 0})));
    const std::vector<Contact> own = set.find();
    for (const bool swapped : {false, true}) {
        const Object *first = set.objects[swapped].get(), *second = set.objects[!swapped].get();
        ::fcl::CollisionResultd result;
        ::fcl::collide(first, second, ::fcl::CollisionRequestd(8, true), result);
        set.contacts.begin();
        set.contacts.add(first, second, result);
        EXPECT_THROW(set.contacts.add(second, first, result), std::invalid_argument);
        set.contacts.finish();
        ASSERT_EQ(set.contacts.contacts().size(), own.size());
        EXPECT_EQ(std::memcmp(set.contacts.contacts().data(), own.data(), own.size() * sizeof(Contact)), 0);
    }
}

TEST(Contacts, OfTheSameBodyOrFilteredOrWithoutASurfaceThereAreNone) {
    Set set;
    Object& first = set.add(box(1, 1, 1), at({0, 0, 0}));
    Object& second = set.add(box(1, 1, 1), at({0, 0.9, 0}));
    EXPECT_FALSE(set.find().empty());
    set.contacts.setFilter([&](const Object& a, const Object& b) { return !(&a == &first && &b == &second); });
    EXPECT_TRUE(set.find().empty());
    set.contacts.setFilter(nullptr);
    set.contacts.attach(&second, {0});
    EXPECT_TRUE(set.find().empty());
    set.contacts.attach(&second, {1});
    EXPECT_FALSE(set.find().empty());
    set.contacts.detach(&second);
    EXPECT_TRUE(set.find().empty());
}

TEST(Contacts, ACenterOfMassElsewhereMovesTheArms) {
    Set set;
    Object& first = set.add(box(1, 1, 1), at({0, 0, 0}, turn(kPi / 2, {0, 0, 1})));
    set.add(box(1, 1, 1), at({0, 0.999, 0}));
    const Vector3d arm = vector(set.find()[0].armA);
    cairn::fcl::Surface surface(0);
    surface.centerOfMass = Vector3d(0.1, 0.2, 0.3); // of the object's frame: (-0.2, 0.1, 0.3) of the world's
    set.contacts.attach(&first, surface);
    EXPECT_LT((vector(set.find()[0].armA) - arm - Vector3d(0.2, -0.1, -0.3)).norm(), 1e-12);
}

// A square of two triangles a side of 4 m, facing up.
Geometry meshFloor() {
    auto model = std::make_shared<::fcl::BVHModel<::fcl::OBBRSSd>>();
    model->beginModel();
    model->addTriangle({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2});
    model->addTriangle({-2, 0, -2}, {2, 0, 2}, {2, 0, -2});
    model->endModel();
    return model;
}

TEST(Contacts, ABoxLiesOnAMeshByFourPointsAcrossItsTriangles) {
    for (const bool meshFirst : {true, false}) {
        Set set;
        if (meshFirst)
            set.add(meshFloor(), at({0, 0, 0}));
        set.add(box(1, 1, 1), at({0.2, 0.499, 0}));
        if (!meshFirst)
            set.add(meshFloor(), at({0, 0, 0}));
        ASSERT_EQ(set.find().size(), 4u);
        EXPECT_NEAR(set.widest(), std::sqrt(2.0), 0.01);
        for (const Contact& c : set.contacts.contacts()) {
            EXPECT_NEAR(c.normal[1], meshFirst ? 1 : -1, 1e-9);
            EXPECT_NEAR(c.separation, -0.001, 1e-9);
        }
    }
    Set ball;
    ball.add(meshFloor(), at({0, 0, 0}));
    ball.add(sphere(0.5), at({0.3, 0.49, 0.1}));
    ASSERT_EQ(ball.find().size(), 1u);
    EXPECT_NEAR(ball.contacts.contacts()[0].separation, -0.01, 1e-9);
}

Geometry meshCube() {
    auto model = std::make_shared<::fcl::BVHModel<::fcl::OBBRSSd>>();
    const auto hull = boxMesh(1, 1, 1, true);
    const std::vector<int>& faces = hull->getFaces();
    model->beginModel();
    for (std::size_t i = 0; i < faces.size(); i += 4) {
        const auto corner = [&](std::size_t k) { return hull->getVertices()[static_cast<std::size_t>(faces[i + k])]; };
        model->addTriangle(corner(1), corner(2), corner(3));
    }
    model->endModel();
    return model;
}

TEST(Contacts, MeshesOfTrianglesTouchEachOtherAndHalfSpaces) {
    for (const Geometry& below : {floorAt(0.5), meshCube()}) {
        Set set;
        set.add(meshCube(), at({0, 0.98, 0}, turn(0.3, {0, 1, 0})));
        set.add(below, at({0, 0, 0}));
        const std::vector<Contact>& found = set.find();
        ASSERT_GE(found.size(), 3u);
        for (const Contact& c : found) {
            const Vector3d gap = set.center(c.bodyB) + vector(c.armB) - set.center(c.bodyA) - vector(c.armA);
            EXPECT_LT((gap - c.separation * vector(c.normal)).norm(), 1e-14);
            EXPECT_LE(c.separation, 0.01);
        }
        EXPECT_LT(
            std::min_element(found.begin(), found.end(), [](const Contact& p, const Contact& q) { return p.separation < q.separation; })
                ->separation,
            -0.01);
    }
}

TEST(Contacts, RefusalsSayWhatIsWrong) {
    Set set;
    Object& object = set.add(box(1, 1, 1), at({0, 0, 0}));
    const auto refused = [](const std::function<void()>& call) {
        try {
            call();
        } catch (const std::invalid_argument& error) {
            return std::string(error.what());
        }
        return std::string("nothing was thrown");
    };
    EXPECT_NE(refused([&] { set.contacts.attach(nullptr, {0}); }).find("NULL"), std::string::npos);
    EXPECT_NE(refused([&] { set.contacts.attach(&object, {-2}); }).find("body -2"), std::string::npos);
    EXPECT_NE(refused([&] { set.contacts.attach(&object, {0, -0.5}); }).find("friction -0.5"), std::string::npos);
    EXPECT_NE(refused([&] { set.contacts.attach(&object, {0, 0.5, 1.5}); }).find("restitution 1.5"), std::string::npos);
    EXPECT_NE(refused([&] { set.contacts.setMargin(std::numeric_limits<double>::quiet_NaN()); }).find("margin"), std::string::npos);
    const Object stranger(box(1, 1, 1), at({0, 0.9, 0}));
    EXPECT_NE(refused([&] { set.contacts.add(&object, &stranger, ::fcl::CollisionResultd()); }).find("not attached"), std::string::npos);
    object.setTransform(at({0, std::numeric_limits<double>::quiet_NaN(), 0}));
    EXPECT_NE(refused([&] { set.contacts.find(set.manager); }).find("object 0"), std::string::npos);
    EXPECT_NE(refused([&] { cairn::fcl::signedDistance(stranger, Object(meshFloor()), 1); }).find("neither"), std::string::npos);
}

} // namespace
