// FCL in front of Cairn: contact points for the C interface (cairn/cairn.h) from FCL's collision detection.
//
//     fcl::DynamicAABBTreeCollisionManagerd manager;       // any of FCL's broadphases
//     cairn::fcl::Contacts contacts;
//     contacts.attach(&object, {bodyIndex, friction});     // once for each fcl::CollisionObjectd
//     manager.registerObject(&object);                     // all but half spaces and planes
//     ...
//     manager.update();                                    // each step, after the objects' transforms were set
//     contacts.find(manager);
//     const cairn_contacts table = contacts.table();
//     step.contacts = &table;
//
// Compiled inside the application's build, in C++14, over FCL's double interface. README.md beside this folder says what each pair of
// shapes gets. Units are SI. Inside namespace cairn write ::fcl for FCL itself.
#ifndef CAIRN_FCL_HPP
#define CAIRN_FCL_HPP

#include <cairn/cairn.h>

#include <fcl/broadphase/broadphase_collision_manager.h>
#include <fcl/narrowphase/collision_object.h>
#include <fcl/narrowphase/collision_result.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace cairn {
namespace fcl {

// What an object is to the solver. Several objects may belong to one body.
struct Surface {
    int32_t body = CAIRN_WORLD;                             // index in cairn_bodies
    double friction = 0.5;                                  // >= 0; a contact's coefficient is the product of its two objects'
    double restitution = 0;                                 // 0 ... 1; likewise
    ::fcl::Vector3d centerOfMass = ::fcl::Vector3d::Zero(); // m, of the body, in the object's frame

    Surface() = default;
    Surface(int32_t bodyIndex, double frictionFactor = 0.5, double restitutionFactor = 0) // NOLINT: meant to convert
        : body(bodyIndex), friction(frictionFactor), restitution(restitutionFactor) {}
};

// A contact point: one row of cairn_contacts. Arms are in world axes and satisfy (x_b + armB) - (x_a + armA) = separation * normal to
// rounding, x being the centres of mass.
struct Contact {
    uint64_t key; // keeps to a point while it stays within a twentieth of the smaller object's size on either object
    int32_t bodyA;
    int32_t bodyB;
    uint32_t flags; // CAIRN_CONTACT_ROUND_A, _B: spheres
    uint32_t padding;
    double normal[3]; // unit, from a to b
    double armA[3];   // m
    double armB[3];
    double separation; // m, negative when the objects overlap
    double friction;
    double restitution;
};

// Finds the contacts of a step and remembers their keys. It holds no object: detach one before it is destroyed.
// One instance serves one thread at a time. Methods throw std::invalid_argument for what does not fit, and then have changed nothing.
class Contacts {
  public:
    // Tells whether two objects, in the order in which they were attached, may touch.
    using Filter = std::function<bool(const ::fcl::CollisionObjectd&, const ::fcl::CollisionObjectd&)>;

    Contacts();
    ~Contacts();
    Contacts(const Contacts&) = delete;
    Contacts& operator=(const Contacts&) = delete;

    // Gives an object to the solver, or another surface to one that has it. Contacts come in the order of attaching, whatever the
    // broadphase's. Refused: a surface out of range, and octrees.
    void attach(const ::fcl::CollisionObjectd* object, const Surface& surface);
    // Forgets an object and its contacts' keys; one that is not attached is ignored.
    void detach(const ::fcl::CollisionObjectd* object);

    // Objects nearer than this get contacts too, with a positive separation, so that what will meet within a step does not first
    // overlap. m, >= 0, 0.01 unless set; 0: only what overlaps or touches.
    void setMargin(double margin);
    double margin() const;
    // Objects of the same body, and pairs of CAIRN_WORLD alone, never touch.
    void setFilter(Filter filter);

    // The contacts of all pairs of attached objects that `manager` holds; others in it take no part. Call manager.update() first.
    // Half spaces and planes are only attached, and meet all: FCL's trees crash on their infinite boxes.
    void find(const ::fcl::BroadPhaseCollisionManagerd& manager);

    // The same pair by pair, for those who call FCL themselves: begin(), add() for each pair (once, or refused), finish().
    // `result` is that of ::fcl::collide(object1, object2) with contacts enabled: its first contact's normal is where the search for
    // the manifold of two convex shapes starts, and every contact of a mesh is used.
    void begin();
    void add(const ::fcl::CollisionObjectd* object1, const ::fcl::CollisionObjectd* object2, const ::fcl::CollisionResultd& result);
    void finish();

    // What was found, in an order that depends on the input alone; friction and restitution may be changed before the step.
    std::vector<Contact>& contacts();
    const std::vector<Contact>& contacts() const;
    // The same as views of contacts(): good until the next change of it.
    cairn_contacts table();

  private:
    struct Implementation;
    std::unique_ptr<Implementation> m_implementation;
};

// The signed distance of two objects, m: -depth where they overlap, depth being the shortest translation that parts them. Exact to
// rounding for boxes, spheres, capsules, half spaces and convex meshes (two meshes with more than a thousand pairs of edges: if FCL's
// search starts on the right side). With a cylinder, cone or ellipsoid the depth may come out too large, by up to some hundredths of the
// smaller shape's size where they overlap deeply. If apart by more than `margin`, some distance above `margin`. Throws
// std::invalid_argument for meshes of triangles (BVHModel) and octrees, which have no inside, and for two half spaces or planes.
double signedDistance(const ::fcl::CollisionObjectd& object1, const ::fcl::CollisionObjectd& object2, double margin = 0);

} // namespace fcl
} // namespace cairn
#endif
