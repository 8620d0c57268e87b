// The elements of each table. The views have been checked: every present element can be read, every required view is there.
// A table is gone through in parts that stay in the cache while one check after the other reads them, because the fields of an
// array of structs share its lines.
#pragma once
#include "keys.h"
#include "scene/input.h"

#include <algorithm>
#include <cstddef>

namespace cairn::capi {

constexpr std::size_t kPart = 256;

template <class Check> void in_parts(std::size_t count, Check check) {
    for (std::size_t first = 0; first < count; first += kPart)
        check(first, std::min(first + kPart, count));
}

void check_bodies(const BodyColumns& columns);
void check_contacts(const ContactColumns& columns, std::size_t bodies, KeySet& keys);
void check_joints(const JointColumns& columns, std::size_t bodies, KeySet& keys);
void check_rows(const RowColumns& columns, std::size_t bodies, KeySet& keys);

} // namespace cairn::capi
