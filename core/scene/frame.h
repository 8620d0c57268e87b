// Everything that the stages of a step work on, as plain pointers: the same struct goes to a CPU thread and to a GPU kernel.
//
// Bodies are rows of eight numbers, because constraints reach them by index and a row is one cache line's half:
//   velocity      vx vy vz beta | wx wy wz active     where the next sweep looks (Nesterov's y); beta, active: its island's
//   displacement  dx dy dz 0    | qx qy qz qw         since the step's start; far from the origin nothing is lost
//   mass          1/m x y z, n  | Ixx Iyy Izz 0        inverse, factors applied; n: blocks that share the body (eq. 19)
//   mass_cross    Ixy Ixz Iyz ...
// Row body_count is the world. Constraints are structures of arrays in groups of kGroup lanes, [field][lane]; a group holds
// blocks of one shape (manifolds of as many points, joints of one kind), so that no lane idles. A block writes the impulse
// it gives to each of its two bodies into a slot of its own; the slots of a body are adjacent, in the order of the input.
#pragma once
#include "../portable.h"

#include <cstddef>
#include <cstdint>

namespace cairn {

constexpr std::uint32_t kGroup = 16;
constexpr std::uint32_t kPoints = 4; // of a manifold
constexpr std::uint32_t kRawRows = 6;

// What the rows of a substep are for.
enum class Phase : std::uint32_t { substep, relax, restitution };

// Fields of a contact point, swept. n, t1, t2: directions; a, b: arms of the common point of application.
enum ContactField : std::uint32_t {
    kNormal = 0,
    kTangent1 = 3,
    kTangent2 = 6,
    kArmA = 9,
    kArmB = 12,
    kInverseN = 15, // 1/(D_nn + gamma)
    kDn1,
    kDn2, // D's coupling of normal and tangents
    kInverseT1,
    kInverseT2,
    kDt12, // cone: 1/sigma twice, sigma = lambda_max(D_tt); pyramid: 1/D_11, 1/D_22 and D_12
    kBias,
    kGamma,
    kFriction,
    kDnn,
    kDt1,
    kDt2,    // the majoriser's diagonal, for restart and residual
    kLambda, // two buffers of three: normal, tangent 1, tangent 2
    kContactFields = kLambda + 6,
};
// Fields read once a substep or less.
enum ContactColdField : std::uint32_t {
    kSeparation = 0,
    kAnchorA = 1,
    kAnchorB = 4,
    kTurnsA = 7,
    kTurnsB, // kTurns: 0 where the side is round
    kRestitution,
    kApproach,
    kTotal,             // of the step
    kKept = kTotal + 3, // of the last substep
    kContactColdFields = kKept + 3,
};
// Fields of points in groups that are `special`; the others have none.
enum ContactExtraField : std::uint32_t {
    kSlipTarget = 0, // t1 . u and t2 . u that friction drives to
    kSpringRate = 2,
    kSpringGamma,  // of a contact that is a spring and damper; gamma is 0 where it is rigid
    kRollingBound, // coefficients of rolling and spinning friction, m
    kSpinningBound,
    kInverseRoll,
    kInverseSpin,
    kDRoll,
    kDSpin,  // the majoriser's diagonal and its inverse
    kTorque, // two buffers of three: angular impulse on b, world axes
    kTorqueTotal = kTorque + 6,
    kContactExtraFields = kTorqueTotal + 3,
};

// Joints: axes 0-2 translate, 3-5 rotate.
enum JointField : std::uint32_t {
    kLinear = 0,  // three directions
    kAngular = 9, // three directions
    kJointArmA = 18,
    kJointArmB = 21,
    kJointBias = 24,
    kJointGamma = 30,
    kFactor = 36,   // LDL^T of the locked axes' block: 15 of L, row by row
    kPivot = 51,    // 6 inverse pivots, 0 for axes that are not locked
    kBlock = 57,    // D, 21: row by row, lower triangle; only where some axis is limited or driven
    kInverseD = 78, // 6: 1/(D_ii + gamma_i) of limited axes, else 0
    kLow = 84,
    kHigh = 90, // bounds of limited and locked axes
    kMotorInverse = 96,
    kMotorSpeed = 102,
    kMotorBound = 108,
    kMotorGamma = 114,  // of springs, else 0
    kJointLambda = 120, // two buffers of twelve: axes, motors and springs
    kJointFields = kJointLambda + 24,
};
enum JointColdField : std::uint32_t {
    kStartArmA = 0,
    kStartArmB = 3,
    kStartFrameA = 6,
    kStartFrameB = 10,
    kStartGap = 14,
    kIsLocked = 17,
    kIsLimited = 23,
    kIsDriven = 29, // by a motor or a spring
    kLowerLimit = 35,
    kUpperLimit = 41,
    kSpeed = 47,  // springs: damping
    kForce = 53,  // springs: stiffness
    kTarget = 59, // of servos and springs
    kRate = 65,   // of servos; 0: a motor, negative: a spring
    kYield = 71,  // of servos: force per error
    kMostForce = 77,
    kJointTotal = 78,
    kJointKept = kJointTotal + 12,
    kJointColdFields = kJointKept + 12,
};
// How a group of joints measures rotation.
enum class Rotation : std::uint32_t { none, locked, about_x, about_y, about_z, cardan, vector, cone };

// Fields of a raw row.
enum RawField : std::uint32_t {
    kJacobianA = 0,
    kJacobianB = 6,
    kRhs = 12,
    kRawLow,
    kRawHigh,
    kRawGamma,
    kRawInverse,
    kRawD,
    kRawFriction,
    kFrictionSource, // row of the block whose impulse bounds this one, -1: none
    kPairFirst,
    kPairSecond, // two friction rows with one source share a disc
    kRawLambda,
    kRawTotal = kRawLambda + 2,
    kRawKept,
    kRawFields,
};

// What the points of a manifold have, the most that any of them has; special: a spring, or a target for the slip.
enum class ContactKind : std::uint32_t { torsional, special, frictional, smooth };
CAIRN_HD constexpr std::uint32_t rows_of(ContactKind kind) {
    return kind == ContactKind::torsional ? 6 : kind == ContactKind::smooth ? 1 : 3;
}

// Lanes side by side are of one shape; shapes in the order in which they are laid out.
constexpr std::uint32_t kContactShapes = 4 * kPoints, kJointShapes = 16, kRawShapes = kRawRows;

struct Group {
    std::uint32_t first = 0;       // place of lane 0's first point (joint, row) among all of its kind
    std::uint32_t stride = kGroup; // from a lane's point to its next
    std::uint32_t count = 0;       // points of each manifold, rows of each raw block, 1 for joints
    Rotation rotation = Rotation::none;
    ContactKind contact = ContactKind::smooth;
    bool bounded = false; // joints: some lane has a limited, driven or sprung axis, or bounded impulses

