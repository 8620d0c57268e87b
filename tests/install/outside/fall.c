/* A body falls freely for a second; its height is the textbook's. Returns 0 if so. */
#include <cairn/cairn.h>
#include <stdio.h>

static cairn_view view(double* values) {
    cairn_view v = {0};
    v.data = values;
    v.type = CAIRN_F64;
    return v;
}

int main(void) {
    double position[3] = {0, 100, 0}, orientation[4] = {0, 0, 0, 1}, linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0};
    double inverse_mass[1] = {1}, inverse_inertia[3] = {1, 1, 1};
    const double g = 9.81;
    const int steps = 100;
    double expected, error;
    int i;
    cairn_solver* solver = NULL;
    cairn_bodies bodies = {sizeof bodies};
    cairn_step step = {sizeof step};
    cairn_results results = {sizeof results};

    bodies.count = 1;
    bodies.position = results.position = view(position);
    bodies.orientation = results.orientation = view(orientation);
    bodies.linear_velocity = results.linear_velocity = view(linear);
    bodies.angular_velocity = results.angular_velocity = view(angular);
    bodies.inverse_mass = view(inverse_mass);
    bodies.inverse_inertia = view(inverse_inertia);
    step.dt = 1.0 / steps;
    step.gravity[1] = -g;
    step.bodies = &bodies;

    if (cairn_solver_create(NULL, &solver) != CAIRN_OK) {
        fprintf(stderr, "%s\n", cairn_last_error());
        return 1;
    }
    for (i = 0; i < steps; ++i) {
        if (cairn_solver_step(solver, &step, &results) != CAIRN_OK) {
            fprintf(stderr, "%s\n", cairn_last_error());
            return 1;
        }
    }
    cairn_solver_destroy(solver);

    /* Symplectic Euler lags by at most half a step's travel: g dt / 2 after a second. */
    expected = 100 - g / 2;
    error = position[1] - expected;
    printf("height %g m, textbook %g m\n", position[1], expected);
    return error < 0.001 && error > -g / steps ? 0 : 1;
}
