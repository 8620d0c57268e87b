// cairn_config to core's Config.
#pragma once
#include "solver.h"

#include <cairn/cairn.h>

namespace cairn::capi {

// NULL: all defaults.
Config check_config(const cairn_config* given);

} // namespace cairn::capi
