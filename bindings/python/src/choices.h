// What the method auto did with every island, as columns by the names of cairn_choice.
#pragma once
#include <cairn/cairn.h>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <vector>

namespace cairn_python {

inline pybind11::dict columns_of(const std::vector<cairn_choice>& choices) {
    pybind11::dict columns;
    const auto add = [&](const char* name, auto field) {
        pybind11::array_t<decltype(field(choices[0]))> values(static_cast<pybind11::ssize_t>(choices.size()));
        for (std::size_t i = 0; i < choices.size(); ++i)
            values.mutable_at(static_cast<pybind11::ssize_t>(i)) = field(choices[i]);
        columns[name] = values;
    };
    add("first_body", [](const cairn_choice& c) { return c.first_body; });
    add("bodies", [](const cairn_choice& c) { return c.bodies; });
    add("reason", [](const cairn_choice& c) { return c.reason; });
    add("method", [](const cairn_choice& c) { return c.method; });
    add("substeps", [](const cairn_choice& c) { return c.substeps; });
    add("iterations", [](const cairn_choice& c) { return c.iterations; });
    add("swept", [](const cairn_choice& c) { return c.swept; });
    add("met", [](const cairn_choice& c) { return c.met; });
    add("residual", [](const cairn_choice& c) { return c.residual; });
    return columns;
}

} // namespace cairn_python
