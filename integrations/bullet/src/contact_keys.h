// Keys for warm starts: which contact point of this step is which of the last one.
//
// A point's address says nothing: btPersistentManifold moves its last point into the hole that a removed one leaves, and
// m_userPersistentData belongs to the application. So each manifold's points are remembered by their places on the two
// bodies, and a point takes over the key of the nearest remembered one that is within the manifold's breaking threshold
// on either body: the rule that Bullet itself keeps points by.
#pragma once
#include <LinearMath/btVector3.h>

#include <cstdint>
#include <unordered_map>

class btCollisionObject;
class btPersistentManifold;

namespace cairn {
namespace bullet {

class ContactKeys {
  public:
    static constexpr int kPoints = 4; // MANIFOLD_CACHE_SIZE

    void beginStep() { ++m_step; }
    // Fills keys[0 ... manifold.getNumContacts() - 1].
    void match(const btPersistentManifold& manifold, uint64_t (&keys)[kPoints]);
    // Forgets manifolds that have not been seen for a while.
    void endStep(std::size_t manifolds);
    void clear() { m_manifolds.clear(); }

  private:
    struct Point {
        btVector3 localA, localB;
        uint64_t key;
    };
    struct Remembered {
        const btCollisionObject* body0 = nullptr;
        const btCollisionObject* body1 = nullptr;
        uint64_t step = 0;
        int count = 0;
        Point points[kPoints];
    };
    std::unordered_map<const btPersistentManifold*, Remembered> m_manifolds;
    uint64_t m_step = 0;
    uint64_t m_nextKey = 1; // 0 means no key
};

} // namespace bullet
} // namespace cairn