    CAIRN_HD bool special() const { return contact <= ContactKind::special; }
};

// The first of `fields` numbers, kGroup apart, of place i of an array of constraints ...
template <class S> CAIRN_HD S* fields_at(S* array, std::uint32_t fields, std::size_t i) {
    return array + i / kGroup * fields * kGroup + i % kGroup;
}
// ... and of point p of lane `sub` of a group.
template <class S> CAIRN_HD S* fields_of(S* array, std::uint32_t fields, const Group& g, std::uint32_t p, std::uint32_t sub) {
    return fields_at(array, fields, g.first + static_cast<std::size_t>(p) * g.stride + sub);
}

// Special ones come first, so that their points do.
CAIRN_HD inline std::uint32_t contact_shape(std::uint32_t count, ContactKind kind) {
    return kPoints * static_cast<std::uint32_t>(kind) + (kPoints - count);
}
CAIRN_HD inline Group contact_group_of(std::uint32_t shape) {
    Group g;
    g.count = kPoints - shape % kPoints;
    g.contact = static_cast<ContactKind>(shape / kPoints);
    return g;
}
CAIRN_HD inline std::uint32_t joint_shape(Rotation rotation, bool bounded) {
    return 2 * static_cast<std::uint32_t>(rotation) + (bounded ? 0u : 1u);
}
CAIRN_HD inline Group joint_group_of(std::uint32_t shape) {
    Group g;
    g.count = 1;
    g.rotation = static_cast<Rotation>(shape / 2);
    g.bounded = shape % 2 == 0;
    return g;
}
CAIRN_HD inline std::uint32_t raw_shape(std::uint32_t count) { return kRawRows - count; }
CAIRN_HD inline Group raw_group_of(std::uint32_t shape) {
    Group g;
    g.count = kRawRows - shape;
    return g;
}

// What never changes in a step, a body. Only stages that visit each body once a substep read it.
template <class S> struct BodyConstants {
    S orientation[4];
    S inverse_inertia[3]; // principal
    S inverse_mass[3];    // with factors
    S angular_factor[3];
    S acceleration[3], torque[3];
    S mass; // 1/inverse mass, for the energy; 0 if it has none
    bool movable, gyroscopic;
};

// The bodies' energies are added up this many at a time, in the order of the input, then the sums.
constexpr std::uint32_t kEnergyChunk = 256;

// One island's state of the iteration.
template <class S> struct Control {
    S t, beta, active, residual; // Nesterov's t and momentum; 1 or 0; squared residual of the last sweep
    S stop;                      // the sweeps stop below this squared residual; 0: below the frame's tolerance
    S violent;                   // and after enough of them below this one
    S ended;                     // the largest squared residual in which a substep's sweeps have ended
    std::uint32_t sweeps[3];     // made in each phase, over all substeps; counted only where the sweeps are reduced
};

// Where the schedule is. What the stages see of it changes from one to the next; the rest of a frame stays.
struct Progress {
    std::uint32_t current; // lambda's buffer that holds x; the other holds the x before
    std::uint32_t sweep;   // of the step, restitution apart
    Phase phase;
    bool reduces, last_sweep; // reduces: islands have control records
    bool too_few, enough;     // sweeps of this phase of the substep: islands must not stop yet; stop unless they are violent
};

template <class S> struct Frame : Progress {
    // sizes
    std::uint32_t body_count, movable_count, moving_count, island_count;
    std::uint32_t contact_groups, joint_groups, raw_groups;
    // bodies
    S *velocity, *iterate, *displacement, *mass, *mass_cross; // iterate: velocity of lambda itself (Nesterov's x)
    const BodyConstants<S>* body;
    const std::uint32_t* moving; // movable bodies, then kinematic ones
    const std::uint32_t* body_island;
    const std::uint32_t* slot_begin; // [body_count + 1]
    S* slots;
    std::uint32_t* rotation_clamped; // per body
    double* energy_change;           // per body: of its kinetic energy, over the sweeps of all substeps
    // constraints: per group
    const Group *contact_group, *joint_group, *raw_group;
    S *contact, *contact_cold, *contact_extra, *joint, *joint_cold, *raw;
    // per lane, contacts first, then joints, then raw blocks
    const std::int32_t *lane_a, *lane_b, *slot_a, *slot_b;
    const std::uint32_t* lane_partial; // where the lane's share of its island's sums goes
    const std::uint32_t* lane_island;
    const S* lane_static; // 1: one side cannot move
    S *partial_restart, *partial_residual;
    // islands
    const std::uint32_t* island_begin; // [island_count + 1], into the partial sums
    std::uint8_t* island_bounces;
    Control<S>* control;
    S* trace; // [sweep of the step][island] squared residuals, not >= 0 where an island rested; null: not wanted
    // the step
    S h, dt;
    bool warm, momentum, manifold_blocks, pyramid;
    // parameters
    bool soft, unbiased; // the method's bias: soft, none, or else Baumgarte
    S contact_warm, joint_warm, contact_baumgarte, joint_baumgarte, contact_omega, contact_omega_static, contact_zeta;
    S joint_omega, joint_zeta, push_speed, restitution_threshold, tolerance;
};

// What an executor runs; each is a loop without order over groups, bodies or islands.
enum class Stage : std::uint32_t {
    approach,       // groups: approach speeds, for restitution
    bouncing,       // islands: does any contact bounce
    inertia,        // bodies: of the pose at the step's start
    forces,         // bodies: external forces
    energy_before,  // bodies: the kinetic energy before a substep's sweeps ...
    energy_after,   // ... and after them
    build,          // groups: rows, effective masses, warm start
    begin,          // islands: control records
    apply_start,    // bodies: the warm start's impulses; momentum starts afresh
    sweep,          // groups
    reduce,         // islands
    apply,          // bodies: gather the sweep's impulses
    integrate,      // bodies: poses
    position_sweep, // groups
    position_apply, // bodies
    accumulate,     // groups: impulses of the substep into those of the step
    keep,           // groups: impulses of the last substep, for the next step's warm start
};

// What a stage loops over. Movable bodies come before kinematic ones, which only move.
enum class Domain : std::uint32_t { groups, movable, moving, islands };
CAIRN_HD constexpr Domain domain_of(Stage stage) {
    switch (stage) {
    case Stage::bouncing:
    case Stage::begin:
    case Stage::reduce:
        return Domain::islands;
    case Stage::integrate:
        return Domain::moving;
    case Stage::inertia:
    case Stage::forces:
    case Stage::energy_before:
    case Stage::energy_after:
    case Stage::apply_start:
    case Stage::apply:
    case Stage::position_apply:
        return Domain::movable;
    default:
        return Domain::groups;
    }
}

template <class S> using RunStage = void (*)(Stage, const Frame<S>&, std::uint32_t begin, std::uint32_t end);

} // namespace cairn
