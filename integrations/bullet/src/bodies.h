// Bodies of a step: which of Bullet's objects take part, under which index, and the way back.
#pragma once
#include "loops.h"
#include "tables.h"

#include <utility>

class btCollisionObject;
class btCollisionWorld;

namespace cairn {
namespace bullet {

// A body between the solve and the landing.
struct Flight {
    btRigidBody* body;
    int worldIndex;
    btScalar position[3]; // where the substeps ended
    btScalar orientation[4];
    btScalar linear[3]; // and with what velocity
    btScalar angular[3];
    btScalar averageLinear[3]; // what the body has meanwhile
    btScalar averageAngular[3];
};

class Bodies {
  public:
    explicit Bodies(Tables& tables) : m_tables(tables) {}

    void beginStep();
    // The object's index in tables.bodies-to-be, given at its first mention; CAIRN_WORLD for btTypedConstraint::getFixedBody().
    int indexOf(btCollisionObject& object);
    bool canMove(int index) const { return index >= 0 && m_tables.bodyOwners[static_cast<std::size_t>(index)] != nullptr; }

    // Fills tables.bodies, once all have been mentioned.
    void gather(const Loops& loops);
    bool empty() const { return m_objects.empty(); }

    // Velocities, and the pose from which Bullet's own integration of this step lands on the solver's pose.
    void scatter(btScalar dt, const Loops& loops) const;
    // Or: the velocities that lead there, the rest in `flights`.
    void scatter(btScalar dt, std::vector<Flight>& flights, const Loops& loops) const;

  private:
    int add(btCollisionObject& object);

    struct Place {
        uint64_t step;
        int index;
    };
    // move(i, body, record) for the i-th body that the step may move.
    template <class Move> void eachMovable(const Loops& loops, const Move& move) const;
    static void fill(BodyRecord& record, btCollisionObject& object, btRigidBody* owner);

    Tables& m_tables;
    std::vector<btCollisionObject*> m_objects;                      // of tables.bodies
    std::vector<uint32_t> m_movable;                                // those of them that the step may move
    std::vector<Place> m_byWorldIndex;                              // by btCollisionObject::getWorldArrayIndex()
    std::vector<std::pair<btCollisionObject*, int>> m_outsideWorld; // the few that are in no world
    btCollisionObject* m_fixed = nullptr;
    uint64_t m_step = 0;
};

// The end of the step, once the world has integrated: poses, but for bodies that CCD has stopped on the way, and velocities.
void land(const std::vector<Flight>& flights, btCollisionWorld& world);

} // namespace bullet
} // namespace cairn
