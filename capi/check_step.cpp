// The order of a step's checks: the step itself, then every view, then which memory overlaps, and last the elements, which are
// read only once it is certain that they can be.
#include "check_step.h"

#include "check_tables.h"
#include "elements.h"
#include "scene/fields.h"
#include "scene/pack.h"
#include "struct_size.h"
#include "views.h"

#include <cmath>
#include <limits>

namespace cairn::capi {

namespace {

constexpr std::uint32_t kLargestCount = std::numeric_limits<std::int32_t>::max() - 1;

// The memory of a step's present views.
template <std::size_t Capacity> struct Extents {
    std::array<Extent, Capacity> all;
    std::size_t count = 0;

    const Extent* begin() const { return all.data(); }
    const Extent* end() const { return all.data() + count; }
    void add(const Extent& extent) {
        if (extent.present)
            all[count++] = extent;
    }
};
using Inputs = Extents<kBodyTable.size() + kContactTable.size() + kJointTable.size() + kRowTable.size()>;
using Outputs = Extents<kResultTable.size()>;

// A copy of the caller's table, all zero (no elements) where there is none.
template <class Table> Table read_table(const Table* given, const char* name) {
    if (given == nullptr)
        return Table{};
    const Table table = read_struct(given, Table{});
    if (table.count > kLargestCount)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.count is %u: must be at most %u", name, table.count, kLargestCount);
    return table;
}

template <class Table, class Columns, std::size_t N>
void take_views(const Table& table, const char* name, const std::array<Field<Table, Columns>, N>& fields, Columns& columns, int device,
                Inputs& inputs) {
    columns = Columns{};
    columns.count = table.count;
    columns.revision = table.revision;
    for (const auto& field : fields) {
        const cairn_view& view = table.*field.view;
        const Extent extent = check_view(view, {name, field.name, field.kind, field.components, table.count, field.required, device});
        inputs.add(extent);
        if (!extent.present)
            continue;
        const bool on_device = view.device == CAIRN_DEVICE;
        columns.*field.column = {static_cast<const std::byte*>(view.data), extent.signed_stride, static_cast<Type>(view.type), on_device};
        columns.on_device = columns.on_device || on_device;
    }
}

std::size_t count_of(Of of, const Input& input) {
    switch (of) {
    case Of::bodies:
        return input.bodies.count;
    case Of::contacts:
        return input.contacts.count;
    case Of::joints:
        return input.joints.count;
    default:
        return input.rows.count;
    }
}

[[noreturn]] void refuse_overlap(const Extent& output, const Extent& other, const char* hint) {
    refuse(CAIRN_ERROR_INVALID_ARGUMENT, "%s.%s overlaps %s.%s: a result needs memory of its own%s", output.demand.table,
           output.demand.field, other.demand.table, other.demand.field, hint);
}

void take_results(const cairn_results& results, const cairn_bodies& bodies, const Input& input, const Inputs& inputs, int device,
                  Output& output) {
    Outputs outputs;
    for (const ResultField& field : kResultTable) {
        const cairn_view& view = results.*field.view;
        const Extent extent =
            check_view(view, {"results", field.name, Kind::real, field.components, count_of(field.of, input), false, device});
        if (!extent.present)
            continue;
        output.*field.column = {static_cast<std::byte*>(view.data), extent.signed_stride, static_cast<Type>(view.type),
                                view.device == CAIRN_DEVICE};
        const cairn_view* const in_place = field.in_place == nullptr ? nullptr : &(bodies.*field.in_place);
        for (const Extent& other : inputs) {
            if (other.view == in_place && identical(extent, other))
                continue;
            if (overlap(extent, other))
                refuse_overlap(extent, other, other.view == in_place ? ", or exactly this input's view (in place)" : "");
        }
        for (const Extent& other : outputs)
            if (overlap(extent, other))
                refuse_overlap(extent, other, "");
        outputs.add(extent);
    }
}

void check_time_and_gravity(const cairn_step& step) {
    // below, the reciprocal of a substep in float would leave the range of numbers
    if (!(std::isfinite(step.dt) && step.dt >= 1e-9))
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "step.dt is %g s: must be at least 1e-9 and finite", step.dt);
    for (int c = 0; c < 3; ++c)
        if (!std::isfinite(step.gravity[c]))
            refuse(CAIRN_ERROR_INVALID_ARGUMENT, "step.gravity[%d] is %s: must be finite", c,
                   std::isnan(step.gravity[c]) ? "nan" : "infinite");
    if (step.reserved != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "step.reserved is %u: must be 0", step.reserved);
    if (step.bodies == nullptr)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "step.bodies is NULL: a step needs a table of bodies, with count 0 for none");
}

