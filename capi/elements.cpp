#include "elements.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>

namespace cairn::capi {

Value value_of(const Array& array, std::size_t i, std::size_t component) {
    Value value{};
    char* const end = value.text + sizeof value.text - 1;
    switch (array.column.type) {
    case Type::f32:
    case Type::f64: {
        const double real = array.column.real(i, component);
        if (std::isnan(real)) // to_chars would show the sign of a NaN
            std::memcpy(value.text, "nan", 4);
        else if (array.column.type == Type::f32)
            std::to_chars(value.text, end, static_cast<float>(real));
        else
            std::to_chars(value.text, end, real);
        break;
    }
    case Type::i32:
        std::to_chars(value.text, end, static_cast<std::int32_t>(array.column.integer(i, component)));
        break;
    case Type::u32:
        std::to_chars(value.text, end, static_cast<std::uint32_t>(array.column.integer(i, component)));
        break;
    case Type::u64:
        std::to_chars(value.text, end, array.column.key(i));
        break;
    }
    return value;
}

namespace {

// 0 if every component is finite, else NaN: no branch an element.
template <std::size_t N, class Real> Real finiteness(const Real* values) {
    Real sum = 0;
    for (std::size_t c = 0; c < N; ++c)
        sum += values[c] * Real(0);
    return sum;
}

template <std::size_t N> std::size_t first_not_finite(const Array& array) {
    return first_bad<N>(array, [](const auto* values) { return finiteness<N>(values) == 0; });
}

// find(N) for the number of components that a field may have.
template <class Find> std::size_t by_components(const Array& array, Find find) {
    switch (array.components) {
    case 1:
        return find(std::integral_constant<std::size_t, 1>{});
    case 2:
        return find(std::integral_constant<std::size_t, 2>{});
    case 3:
        return find(std::integral_constant<std::size_t, 3>{});
    case 6:
        return find(std::integral_constant<std::size_t, 6>{});
    }
    refuse(CAIRN_ERROR_INTERNAL, "%s.%s: no check for %zu components", array.table, array.field, array.components);
}

[[noreturn]] void refuse_not_finite(const Array& array, std::size_t i) {
    for (std::size_t c = 0; c < array.components; ++c) {
        if (std::isfinite(array.column.real(i, c)))
            continue;
        if (array.components == 1)
            refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu] is %s: must be finite", array.table, array.field, i, value_of(array, i).text);
        refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu][%zu] is %s: must be finite", array.table, array.field, i, c,
               value_of(array, i, c).text);
    }
    refuse(CAIRN_ERROR_INTERNAL, "%s.%s[%zu]: not finite, but every component is", array.table, array.field, i);
}

template <std::size_t N> void check_unit_of(const Array& array) {
    const std::size_t i = first_bad<N>(array, [](const auto* values) {
        double square = 0;
        for (std::size_t c = 0; c < N; ++c)
            square += static_cast<double>(values[c]) * static_cast<double>(values[c]);
        return Rule::is_unit(square);
    });
    if (i == array.end)
        return;
    double norm = 0;
    for (std::size_t c = 0; c < N; ++c) {
        const double value = array.column.real(i, c);
        if (!std::isfinite(value))
            refuse_not_finite(array, i);
        norm = std::hypot(norm, value);
    }
    refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu] is (%s, %s, %s%s%s), of norm %.9g: must be 1 to within 1e-3", array.table, array.field, i,
           value_of(array, i, 0).text, value_of(array, i, 1).text, value_of(array, i, 2).text, N == 4 ? ", " : "",
           N == 4 ? value_of(array, i, 3).text : "", norm);
}

void check_finite(const Array& array) {
    if (!array.present())
        return;
    const std::size_t i =
        by_components(array, [&]<std::size_t N>(std::integral_constant<std::size_t, N>) { return first_not_finite<N>(array); });
    if (i < array.end)
        refuse_not_finite(array, i);
}

void check_range(const Array& array, const Rule& rule) {
    if (!array.present())
        return;
    // Both bounds are finite, so that NaN and infinity are outside.
    const auto inside = [low = rule.low, high = rule.high](auto value) { return value >= low && value <= high; };
    const std::size_t i = by_components(array, [&]<std::size_t N>(std::integral_constant<std::size_t, N>) {
        return first_bad<N>(array, [&](const auto* values) { return std::all_of(values, values + N, inside); });
    });
    if (i == array.end)
        return;
    for (std::size_t c = 0; c < array.components; ++c) {
        if (inside(array.column.real(i, c)))
            continue;
        if (!std::isfinite(array.column.real(i, c)))
            refuse_not_finite(array, i);
        if (array.components == 1)
            refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu] is %s: must be %s", array.table, array.field, i, value_of(array, i).text,
                   rule.must);
        refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu][%zu] is %s: must be %s", array.table, array.field, i, c, value_of(array, i, c).text,
               rule.must);
    }
}

void check_unit(const Array& array) {
    if (!array.present())
        return;
    if (array.components == 4)
        check_unit_of<4>(array);
    else
        check_unit_of<3>(array);
}

void check_bits(const Array& array, const Rule& rule) {
    if (!array.present())
        return;
    for (std::size_t i = array.first; i < array.end; ++i)
        for (std::size_t c = 0; c < array.components; ++c) {
            const auto bits = static_cast<std::uint32_t>(array.column.integer(i, c));
            if ((bits & ~rule.known) == 0)
                continue;
            if (array.components == 1)
                refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu] is %s: has bits beside %s", array.table, array.field, i,
                       value_of(array, i).text, rule.must);
            refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu][%zu] is %s: has bits beside %s", array.table, array.field, i, c,
                   value_of(array, i, c).text, rule.must);
        }
}

} // namespace

void check_rule(const Array& array, const Rule& rule) {
    switch (rule.of) {
    case Rule::none:
        return;
    case Rule::finite:
        return check_finite(array);
    case Rule::range:
        return check_range(array, rule);
    case Rule::unit:
        return check_unit(array);
    case Rule::bits:
        return check_bits(array, rule);
    }
}

void check_pairs(const Array& body_a, const Array& body_b, std::size_t bodies) {
    if (!body_a.present())
        return;
    const auto count = static_cast<std::int64_t>(bodies);
    const auto refuse_index = [count](const Array& array, std::size_t i) {
        refuse(CAIRN_ERROR_INVALID_DATA, "%s.%s[%zu] is %s: must be CAIRN_WORLD (-1) or an index below the number of bodies, %lld",
               array.table, array.field, i, value_of(array, i).text, static_cast<long long>(count));
    };
    for (std::size_t i = body_a.first; i < body_a.end; ++i) {
        const std::int32_t a = body_a.index(i), b = body_b.index(i);
        if (a < CAIRN_WORLD || a >= count)
            refuse_index(body_a, i);
        if (b < CAIRN_WORLD || b >= count)
            refuse_index(body_b, i);
        if (a == b)
            refuse(CAIRN_ERROR_INVALID_DATA, "%s.body_a[%zu] and %s.body_b[%zu] are both %d: must be two different bodies", body_a.table, i,
                   body_b.table, i, static_cast<int>(a));
    }
}

} // namespace cairn::capi
