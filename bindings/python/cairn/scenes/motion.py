"""What must move as a formula says: sliding, bouncing, tumbling."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from .model import Array, Body, Box, Plane, Scene, Sphere


def _creep(positions: Array, _: Array, *, start: Array, stick: Array) -> float:
    return float(np.linalg.norm(positions[stick] - start[stick], axis=1).max(initial=0.0))


def slope(slabs: int = 11, degrees: float = 30.0) -> Scene:
    """Slabs with friction 0 to 1, evenly, on a slope of that many degrees: above its tangent they must stick.

    `creep_m` is how far the farthest of those has moved.
    """
    if slabs < 2 or not 0 < degrees < 90:
        raise ValueError(f"slope: slabs = {slabs} must be at least 2, and degrees = {degrees} between 0 and 90")
    why = "Slabs with friction from 0 to 1 on a slope of 30 degrees: do those creep that should stick?"
    angle = math.radians(degrees)
    half = (0.5, 0.1, 0.4)
    normal = (math.sin(angle), math.cos(angle), 0.0)
    turn = (0.0, 0.0, -math.sin(angle / 2), math.cos(angle / 2))
    bodies = [Body(Plane(normal, 0.0), 0.0, friction=1.0, name="slope")]
    for i in range(slabs):
        centre = (half[1] * normal[0], half[1] * normal[1], 1.2 * i)
        bodies.append(Body(Box(half), 1.0, centre, turn, friction=i / (slabs - 1), name=f"slab {i}"))
    start = np.array([body.position for body in bodies])
    stick = np.array([body.mass > 0 and body.friction > 1.02 * math.tan(angle) for body in bodies])
    quantities = {"creep_m": partial(_creep, start=start, stick=stick)}
    settings = {"slabs": slabs, "degrees": degrees}
    return Scene("slope", why, "creep_m", bodies, settings=settings, frames=300, quantities=quantities)


def bounce(balls: int = 7, radius: float = 0.5, height: float = 2.0, restitution: float = 1.0) -> Scene:
    """balls x balls balls of `radius` (m) and 1 kg, dropped `height` (m) above the floor: none touches another.

    With restitution 1 the energy must stay.
    """
    why = "49 balls bounce without loss: does the energy stay what it was?"
    bodies = [Body(Plane(), 0.0, restitution=1.0, friction=0.0, name="floor")]
    for i in range(balls):
        for j in range(balls):
            centre = (3 * radius * i, radius + height, 3 * radius * j)
            ball = Body(Sphere(radius), 1.0, centre, restitution=restitution, friction=0.0, name=f"ball {i} {j}")
            bodies.append(ball)
    settings = {"balls": balls, "radius": radius, "height": height, "restitution": restitution}
    return Scene("bounce", why, "energy_change_J", bodies, settings=settings)


def spheres_666(edge: int = 6, radius: float = 0.5, mass: float = 10.0, gap: float = 0.05, drop: float = 0.05) -> Scene:
    """edge^3 spheres without friction or bounce fall on each other from a lattice a little askew; radius, gap in m.

    The lowest fall `drop` (m). `squared_depths_m2` is the sum of the squares of all depths, as in SimBenchmark's "666".
    """
    why = "216 spheres without friction or bounce drop on each other: how deep do they press into one another?"
    bodies = [Body(Plane(), 0.0, friction=0.0, name="floor")]
    pitch = 2 * radius + gap
    for layer in range(edge):
        for i in range(edge):
            for j in range(edge):
                skew = 0.02 * radius * ((layer + 2 * i + 3 * j) % 5 - 2)
                centre = (i * pitch + skew, radius + drop + layer * pitch, j * pitch - skew)
                bodies.append(Body(Sphere(radius), mass, centre, friction=0.0, name=f"sphere {layer} {i} {j}"))
    settings = {"edge": edge, "radius": radius, "mass": mass, "gap": gap, "drop": drop}
    quantities = {"squared_depths_m2": partial(_squared_depths, radius=radius)}
    return Scene("666", why, "max_penetration_m", bodies, settings=settings, frames=600, quantities=quantities)


ROLLING_BALLS, ROLLING_BALL, ROLLING_BOX = 25, 1.0, 10.0  # SimBenchmark's: balls, kg of a ball, kg of the box
ROLLING_GRAVITY = 9.8  # m/s^2, as there


def rolling_accelerations(force: float, on_floor: float) -> tuple[float, float]:
    """m/s^2 of the box and of each ball, which roll on it: the analytic answer of `rolling`.

    force (N) pushes the box, whose friction with the floor is `on_floor`; it must exceed that. A ball's contact force f
    speeds it up by f / m and its surface by 7/2 f / m, which is the box's acceleration.
    """
    n, m, box = ROLLING_BALLS, ROLLING_BALL, ROLLING_BOX
    slides = force - on_floor * (box + n * m) * ROLLING_GRAVITY
    contact = slides / box / (3.5 / m + n / box)
    return 3.5 * contact / m, contact / m


def _rolling_error(time: float, velocities: Array, *, box: Array, ball: Array) -> float:
    errors = velocities[1, :3] - time * box, velocities[2, :3] - time * ball
    return float(np.sqrt(sum(e @ e for e in errors)))


def rolling(force: float = 150.0, degrees: float = 60.0, on_floor: float = 0.4, on_box: float = 0.8) -> Scene:
    """SimBenchmark's rolling: a plate of 10 kg with 25 balls of 1 kg on it is pushed along the floor.

    force (N) pushes the plate at `degrees` from x towards -z; on_floor and on_box are the coefficients of friction
    below and above it. It slides while the balls roll without slipping. `velocity_error_m_s` is how far the velocities
    of the plate and of the first ball are from the analytic ones: the root of the sum of both squares.
    """
    accelerations = rolling_accelerations(force, on_floor)
    if accelerations[0] <= 0:
        raise ValueError(f"rolling: force = {force} N does not move the plate against a friction of {on_floor}")
    why = "A plate under 25 balls is pushed across the axes: are its speed and the balls' what the formula says?"
    angle = math.radians(degrees)
    way = np.array([math.cos(angle), 0.0, -math.sin(angle)])
    push = (force * math.cos(angle), 0.0, -force * math.sin(angle))
    deep = 1e-5  # m, each contact's overlap at the start, and a floor that is a box: all points from the first step on
    place = (0.0, 0.5 - deep, 0.0)
    plate = Body(Box((10.0, 0.5, 10.0)), ROLLING_BOX, place, friction=1.0, name="plate", force=push)
    floor = Body(Box((25.0, 5.0, 25.0)), 0.0, (0.0, -5.0, 0.0), friction=on_floor, name="floor")
    bodies = [floor, plate]
    for i in range(5):
        for j in range(5):
            place = (2.0 * i - 4.0, 1.5 - 2 * deep, 2.0 * j - 4.0)
            bodies.append(Body(Sphere(0.5), ROLLING_BALL, place, friction=on_box, name=f"ball {i} {j}"))
    settings = {"force": force, "degrees": degrees, "on_floor": on_floor, "on_box": on_box}
    motions = {"velocity_error_m_s": partial(_rolling_error, box=accelerations[0] * way, ball=accelerations[1] * way)}
    gravity = (0.0, -ROLLING_GRAVITY, 0.0)
    return Scene(
        "rolling", why, "velocity_error_m_s", bodies, gravity=gravity, frames=250, settings=settings, motions=motions,
        tolerance=(0.03, 0.3),
    )  # fmt: skip


def _squared_depths(positions: Array, _: Array, *, radius: float) -> float:
    """m^2, the sum over all pairs of balls, and of balls and the floor, of their depth squared; the floor is body 0."""
    balls = positions[1:]
    apart = np.linalg.norm(balls[:, None] - balls[None], axis=2)[np.triu_indices(len(balls), 1)]
    depths = np.concatenate([np.maximum(2 * radius - apart, 0), np.maximum(radius - balls[:, 1], 0)])
    return float(depths @ depths)


def tumble(speed: float = 5.0, wobble: float = 0.01) -> Scene:
    """A box with three different moments spins about the middle axis at `speed` (rad/s), `wobble` (rad/s) on another.

    No gravity: energy and angular momentum must stay while it flips over and over.
    """
    why = "A box flips about its middle axis in free flight: do energy and angular momentum stay?"
    box = Box((0.5, 0.15, 0.3))  # moments in order of the axes: least, greatest, middle
    body = Body(box, 1.0, angular_velocity=(wobble, 0.0, speed), name="box")
    settings = {"speed": speed, "wobble": wobble}
    return Scene("tumble", why, "energy_change_J", [body], gravity=(0.0, 0.0, 0.0), settings=settings)