// The step itself and its views; returns the table of bodies, for what may be in place.
cairn_bodies take_step(const cairn_step* given, int device, Input& input, Inputs& inputs) {
    const cairn_step step = read_struct(given, cairn_step{});
    check_time_and_gravity(step);
    input = Input{};
    input.dt = step.dt;
    for (int c = 0; c < 3; ++c)
        input.gravity[c] = step.gravity[c];

    const cairn_bodies bodies = read_table(step.bodies, "bodies");
    const cairn_contacts contacts = read_table(step.contacts, "contacts");
    const cairn_joints joints = read_table(step.joints, "joints");
    const cairn_rows rows = read_table(step.rows, "rows");
    take_views(bodies, "bodies", kBodyTable, input.bodies, device, inputs);
    take_views(contacts, "contacts", kContactTable, input.contacts, device, inputs);
    take_views(joints, "joints", kJointTable, input.joints, device, inputs);
    take_views(rows, "rows", kRowTable, input.rows, device, inputs);
    return bodies;
}

cairn_results read_results(const cairn_results* given) {
    const cairn_results results = read_struct(given, cairn_results{});
    if (results.reserved != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "results.reserved is %u: must be 0", results.reserved);
    return results;
}

// Which of a step's results cannot be judged without.
bool is_needed(const ResultField& field, const Input& input) {
    if (field.view == &cairn_results::friction_impulse)
        return input.contacts.friction.present();
    if (field.view == &cairn_results::torsion_impulse)
        return input.contacts.rolling_friction.present() || input.contacts.spinning_friction.present();
    return true;
}

// Numbers of bodies that cannot move are not looked at: a step does not write them.
void check_outcome(const ResultField& field, const Column& column, const Input& input) {
    const std::size_t count = count_of(field.of, input);
    const Rule& rule = field.view == &cairn_results::orientation ? kUnit : kFinite;
    if (field.of != Of::bodies)
        return check_rule(Array{column, "results", field.name, 0, count, field.components}, rule);
    for (std::size_t i = 0; i < count; ++i)
        if (is_movable(input.bodies, i))
            check_rule(Array{column, "results", field.name, i, i + 1, field.components}, rule);
}

} // namespace

void check_step(const cairn_step* given, const cairn_results* given_results, int device, KeySet& keys, Input& input, Output& output) {
    Inputs inputs;
    const cairn_bodies bodies = take_step(given, device, input, inputs);
    output = Output{};
    if (given_results != nullptr)
        take_results(read_results(given_results), bodies, input, inputs, device, output);
    check_elements(input, keys, false);
}

void check_evaluation(const cairn_step* given, const cairn_results* given_results, KeySet& keys, Input& input, Outcome& outcome) {
    Inputs inputs;
    const cairn_bodies bodies = take_step(given, kHostOnly, input, inputs);
    const cairn_results results = read_results(given_results);
    outcome = Outcome{};
    for (const ResultField& field : kResultTable) {
        const cairn_view& view = results.*field.view;
        const Extent extent = check_view(
            view, {"results", field.name, Kind::real, field.components, count_of(field.of, input), is_needed(field, input), kHostOnly});
        if (!extent.present)
            continue;
        for (const Extent& other : inputs)
            if (field.in_place != nullptr && other.view == &(bodies.*field.in_place) && identical(extent, other))
                refuse(CAIRN_ERROR_INVALID_ARGUMENT,
                       "results.%s is in place of bodies.%s: what went into the step is needed, too, so keep a copy of it", field.name,
                       field.name);
        outcome.*field.outcome = {static_cast<const std::byte*>(view.data), extent.signed_stride, static_cast<Type>(view.type), false};
    }
    check_elements(input, keys, false);
    for (const ResultField& field : kResultTable)
        if ((outcome.*field.outcome).present())
            check_outcome(field, outcome.*field.outcome, input);
}

void check_elements(const Input& input, KeySet& keys, bool on_device) {
    if (input.bodies.on_device == on_device)
        check_bodies(input.bodies);
    if (input.contacts.on_device == on_device)
        check_contacts(input.contacts, input.bodies.count, keys);
    if (input.joints.on_device == on_device)
        check_joints(input.joints, input.bodies.count, keys);
    if (input.rows.on_device == on_device)
        check_rows(input.rows, input.bodies.count, keys);
}

} // namespace cairn::capi
