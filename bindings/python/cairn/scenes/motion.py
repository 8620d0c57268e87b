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


def spheres_666(edge: int = 6, radius: float = 0.5, mass: float = 10.0, gap: float = 0.05) -> Scene:
    """edge^3 spheres without friction or bounce fall on each other from a lattice a little askew; radius, gap in m."""
    why = "216 spheres without friction or bounce drop on each other: how deep do they press into one another?"
    bodies = [Body(Plane(), 0.0, friction=0.0, name="floor")]
    pitch = 2 * radius + gap
    for layer in range(edge):
        for i in range(edge):
            for j in range(edge):
                skew = 0.02 * radius * ((layer + 2 * i + 3 * j) % 5 - 2)
                centre = (i * pitch + skew, radius + gap + layer * pitch, j * pitch - skew)
                bodies.append(Body(Sphere(radius), mass, centre, friction=0.0, name=f"sphere {layer} {i} {j}"))
    settings = {"edge": edge, "radius": radius, "mass": mass, "gap": gap}
    return Scene("666", why, "max_penetration_m", bodies, settings=settings, frames=600)


def tumble(speed: float = 5.0, wobble: float = 0.01) -> Scene:
    """A box with three different moments spins about the middle axis at `speed` (rad/s), `wobble` (rad/s) on another.

    No gravity: energy and angular momentum must stay while it flips over and over.
    """
    why = "A box flips about its middle axis in free flight: do energy and angular momentum stay?"
    box = Box((0.5, 0.15, 0.3))  # moments in order of the axes: least, greatest, middle
    body = Body(box, 1.0, angular_velocity=(wobble, 0.0, speed), name="box")
    settings = {"speed": speed, "wobble": wobble}
    return Scene("tumble", why, "energy_change_J", [body], gravity=(0.0, 0.0, 0.0), settings=settings)
