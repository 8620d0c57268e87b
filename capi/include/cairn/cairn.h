/* Cairn: a rigid-body constraint solver for physics engines that already exist.
 *
 * It takes bodies, contacts and joints and gives back velocities, poses and impulses. It does no collision detection
 * and has no scene graph. The five methods are those of Liang, Luo, Guo and He, "Performance analysis of GPU-based
 * parallel solvers for rigid body dynamics" (2025), on the mass splitting of Tonge, Benevolenski and Voroshilov (2012).
 *
 *     cairn_solver *solver;                            cairn_step step = {sizeof step};
 *     cairn_solver_create(NULL, &solver);              step.dt = 1.0 / 60; step.bodies = &bodies; ...
 *     cairn_params params = {sizeof params};           cairn_solver_step(solver, &step, &results);
 *     cairn_params_preset(CAIRN_METHOD_TJ, CAIRN_PRESET_DEFAULT, &params);
 *     cairn_solver_set_params(solver, &params);
 *
 * Units are SI: m, kg, s, rad; impulses are N s (N m s on angular rows). Vectors are world axes unless a field says
 * otherwise. Quaternions are x, y, z, w and unit.
 *
 * Rules that hold for every call
 * - Struct sizes. The caller sets struct_size = sizeof(the struct). A shorter one (an older caller) gets defaults for the
 *   fields it lacks; a longer one (a newer caller) is accepted only if what this library does not know is zero.
 *   cairn_view is the exception: it has no size and never changes.
 * - Status. Every call that can fail returns a cairn_status; CAIRN_OK is 0. cairn_last_error() has the text. A refused
 *   input is refused before anything is changed: the caller's arrays and the solver stay as they were.
 * - Ownership. Views and tables are borrowed for the duration of the call only. Strings returned live as long as the
 *   library, except cairn_last_error()'s, which lives until the same thread's next failing call.
 * - Threads. Distinct solvers are independent. One solver serves one thread at a time. No call throws, and no hook may.
 * - Determinism. Results depend on the input alone: not on threads, instruction set, device or run.
 */
#ifndef CAIRN_CAIRN_H
#define CAIRN_CAIRN_H

#include <stddef.h>
#include <stdint.h>

#if defined(CAIRN_STATIC)
#define CAIRN_API
#elif defined(_WIN32)
#if defined(CAIRN_BUILDING)
#define CAIRN_API __declspec(dllexport)
#else
#define CAIRN_API __declspec(dllimport)
#endif
#else
#define CAIRN_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* The library's version, and the version of this interface. The interface's grows only with an incompatible change. */
#define CAIRN_VERSION_MAJOR 0
#define CAIRN_VERSION_MINOR 1
#define CAIRN_VERSION_PATCH 0
#define CAIRN_ABI_VERSION 1u

/* ---- Statuses ------------------------------------------------------------------------------------------------- */
typedef int32_t cairn_status;
#define CAIRN_OK 0
#define CAIRN_ERROR_INVALID_ARGUMENT 1 /* a null pointer, an unknown constant, a number out of range */
#define CAIRN_ERROR_INVALID_DATA 2     /* an element of a view is bad (the text names array, index and value), or a saved cache */
#define CAIRN_ERROR_STRUCT_SIZE 3      /* struct_size is impossible, or has set fields that this library does not know */
#define CAIRN_ERROR_BUFFER_TOO_SMALL 4 /* the text says how much is needed */
#define CAIRN_ERROR_OUT_OF_MEMORY 5    /* the solver stays usable */
#define CAIRN_ERROR_UNSUPPORTED 6      /* a backend, device or precision that this build or machine does not have */
#define CAIRN_ERROR_NOT_FINITE 7       /* the solve left the range of numbers; the caller's arrays are unchanged */
#define CAIRN_ERROR_INTERNAL 8         /* a bug in Cairn: please report it */

/* ---- Views ---------------------------------------------------------------------------------------------------- */
#define CAIRN_F32 0u
#define CAIRN_F64 1u
#define CAIRN_I32 2u
#define CAIRN_U32 3u
#define CAIRN_U64 4u

#define CAIRN_HOST 0u
#define CAIRN_DEVICE 1u /* memory of the solver's CUDA device (or managed memory); CAIRN_BACKEND_CUDA only */

/* An array of the caller's: `count` elements (count is the table's), each of the number of components that the field's
 * comment gives in [brackets], those components adjacent. Fields of one array of structs may interleave, and a result
 * may be the very same view as its input (in-place update of a body's field). Inputs may share memory; elements that overlap
 * otherwise are refused. Views of host and of device memory may be mixed in one table. Work on the device that fills a view, or reads
 * a result, must be ordered with the solver's stream: see cairn_config.stream. A view with data = NULL is absent: allowed where the comment says optional. Layout fixed for ever: 24 bytes. */
typedef struct cairn_view {
    void *data;      /* not written where the view is an input; aligned to its type */
    int64_t stride;  /* bytes from one element to the next; 0 = packed; may be any multiple of the type's size */
    uint32_t type;   /* CAIRN_F32, ... : floating fields take F32 or F64, index and flag fields I32 or U32 (the
                        same 32 bits: 0xffffffff is -1), keys U64 */
    uint32_t device; /* CAIRN_HOST or CAIRN_DEVICE */
} cairn_view;

