#include "params.h"

#include "struct_size.h"

#include <cmath>
#include <limits>

namespace cairn::capi {

namespace {

constexpr std::uint32_t kMostIterations = 1000000, kMostSubsteps = 1000;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct CountRange {
    const char* name;
    std::uint32_t cairn_params::*field;
    std::uint32_t low, high;
};
constexpr CountRange kCounts[] = {
    {"iterations", &cairn_params::iterations, 1, kMostIterations},
    {"substeps", &cairn_params::substeps, 1, kMostSubsteps},
    {"position_iterations", &cairn_params::position_iterations, 0, kMostIterations},
    {"splitting", &cairn_params::splitting, 0, CAIRN_SPLIT_MANIFOLD},
    {"friction_model", &cairn_params::friction_model, 0, CAIRN_FRICTION_PYRAMID},
    {"acceleration", &cairn_params::acceleration, 0, CAIRN_ACCELERATION_NESTEROV},
    {"residual_trace", &cairn_params::residual_trace, 0, 1},
};

// `open`: low itself is out of range. Infinity is in range only where high is infinite.
struct RealRange {
    const char* name;
    double cairn_params::*field;
    double low, high;
    bool open;
    const char* permitted;
};
constexpr double kBelowOne = 1 - std::numeric_limits<double>::epsilon() / 2;
constexpr double kLargest = std::numeric_limits<double>::max();
constexpr RealRange kReals[] = {
    {"contact_warm_start", &cairn_params::contact_warm_start, 0, 1, false, "0 ... 1"},
    {"joint_warm_start", &cairn_params::joint_warm_start, 0, 1, false, "0 ... 1"},
    {"relax_share", &cairn_params::relax_share, 0, kBelowOne, false, "0 ... below 1"},
    {"contact_baumgarte", &cairn_params::contact_baumgarte, 0, 1, false, "0 ... 1"},
    {"joint_baumgarte", &cairn_params::joint_baumgarte, 0, 1, false, "0 ... 1"},
    {"contact_hertz", &cairn_params::contact_hertz, 0, kLargest, true, "> 0 and finite"},
    {"contact_damping_ratio", &cairn_params::contact_damping_ratio, 0, kLargest, true, "> 0 and finite"},
    {"joint_hertz", &cairn_params::joint_hertz, 0, kLargest, true, "> 0 and finite"},
    {"joint_damping_ratio", &cairn_params::joint_damping_ratio, 0, kLargest, true, "> 0 and finite"},
    {"hertz_limit", &cairn_params::hertz_limit, 0, kInfinity, true, "> 0 (infinity: no limit)"},
    {"static_hertz_scale", &cairn_params::static_hertz_scale, 0, kLargest, true, "> 0 and finite"},
    {"max_push_speed", &cairn_params::max_push_speed, 0, kInfinity, true, "> 0 (infinity: no cap)"},
    {"restitution_threshold", &cairn_params::restitution_threshold, 0, kInfinity, false, ">= 0 (infinity: nothing bounces)"},
    {"residual_tolerance", &cairn_params::residual_tolerance, 0, kLargest, false, ">= 0 and finite (0: never stop early)"},
    {"contact_hertz_floor", &cairn_params::contact_hertz_floor, 0, kLargest, false, ">= 0 and finite (0: contact_hertz as it is)"},
    {"tolerance", &cairn_params::tolerance, 0, kLargest, false, ">= 0 and finite"},
};

void check_method(std::uint32_t method) {
    if (method >= CAIRN_METHOD_COUNT)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "method is %u: must be one of CAIRN_METHOD_..., 0 ... %u", method, CAIRN_METHOD_COUNT - 1);
}

void check_ranges(const cairn_params& params) {
    for (const CountRange& range : kCounts) {
        const std::uint32_t value = params.*range.field;
        if (value >= range.low && value <= range.high)
            continue;
        if (range.low == range.high)
            refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.%s is %u: must be %u", range.name, value, range.low);
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.%s is %u: must be %u ... %u", range.name, value, range.low, range.high);
    }
    if (params.restitution_iterations > kMostIterations && params.restitution_iterations != CAIRN_SAME_AS_SWEEPS)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.restitution_iterations is %u: must be 0 ... %u or CAIRN_SAME_AS_SWEEPS",
               params.restitution_iterations, kMostIterations);
    for (const RealRange& range : kReals) {
        const double value = params.*range.field;
        if (value <= range.high && (range.open ? value > range.low : value >= range.low))
            continue;
        if (std::isnan(value))
            refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.%s is nan: must be %s", range.name, range.permitted);
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.%s is %.9g: must be %s", range.name, value, range.permitted);
    }
    const MethodRow& row = row_of(static_cast<Method>(params.method));
    if (!row.substeps && params.substeps != 1)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.substeps is %u: must be 1 for the method %s (tj and tjsoft have substeps)",
               params.substeps, row.name);
    const bool chooses = params.method == CAIRN_METHOD_AUTO;
    if (chooses && params.residual_tolerance != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.residual_tolerance is %.9g: must be 0 for the method auto, which has tolerance (m/s)",
               params.residual_tolerance);
    if (!chooses && params.tolerance != 0)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "params.tolerance is %.9g: must be 0 for the method %s; only auto has it", params.tolerance,
               row.name);
    if (params.substeps > params.iterations)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT,
               "params.substeps is %u: must be at most params.iterations, %u, or a substep would have no sweep", params.substeps,
               params.iterations);
}

} // namespace

