#include "contact_keys.h"

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

namespace cairn {
namespace bullet {

constexpr int ContactKeys::kPoints;
static_assert(MANIFOLD_CACHE_SIZE == ContactKeys::kPoints, "Bullet keeps four points a manifold");

namespace {

std::size_t indexOf(const btPersistentManifold& manifold) { return static_cast<std::size_t>(static_cast<unsigned>(manifold.m_index1a)); }

} // namespace

void ContactKeys::prefetchGuess(const btPersistentManifold& manifold) const {
    if (!m_places.empty())
        prefetch<offsetof(Remembered, points)>(&m_places[std::min<std::size_t>(guessOf(indexOf(manifold)), m_places.size() - 1)]);
}

uint32_t ContactKeys::place(const btPersistentManifold& manifold) {
    const std::size_t index = indexOf(manifold);
    const bool guesses = index < 2 * m_places.size() + 1024; // another dispatcher's may be anything
    if (guesses && index >= m_byIndex.size())
        m_byIndex.resize(index + index / 2 + 64, 0);
    uint32_t found = guessOf(index);
    if (found >= m_places.size() || m_places[found].manifold != &manifold) {
        const auto known = m_placeOf.find(&manifold);
        if (known != m_placeOf.end()) {
            found = known->second;
        } else {
            if (m_free.empty()) {
                m_places.emplace_back();
                m_free.push_back(static_cast<uint32_t>(m_places.size() - 1));
            }
            found = m_free.back();
            m_placeOf.emplace(&manifold, found);
            m_free.pop_back();
            m_places[found] = Remembered();
            m_places[found].manifold = &manifold;
        }
        if (guesses)
            m_byIndex[index] = found;
    }
    Remembered& old = m_places[found];
    if (old.step == m_step)
        return kSeen;
    old.step = m_step;
    // Bullet reuses a manifold's memory for another pair.
    if (old.body0 != manifold.getBody0() || old.body1 != manifold.getBody1()) {
        old.count = 0;
        old.body0 = manifold.getBody0();
        old.body1 = manifold.getBody1();
    }
    return found;
}

int ContactKeys::match(uint32_t place, const btPersistentManifold& manifold, uint64_t (&keys)[kPoints]) {
    Remembered& old = m_places[place];
    const int count = manifold.getNumContacts();
    const btScalar threshold = manifold.getContactBreakingThreshold();
    bool taken[kPoints] = {false, false, false, false};
    Point points[kPoints];
    int fresh = 0;
    for (int i = 0; i < count; ++i) {
        const btManifoldPoint& point = manifold.getContactPoint(i);
        int best = -1;
        btScalar nearest = threshold * threshold;
        for (int j = 0; j < old.count; ++j) {
            if (taken[j])
                continue;
            const btScalar distanceA = (point.m_localPointA - vector(old.points[j].localA)).length2();
            const btScalar distanceB = (point.m_localPointB - vector(old.points[j].localB)).length2();
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
            keys[i] = 0;
        }
        fresh += keys[i] == 0;
        points[i].key = keys[i];
        store(points[i].localA, point.m_localPointA);
        store(points[i].localB, point.m_localPointB);
    }
    for (int i = 0; i < count; ++i)
        old.points[i] = points[i];
    old.count = count;
    return fresh;
}

void ContactKeys::number(uint32_t place, uint64_t (&keys)[kPoints]) {
    Remembered& known = m_places[place];
    for (int i = 0; i < known.count; ++i) {
        if (known.points[i].key == 0)
            known.points[i].key = m_nextKey++;
        keys[i] = known.points[i].key;
    }
}

void ContactKeys::endStep(std::size_t manifolds) {
    if (m_placeOf.size() <= 2 * manifolds + 64)
        return;
    for (auto entry = m_placeOf.begin(); entry != m_placeOf.end();) {
        if (m_places[entry->second].step != m_step) {
            m_free.push_back(entry->second);
            m_places[entry->second].manifold = nullptr;
            entry = m_placeOf.erase(entry);
        } else {
            ++entry;
        }
    }
}

void ContactKeys::clear() {
    m_places.clear();
    m_free.clear();
    m_placeOf.clear();
    m_byIndex.clear();
}

} // namespace bullet
} // namespace cairn