/* ---- Input: bodies, contacts, joints, raw rows ------------------------------------------------------------------ */
#define CAIRN_BODY_NO_GYROSCOPIC 1u /* leave out the gyroscopic term: angular velocity, not momentum, is kept */
#define CAIRN_BODY_AT_END_POSE 2u   /* a kinematic body (inverse mass and inertia 0) given at its pose at the step's end */

/* A body with inverse mass 0 and inverse inertia 0 is static (velocity 0) or kinematic (velocity not 0): it is never
 * changed, its pose is never written. It moves with its velocity during the step as far as contacts are concerned. */
typedef struct cairn_bodies {
    uint32_t struct_size;
    uint32_t count;              /* up to 2^31 - 2, in every table */
    uint64_t revision;           /* host views with the revision of the last step's are not sent to a device again; 0 = changed */
    cairn_view position;         /* [3] m, the centre of mass */
    cairn_view orientation;      /* [4] x, y, z, w; refused if its norm is more than 1e-3 from 1 */
    cairn_view linear_velocity;  /* [3] m/s */
    cairn_view angular_velocity; /* [3] rad/s */
    cairn_view inverse_mass;     /* [1] 1/kg, >= 0 */
    cairn_view inverse_inertia;  /* [3] 1/(kg m^2), >= 0: about the body's own axes, which must be principal */
    cairn_view force;            /* [3] N, acts through the whole step, gravity of cairn_step apart; optional: 0 */
    cairn_view torque;           /* [3] N m, likewise */
    cairn_view linear_factor;    /* [3] world axes; inverse mass becomes F M^-1 F; optional: 1 */
    cairn_view angular_factor;   /* [3] world axes, likewise; a body with one other than 1 has no gyroscopic term */
    cairn_view flags;            /* [1] CAIRN_BODY_...; optional: 0 */
} cairn_bodies;

#define CAIRN_WORLD (-1) /* as a body index: the immovable world, its frame at the origin */

#define CAIRN_CONTACT_ROUND_A 1u /* the surface of a rolls (sphere, capsule about its axis): its anchor does not turn */
#define CAIRN_CONTACT_ROUND_B 2u

/* Contact points (paper eq. 6-9). Arms run from the centres of mass to the points on the two surfaces, so that
 * (x_b + arm_b) - (x_a + arm_a) = separation * normal; no world points, so precision does not fade far from the origin.
 * Consecutive contacts of the same two bodies, at most four, form a manifold. */
typedef struct cairn_contacts {
    uint32_t struct_size;
    uint32_t count;
    uint64_t revision;
    cairn_view body_a;      /* [1] index or CAIRN_WORLD; a and b differ; if neither can move the contact has no effect */
    cairn_view body_b;      /* [1] */
    cairn_view normal;      /* [3] unit (to 1e-3), from a to b */
    cairn_view arm_a;       /* [3] m */
    cairn_view arm_b;       /* [3] m */
    cairn_view separation;  /* [1] m, negative when the bodies overlap */
    cairn_view friction;    /* [1] Coulomb's coefficient, >= 0; optional: 0 */
    cairn_view restitution; /* [1] 0 ... 1; optional: 0 */
    cairn_view tangent;     /* [3] first friction direction; projected on the plane; optional, or zero: chosen from the normal */
    cairn_view key;         /* [1] U64, unique: finds the contact's impulse of the last step, torsion apart; 0 or absent: from zero */
    cairn_view flags;       /* [1] CAIRN_CONTACT_...; optional: 0 */
    /* What follows costs nothing where it is absent, nor in manifolds that have it at no point. */
    cairn_view friction_scale;    /* [2] >= 0, friction's share along `tangent` and along normal x tangent; optional: 1. An elliptic
                                     cone: |(lambda_1 / scale_1, lambda_2 / scale_2)| <= friction * lambda_n, and in it the friction
                                     that takes most power from the slip; scale 0: none that way. The pyramid is scaled alike */
    cairn_view surface_velocity;  /* [3] m/s, the velocity of b relative to a at the point that friction drives to, as a belt on a
                                     that runs so; its part along the normal is not read; optional: 0 */
    cairn_view rolling_friction;  /* [1] m, >= 0: the torque against relative rotation about the plane's directions is at most this
                                     times the normal force, a disc under the pyramid too; none under NONE; optional: 0 */
    cairn_view spinning_friction; /* [1] m, >= 0: likewise about the normal; optional: 0 */
    cairn_view stiffness;         /* [1] N/m, >= 0: the contact is a spring and damper, integrated implicitly, in place of the method's
                                     bias, position sweeps and push speed; its restitution is not read; optional: 0 (rigid) */
    cairn_view damping;           /* [1] N s/m, >= 0, of the same; without stiffness a damper alone; optional: 0 */
} cairn_contacts;

/* A joint has six axes, x y z of translation and x y z of rotation, in its frame; each is a combination of these: one of
 * locked, limited or neither, and one of motor, servo, spring or neither (a locked axis has none).
 * Ball, hinge, slider and fixed joints (paper eq. 10-17) are presets: cairn_joint_axes(). */
#define CAIRN_AXIS_FREE 0u
#define CAIRN_AXIS_LOCKED 1u
#define CAIRN_AXIS_LIMITED 2u /* lower <= coordinate <= upper */
#define CAIRN_AXIS_DRIVEN 4u  /* a motor: speed is driven to motor_speed with at most motor_force */
#define CAIRN_AXIS_SPRING 8u  /* force stiffness * (target - coordinate) - damping * speed, implicit in the substep: any is stable */
#define CAIRN_AXIS_SERVO 16u  /* with DRIVEN: speed is driven to rate * (target - coordinate), within +-motor_speed; a rotation
                                 turns the shorter way */

