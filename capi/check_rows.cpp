// Raw rows: their numbers, and the blocks that consecutive rows form.
#include "check_tables.h"

#include "scene/fields.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::capi {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kRowsPerBlock = 6;

struct RowArrays {
    Array body_a, body_b, lower, friction_index, block;
};

void check_bounds(const Array& lower, const Array& upper) {
    if (!lower.present() && !upper.present())
        return;
    for (std::size_t i = lower.first; i < lower.end; ++i) {
        const double low = lower.present() ? lower.column.real(i) : -kInfinity;
        const double high = upper.present() ? upper.column.real(i) : kInfinity;
        if (!(low < kInfinity))
            refuse(CAIRN_ERROR_INVALID_DATA, "rows.lower[%zu] is %s: must be finite or -infinity", i, value_of(lower, i).text);
        if (!(high > -kInfinity))
            refuse(CAIRN_ERROR_INVALID_DATA, "rows.upper[%zu] is %s: must be finite or infinity", i, value_of(upper, i).text);
        if (low > high)
            refuse(CAIRN_ERROR_INVALID_DATA, "rows.lower[%zu] is %s, above rows.upper[%zu], which is %s", i, value_of(lower, i).text, i,
                   value_of(upper, i).text);
    }
}

// The friction index of row i, whose block began at row `start`; counts what each row of the block bounds.
void check_friction_index(const RowArrays& rows, std::size_t start, std::size_t i, std::size_t (&bounded)[kRowsPerBlock]) {
    const Array& index = rows.friction_index;
    const std::int32_t normal = index.index(i);
    if (normal == -1)
        return;
    if (normal < 0 || static_cast<std::size_t>(normal) < start || static_cast<std::size_t>(normal) >= i)
        refuse(CAIRN_ERROR_INVALID_DATA,
               "rows.friction_index[%zu] is %s: must be -1 or an earlier row of the same two bodies and block, which begins at row %zu", i,
               value_of(index, i).text, start);
    const auto row = static_cast<std::size_t>(normal);
    if (index.index(row) != -1)
        refuse(CAIRN_ERROR_INVALID_DATA,
               "rows.friction_index[%zu] is %zu, which is a friction row itself: must be a row with friction_index -1", i, row);
    if (!rows.lower.present() || rows.lower.column.real(row) < 0)
        refuse(CAIRN_ERROR_INVALID_DATA,
               "rows.friction_index[%zu] is %zu, but rows.lower[%zu] is %s: a row that bounds friction needs lower >= 0", i, row, row,
               rows.lower.present() ? value_of(rows.lower, row).text : "absent");
    if (++bounded[row - start] > 2)
        refuse(CAIRN_ERROR_INVALID_DATA, "rows.friction_index[%zu] is %zu, as in two rows before: a row bounds at most two friction rows",
               i, row);
    if (bounded[row - start] == 2 && index.index(i - 1) != normal)
        refuse(CAIRN_ERROR_INVALID_DATA,
               "rows.friction_index[%zu] is %zu, as in an earlier row, but row %zu lies between: put the two side by side", i, row, i - 1);
}

void check_blocks(const RowArrays& rows) {
    const auto block = [&](std::size_t i) { return rows.block.present() ? rows.block.index(i) : 0; };
    std::size_t start = 0, bounded[kRowsPerBlock] = {};
    for (std::size_t i = 0; i < rows.body_a.end; ++i) {
        const bool same = i > 0 && rows.body_a.index(i) == rows.body_a.index(start) && rows.body_b.index(i) == rows.body_b.index(start) &&
                          block(i) == block(start);
        if (!same) {
            start = i;
            std::fill_n(bounded, kRowsPerBlock, std::size_t{0});
        }
        if (i - start >= kRowsPerBlock)
            refuse(CAIRN_ERROR_INVALID_DATA,
                   "rows.block[%zu] is %s: row %zu is the seventh in a row of bodies %d and %d and this block, from row %zu on, and at "
                   "most six are "
                   "solved together: give it another block",
                   i, rows.block.present() ? value_of(rows.block, i).text : "0 (absent)", i, static_cast<int>(rows.body_a.index(i)),
                   static_cast<int>(rows.body_b.index(i)), start);
        if (rows.friction_index.present())
            check_friction_index(rows, start, i, bounded);
    }
}

void check_row_part(const RowColumns& columns, std::size_t bodies, KeySet& keys, std::size_t first, std::size_t end) {
    const auto array = [&](const Column& column, const char* field, std::size_t components = 1) {
        return Array{column, "rows", field, first, end, components};
    };
    check_pairs(array(columns.body_a, "body_a"), array(columns.body_b, "body_b"), bodies);
    check_rules(columns, "rows", kRowTable, first, end);
    check_bounds(array(columns.lower, "lower"), array(columns.upper, "upper"));
    keys.add(array(columns.key, "key"));
}

} // namespace

void check_rows(const RowColumns& columns, std::size_t bodies, KeySet& keys) {
    keys.start(columns.count);
    in_parts(columns.count, [&](std::size_t first, std::size_t end) { check_row_part(columns, bodies, keys, first, end); });
    const auto array = [&](const Column& column, const char* field) { return Array{column, "rows", field, 0, columns.count, 1}; };
    check_blocks({array(columns.body_a, "body_a"), array(columns.body_b, "body_b"), array(columns.lower, "lower"),
                  array(columns.friction_index, "friction_index"), array(columns.block, "block")});
}

} // namespace cairn::capi
