// The elements of each table. The views have been checked: every present element can be read, every required view is there.
#pragma once
#include "keys.h"
#include "scene/input.h"

#include <cstddef>

namespace cairn::capi {

void check_bodies(const BodyColumns& columns);
void check_contacts(const ContactColumns& columns, std::size_t bodies, KeySet& keys);
void check_joints(const JointColumns& columns, std::size_t bodies, KeySet& keys);
void check_rows(const RowColumns& columns, std::size_t bodies, KeySet& keys);

} // namespace cairn::capi
