// Keys for warm starts: which contact point of this step is which of the last one.
//
// A point's address says nothing: btPersistentManifold moves its last point into the hole that a removed one leaves, and
// m_userPersistentData belongs to the application. So each manifold's points are remembered by their places on the two
// bodies, and a point takes over the key of the nearest remembered one that is within the manifold's breaking threshold
// on either body: the rule that Bullet itself keeps points by.
#pragma once
#include "loops.h"
#include "tables.h"

#include <LinearMath/btVector3.h>

#include <cstdint>
#include <unordered_map>
#include <vector>

class btCollisionObject;
class btPersistentManifold;

namespace cairn {
namespace bullet {

class ContactKeys {
  public:
    static constexpr int kPoints = 4; // MANIFOLD_CACHE_SIZE

    static constexpr uint32_t kSeen = UINT32_MAX;

    void beginStep() { ++m_step; }
    // A step's manifolds, each in three turns: first the place where it is remembered, kSeen if it came before in this step; then
    // match(), which any number of threads may call at once for different places: fills keys[0 ... manifold.getNumContacts() - 1], with 0
    // for a point that is new, and returns how many are; then new keys for those of a place, one call after another.
    uint32_t place(const btPersistentManifold& manifold);
    int match(uint32_t place, const btPersistentManifold& manifold, uint64_t (&keys)[kPoints]);
    // What place(), what match() will look at.
    void prefetchGuess(const btPersistentManifold& manifold) const;
    void prefetchPlace(uint32_t place) const { prefetch<sizeof(Remembered)>(&m_places[place]); }
    void number(uint32_t place, uint64_t (&keys)[kPoints]);
    // Forgets manifolds that have not been seen for a while.
    void endStep(std::size_t manifolds);
    void clear();

  private:
    struct Point {
        uint64_t key;
        btScalar localA[3], localB[3];
    };
    struct Remembered {
        const btPersistentManifold* manifold = nullptr;
        const btCollisionObject* body0 = nullptr;
        const btCollisionObject* body1 = nullptr;
        uint64_t step = 0;
        int count = 0;
        Point points[kPoints];
    };
    std::vector<Remembered> m_places;
    std::vector<uint32_t> m_free;
    std::unordered_map<const btPersistentManifold*, uint32_t> m_placeOf;
    // The place that the manifold's index in its dispatcher suggests.
    uint32_t guessOf(std::size_t index) const { return index < m_byIndex.size() ? m_byIndex[index] : 0; }

    std::vector<uint32_t> m_byIndex; // by btPersistentManifold::m_index1a, the dispatcher's; a guess that saves the look-up
    uint64_t m_step = 0;
    uint64_t m_nextKey = 1; // 0 means no key
};

} // namespace bullet
} // namespace cairn
