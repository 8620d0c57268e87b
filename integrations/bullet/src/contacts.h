// Contact points: from Bullet's manifolds to the contact table, and the impulses back.
#pragma once
#include "bodies.h"
#include "contact_keys.h"

class btDispatcher;
struct btContactSolverInfo;

namespace cairn {
namespace bullet {

// Adds the points of a manifold that take part. `dispatcher` decides on response (ghosts, flags); NULL: all respond.
void gatherContacts(btPersistentManifold& manifold, btDispatcher* dispatcher, const btContactSolverInfo& info, Bodies& bodies,
                    ContactKeys& keys, Tables& tables);
// The whole step's impulses, into the manifold points.
void scatterContacts(const Tables& tables);

} // namespace bullet
} // namespace cairn
