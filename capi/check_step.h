// From a caller's step and results to core's columns, with everything checked that the public header promises.
#pragma once
#include "keys.h"
#include "scene/input.h"

#include <cairn/cairn.h>

namespace cairn::capi {

// Refuses by throwing; changes nothing but the set's memory. `results` may be null.
void check_step(const cairn_step* step, const cairn_results* results, KeySet& keys, Input& input, Output& output);

} // namespace cairn::capi
