// Contact points: from Bullet's manifolds to the contact table, and the impulses back.
#pragma once
#include "bodies.h"
#include "contact_keys.h"
#include "loops.h"

class btDispatcher;
struct btContactSolverInfo;

namespace cairn {
namespace bullet {

class Contacts {
  public:
    Contacts(Tables& tables, Bodies& bodies) : m_tables(tables), m_bodies(bodies) {}

    // Adds the points that take part to tables.contacts, which it fills anew. `dispatcher` decides on response (ghosts, flags); NULL: all
    // respond. What can be an application's own code, the dispatcher's and the restitution callback, runs on the calling thread.
    void gather(const std::vector<btPersistentManifold*>& manifolds, btDispatcher* dispatcher, const btContactSolverInfo& info,
                const Loops& loops);
    // The whole step's impulses, into the manifold points.
    void scatter(const Loops& loops) const;
    // Forgets which point was which.
    void clear() { m_keys.clear(); }

  private:
    // A manifold that takes part.
    struct Entry {
        btPersistentManifold* manifold;
        int32_t body0, body1; // in tables.bodies
        uint32_t place;       // in m_keys
        uint32_t first;       // of its points in tables.contacts
        uint8_t count, fresh; // points, those without a key
        uint8_t left;         // points that take no part
        uint8_t features;     // of any point
    };
    void choose(const std::vector<btPersistentManifold*>& manifolds, btDispatcher* dispatcher);
    void fill(Entry& entry, const btContactSolverInfo& info);
    void useFeatures(const Entry& entry, const btContactSolverInfo& info);
    void bounce(const Entry& entry);
    void number(const Entry& entry);
    void closeGaps();

    Tables& m_tables;
    Bodies& m_bodies;
    ContactKeys m_keys;
    std::vector<Entry> m_entries;
};

} // namespace bullet
} // namespace cairn
