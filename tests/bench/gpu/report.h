// What was measured, as a table for people and as JSON for the chart and for keeps.
#pragma once
#include "crossing.h"
#include "device.h"
#include "measure.h"

#include <cstdio>

namespace cairn_bench {

struct Report {
    std::string cpu, build, cuda, driver, bullet, when, command;
    unsigned cores = 0;
    std::optional<CopyRate> copy;
    std::string copyWhy; // it is missing
    std::optional<std::string> gpuMissing;
    std::vector<Measured> measured;
    bool complete = false; // nothing is left to measure
};

// Of the GPU, by its automatic choice, against the CPU or stock Bullet, in bodies; `group`: stack, pile, worlds.
Crossing crossingIn(const Report& report, const std::string& group, Who other);

std::string json(const Report& report);

void printHeader(const Report& report, std::FILE* to);
// Rows of one case; `first`: with the columns' names.
void printRows(const Report& report, const Measured& measured, bool first, std::FILE* to);
void printCrossings(const Report& report, std::FILE* to);

} // namespace cairn_bench
