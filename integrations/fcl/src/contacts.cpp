#include "mesh.h"
#include "point_keys.h"

#include <cairn/fcl.hpp>

#include <fcl/narrowphase/collision.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <unordered_map>

namespace cairn {
namespace fcl {
namespace {

using Object = ::fcl::CollisionObjectd;

constexpr double kKeyReach = 0.05;           // of the smaller object's size
constexpr std::size_t kMeshContacts = 10000; // of a pair

bool isBounded(const Geometry& geometry) {
    return geometry.getNodeType() != ::fcl::GEOM_HALFSPACE && geometry.getNodeType() != ::fcl::GEOM_PLANE;
}

// Whether the boxes about two objects, or the box of one and the half space or plane that is the other, are further apart.
bool apart(const Object& a, const Object& b, double margin) {
    const Object *unbounded = nullptr, *object = &b;
    if (!isBounded(*a.collisionGeometry()))
        unbounded = &a;
    else if (!isBounded(*b.collisionGeometry())) {
        unbounded = &b;
        object = &a;
    }
    if (!unbounded)
        return a.getAABB().distance(b.getAABB()) > margin;
    const Vector3 origin = object->getTranslation();
    Transform pose = unbounded->getTransform();
    pose.translation() -= origin;
    const Core plane = makeCore(*unbounded->collisionGeometry(), pose, Vector3::Zero(), Vector3::Zero());
    const Vector3 center = object->getAABB().center() - origin, half = (object->getAABB().max_ - object->getAABB().min_) / 2;
    return plane.planeNormal.dot(center) - plane.planeNormal.cwiseAbs().dot(half) - plane.planeOffset > margin;
}

// m; FCL's radius of half spaces means nothing.
double sizeOf(const Geometry& geometry) { return isBounded(geometry) ? geometry.aabb_radius : std::numeric_limits<double>::infinity(); }

// Poses from an origin at one of the objects that has a place, so that nothing is lost far from the world's.
struct Pose {
    Pose(const Object& a, const Object& b)
        : origin(isBounded(*a.collisionGeometry()) ? a.getTranslation() : b.getTranslation()), poseA(a.getTransform()),
          poseB(b.getTransform()) {
        poseA.translation() -= origin;
        poseB.translation() -= origin;
    }
    Vector3 origin;
    Transform poseA, poseB;
};

struct Pair {
    Core a, b;
    Direction best;
};

Pair search(const Geometry& geometryA, const Geometry& geometryB, const Pose& pose, const Vector3* start, double margin) {
    const Vector3 zero = Vector3::Zero();
    Pair pair{makeCore(geometryA, pose.poseA, zero, pose.poseB.translation()),
              makeCore(geometryB, pose.poseB, zero, pose.poseA.translation()), Direction{zero, 0}};
    Vector3 from = Vector3(0, 1, 0);
    if (pair.a.solid != Solid::halfSpace && pair.b.solid != Solid::halfSpace)
        from = start ? *start : startDirection(geometryA, pose.poseA, geometryB, pose.poseB, pair.b.center - pair.a.center, margin);
    pair.best = bestDirection(pair.a, pair.b, from, margin);
    return pair;
}

void store(double (&to)[3], const Vector3& from) {
    for (int i = 0; i < 3; ++i)
        to[i] = from[i];
}

void check(double value, double low, double high, const char* name) {
    if (!(value >= low && value <= high))
        throw std::invalid_argument("cairn::fcl: " + std::string(name) + " " + std::to_string(value) + " is not in " + std::to_string(low) +
                                    " ... " + std::to_string(high));
}

} // namespace

struct Contacts::Implementation {
    struct Attached {
        const Object* object;
        Surface surface;
        uint32_t number; // in the order of attaching
    };
    using Numbers = std::pair<uint32_t, uint32_t>;

