// Whatever the host's checks refuse, the device's do, in the same words.
#include "device_world.h"

cairn_status step_world(cairn_solver* solver, SmallWorld& world) {
    static int calls = 0;
    DeviceWorld on_device(world, static_cast<Where>(calls++ % 3));
    const cairn_status status = cairn_solver_step(solver, &on_device.step, &on_device.results);
    on_device.fetch();
    return status;
}
