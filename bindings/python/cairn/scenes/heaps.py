"""Boxes and balls on a floor, where weight makes solvers fail: high, pointed, heavy on light, many on one, many."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from .model import Array, Body, Box, Capsule, Plane, Scene, Shape, Sphere, Vec3


def _floor(friction: float) -> Body:
    return Body(Plane(), 0.0, friction=math.sqrt(friction), name="floor")


def column(boxes: int = 20, half_extent: float = 0.5, mass: float = 1.0, friction: float = 0.5) -> Scene:
    """One box on another: how high before the column tilts or sags?

    boxes of `half_extent` (m) and `mass` (kg); friction is the coefficient at a contact.
    """
    why = "One box on another, twenty high: does the error of a tall, narrow stack tilt it until it falls?"
    surface, side = math.sqrt(friction), 2 * half_extent
    shape = Box((half_extent, half_extent, half_extent))
    bodies = [_floor(friction)]
    bodies += [
        Body(shape, mass, (0.0, half_extent + i * side, 0.0), friction=surface, name=f"box {i}") for i in range(boxes)
    ]
    settings = {"boxes": boxes, "half_extent": half_extent, "mass": mass, "friction": friction}
    return Scene("column", why, "max_drift_m", bodies, rests=True, settings=settings)


def pyramid(base: int = 20, half_extent: float = 0.5, mass: float = 1.0, friction: float = 0.5) -> Scene:
    """A wall that narrows to one box, `base` boxes in the lowest row: base (base + 1) / 2 in all; sizes as `column`."""
    why = "A wall of boxes that narrows to one, each on two: does it creep apart under its own weight?"
    surface, side = math.sqrt(friction), 2 * half_extent
    shape = Box((half_extent, half_extent, half_extent))
    bodies = [_floor(friction)]
    for row in range(base):
        for i in range(base - row):
            centre = ((i - (base - row - 1) / 2) * side, half_extent + row * side, 0.0)
            bodies.append(Body(shape, mass, centre, friction=surface, name=f"box {row} {i}"))
    settings = {"base": base, "half_extent": half_extent, "mass": mass, "friction": friction}
    return Scene("pyramid", why, "max_drift_m", bodies, rests=True, settings=settings)


def mass_ratio(ratio: float = 100.0, half_extent: float = 0.5, mass: float = 1.0) -> Scene:
    """A box `ratio` times heavier on a light one of `mass` (kg), both cubes of `half_extent` (m).

    It fails silently: what is seen is finite and still, but sunk. `sinking_m` is how far the heavy box is too low.
    """
    why = "A box a hundred times heavier on a light one: how far does it sink while all stands still?"
    shape = Box((half_extent, half_extent, half_extent))
    light = Body(shape, mass, (0.0, half_extent, 0.0), name="light")
    heavy = Body(shape, ratio * mass, (0.0, 3 * half_extent, 0.0), name="heavy")

    def sinking(positions: Array, _: Array) -> float:
        return 3 * half_extent - float(positions[2, 1])

    settings = {"ratio": ratio, "half_extent": half_extent, "mass": mass}
    quantities = {"sinking_m": sinking}
    return Scene("mass-ratio", why, "sinking_m", [_floor(0.5), light, heavy], settings=settings, quantities=quantities)


def inverted(cubes: int = 5, half_extent: float = 0.1, density: float = 1000.0, growth: float = 2.0) -> Scene:
    """Cubes, each `growth` times the size of the one below it: the lowest has `half_extent` (m). density in kg/m^3."""
    why = "Five cubes, each twice the size of the one below, 32 000 to 1 in weight: does the least one carry the rest?"
    bodies = [_floor(0.5)]
    top = 0.0
    for i in range(cubes):
        half = half_extent * growth**i
        shape = Box((half, half, half))
        bodies.append(Body(shape, density * (2 * half) ** 3, (0.0, top + half, 0.0), name=f"cube {i}"))
        top += 2 * half
    settings = {"cubes": cubes, "half_extent": half_extent, "density": density, "growth": growth}
    return Scene("inverted", why, "max_penetration_m", bodies, rests=True, settings=settings)


def hub(balls: int = 24, radius: float = 0.1, mass: float = 1.0, plate_mass: float = 100.0) -> Scene:
    """A plate on balls x balls balls of `radius` (m) and `mass` (kg): one body with as many contacts."""
    why = "A plate on 576 balls: does one body with so many contacts slow the sweeps down?"
    spacing = 2.5 * radius
    bodies = [_floor(0.5)]
    for i in range(balls):
        for j in range(balls):
            centre = ((i - (balls - 1) / 2) * spacing, radius, (j - (balls - 1) / 2) * spacing)
            bodies.append(Body(Sphere(radius), mass, centre, name=f"ball {i} {j}"))
    half = balls * spacing / 2
    bodies.append(Body(Box((half, radius, half)), plate_mass, (0.0, 3 * radius, 0.0), name="plate"))
    settings = {"balls": balls, "radius": radius, "mass": mass, "plate_mass": plate_mass}
    return Scene("hub", why, "max_penetration_m", bodies, settings=settings)


def _jump(positions: Array, _: Array, *, start: Array, boxes: slice) -> float:
    return max(0.0, float((positions[boxes, 1] - start[boxes, 1]).max()))


def warm_removal(
    side: int = 4, layers: int = 4, ratio: float = 100.0, half_extent: float = 0.5, leaves: int = 120
) -> Scene:
    """A block of side x layers x side boxes under a plate `ratio` times heavier than a box, taken away at a frame.

    Boxes of `half_extent` (m) and 1 kg. After frame `leaves` the plate is no longer there, but what the contacts below
    carried is still what the next solve starts from: `jump_m` is how far a box's centre then rises above its start.
    """
    why = "A plate a hundred times heavier than a box leaves the pile below it: do the boxes jump?"
    bodies = [_floor(0.5)]
    shape = Box((half_extent, half_extent, half_extent))
    for layer in range(layers):
        for row in range(side):
            for column in range(side):
                x, z = ((i - (side - 1) / 2) * 2 * half_extent for i in (column, row))
                place = (x, (2 * layer + 1) * half_extent, z)
                bodies.append(Body(shape, 1.0, place, name=f"box {column} {layer} {row}"))
    half = (side * half_extent, half_extent / 2, side * half_extent)
    height = 2 * layers * half_extent + half[1]
    bodies.append(Body(Box(half), ratio, (0.0, height, 0.0), name="plate", removed_at=leaves))
    settings = {"side": side, "layers": layers, "ratio": ratio, "half_extent": half_extent, "leaves": leaves}
    start = np.array([body.position for body in bodies])
    quantities = {"jump_m": partial(_jump, start=start, boxes=slice(1, len(bodies) - 1))}
    return Scene(
        "warm-removal", why, "jump_m", bodies, frames=300, settings=settings, quantities=quantities,
        tolerance=(0.1 * half_extent, half_extent),
    )  # fmt: skip


def pile(bodies: int = 1000, size: float = 0.25, mass: float = 1.0, friction: float = 0.5, seed: int = 1) -> Scene:
    """Boxes, spheres and capsules, in turn, dropped into a square well: half size or radius `size` (m), `mass` (kg).

    They start on a lattice above the floor, each moved and turned a little as `seed` has it.
    """
    why = "A thousand boxes, balls and capsules fall into a well: do they come to rest, and at what cost?"
    random = np.random.default_rng(seed)
    across = max(2, round((bodies / 2) ** (1 / 3)))
    spacing = 3.6 * size
    half = across * spacing / 2
    surface = math.sqrt(friction)
    walls: list[tuple[str, Vec3]] = [
        ("left", (1.0, 0.0, 0.0)),
        ("right", (-1.0, 0.0, 0.0)),
        ("back", (0.0, 0.0, 1.0)),
        ("front", (0.0, 0.0, -1.0)),
    ]
    made = [_floor(friction)]
    made += [Body(Plane(normal, -half), 0.0, friction=surface, name=name) for name, normal in walls]
    shapes: list[Shape] = [Box((size, size, size)), Sphere(size), Capsule(0.6 * size, 0.6 * size)]
    for i in range(bodies):
        cell = (i % across, i // across**2, i // across % across)
        x, y, z = ((c + 0.5) * spacing for c in cell)
        jitter = random.uniform(-0.1, 0.1, 3) * size
        turn = random.normal(size=4)
        turn /= np.linalg.norm(turn)
        centre = (float(x - half + jitter[0]), float(y + jitter[1]), float(z - half + jitter[2]))
        orientation = (float(turn[0]), float(turn[1]), float(turn[2]), float(turn[3]))
        made.append(Body(shapes[i % 3], mass, centre, orientation, friction=surface, name=f"body {i}"))
    settings = {"bodies": bodies, "size": size, "mass": mass, "friction": friction, "seed": seed}
    return Scene("pile", why, "max_penetration_m", made, settings=settings, frames=1000)
