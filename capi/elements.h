// Checks of the elements of one array, or of a part of it. Each is one pass that keeps nothing; the text of a refusal is made
// only when there is one, and names the array, the index and the value.
#pragma once
#include "scene/fields.h"
#include "status.h"

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace cairn::capi {

// Elements first ... end - 1 of a checked view, with its name.
struct Array {
    Column column;
    const char* table = "";
    const char* field = "";
    std::size_t first = 0, end = 0;
    std::size_t components = 1;

    bool present() const { return column.present() && first < end; }
    std::int32_t index(std::size_t i) const { return static_cast<std::int32_t>(column.integer(i)); }
};

// An element's value as text: the shortest digits that give the same value back.
struct Value {
    char text[32];
};
Value value_of(const Array& array, std::size_t i, std::size_t component = 0);

// The rule of a field.
void check_rule(const Array& array, const Rule& rule);
// The rules of a table's fields, elements first ... end - 1.
template <class Columns, class Fields>
void check_rules(const Columns& columns, const char* table, const Fields& fields, std::size_t first, std::size_t end) {
    for (const auto& field : fields)
        check_rule(Array{columns.*field.column, table, field.name, first, end, field.components}, field.rule);
}
// Body indices: in -1 ... bodies - 1, and different.
void check_pairs(const Array& body_a, const Array& body_b, std::size_t bodies);

// The first element for which ok(values) is false, or `end`. `values` points to N components in the array's own type.
template <std::size_t N, class Ok> std::size_t first_bad(const Array& array, Ok ok) {
    const auto scan = [&]<class Real>(Real) {
        const std::byte* at = array.column.data + static_cast<std::ptrdiff_t>(array.first) * array.column.stride;
        for (std::size_t i = array.first; i < array.end; ++i, at += array.column.stride) {
            Real values[N];
            std::memcpy(values, at, sizeof values);
            if (!ok(static_cast<const Real*>(values)))
                return i;
        }
        return array.end;
    };
    return array.column.type == Type::f32 ? scan(0.0f) : scan(0.0);
}

} // namespace cairn::capi
