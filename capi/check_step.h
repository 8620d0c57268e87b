// From a caller's step and results to core's columns, with everything checked that the public header promises.
#pragma once
#include "keys.h"
#include "scene/input.h"

#include <cairn/cairn.h>

namespace cairn::capi {

// Refuses by throwing; changes nothing but the set's memory. `results` may be null. Elements of tables on the device
// are left to the solver.
void check_step(const cairn_step* step, const cairn_results* results, int device, KeySet& keys, Input& input, Output& output);
// What went into a step and what came out, to be read by cairn_evaluate.
void check_evaluation(const cairn_step* step, const cairn_results* results, KeySet& keys, Input& input, Outcome& outcome);
// The elements of the tables that are (or are not) on the device; the columns themselves must be in host memory.
void check_elements(const Input& input, KeySet& keys, bool on_device);

} // namespace cairn::capi