#define CAIRN_JOINT_BALL 0u   /* three rotations free */
#define CAIRN_JOINT_HINGE 1u  /* rotation about z free */
#define CAIRN_JOINT_SLIDER 2u /* translation along x free */
#define CAIRN_JOINT_FIXED 3u  /* none free */

#define CAIRN_ROTATION_BY_AXES 0u
#define CAIRN_ROTATION_VECTOR 1u /* the rotation vector, angle times axis, in a's frame: for servos and springs towards an orientation */
#define CAIRN_ROTATION_CONE 2u   /* swing and twist: rx is the angle of twist about b's x; ry and rz, limited both, keep b's x in an
                                    elliptic cone about a's x, of half-angles upper[4] about y and upper[5] about z (> 0; lower is
                                    not read), or are both free. The cone has one row, whose impulse is that of ry */

/* Coordinates: translation of b's frame origin from a's, along the axes of a's frame; rotation of b's frame relative to a's.
 * Rotation by kind of joint, unless `rotation` names another: all three locked: rotation vector 2 vec(q); exactly one not
 * locked: the angle about it in (-pi, pi], and the other two by the paper's dot products; otherwise Cardan angles x-y-z as in
 * btGeneric6DofConstraint (y within +-pi/2), of b relative to a: signs opposite to Bullet's. There limits and motors of x and
 * z act along the normalised axes, as Bullet's do, on cos(y) times the coordinate's rate. */
typedef struct cairn_joints {
    uint32_t struct_size;
    uint32_t count;
    uint64_t revision;
    cairn_view body_a;      /* [1] index or CAIRN_WORLD; a and b differ */
    cairn_view body_b;      /* [1] */
    cairn_view anchor_a;    /* [3] m, origin of the joint's frame in a's axes, from a's centre of mass (world: world point) */
    cairn_view anchor_b;    /* [3] m */
    cairn_view frame_a;     /* [4] quaternion: the joint's axes in a's axes; optional: identity */
    cairn_view frame_b;     /* [4] likewise in b's axes */
    cairn_view axes;        /* [6] I32 or U32, CAIRN_AXIS_... of tx ty tz rx ry rz */
    cairn_view lower;       /* [6] m or rad, may be -infinity; only limited axes are read; optional if none is limited */
    cairn_view upper;       /* [6] >= lower, may be infinity */
    cairn_view motor_speed; /* [6] m/s or rad/s; only driven axes are read; optional if none is driven. Servos: >= 0, infinity allowed */
    cairn_view motor_force; /* [6] N or N m, >= 0; infinity allowed */
    cairn_view key;         /* [1] U64, as for contacts; optional */
    cairn_view rotation;    /* [1] CAIRN_ROTATION_...; optional: CAIRN_ROTATION_BY_AXES */
    cairn_view target;      /* [6] m or rad, of springs and servos; optional: 0 */
    cairn_view stiffness;   /* [6] N/m or N m/rad, >= 0; of springs: optional if there are none; of servos: their force is at most
                               stiffness * |target - coordinate|, infinity allowed; optional: infinity */
    cairn_view damping;     /* [6] N s/m or N m s/rad, >= 0, of springs; optional: 0 */
    cairn_view rate;        /* [6] 1/s, >= 0, of servos; what is above 1/h of a substep is 1/h; optional: infinity */
    cairn_view max_force;   /* [1] N or N m, >= 0: bounds the force of each axis, of locked ones, limits and motors each on its own,
                               averaged over a substep; optional: infinity */
} cairn_joints;

/* Raw rows: constraints that Cairn does not know, as Jacobians of the step's start, frozen over its substeps:
 *     J v + compliance * lambda = rhs,   lower <= lambda <= upper
 * Consecutive rows of the same two bodies and the same `block` are solved together: at most six, or they are refused. */
typedef struct cairn_rows {
    uint32_t struct_size;
    uint32_t count;
    uint64_t revision;
    cairn_view body_a;         /* [1] index or CAIRN_WORLD; a and b differ */
    cairn_view body_b;         /* [1] */
    cairn_view jacobian_a;     /* [6] linear, angular, for body a */
    cairn_view jacobian_b;     /* [6] likewise for body b */
    cairn_view rhs;            /* [1] target of J v, m/s or rad/s; optional: 0 */
    cairn_view lower;          /* [1] N s over the whole step, may be -infinity; optional: -infinity */
    cairn_view upper;          /* [1] >= lower, may be infinity; optional: infinity */
    cairn_view compliance;     /* [1] >= 0, 1/kg (1/(kg m^2)): of the impulse of one substep; optional: 0 */
    cairn_view friction_index; /* [1] index of an earlier row of the same block that has lower >= 0, or -1; optional: -1. The row is
                                  then a friction row: |lambda| <= friction * lambda[friction_index]; at most two, side by side,
                                  name the same row, and two are bounded by a disc */
    cairn_view friction;       /* [1] coefficient for friction rows, >= 0; optional: 0 */
    cairn_view block;          /* [1] optional: 0 */
    cairn_view key;            /* [1] U64, as for contacts; optional */
} cairn_rows;

typedef struct cairn_step {
    uint32_t struct_size;
    uint32_t reserved;    /* 0 */
    double dt;            /* s, at least 1e-9 */
    double gravity[3];    /* m/s^2, on every body with inverse mass > 0 */
    const cairn_bodies *bodies;
    const cairn_contacts *contacts; /* may be NULL: none */
    const cairn_joints *joints;     /* may be NULL: none */
    const cairn_rows *rows;         /* may be NULL: none */
} cairn_step;

