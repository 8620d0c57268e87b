// cairn_params to and from core's Params, and their permitted ranges.
#pragma once
#include "method/params.h"

#include <cairn/cairn.h>

namespace cairn::capi {

cairn_params to_c(const Params& params);
// Fills what a shorter struct lacks from the method's default preset; refuses a field out of range, naming it.
Params check_params(const cairn_params* given);
Params check_preset(std::uint32_t method, std::uint32_t preset);

} // namespace cairn::capi