cairn_params to_c(const Params& params) {
    cairn_params c = {};
    c.struct_size = sizeof c;
    c.method = static_cast<std::uint32_t>(params.method);
    c.iterations = params.iterations;
    c.substeps = params.substeps;
    c.position_iterations = params.position_iterations;
    c.relax_share = params.relax_share;
    c.restitution_iterations = params.restitution_iterations;
    c.splitting = static_cast<std::uint32_t>(params.splitting);
    c.friction_model = static_cast<std::uint32_t>(params.friction_model);
    c.acceleration = static_cast<std::uint32_t>(params.acceleration);
    c.residual_trace = params.residual_trace ? 1 : 0;
    c.contact_warm_start = params.contact_warm_start;
    c.joint_warm_start = params.joint_warm_start;
    c.contact_baumgarte = params.contact_baumgarte;
    c.joint_baumgarte = params.joint_baumgarte;
    c.contact_hertz = params.contact_hertz;
    c.contact_damping_ratio = params.contact_damping_ratio;
    c.joint_hertz = params.joint_hertz;
    c.joint_damping_ratio = params.joint_damping_ratio;
    c.hertz_limit = params.hertz_limit;
    c.static_hertz_scale = params.static_hertz_scale;
    c.max_push_speed = params.max_push_speed;
    c.restitution_threshold = params.restitution_threshold;
    c.residual_tolerance = params.residual_tolerance;
    c.contact_hertz_floor = params.contact_hertz_floor;
    c.tolerance = params.tolerance;
    return c;
}

Params check_params(const cairn_params* given) {
    // The method first: it says what the defaults are.
    const std::uint32_t method = read_struct(given, cairn_params{}).method;
    check_method(method);
    const cairn_params c = read_struct(given, to_c(preset(static_cast<Method>(method), Preset::best)));
    check_ranges(c);
    Params params = {};
    params.method = static_cast<Method>(c.method);
    params.iterations = c.iterations;
    params.substeps = c.substeps;
    params.position_iterations = c.position_iterations;
    params.relax_share = c.relax_share;
    params.restitution_iterations = c.restitution_iterations;
    params.splitting = static_cast<Splitting>(c.splitting);
    params.friction_model = static_cast<Friction>(c.friction_model);
    params.acceleration = static_cast<Acceleration>(c.acceleration);
    params.residual_trace = c.residual_trace != 0;
    params.contact_warm_start = c.contact_warm_start;
    params.joint_warm_start = c.joint_warm_start;
    params.contact_baumgarte = c.contact_baumgarte;
    params.joint_baumgarte = c.joint_baumgarte;
    params.contact_hertz = c.contact_hertz;
    params.contact_damping_ratio = c.contact_damping_ratio;
    params.joint_hertz = c.joint_hertz;
    params.joint_damping_ratio = c.joint_damping_ratio;
    params.hertz_limit = c.hertz_limit;
    params.static_hertz_scale = c.static_hertz_scale;
    params.max_push_speed = c.max_push_speed;
    params.restitution_threshold = c.restitution_threshold;
    params.residual_tolerance = c.residual_tolerance;
    params.contact_hertz_floor = c.contact_hertz_floor;
    params.tolerance = c.tolerance;
    return params;
}

Params check_preset(std::uint32_t method, std::uint32_t which) {
    check_method(method);
    if (which > CAIRN_PRESET_PAPER)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "preset is %u: must be CAIRN_PRESET_DEFAULT (0) or CAIRN_PRESET_PAPER (1)", which);
    if (method == CAIRN_METHOD_AUTO && which == CAIRN_PRESET_PAPER)
        refuse(CAIRN_ERROR_INVALID_ARGUMENT, "preset is %u: the method auto is not in the paper, it has CAIRN_PRESET_DEFAULT (0) alone",
               which);
    return preset(static_cast<Method>(method), static_cast<Preset>(which));
}

} // namespace cairn::capi
