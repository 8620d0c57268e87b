// Bodies of a step: which of Bullet's objects take part, under which index, and the way back.
#pragma once
#include "tables.h"

#include <utility>

class btCollisionObject;

namespace cairn {
namespace bullet {

class Bodies {
  public:
    explicit Bodies(Tables& tables) : m_tables(tables) {}

    void beginStep();
    // The object's index in tables.bodies, added at its first mention; CAIRN_WORLD for btTypedConstraint::getFixedBody().
    int indexOf(btCollisionObject& object);
    bool canMove(int index) const { return index >= 0 && m_tables.bodyOwners[static_cast<std::size_t>(index)] != nullptr; }

    // Velocities, and the pose from which Bullet's own integration of this step lands on the solver's pose.
    void scatter(btScalar dt) const;

  private:
    int add(btCollisionObject& object);

    struct Place {
        uint64_t step;
        int index;
    };
    Tables& m_tables;
    std::vector<Place> m_byWorldIndex;                              // by btCollisionObject::getWorldArrayIndex()
    std::vector<std::pair<btCollisionObject*, int>> m_outsideWorld; // the few that are in no world
    btCollisionObject* m_fixed = nullptr;
    uint64_t m_step = 0;
};

} // namespace bullet
} // namespace cairn