/* Where results go; every view is optional. Impulses are sums over the step: substeps, relaxation and restitution. */
typedef struct cairn_results {
    uint32_t struct_size;
    uint32_t reserved;           /* 0 */
    cairn_view position;         /* [3] per body; not written for bodies that cannot move */
    cairn_view orientation;      /* [4] */
    cairn_view linear_velocity;  /* [3] */
    cairn_view angular_velocity; /* [3] */
    cairn_view contact_impulse;  /* [1] per contact, N s, along the normal, >= 0 */
    cairn_view friction_impulse; /* [3] per contact, N s, world axes, on body b */
    cairn_view joint_impulse;    /* [6] per joint, N s and N m s, on body b, in the joint's axes */
    cairn_view row_impulse;      /* [1] per raw row */
    cairn_view torsion_impulse;  /* [3] per contact, N m s, world axes, on body b: rolling and spinning friction */
    cairn_view joint_linear;     /* [3] per joint, N s, world axes, on body b at its anchor, opposite on a: joint_impulse along the
                                    last substep's axes, for every kind of rotation */
    cairn_view joint_angular;    /* [3] per joint, N m s, likewise; the linear impulse's moments about the centres apart */
} cairn_results;

/* ---- Method and parameters -------------------------------------------------------------------------------------- */
#define CAIRN_METHOD_PJ 0u     /* projected Jacobi, Baumgarte bias */
#define CAIRN_METHOD_PJNJ 1u   /* projected Jacobi without bias, then nonlinear Jacobi on positions */
#define CAIRN_METHOD_PJSOFT 2u /* projected Jacobi, soft constraints */
#define CAIRN_METHOD_TJ 3u     /* substeps of PJ */
#define CAIRN_METHOD_TJSOFT 4u /* substeps of PJSoft */
#define CAIRN_METHOD_AUTO 5u   /* for every island (bodies tied by contacts, joints and rows) one of the above, by what the island is made
                                  of; stops where params.tolerance is met; on the CPU alone. See cairn_choice */
#define CAIRN_METHOD_COUNT 6u

#define CAIRN_PRESET_DEFAULT 0u /* the best that Cairn can show */
#define CAIRN_PRESET_PAPER 1u   /* the paper's: cold start, split by point, 300 iterations in all, no speed cap */

#define CAIRN_SPLIT_POINT 0u    /* a contact point is a block of the splitting */
#define CAIRN_SPLIT_MANIFOLD 1u /* a manifold is: fewer iterations, each a little dearer */

#define CAIRN_FRICTION_NONE 0u
#define CAIRN_FRICTION_CONE 1u    /* |lambda_t| <= mu lambda_n */
#define CAIRN_FRICTION_PYRAMID 2u /* each component on its own */

#define CAIRN_ACCELERATION_NONE 0u
#define CAIRN_ACCELERATION_NESTEROV 1u /* momentum with adaptive restart, per island */

#define CAIRN_SAME_AS_SWEEPS 0xffffffffu /* for restitution_iterations: the sweeps of a substep */

typedef struct cairn_params {
    uint32_t struct_size;
    uint32_t method;                 /* CAIRN_METHOD_... */
    uint32_t iterations;             /* velocity sweeps of a whole step, relaxation included, shared out over the substeps;
                                        1 ... 1 000 000 */
    uint32_t substeps;               /* 1 ... 1000, <= iterations; 1 for PJ, PJNJ and PJSoft */
    uint32_t position_iterations;    /* PJNJ only: nonlinear position sweeps of a step; 0 ... 1 000 000 */
    uint32_t restitution_iterations; /* sweeps at the step's end where a contact bounces; or CAIRN_SAME_AS_SWEEPS */
    uint32_t splitting;              /* CAIRN_SPLIT_... */
    uint32_t friction_model;         /* CAIRN_FRICTION_... */
    uint32_t acceleration;           /* CAIRN_ACCELERATION_... */
    uint32_t residual_trace;         /* 1: record the residual of every sweep (cairn_solver_residual_trace) */
    double contact_warm_start;       /* share of the last impulse to start from; 0 (cold) ... 1 */
    double joint_warm_start;         /* likewise, for joints and raw rows; keep <= 0.5 with a rigid bias: see README, "limits" */
    double relax_share;              /* share of a substep's sweeps, rounded down, that come after its poses are integrated, without
                                        bias: they take the push-out speed out again; 0 ... below 1 */
    double contact_baumgarte;        /* share of the error removed per substep (paper eq. 20), 0 ... 1; PJ, TJ */
    double joint_baumgarte;          /* likewise */
    double contact_hertz;            /* Hz, > 0; soft constraints (paper eq. 22); PJSoft, TJSoft */
    double contact_damping_ratio;    /* non-dimensional, > 0 */
    double joint_hertz;              /* Hz, > 0 */
    double joint_damping_ratio;      /* non-dimensional, > 0 */
    double hertz_limit;              /* soft frequencies are at most hertz_limit / substep; > 0, infinity: no limit */
    double static_hertz_scale;       /* contact_hertz is multiplied by this against bodies that cannot move; > 0 */
    double max_push_speed;           /* m/s, > 0, cap on the speed that pushes overlapping contacts apart; infinity: none */
    double restitution_threshold;    /* m/s, >= 0: slower approaches do not bounce */
    double residual_tolerance;       /* sqrt(J), an island stops sweeping when its residual is below; 0: never; 0 under AUTO */
    double contact_hertz_floor;      /* contact_hertz is at least contact_hertz_floor / substep, and contact_damping_ratio then higher in
                                        proportion: shorter substeps carry stiffer contacts, which sink less and push out no faster;
                                        >= 0, 0: contact_hertz as it is */
    double tolerance;                /* m/s, >= 0; AUTO only, else 0. An island's sweeps stop, in each substep, where one changes the speeds of
                                        its n bodies by less in root mean square: where the residual is below tolerance * sqrt(n m), m the
                                        lightest one's mass; but not before a few sweeps, and after enough of them (8 at contacts, 4 of unlike
                                        masses, 6 where SLENDER, 30 at few joints, 12 where STIFF; half of it in sweeps without bias) also where
                                        it is not met, unless a sweep still changes the speeds, each body weighed by its mass, by more than
                                        1 m/s: what is left then is better spent on the next substep. iterations and substeps are the most that a
                                        step of any island may have; 0: all the sweeps are made */
} cairn_params;

