#include "contact_keys.h"

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

namespace cairn {
namespace bullet {

constexpr int ContactKeys::kPoints;
static_assert(MANIFOLD_CACHE_SIZE == ContactKeys::kPoints, "Bullet keeps four points a manifold");

void ContactKeys::match(const btPersistentManifold& manifold, uint64_t (&keys)[kPoints]) {
    Remembered& old = m_manifolds[&manifold];
    // Bullet reuses a manifold's memory for another pair.
    if (old.body0 != manifold.getBody0() || old.body1 != manifold.getBody1()) {
        old.count = 0;
        old.body0 = manifold.getBody0();
        old.body1 = manifold.getBody1();
    }
    const int count = manifold.getNumContacts();
    const btScalar threshold = manifold.getContactBreakingThreshold();
    bool taken[kPoints] = {false, false, false, false};
    Point points[kPoints];
    for (int i = 0; i < count; ++i) {
        const btManifoldPoint& point = manifold.getContactPoint(i);
        int best = -1;
        btScalar nearest = threshold * threshold;
        for (int j = 0; j < old.count; ++j) {
            if (taken[j])
                continue;
            const btScalar distanceA = (point.m_localPointA - old.points[j].localA).length2();
            const btScalar distanceB = (point.m_localPointB - old.points[j].localB).length2();
            const btScalar distance = distanceA < distanceB ? distanceA : distanceB;
            if (distance < nearest) {
                nearest = distance;
                best = j;
            }
        }
        if (best >= 0) {
            taken[best] = true;
            keys[i] = old.points[best].key;
        } else {
            keys[i] = m_nextKey++;
        }
        points[i] = Point{point.m_localPointA, point.m_localPointB, keys[i]};
    }
    for (int i = 0; i < count; ++i)
        old.points[i] = points[i];
    old.count = count;
    old.step = m_step;
}

void ContactKeys::endStep(std::size_t manifolds) {
    if (m_manifolds.size() <= 2 * manifolds + 64)
        return;
    for (auto entry = m_manifolds.begin(); entry != m_manifolds.end();) {
        if (entry->second.step != m_step)
            entry = m_manifolds.erase(entry);
        else
            ++entry;
    }
}

} // namespace bullet
} // namespace cairn
