// The conformance matrix: each test that fills a cell reports how far Cairn is from its reference, or why the cell does not
// apply. What a whole run reports goes, as CSV, to the file that CAIRN_CONFORMANCE names; table.py makes Markdown of it.
//
// A section is a table, with its own rows and columns: "Joints", "Contacts", "Bodies", ...
#pragma once
#include <gtest/gtest.h>

#include <LinearMath/btScalar.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace conformance {

enum class Reference {
    stock,      // Bullet's solver in small substeps: a thirtieth of the step, 100 iterations
    stockStep,  // Bullet's solver in the same steps, where its behaviour depends on their size
    formula,    // a closed formula
    deliberate, // a difference from stock that is meant; the tolerance is on what Cairn does instead
};

struct Cell {
    std::string section, row, column;
};

class Table : public testing::Environment {
  public:
    static Table& get() {
        static Table* table = static_cast<Table*>(testing::AddGlobalTestEnvironment(new Table)); // owned by GoogleTest
        return *table;
    }
    void add(const Cell& cell, const std::string& rest) {
        lines.push_back(cell.section + ';' + cell.row + ';' + cell.column + ';' + (sizeof(btScalar) == 8 ? "double" : "float") + ';' +
                        rest);
    }
    void TearDown() override {
        const char* const path = std::getenv("CAIRN_CONFORMANCE");
        if (!path)
            return;
        std::FILE* const file = std::fopen(path, "w");
        ASSERT_NE(file, nullptr) << path;
        std::fputs("section;row;column;precision;measured;tolerance;unit;reference;why\n", file);
        for (const std::string& line : lines)
            std::fprintf(file, "%s\n", line.c_str());
        EXPECT_EQ(std::fclose(file), 0) << path;
    }

  private:
    std::vector<std::string> lines;
};

// A cell's deviation from its reference; fails beyond the tolerance. `why`: what a deliberate difference is.
inline void report(const Cell& cell, double measured, double tolerance, const char* unit, Reference reference, const char* why = "") {
    static const char* const names[] = {"stock", "stock step", "formula", "deliberate"};
    char text[64];
    std::snprintf(text, sizeof text, "%.3g;%.3g;", measured, tolerance);
    Table::get().add(cell, std::string(text) + unit + ';' + names[static_cast<int>(reference)] + ';' + why);
    EXPECT_LE(measured, tolerance) << cell.section << ": " << cell.row << ", " << cell.column << " (" << unit << ")";
}

// A cell that does not apply.
inline void absent(const Cell& cell, const std::string& why) { Table::get().add(cell, ";;;absent;" + why); }

} // namespace conformance
