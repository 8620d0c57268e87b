#include "small_world.h"

cairn_status step_world(cairn_solver* solver, SmallWorld& world) { return cairn_solver_step(solver, &world.step, &world.results); }
