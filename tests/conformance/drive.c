/* A C99 program that knows one symbol, cairn_get_api: drops a box and a tethered ball on the ground under every method,
 * restarts a run from a saved cache, and provokes the errors that a caller meets first. Returns 0 when all is well. */
#include <cairn/cairn.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;

static int report(int good, const char* what, int line) {
    if (!good) {
        fprintf(stderr, "drive.c:%d: %s\n", line, what);
        ++failures;
    }
    return good;
}
#define EXPECT(condition) report((condition), #condition, __LINE__)

#define BODIES 2
#define CONTACTS 5
static const double half = 0.2;

/* An array of structs, as engines have them: the views point into it. */
struct body {
    float position[3], orientation[4], linear[3], angular[3];
    float inverse_mass, inverse_inertia[3];
};
struct contact {
    int32_t a, b;
    float normal[3], arm_a[3], arm_b[3], separation, friction;
    uint64_t key;
};
struct world {
    struct body body[BODIES];
    struct contact contact[CONTACTS];
    uint32_t contacts;
};

static cairn_view view(void* data, size_t stride, uint32_t type) {
    cairn_view v;
    memset(&v, 0, sizeof v);
    v.data = data;
    v.stride = (int64_t)stride;
    v.type = type;
    return v;
}

static void start(struct world* w) {
    int i;
    memset(w, 0, sizeof *w);
    for (i = 0; i < BODIES; ++i) {
        struct body* b = &w->body[i];
        b->position[0] = (float)i;
        b->position[2] = (float)(half + 0.05);
        b->orientation[3] = 1;
        b->linear[0] = 0.5f;
        b->inverse_mass = 1;
        b->inverse_inertia[0] = b->inverse_inertia[1] = b->inverse_inertia[2] = (float)(1.5 / (half * half));
    }
}

static void add_contact(struct world* w, int body, double x, double y, double z, uint64_t key) {
    struct body* b = &w->body[body];
    struct contact* c = &w->contact[w->contacts];
    const double distance = b->position[2] + z;
    if (distance > 0.02)
        return;
    memset(c, 0, sizeof *c);
    c->a = CAIRN_WORLD;
    c->b = body;
    c->normal[2] = 1;
    c->arm_b[0] = (float)x;
    c->arm_b[1] = (float)y;
    c->arm_b[2] = (float)z;
    c->arm_a[0] = b->position[0] + (float)x;
    c->arm_a[1] = b->position[1] + (float)y;
    c->separation = (float)distance;
    c->friction = 0.5f;
    c->key = key;
    ++w->contacts;
}

/* The box's lower corners, turned with it, and the ball's lowest point. */
static void collide(struct world* w) {
    const float* q = w->body[0].orientation;
    int i;
    w->contacts = 0;
    for (i = 0; i < 4; ++i) {
        const double x = i & 1 ? half : -half, y = i & 2 ? half : -half, z = -half;
        const double tx = 2 * (q[1] * z - q[2] * y), ty = 2 * (q[2] * x - q[0] * z), tz = 2 * (q[0] * y - q[1] * x);
        add_contact(w, 0, x + q[3] * tx + q[1] * tz - q[2] * ty, y + q[3] * ty + q[2] * tx - q[0] * tz,
                    z + q[3] * tz + q[0] * ty - q[1] * tx, (uint64_t)i + 1);
    }
    add_contact(w, 1, 0, 0, -half, 5);
}

static cairn_status step(const cairn_api* api, cairn_solver* solver, struct world* w) {
    static float anchor_a[3] = {0.5f, 0, 0}, anchor_b[3] = {-0.5f, 0, 0};
    static int32_t joint_a = 0, joint_b = 1;
    static uint64_t joint_key = 99;
    uint32_t axes[6];
    float impulse[CONTACTS];
    cairn_bodies bodies;
    cairn_contacts contacts;
    cairn_joints joints;
    cairn_step input;
    cairn_results results;
    cairn_status status;
    const size_t body = sizeof(struct body), contact = sizeof(struct contact);
    uint32_t i;

    collide(w);
    memset(&bodies, 0, sizeof bodies);
    bodies.struct_size = sizeof bodies;
    bodies.count = BODIES;
    bodies.position = view(w->body[0].position, body, CAIRN_F32);
    bodies.orientation = view(w->body[0].orientation, body, CAIRN_F32);
    bodies.linear_velocity = view(w->body[0].linear, body, CAIRN_F32);
    bodies.angular_velocity = view(w->body[0].angular, body, CAIRN_F32);
    bodies.inverse_mass = view(&w->body[0].inverse_mass, body, CAIRN_F32);
    bodies.inverse_inertia = view(w->body[0].inverse_inertia, body, CAIRN_F32);

    memset(&contacts, 0, sizeof contacts);
    contacts.struct_size = sizeof contacts;
    contacts.count = w->contacts;
    contacts.body_a = view(&w->contact[0].a, contact, CAIRN_I32);
    contacts.body_b = view(&w->contact[0].b, contact, CAIRN_I32);
    contacts.normal = view(w->contact[0].normal, contact, CAIRN_F32);
    contacts.arm_a = view(w->contact[0].arm_a, contact, CAIRN_F32);
    contacts.arm_b = view(w->contact[0].arm_b, contact, CAIRN_F32);
    contacts.separation = view(&w->contact[0].separation, contact, CAIRN_F32);
    contacts.friction = view(&w->contact[0].friction, contact, CAIRN_F32);
    contacts.key = view(&w->contact[0].key, contact, CAIRN_U64);

    EXPECT(api->joint_axes(CAIRN_JOINT_BALL, axes) == CAIRN_OK);
    memset(&joints, 0, sizeof joints);
    joints.struct_size = sizeof joints;
    joints.count = 1;
    joints.body_a = view(&joint_a, 0, CAIRN_I32);
    joints.body_b = view(&joint_b, 0, CAIRN_I32);
    joints.anchor_a = view(anchor_a, 0, CAIRN_F32);
    joints.anchor_b = view(anchor_b, 0, CAIRN_F32);
    joints.axes = view(axes, 0, CAIRN_U32);
    joints.key = view(&joint_key, 0, CAIRN_U64);

    memset(&input, 0, sizeof input);
    input.struct_size = sizeof input;
    input.dt = 1.0 / 60;
    input.gravity[2] = -9.81;
    input.bodies = &bodies;
    input.contacts = &contacts;
    input.joints = &joints;

    memset(&results, 0, sizeof results);
    results.struct_size = sizeof results;
    results.position = bodies.position;
    results.orientation = bodies.orientation;
    results.linear_velocity = bodies.linear_velocity;
    results.angular_velocity = bodies.angular_velocity;
    results.contact_impulse = view(impulse, 0, CAIRN_F32);
    status = api->solver_step(solver, &input, &results);
    if (status == CAIRN_OK) {
        for (i = 0; i < w->contacts; ++i)
            EXPECT(impulse[i] >= 0);
    }
    return status;
}

