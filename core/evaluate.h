// How good a step was, whoever solved it: residuals, position errors, momentum and energy in double, per island. cairn.h says what
// each quantity is.
#pragma once
#include "scene/input.h"

#include <cairn/cairn.h>

#include <cstdint>
#include <vector>

namespace cairn {

struct Evaluated {
    cairn_evaluation whole{};
    std::vector<cairn_evaluation> islands;
    std::vector<std::int32_t> body_island; // -1: cannot move
};

// Input and outcome have been checked: what cairn_evaluate requires is there and finite. Throws NotFinite, std::bad_alloc.
Evaluated evaluate(const Input& input, const Outcome& outcome);

} // namespace cairn
