// The whole program, callable from a test.
#pragma once
#include "report.h"

namespace cairn_bench {

// Measures, prints the table to `table`, writes options.json. Returns the exit status; `report` is what was found.
int run(const Options& options, std::FILE* table, Report& report);

} // namespace cairn_bench