/* ---- Solver ------------------------------------------------------------------------------------------------------ */
typedef struct cairn_solver cairn_solver;

#define CAIRN_BACKEND_AUTO 0u /* the CPU, unless the environment variable CAIRN_BACKEND says "cuda", precision is 32 and instructions
                                 are CAIRN_ISA_AUTO */
#define CAIRN_BACKEND_CPU 1u
#define CAIRN_BACKEND_CUDA 2u /* on the CUDA device that is current in the thread that creates the solver */

/* How the CUDA backend runs the schedule. Results do not depend on it. */
#define CAIRN_EXECUTOR_AUTO 0u  /* by the size of the largest set of tied bodies and of the whole */
#define CAIRN_EXECUTOR_BLOCK 1u /* a CUDA block for every few islands, the whole step in one launch: many small islands or worlds */
#define CAIRN_EXECUTOR_GRID 2u  /* all of the device (or one cluster of it) in one launch, a barrier between stages */
#define CAIRN_EXECUTOR_GRAPH 3u /* a kernel a stage, replayed as a CUDA graph: large scenes */

#define CAIRN_ISA_AUTO 0u /* the widest that the processor has */
#define CAIRN_ISA_SCALAR 1u
#define CAIRN_ISA_SSE2 2u
#define CAIRN_ISA_AVX2 3u
#define CAIRN_ISA_AVX512 4u

#define CAIRN_LOG_INFO 0
#define CAIRN_LOG_WARNING 1

/* Run task(argument, i) for every i in 0 ... count - 1, on any threads, and return when all are done. Tasks are few
 * (at most cairn_config.threads) and none waits for another. */
typedef void (*cairn_task)(void *argument, uint32_t index);
typedef void (*cairn_parallel_for)(void *user, uint32_t count, cairn_task task, void *argument);
typedef void (*cairn_log)(void *user, int32_t level, const char *text);
typedef void *(*cairn_allocate)(void *user, size_t bytes, size_t alignment); /* NULL: out of memory */
typedef void (*cairn_release)(void *user, void *memory, size_t bytes, size_t alignment);

typedef struct cairn_config {
    uint32_t struct_size;
    uint32_t backend;      /* CAIRN_BACKEND_... */
    uint32_t threads;      /* 1 ... 1024; 0: as many as the process may use */
    uint32_t instructions; /* CAIRN_ISA_...; for tests and measurements: results do not depend on it */
    uint32_t precision;    /* 32 or 64, 0 = 32. 64 is the reference: scalar, slow, for accuracy studies */
    uint32_t reserved;     /* 0 */
    void *user;            /* handed to every hook */
    cairn_log log;         /* optional */
    cairn_parallel_for parallel_for; /* optional: else Cairn's own threads */
    cairn_allocate allocate;         /* optional, with release: for the solver's large arrays on the host */
    cairn_release release;
    uint32_t executor;   /* CAIRN_EXECUTOR_..., for the CUDA backend */
    uint32_t reserved_2; /* 0 */
    void *stream;        /* cudaStream_t (CUstream) that the CUDA backend queues its work on, and that must outlive the solver; NULL: one
                            of the solver's own, ordered with the legacy default stream but with no other */
} cairn_config;

/* What the last step did. Times are wall-clock seconds. */
typedef struct cairn_statistics {
    uint32_t struct_size;
    uint32_t bodies;              /* that can move */
    uint32_t contacts;            /* that had an effect */
    uint32_t manifolds;
    uint32_t joints;
    uint32_t rows;                /* scalar rows swept, of joints, raw rows and contacts: by manifold, a point has 6 with rolling or
                                     spinning friction, else 3 with friction or a spring, else 1 */
    uint32_t islands;
    uint32_t substeps;
    uint32_t iterations;          /* velocity sweeps, of the busiest island */
    uint32_t position_iterations;
    uint32_t relax_iterations;    /* how many of the iterations went without bias */
    uint32_t restitution_iterations;
    uint32_t warm_started;        /* contacts, joints and raw rows whose impulse was found in the cache */
    uint32_t rotation_clamped;    /* times that a body's turn in a substep was cut to pi/4 */
    uint32_t threads;
    uint32_t instructions;        /* CAIRN_ISA_... used */
    uint32_t backend;             /* CAIRN_BACKEND_... used */
    uint32_t executor;            /* CAIRN_EXECUTOR_... used, 0 on the CPU */
    double time_total;
    double time_pack;             /* check, gather, order, match the cache; on a device the first two are in time_total alone */
    double time_build;            /* rows and effective masses */
    double time_sweep;            /* velocity sweeps; on a device the whole schedule, which is not taken apart there */
    double time_position;         /* position sweeps */
    double time_integrate;        /* forces and poses */
    double time_finish;           /* restitution, relaxation, cache, write back */
    double kinetic_energy_change; /* J: sum over substeps of the energy after the sweeps - before them (after forces) */
    double residual;              /* of the last sweep: |step of lambda| in the metric of D, sqrt(J); 0 unless traced */
    double time_upload;           /* sending tables to the device, 0 on the CPU */
    double time_download;         /* fetching results from it */
} cairn_statistics;