    std::unordered_map<const Object*, Attached> attached;
    std::vector<std::pair<Numbers, std::pair<const Attached*, const Attached*>>> pairs; // of the manager's, before they are sorted
    std::vector<std::pair<Numbers, std::vector<Contact>>> found;
    std::set<Numbers> added; // pairs, by the user
    std::vector<Contact> contacts;
    PointKeys keys;
    Filter filter;
    double margin = 0.01;
    uint32_t nextNumber = 0;

    // Whether the two touch at all as far as bodies go; puts them in the order of attaching.
    bool meet(const Attached*& a, const Attached*& b) const {
        if (a->surface.body == b->surface.body)
            return false;
        if (a->number > b->number)
            std::swap(a, b);
        return !filter || filter(*a->object, *b->object);
    }

    void collect(const Object* object1, const Object* object2) {
        const auto first = attached.find(object1), second = attached.find(object2);
        if (first == attached.end() || second == attached.end() || apart(*object1, *object2, margin))
            return;
        const Attached *a = &first->second, *b = &second->second;
        if (meet(a, b))
            pairs.push_back({{a->number, b->number}, {a, b}});
    }

    // FCL's trees cannot hold half spaces and planes, whose boxes are infinite: each is held against every object.
    void collectUnbounded(const ::fcl::BroadPhaseCollisionManagerd& manager) {
        std::vector<Object*> objects;
        manager.getObjects(objects);
        for (const auto& one : attached)
            if (!isBounded(*one.second.object->collisionGeometry()))
                for (const Object* object : objects)
                    if (isBounded(*object->collisionGeometry()))
                        collect(one.second.object, object);
    }

    static void checkPose(const Attached& one) {
        if (!one.object->getTransform().matrix().allFinite())
            throw std::invalid_argument("cairn::fcl: the transform of object " + std::to_string(one.number) +
                                        ", in the order of attaching, is not finite");
    }