static void run_method(const cairn_api* api, uint32_t method) {
    struct world w, copy;
    cairn_solver *solver = NULL, *second = NULL;
    cairn_params params;
    cairn_statistics statistics;
    void* cache;
    size_t size = 0;
    int frame;

    memset(&params, 0, sizeof params);
    params.struct_size = sizeof params;
    EXPECT(api->params_preset(method, CAIRN_PRESET_DEFAULT, &params) == CAIRN_OK);
    EXPECT(params.method == method);
    if (!EXPECT(api->solver_create(NULL, &solver) == CAIRN_OK))
        return;
    if (!EXPECT(api->solver_create(NULL, &second) == CAIRN_OK)) {
        api->solver_destroy(solver);
        return;
    }
    EXPECT(api->solver_set_params(solver, &params) == CAIRN_OK);
    EXPECT(api->solver_set_params(second, &params) == CAIRN_OK);

    start(&w);
    for (frame = 0; frame < 120; ++frame) {
        if (!EXPECT(step(api, solver, &w) == CAIRN_OK)) {
            fprintf(stderr, "  %s, frame %d: %s\n", api->method_name(method), frame, api->last_error());
            break;
        }
    }
    /* both have come to rest on the ground, a metre apart */
    EXPECT(fabs(w.body[0].position[2] - half) < 5e-3);
    EXPECT(fabs(w.body[1].position[2] - half) < 5e-3);
    EXPECT(fabs(w.body[1].position[0] - w.body[0].position[0] - 1) < 5e-3);
    EXPECT(fabs(w.body[0].linear[0]) < 1e-2 && fabs(w.body[0].linear[2]) < 1e-2);

    memset(&statistics, 0, sizeof statistics);
    statistics.struct_size = sizeof statistics;
    EXPECT(api->solver_get_statistics(solver, &statistics) == CAIRN_OK);
    EXPECT(statistics.bodies == BODIES && statistics.contacts == CONTACTS && statistics.joints == 1 && statistics.islands == 1);

    /* a run restarted from a saved cache goes on with the same bits */
    EXPECT(api->solver_save_cache(solver, NULL, 0, &size) == CAIRN_OK);
    cache = malloc(size + 1);
    if (EXPECT(cache != NULL)) {
        EXPECT(api->solver_save_cache(solver, cache, size, &size) == CAIRN_OK);
        EXPECT(api->solver_load_cache(second, cache, size) == CAIRN_OK);
        free(cache);
    }
    w.body[0].linear[1] = w.body[1].linear[2] = 0.5f; /* something to do */
    copy = w;
    for (frame = 0; frame < 10; ++frame)
        EXPECT(step(api, solver, &w) == CAIRN_OK && step(api, second, &copy) == CAIRN_OK);
    EXPECT(memcmp(w.body, copy.body, sizeof w.body) == 0);

    /* a refused input changes nothing */
    w.body[1].inverse_mass = -1;
    copy = w;
    EXPECT(step(api, solver, &w) == CAIRN_ERROR_INVALID_DATA);
    EXPECT(strstr(api->last_error(), "inverse_mass") != NULL && strstr(api->last_error(), "-1") != NULL);
    EXPECT(memcmp(w.body, copy.body, sizeof w.body) == 0);

    api->solver_destroy(second);
    api->solver_destroy(solver);
}

int main(void) {
    const cairn_api* api = cairn_get_api(CAIRN_ABI_VERSION);
    cairn_info info;
    uint32_t method;

    if (!EXPECT(api != NULL))
        return EXIT_FAILURE;
    EXPECT(cairn_get_api(CAIRN_ABI_VERSION + 1) == NULL);
    EXPECT(api->struct_size >= sizeof(cairn_api));
    EXPECT(api->abi_version == CAIRN_ABI_VERSION);
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    EXPECT(api->get_info(&info) == CAIRN_OK);
    EXPECT(info.abi_version == CAIRN_ABI_VERSION && info.build != NULL && info.cuda != NULL);
    EXPECT(api->status_name(CAIRN_ERROR_INVALID_DATA) != NULL && api->status_name(12345) == NULL);
    EXPECT(api->method_name(CAIRN_METHOD_COUNT) == NULL);
    api->solver_destroy(NULL);
    for (method = 0; method < CAIRN_METHOD_COUNT; ++method)
        run_method(api, method);
    if (failures == 0)
        printf("cairn %u.%u.%u: all is well (%s)\n", info.version[0], info.version[1], info.version[2], info.build);
    return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