/* ---- How good was a step? ---------------------------------------------------------------------------------------- */

/* What cairn_evaluate says of an island, or of the whole. In double, from the tables that went into a step of any solver and the results
 * that came out, against the problem as it was given: the caller's constraints, hard, whatever bias, softness or substeps a method
 * puts in their place. h = step.dt. Each body's mean twist V over the step is taken from its poses: (x+ - x) / h, and the rotation vector
 * of q+ q^-1 over h (the shorter turn); bodies that cannot move have the velocity they were given. So steps with and without substeps
 * are judged alike. Poses of single precision leave their rounding over h in V, in m/s; pass double where that is too much.
 *
 * Residuals are natural maps, r = D lambda - P(D lambda - w): 0 exactly where lambda and w obey the row's law; P is the projection on
 * what lambda may be, D = J M^-1 J^T at the step's start makes a speed of an impulse.
 * - Contacts: Coulomb's cone K of the coefficient mu, with De Saxce's correction (De Saxce and Feng 1998; Acary and Brogliato 2008):
 *     r = D lambda - P_K(D lambda - (w + mu |w_t| n)),   w_t = J_t V - surface_velocity,   D = trace(J M^-1 J^T) / 3
 *   with normal and arms of the step's start, both bodies pushed half way between the surfaces. w_n = (C - C*) / h with
 *   C = separation + h J_n V and C* what is nearest to C of what a step may do: keep the surfaces in touch, keep or reduce an overlap
 *   that was there, or part again with restitution times the speed of approach. Overlap itself is what penetration says.
 * - Joints: locked axes w = (C - C*) / h from the coordinate C at the end and C* nearest to it between 0 and its value at the start:
 *   an error may be kept or reduced; lambda is free, or within h max_force. Limited axes: the same for each limit, where lambda only
 *   pushes back. Motors: w = J V - motor_speed with J of the start, |lambda| <= h motor_force and h max_force.
 * - Raw rows: w = J V - rhs, lower <= lambda <= upper; friction rows in a disc (or interval) of friction * |lambda[friction_index]|.
 * What has a law of its own instead is not in the residuals, though its impulses are in momentum and energy: contacts with stiffness
 * or damping, rolling and spinning friction, servos and springs of joints, axes with a limit and one of these or a motor, raw rows with
 * compliance, rows with D = 0. An index is one in the caller's table, the smallest of equals; -1 where its quantity is 0. A mean is over
 * all of the island's contacts or joints, those without error included; 0 if there are none. */
typedef struct cairn_evaluation {
    uint32_t struct_size;
    uint32_t bodies;                /* that can move: the island's, or all */
    uint32_t contacts;              /* of which a body can move; likewise: */
    uint32_t joints;
    uint32_t rows;
    int32_t penetration_contact;    /* which element has the largest penetration; likewise: */
    int32_t residual_contact;
    int32_t gap_joint;
    int32_t angle_joint;
    int32_t residual_joint;
    int32_t angular_residual_joint;
    int32_t residual_row;
    int32_t momentum_body;
    int32_t angular_momentum_body;
    double penetration;             /* m, of the end's poses: -(separation + n . change of the anchors' distance), >= 0 */
    double penetration_mean;        /* m */
    double joint_gap;               /* m, of the end's poses: norm over the translations locked, or limited and violated */
    double joint_gap_mean;          /* m */
    double joint_angle;             /* rad, likewise over the rotations, in the joint's coordinates */
    double joint_angle_mean;        /* rad */
    double contact_residual;        /* m/s, |r| */
    double joint_residual;          /* m/s, |r| of a translation */
    double joint_angular_residual;  /* rad/s, |r| of a rotation */
    double row_residual;            /* |r| in the row's unit */
    double relative_residual;       /* 0 ... 1, no unit: all residuals beside all impulses, as energies: e / sqrt(e^2 + i^2), e^2 = sum of
                                       |r|^2 / D, i^2 = sum of D |lambda|^2, and over bodies of h^2 a . M a, a the external acceleration */
    double complementarity;         /* J, |lambda_n w_n| of a contact: pushing while apart, or pulling */
    double coulomb_excess;          /* N s, |lambda_t| - mu lambda_n of a contact, >= 0 (elliptic friction: in the scale of the longer axis) */
    double momentum;                /* N s, of a body: m |v+ - v - h (external acceleration) - M^-1 (reported impulses)| */
    double angular_momentum;        /* N m s, likewise: |I+ w+ - I w - ...|, without gyroscopic term |I (w+ - w) - ...|; impulses of contacts
                                       and rows at the start's arms, of joints at the mean of the start's and the end's. Of joints whose
                                       axes turn while a step's impulses add up, that turn times the impulse remains in both */
    double momentum_total;          /* N s, the same changes added as vectors: what came from nowhere */
    double angular_momentum_total;  /* N m s, likewise about the centre of mass, at the start's positions */
    double kinetic_energy;          /* J: E+ - E - h (force . (v + v+) / 2 + torque . (w + w+) / 2), what the constraints added; negative: took */
} cairn_evaluation;
/* What CAIRN_METHOD_AUTO did with an island in the last step. Layout fixed for ever: 40 bytes. */
#define CAIRN_REASON_ALONE 0u    /* no constraints */
#define CAIRN_REASON_CONTACTS 1u /* contacts alone, the heaviest body at most 10 times the lightest */
#define CAIRN_REASON_UNEVEN 2u   /* contacts alone, masses further apart */
#define CAIRN_REASON_JOINTS 3u   /* at most four joints (raw rows count six to one), no ring of them, like masses */
#define CAIRN_REASON_STIFF 4u    /* more joints, a ring of them, or unlike masses */
#define CAIRN_REASON_SLENDER 5u  /* contacts alone, like masses; more than 8 bodies high, and 2 bodies < height^2 */

