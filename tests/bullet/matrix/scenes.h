// What the scenes of the matrix share.
#pragma once
#include "../world.h"

constexpr int kSmall = 30; // substeps of the reference
constexpr double kGravity = 9.81;

inline double real(btScalar value) { return static_cast<double>(value); }
inline btVector3 vec(double x, double y, double z) {
    return btVector3(static_cast<btScalar>(x), static_cast<btScalar>(y), static_cast<btScalar>(z));
}

// Advances a world by kDt: Cairn in one step, stock in `parts`.
inline void advance(TestWorld& w, int parts = kSmall) {
    if (w.cairn)
        parts = 1;
    for (int i = 0; i < parts; ++i)
        w.world->stepSimulation(kDt / static_cast<btScalar>(parts), 0);
}

template <class Visit> void eachPoint(TestWorld& w, const Visit& visit) {
    for (int m = 0; m < w.dispatcher.getNumManifolds(); ++m) {
        btPersistentManifold& manifold = *w.dispatcher.getManifoldByIndexInternal(m);
        for (int i = 0; i < manifold.getNumContacts(); ++i)
            visit(manifold, manifold.getContactPoint(i));
    }
}
