// Bytes that the iterations must move, by core/scene/traffic.h, of a scene whose points have all friction or none.
#pragma once
#include <cairn/cairn.h>

#include <cstddef>

namespace cairn_bench {

// What is swept: contact points, with friction unless the params have none, their manifolds, joints with free and locked axes only, and the
// bodies that can move.
struct Load {
    double points = 0, manifolds = 0, joints = 0, bodies = 0;
    double movableSides = 0; // of manifolds and joints
};

// Of one velocity sweep. `device`: with the indices that a GPU thread reads for itself. Without the residual trace.
double sweepBytes(const Load& load, const cairn_params& params, bool device);

// Of a point alone, its manifold's and bodies' share left out.
double pointBytes(const cairn_params& params);
double jointBytes(const cairn_params& params);

} // namespace cairn_bench