typedef struct cairn_choice {
    uint32_t first_body; /* the island's first body that can move */
    uint32_t bodies;     /* its bodies that can move */
    uint32_t reason;     /* CAIRN_REASON_... */
    uint32_t method;     /* CAIRN_METHOD_..., the one taken */
    uint32_t substeps;
    uint32_t iterations; /* velocity sweeps that the step had at most, relaxation included */
    uint32_t swept;      /* how many were made; all of them where the tolerance is 0 */
    uint32_t met;        /* 1: in every substep the sweeps, and those without bias, ended below the tolerance; 0 also where they ended
                            after enough of them, see params.tolerance */
    double residual;     /* m/s, in the tolerance's measure, of the substep in which they ended worst */
} cairn_choice;

typedef struct cairn_info {
    uint32_t struct_size;
    uint32_t abi_version;
    uint32_t version[3];
    uint32_t instructions;   /* CAIRN_ISA_... that AUTO takes here */
    const char *build;       /* compiler, flags, commit */
    const char *cuda;        /* the CUDA backend's state in words: present, or what is missing */
} cairn_info;

/* Text of this thread's last failing call; "" if there was none. */
CAIRN_API const char *cairn_last_error(void);
/* Short name of a status: "invalid data". NULL for an unknown one. */
CAIRN_API const char *cairn_status_name(cairn_status status);
/* "pj", "pjnj", "pjsoft", "tj", "tjsoft", "auto"; NULL for an unknown one. */
CAIRN_API const char *cairn_method_name(uint32_t method);
CAIRN_API cairn_status cairn_get_info(cairn_info *info);

/* CAIRN_REASON_... in words, and with what is done about it; NULL for an unknown one. */
CAIRN_API const char *cairn_reason_text(uint32_t reason);

/* Fills params (struct_size must be set) for a method; every field is then valid. AUTO has no CAIRN_PRESET_PAPER. */
CAIRN_API cairn_status cairn_params_preset(uint32_t method, uint32_t preset, cairn_params *params);
/* Fills axes[6] for CAIRN_JOINT_... */
CAIRN_API cairn_status cairn_joint_axes(uint32_t joint, uint32_t *axes);

/* config may be NULL: all defaults. A new solver has the TJSoft method's default preset. *solver is NULL on failure. */
CAIRN_API cairn_status cairn_solver_create(const cairn_config *config, cairn_solver **solver);
/* NULL is allowed. */
CAIRN_API void cairn_solver_destroy(cairn_solver *solver);
/* Refused as a whole if any field is out of range, and CAIRN_METHOD_AUTO by a CUDA backend (CAIRN_ERROR_UNSUPPORTED). A shorter struct keeps the method's default for what it lacks. */
CAIRN_API cairn_status cairn_solver_set_params(cairn_solver *solver, const cairn_params *params);
CAIRN_API cairn_status cairn_solver_get_params(const cairn_solver *solver, cairn_params *params);

/* One step of the simulation: forces, constraints, poses. results may be NULL: then nothing is written. */
CAIRN_API cairn_status cairn_solver_step(cairn_solver *solver, const cairn_step *step, const cairn_results *results);

/* The same step in two calls, so that the caller can work while a device does: step_async checks tables that are in host memory alone,
 * sends and queues the rest; wait waits for it and returns what cairn_solver_step would have. In between the memory of all views is borrowed
 * (the structs are not), host results are not there yet, and every other call on the solver but destroy is refused. If step_async fails,
 * no step is in flight. wait returns CAIRN_OK if none is. On the CPU step_async does it all.
 * Results in device memory are there in the order of the solver's stream, even before wait; but only wait tells whether an element in
 * device memory was refused or a body left the range of numbers, and then they were not written. */
CAIRN_API cairn_status cairn_solver_step_async(cairn_solver *solver, const cairn_step *step, const cairn_results *results);
CAIRN_API cairn_status cairn_solver_wait(cairn_solver *solver);

/* Of the last step that succeeded. */
CAIRN_API cairn_status cairn_solver_get_statistics(const cairn_solver *solver, cairn_statistics *statistics);
/* Residual of every velocity sweep of the last step, if params.residual_trace. *count is set to how many there are; they
 * are written if values is not NULL and capacity suffices (else CAIRN_ERROR_BUFFER_TOO_SMALL, nothing written). */
