"""`jeep-bridge`, the paper's first complex scene: a car with driven wheels crosses a bridge of planks."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from .model import FIXED, HINGE, Array, Body, Box, Capsule, Joint, Quat, Scene, Vec3

PLANK: Vec3 = (1.621, 0.142, 0.436)  # m, half sizes
JEEP: Vec3 = (1.011, 0.793, 2.413)
JEEP_MASS = 1548.0  # kg, without wheels
WHEEL_RADIUS = 0.447  # m
_SHELL = (
    0.1  # of the jeep's mass is in its body, the rest in the chassis 1 m / (1 - _SHELL) below: 1 m for both together
)
_ACROSS: Quat = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))  # a capsule's axis along x


def _progress(positions: Array, _: Array, *, body: int, start: float) -> float:
    return float(positions[body, 2]) - start


def _shakes(positions: Array, _: Array, *, planks: int) -> float:
    return float(np.abs(positions[:planks, 1]).max())


def jeep_bridge(
    planks: int = 43, spacing: float = 0.911, speed: float = 30.0, torque: float = 500.0, hinged: float = 0.0
) -> Scene:
    """A jeep drives over a bridge of planks on fixed joints: do the joints hold, does it arrive, do the planks shake?

    planks every `spacing` (m) along z, 80 kg each, level at the start, joined to each other by fixed joints (hinged =
    0) or by hinges (any other), and to abutments that cannot move by hinges. The wheels turn at `speed` (rad/s), each
    driven by at most `torque` (N m).
    The jeep's body and a chassis, fixed to it and colliding with nothing, have their common centre of mass 1 m below
    the body's centre. `progress_m` is how far the jeep has come: it arrives at (planks spacing + 4) m.
    `planks_shake_m` is the largest distance of a plank's centre from level. A row of hinges that starts level has no
    rigid answer under a load: what is seen there is how soft the joints are.
    """
    why = "A jeep with driven wheels crosses a bridge of 43 planks: do the joints hold, and does it arrive?"
    length = planks * spacing
    bodies = [
        Body(Box(PLANK), 80.0, (0.0, 0.0, (i + 0.5) * spacing), name=f"plank {i}", collision_group=1)
        for i in range(planks)
    ]
    joints = [
        Joint(HINGE if hinged else FIXED, i, i - 1, (0.0, 0.0, i * spacing), (1.0, 0.0, 0.0)) for i in range(1, planks)
    ]
    for name, first, last, plank in (("near", -20.0, 0.0, 0), ("far", length, length + 80.0, planks - 1)):
        half = (3.0, 0.5, (last - first) / 2)
        place = (0.0, PLANK[1] - half[1], (first + last) / 2)
        joints.append(Joint(HINGE, plank, len(bodies), (0.0, 0.0, last if name == "near" else first), (1.0, 0.0, 0.0)))
        bodies.append(Body(Box(half), 0.0, place, name=f"{name} abutment", collision_group=1))

    start = -4.0
    axle = PLANK[1] + WHEEL_RADIUS
    middle = axle + JEEP[1]
    body, chassis = len(bodies), len(bodies) + 1
    bodies.append(Body(Box(JEEP), _SHELL * JEEP_MASS, (0.0, middle, start), name="jeep", collision_group=2))
    low = (0.0, middle - 1.0 / (1.0 - _SHELL), start)
    bodies.append(Body(Box((0.6, 0.1, 1.8)), (1.0 - _SHELL) * JEEP_MASS, low, name="chassis", collision_group=-1))
    joints.append(Joint(FIXED, body, chassis, low))
    for z, end in ((start + 3.147 / 2, "front"), (start - 3.147 / 2, "rear")):
        for x, side in ((-0.812, "left"), (0.812, "right")):
            centre = (x, axle, z)
            joints.append(Joint(HINGE, chassis, len(bodies), centre, (1.0, 0.0, 0.0), speed, torque))
            wheel = Capsule(WHEEL_RADIUS, 0.1)
            bodies.append(Body(wheel, 56.0, centre, _ACROSS, name=f"wheel {end} {side}", collision_group=2))
    spare = (0.0, middle, start - JEEP[2] - 0.15)
    joints.append(Joint(FIXED, body, len(bodies), spare))
    bodies.append(Body(Capsule(0.3, 0.05), 24.0, spare, _ACROSS, name="spare wheel", collision_group=2))

    settings = {"planks": planks, "spacing": spacing, "speed": speed, "torque": torque, "hinged": hinged}
    quantities = {
        "progress_m": partial(_progress, body=body, start=start),
        "planks_shake_m": partial(_shakes, planks=planks),
    }
    return Scene(
        "jeep-bridge", why, "max_joint_error_m", bodies, joints, settings=settings, quantities=quantities, frames=600,
        fastest=abs(speed) * WHEEL_RADIUS,
    )  # fmt: skip