    void add(const Attached& a, const Attached& b, const ::fcl::CollisionResultd* result, bool swapped) {
        const Object &objectA = *a.object, &objectB = *b.object;
        const Geometry &geometryA = *objectA.collisionGeometry(), &geometryB = *objectB.collisionGeometry();
        const Pose pose(objectA, objectB);
        std::vector<Point> points;
        if (isMesh(geometryA) || isMesh(geometryB)) {
            if (result && !swapped) {
                points =
                    meshPoints(geometryA, objectA.getTransform(), geometryB, objectB.getTransform(), pose.origin, *result, true, margin);
            } else {
                ::fcl::CollisionResultd own;
                bool hasPoints = true;
                try {
                    ::fcl::collide(&geometryA, pose.poseA, &geometryB, pose.poseB, ::fcl::CollisionRequestd(kMeshContacts, true), own);
                } catch (const std::exception&) { // EPA gives up on some triangles: which ones touch it can tell all the same
                    hasPoints = false;
                    own.clear();
                    ::fcl::collide(&geometryA, pose.poseA, &geometryB, pose.poseB, ::fcl::CollisionRequestd(kMeshContacts, false), own);
                }
                points = meshPoints(geometryA, pose.poseA, geometryB, pose.poseB, Vector3::Zero(), own, hasPoints, margin);
            }
        } else if (isBounded(geometryA) || isBounded(geometryB)) {
            Vector3 start;
            if (result && result->numContacts() > 0)
                start = swapped ? Vector3(-result->getContact(0).normal) : result->getContact(0).normal;
            const bool started = result && result->numContacts() > 0 && std::abs(start.squaredNorm() - 1) < 1e-3;
            const Pair pair = search(geometryA, geometryB, pose, started ? &start : nullptr, margin);
            points = makeManifold(pair.a, pair.b, pair.best, margin);
            reduceToFour(points, std::min(pair.a.size, pair.b.size));
        }
        if (points.empty())
            return;

        std::vector<PointKeys::Place> places;
        for (const Point& point : points) {
            const Vector3 onB = point.onA + point.separation * point.normal;
            places.push_back({pose.poseA.linear().transpose() * (point.onA - pose.poseA.translation()),
                              pose.poseB.linear().transpose() * (onB - pose.poseB.translation()), 0});
        }
        keys.match({a.number, b.number}, places, kKeyReach * std::min(sizeOf(geometryA), sizeOf(geometryB)));

        uint32_t flags = 0;
        if (geometryA.getNodeType() == ::fcl::GEOM_SPHERE && a.surface.centerOfMass.isZero())
            flags |= CAIRN_CONTACT_ROUND_A;
        if (geometryB.getNodeType() == ::fcl::GEOM_SPHERE && b.surface.centerOfMass.isZero())
            flags |= CAIRN_CONTACT_ROUND_B;
        const auto center = [&](const Attached& one, const Transform& at) -> Vector3 {
            if (one.surface.body == CAIRN_WORLD)
                return -pose.origin; // the world's frame is at its origin
            return at.translation() + at.linear() * one.surface.centerOfMass;
        };
        const Vector3 centerA = center(a, pose.poseA), centerB = center(b, pose.poseB);
        found.push_back({{a.number, b.number}, {}});
        for (std::size_t i = 0; i < points.size(); ++i) {
            Contact contact = {};
            contact.key = places[i].key;
            contact.bodyA = a.surface.body;
            contact.bodyB = b.surface.body;
            contact.flags = flags;
            contact.separation = points[i].separation;
            contact.friction = a.surface.friction * b.surface.friction;
            contact.restitution = a.surface.restitution * b.surface.restitution;
            store(contact.normal, points[i].normal);
            store(contact.armA, points[i].onA - centerA);
            store(contact.armB, points[i].onA + points[i].separation * points[i].normal - centerB);
            found.back().second.push_back(contact);
        }
    }
};

Contacts::Contacts() : m_implementation(new Implementation) {}

Contacts::~Contacts() = default;

void Contacts::attach(const Object* object, const Surface& surface) {
    if (!object || !object->collisionGeometry())
        throw std::invalid_argument("cairn::fcl: an object to attach is NULL, or has no geometry");
    if (object->getObjectType() != ::fcl::OT_GEOM && object->getObjectType() != ::fcl::OT_BVH)
        throw std::invalid_argument("cairn::fcl: an object's geometry is neither a shape nor a BVHModel");
    const double largest = std::numeric_limits<double>::max();
    check(surface.body, CAIRN_WORLD, std::numeric_limits<int32_t>::max(), "body");
    check(surface.friction, 0, largest, "friction");
    check(surface.restitution, 0, 1, "restitution");
    for (int i = 0; i < 3; ++i)
        check(surface.centerOfMass[i], -largest, largest, "centerOfMass");
    Implementation& m = *m_implementation;
    const auto known = m.attached.find(object);
    if (known != m.attached.end())
        known->second.surface = surface;
    else
        m.attached.insert({object, Implementation::Attached{object, surface, m.nextNumber++}});
}

void Contacts::detach(const Object* object) {
    const auto known = m_implementation->attached.find(object);
    if (known == m_implementation->attached.end())
        return;
    m_implementation->keys.forget(known->second.number);
    m_implementation->attached.erase(known);
}

void Contacts::setMargin(double margin) {
    check(margin, 0, std::numeric_limits<double>::max(), "margin");
    m_implementation->margin = margin;
}

double Contacts::margin() const { return m_implementation->margin; }

void Contacts::setFilter(Filter filter) { m_implementation->filter = std::move(filter); }

void Contacts::find(const ::fcl::BroadPhaseCollisionManagerd& manager) {
    Implementation& m = *m_implementation;
    for (const auto& one : m.attached)
        Implementation::checkPose(one.second);
    m.pairs.clear();
    // A broadphase offers pairs that overlap, or pairs nearer than the least distance so far: here that is always the margin.
    if (m.margin > 0)
        manager.distance(&m, [](Object* a, Object* b, void* data, double& least) {
            least = static_cast<Implementation*>(data)->margin;
            static_cast<Implementation*>(data)->collect(a, b);
            return false;
        });
    else
        manager.collide(&m, [](Object* a, Object* b, void* data) {
            static_cast<Implementation*>(data)->collect(a, b);
            return false;
        });
    m.collectUnbounded(manager);
    // Its own order may depend on where objects lie in memory.
    std::sort(m.pairs.begin(), m.pairs.end());
    m.pairs.erase(std::unique(m.pairs.begin(), m.pairs.end()), m.pairs.end());
    begin();
    for (const auto& pair : m.pairs)
        m.add(*pair.second.first, *pair.second.second, nullptr, false);
    finish();
}

void Contacts::begin() {
    m_implementation->found.clear();
    m_implementation->added.clear();
    m_implementation->keys.beginStep();
}

void Contacts::add(const Object* object1, const Object* object2, const ::fcl::CollisionResultd& result) {
    Implementation& m = *m_implementation;
    const auto first = m.attached.find(object1), second = m.attached.find(object2);
    if (first == m.attached.end() || second == m.attached.end())
        throw std::invalid_argument("cairn::fcl: an object of a result is not attached");
    const Implementation::Attached *a = &first->second, *b = &second->second;
    if (!m.meet(a, b))
        return;
    const Implementation::Numbers numbers{a->number, b->number};
    if (m.added.count(numbers) > 0)
        throw std::invalid_argument("cairn::fcl: objects " + std::to_string(a->number) + " and " + std::to_string(b->number) +
                                    " were added twice in this step");
    m.checkPose(*a);
    m.checkPose(*b);
    m.added.insert(numbers);
    m.add(*a, *b, &result, a->object != object1);
}

void Contacts::finish() {
    Implementation& m = *m_implementation;
    m.keys.endStep();
    std::sort(m.found.begin(), m.found.end(), [](const auto& p, const auto& q) { return p.first < q.first; });
    m.contacts.clear();
    for (const auto& pair : m.found)
        m.contacts.insert(m.contacts.end(), pair.second.begin(), pair.second.end());
}

std::vector<Contact>& Contacts::contacts() { return m_implementation->contacts; }
const std::vector<Contact>& Contacts::contacts() const { return m_implementation->contacts; }

cairn_contacts Contacts::table() {
    std::vector<Contact>& rows = m_implementation->contacts;
    cairn_contacts table = {};
    table.struct_size = sizeof table;
    if (rows.size() > std::numeric_limits<int32_t>::max() - 1u)
        throw std::invalid_argument("cairn::fcl: there are " + std::to_string(rows.size()) + " contacts, more than a step takes");
    table.count = static_cast<uint32_t>(rows.size());
    if (rows.empty())
        return table;
    const auto view = [](void* data, uint32_t type) {
        cairn_view v = {};
        v.data = data;
        v.stride = sizeof(Contact);
        v.type = type;
        return v;
    };
    Contact& first = rows.front();
    table.body_a = view(&first.bodyA, CAIRN_I32);
    table.body_b = view(&first.bodyB, CAIRN_I32);
    table.normal = view(first.normal, CAIRN_F64);
    table.arm_a = view(first.armA, CAIRN_F64);
    table.arm_b = view(first.armB, CAIRN_F64);
    table.separation = view(&first.separation, CAIRN_F64);
    table.friction = view(&first.friction, CAIRN_F64);
    table.restitution = view(&first.restitution, CAIRN_F64);
    table.key = view(&first.key, CAIRN_U64);
    table.flags = view(&first.flags, CAIRN_U32);
    return table;
}

double signedDistance(const Object& object1, const Object& object2, double margin) {
    const Geometry &geometry1 = *object1.collisionGeometry(), &geometry2 = *object2.collisionGeometry();
    if (!isBounded(geometry1) && !isBounded(geometry2))
        throw std::invalid_argument("cairn::fcl: the distance of two half spaces or planes is not defined here");
    return search(geometry1, geometry2, Pose(object1, object2), nullptr, margin).best.distance;
}

} // namespace fcl
} // namespace cairn