CAIRN_API cairn_status cairn_solver_residual_trace(const cairn_solver *solver, double *values, size_t capacity,
                                                   size_t *count);
/* n_i of paper eq. 19, per body of the last step: how many blocks share it. Same protocol. */
CAIRN_API cairn_status cairn_solver_split_counts(const cairn_solver *solver, uint32_t *values, size_t capacity,
                                                 size_t *count);

/* Of every island of the last step, in the order of their first bodies; none if its method was not CAIRN_METHOD_AUTO. Same protocol.
 * Under AUTO the statistics are sums over the islands, substeps and iterations the most of any; the residual trace has the sweeps of
 * CAIRN_REASON_CONTACTS's islands first, then those of the next reason, and so on. */
CAIRN_API cairn_status cairn_solver_choices(const cairn_solver *solver, cairn_choice *values, size_t capacity, size_t *count);

/* The warm-start cache: forget it; save it and load it, so that a run can be restarted with the same bits. */
CAIRN_API cairn_status cairn_solver_reset(cairn_solver *solver);
CAIRN_API cairn_status cairn_solver_save_cache(const cairn_solver *solver, void *bytes, size_t capacity, size_t *size);
CAIRN_API cairn_status cairn_solver_load_cache(cairn_solver *solver, const void *bytes, size_t size);

/* task(argument, i) for every i in 0 ... count - 1 on the threads that the solver steps with (cairn_config's), for what a caller does around a
 * step, such as packing its tables; returns when all are done. Neighbours are mostly run one after another on one thread. In the solver's
 * floating-point environment: rounding to nearest, subnormals kept. No task may call the solver or throw. */
CAIRN_API cairn_status cairn_solver_parallel_for(cairn_solver *solver, uint32_t count, cairn_task task, void *argument);

/* How good was this step? `step` is what went in, as it was before the step, `results` what came out, from any solver; both are only read,
 * in host memory. Required of results: position, orientation and the velocities of bodies (those that cannot move are not read), and
 * where there are such elements contact_impulse, friction_impulse with contacts.friction, torsion_impulse with rolling or spinning friction,
 * joint_impulse, joint_linear, joint_angular and row_impulse. Refused like cairn_solver_step's input; also results in place of
 * their input, which is then gone, and elements of results that are not finite or not unit.
 * Each output may be NULL. `whole` is all islands together. Islands are sets of movable bodies tied by contacts, joints or rows, numbered
 * by their first body, as the solver numbers them; `*island_count` is set to how many there are, and they are written if `islands` is
 * not NULL and `capacity` suffices (else CAIRN_ERROR_BUFFER_TOO_SMALL, nothing else written). islands[0].struct_size must be set: it is
 * the distance of one island from the next. body_island has room for every body: its island, or -1 if it cannot move.
 * CAIRN_ERROR_NOT_FINITE if a quantity left the range of numbers. Needs no solver; threads may call it at once. */
CAIRN_API cairn_status cairn_evaluate(const cairn_step *step, const cairn_results *results, cairn_evaluation *whole,
                                      cairn_evaluation *islands, size_t capacity, size_t *island_count, int32_t *body_island);

/* Every call above as a table, so that a loader needs one symbol. Grows at its end only; struct_size says how far. */
typedef struct cairn_api {
    uint32_t struct_size;
    uint32_t abi_version;
    const char *(*last_error)(void);
    const char *(*status_name)(cairn_status);
    const char *(*method_name)(uint32_t);
    cairn_status (*get_info)(cairn_info *);
    cairn_status (*params_preset)(uint32_t, uint32_t, cairn_params *);
    cairn_status (*joint_axes)(uint32_t, uint32_t *);
    cairn_status (*solver_create)(const cairn_config *, cairn_solver **);
    void (*solver_destroy)(cairn_solver *);
    cairn_status (*solver_set_params)(cairn_solver *, const cairn_params *);
    cairn_status (*solver_get_params)(const cairn_solver *, cairn_params *);
    cairn_status (*solver_step)(cairn_solver *, const cairn_step *, const cairn_results *);
    cairn_status (*solver_get_statistics)(const cairn_solver *, cairn_statistics *);
    cairn_status (*solver_residual_trace)(const cairn_solver *, double *, size_t, size_t *);
    cairn_status (*solver_split_counts)(const cairn_solver *, uint32_t *, size_t, size_t *);
    cairn_status (*solver_reset)(cairn_solver *);
    cairn_status (*solver_save_cache)(const cairn_solver *, void *, size_t, size_t *);
    cairn_status (*solver_load_cache)(cairn_solver *, const void *, size_t);
    cairn_status (*solver_step_async)(cairn_solver *, const cairn_step *, const cairn_results *);
    cairn_status (*solver_wait)(cairn_solver *);
    cairn_status (*solver_parallel_for)(cairn_solver *, uint32_t, cairn_task, void *);
    cairn_status (*evaluate)(const cairn_step *, const cairn_results *, cairn_evaluation *, cairn_evaluation *, size_t, size_t *, int32_t *);
    const char *(*reason_text)(uint32_t);
    cairn_status (*solver_choices)(const cairn_solver *, cairn_choice *, size_t, size_t *);
} cairn_api;

/* NULL if this library does not have that version (pass CAIRN_ABI_VERSION). */
CAIRN_API const cairn_api *cairn_get_api(uint32_t abi_version);

#ifdef __cplusplus
}
#endif
#endif
