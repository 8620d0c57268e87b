"""What is built of many pieces and must stand: a house of cards, an arch, a tower of blocks."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from .model import Array, Body, Box, Plane, Quat, Scene, Wedge


def _sinks(positions: Array, _: Array, *, body: int, start: float) -> float:
    return start - float(positions[body, 1])


def _moves(positions: Array, _: Array, *, body: int, start: Array) -> float:
    return float(np.linalg.norm(positions[body] - start))


def card_house(
    levels: int = 5,
    length: float = 0.1,
    width: float = 0.06,
    thickness: float = 0.002,
    mass: float = 0.01,
    friction: float = 0.7,
    degrees: float = 20.0,
) -> Scene:
    """Tents of two cards each, a card across from tent to tent: how long does the house stand?

    The lowest level has as many tents as there are levels, each higher one a tent less. Cards are `length` x `width` x
    `thickness` (m) and of `mass` (kg); those of a tent lean `degrees` off the vertical and touch along their upper
    edges. All that touch overlap by 0.1 mm: Bullet finds no contact of two boxes that merely touch with their edges,
    and a card falls further than it is thick in a step of 16 ms. friction is the coefficient at a contact.
    `top_sinks_m` is how far the highest card has come down; it has collapsed when that is half a card.
    """
    angle = math.radians(degrees)
    if not 0 < 2 * length * math.sin(angle) < length:
        raise ValueError(
            f"card-house: degrees = {degrees} must be above 0, and below 30 for tents to stand side by side"
        )
    why = "Cards 2 mm thick lean on each other, five levels high: how long does the house stand?"
    surface = math.sqrt(friction)
    bite = 1e-4  # m, the overlap at the start
    shape = Box((thickness / 2, length / 2, width / 2))
    along, across = length * math.cos(angle), thickness * math.sin(angle)
    height = along + across  # of a tent
    reach = (length * math.sin(angle) + thickness * math.cos(angle) - bite) / 2  # from a tent's middle to a card's
    bodies = [Body(Plane(), 0.0, friction=surface, name="floor")]
    base = -bite
    for level in range(levels):
        tents = levels - level
        middles = [(i - (tents - 1) / 2) * length for i in range(tents)]
        for i, x in enumerate(middles):
            for side, name in ((-1, "left"), (1, "right")):
                turn: Quat = (0.0, 0.0, side * math.sin(angle / 2), math.cos(angle / 2))
                centre = (x + side * reach, base + height / 2, 0.0)
                bodies.append(Body(shape, mass, centre, turn, friction=surface, name=f"card {level} {i} {name}"))
        base += height - bite
        level_turn: Quat = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
        for i, (left, right) in enumerate(zip(middles, middles[1:])):
            centre = ((left + right) / 2, base + thickness / 2, 0.0)
            bodies.append(Body(shape, mass, centre, level_turn, friction=surface, name=f"card {level} {i} across"))
        base += thickness - bite
    settings = {
        "levels": levels,
        "length": length,
        "width": width,
        "thickness": thickness,
        "mass": mass,
        "friction": friction,
        "degrees": degrees,
    }
    top = len(bodies) - 1
    quantities = {"top_sinks_m": partial(_sinks, body=top, start=bodies[top].position[1])}
    tolerance = (0.05 * length, 0.5 * length)
    return Scene(
        "card-house", why, "top_sinks_m", bodies, settings=settings, quantities=quantities, tolerance=tolerance
    )


def arch(
    stones: int = 17,
    boxes: int = 4,
    radius: float = 2.0,
    thickness: float = 0.6,
    depth: float = 0.6,
    density: float = 1000.0,
    friction: float = 0.6,
) -> Scene:
    """A half circle of wedge stones with boxes on its key stone: does the key stone stay where it is?

    radius is from the centre to the inner faces, thickness to the outer ones, depth along the arch's axis (m); density
    in kg/m^3; friction is the coefficient at a contact. stones is odd, so that there is a key stone.
    `key_stone_moves_m` is how far that one is from its start.
    """
    if stones < 3 or stones % 2 == 0:
        raise ValueError(f"arch: stones = {stones} must be odd and at least 3, so that there is a key stone")
    why = "Seventeen wedge stones make an arch and carry four boxes: how far does the key stone move?"
    surface = math.sqrt(friction)
    slope = math.tan(math.pi / (2 * stones))  # neighbours share a radial plane
    shape = Wedge(radius * slope, (radius + thickness) * slope, thickness, depth / 2)
    mass = density * (shape.half_bottom + shape.half_top) * thickness * depth
    bodies = [Body(Plane(), 0.0, friction=surface, name="floor")]
    middle = radius + shape.centre_height
    for i in range(stones):
        angle = math.pi * (i + 0.5) / stones
        turn = (angle - math.pi / 2) / 2
        centre = (middle * math.cos(angle), middle * math.sin(angle), 0.0)
        orientation: Quat = (0.0, 0.0, math.sin(turn), math.cos(turn))
        bodies.append(Body(shape, mass, centre, orientation, friction=surface, name=f"stone {i}"))
    key = 1 + stones // 2
    half = (0.5 * thickness, 0.25 * thickness, depth / 2)
    for i in range(boxes):
        centre = (0.0, radius + thickness + (2 * i + 1) * half[1], 0.0)
        weight = density * 8 * half[0] * half[1] * half[2]
        bodies.append(Body(Box(half), weight, centre, friction=surface, name=f"box {i}"))
    settings = {
        "stones": stones,
        "boxes": boxes,
        "radius": radius,
        "thickness": thickness,
        "depth": depth,
        "density": density,
        "friction": friction,
    }
    quantities = {"key_stone_moves_m": partial(_moves, body=key, start=np.array(bodies[key].position))}
    tolerance = (0.05 * thickness, 0.5 * thickness)
    return Scene(
        "arch", why, "key_stone_moves_m", bodies, settings=settings, quantities=quantities, tolerance=tolerance
    )


def kapla(floors: int = 6, bases: int = 8, mass: float = 10.0, friction: float = 0.25) -> Scene:
    """The tower of SimBenchmark: at which step does it collapse?

    Blocks 0.1 m high, 0.05 m thick and of `mass` (kg) stand on edge. A floor has `bases` blocks of 0.25 m across it, in
    a row, and near their ends two walls of 0.2 m blocks along it: (2 bases + 1) blocks. friction is the coefficient at
    a contact. It has collapsed, as there, when the last block of the top wall is 0.15 m lower than it was:
    `top_sinks_m`. Its steps are 10 ms and 60 000.
    """
    if bases < 4 or bases % 2:
        raise ValueError(f"kapla: bases = {bases} must be even and at least 4")
    why = "A tower of 102 blocks stands for ten minutes: at which step does it collapse?"
    surface = math.sqrt(friction)
    long, high, thick = 0.2, 0.1, 0.05
    base, wall = Box((thick / 2, high / 2, 0.125)), Box((long / 2, high / 2, thick / 2))
    bodies = [Body(Plane(), 0.0, friction=surface, name="floor")]
    walls = bases // 2
    # Along x a wall's block lies on two bases; on one side they begin at even bases, on the other at odd ones, with a
    # block at each end. `last` is the one whose fall counts.
    right = [2 * j * long + long / 2 for j in range(walls)]
    left = [(2 * j + 1) * long + long / 2 for j in range(walls - 1)]
    left += [long / 2, 2 * (walls - 1) * long + long / 2]
    centre = (bases - 1) * long / 2
    for floor in range(floors):
        y = 2 * floor * high + high / 2
        for j in range(bases):
            place = (j * long - centre, y, 0.0)
            bodies.append(Body(base, mass, place, friction=surface, name=f"base {floor} {j}"))
        for side, places in ((1, right), (-1, left)):
            for j, x in enumerate(places):
                place = (x - centre, y + high, side * long / 2)
                name = f"wall {floor} {'right' if side > 0 else 'left'} {j}"
                bodies.append(Body(wall, mass, place, friction=surface, name=name))
    settings = {"floors": floors, "bases": bases, "mass": mass, "friction": friction}
    last = len(bodies) - 1
    quantities = {"top_sinks_m": partial(_sinks, body=last, start=bodies[last].position[1])}
    return Scene(
        "kapla", why, "top_sinks_m", bodies, dt=0.01, frames=60_000, settings=settings, quantities=quantities,
        tolerance=(0.05 * high, 0.15),
    )  # fmt: skip
