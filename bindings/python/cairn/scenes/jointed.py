"""Many joints at once: long, heavy, wide, stiff."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from .chain import _hanging
from .model import BALL, DT, FIXED, HINGE, Array, Body, Box, Joint, Plane, Scene, Sphere, Vec3


def heavy_pendulum(
    links: int = 50, spacing: float = 1.0, mass: float = 1.0, mass_ratio: float = 10000.0, radius: float = 2.0
) -> Scene:
    """`chain-1m` with a ball `mass_ratio` times a link's mass, 1 to 50 000."""
    why = "The chain under a ball ten thousand times a link's mass: how far does it stretch, and does it survive?"
    half_extents = (0.4 * spacing, 0.2 * spacing, 0.2 * spacing)
    return _hanging("heavy-pendulum", why, links, half_extents, spacing, mass, mass_ratio, radius)


def joint_grid(columns: int = 100, rows: int = 100, spacing: float = 0.1, mass: float = 0.01) -> Scene:
    """A net of balls on ball joints, level at the start, hung by two corners: columns along x, rows along z.

    Neighbours `spacing` (m) apart are joined half way between; `mass` (kg) is a ball's, of radius 0.3 spacings. Nothing
    of it collides. `sag_m` is how far the lowest ball is below the corners that hold.
    """
    why = "Ten thousand balls in a net of joints, hung by two corners: how far do joints in loops give way?"
    bodies: list[Body] = []
    joints = []
    for row in range(rows):
        for column in range(columns):
            index = len(bodies)
            centre = (column * spacing, 0.0, row * spacing)
            held = row == 0 and column in (0, columns - 1)
            name = f"ball {row} {column}"
            bodies.append(Body(Sphere(0.3 * spacing), 0.0 if held else mass, centre, name=name, collision_group=-1))
            if column > 0:
                joints.append(Joint(BALL, index - 1, index, ((column - 0.5) * spacing, 0.0, row * spacing)))
            if row > 0:
                joints.append(Joint(BALL, index - columns, index, (column * spacing, 0.0, (row - 0.5) * spacing)))

    def sag(positions: Array, _: Array) -> float:
        return -float(positions[:, 1].min())

    settings = {"columns": columns, "rows": rows, "spacing": spacing, "mass": mass}
    return Scene(
        "joint-grid", why, "max_joint_error_m", bodies, joints, settings=settings, frames=600, quantities={"sag_m": sag}
    )


def _tip_sag(positions: Array, _: Array, *, start: float) -> float:
    return start - float(positions[-1, 1])


def cantilever(boxes: int = 20, half_extent: float = 0.5, mass: float = 1.0) -> Scene:
    """Cubes of `half_extent` (m) and `mass` (kg) in a row on fixed joints, the first fixed to the world.

    `sag_m` is how far the tip is below its start: the rigid answer is 0.
    """
    why = "Twenty boxes on fixed joints stick out of a wall: how far does the tip sag, where a rigid beam would not?"
    side = 2 * half_extent
    shape = Box((half_extent, 0.9 * half_extent, 0.9 * half_extent))
    bodies = []
    joints = []
    for i in range(boxes):
        bodies.append(Body(shape, mass, ((i + 0.5) * side, 0.0, 0.0), name=f"box {i}", collision_group=-1))
        joints.append(Joint(FIXED, i, i - 1 if i > 0 else None, (i * side, 0.0, 0.0)))
    settings = {"boxes": boxes, "half_extent": half_extent, "mass": mass}
    quantities = {"sag_m": partial(_tip_sag, start=0.0)}
    return Scene("cantilever", why, "sag_m", bodies, joints, settings=settings, quantities=quantities)


def _overshoot(positions: Array, _: Array, *, spacing: float) -> float:
    gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return max(0.0, spacing - float(gaps.min(initial=spacing)))


def stretched_chain(links: int = 40, spacing: float = 0.1, mass: float = 1.0, stretch: float = 2.0) -> Scene:
    """A chain on ball joints, level and without gravity, whose links are created at `stretch` times their spacing.

    The first is pinned to the world. Every joint starts (stretch - 1) spacings apart and pulls together: `overshoot_m`
    is by how much two neighbours' centres have come closer than `spacing` (m), the peak speed is `max_speed_m_s`.
    """
    if stretch < 1:
        raise ValueError(f"stretched-chain: stretch = {stretch} must be at least 1")
    why = "Forty links start at twice their spacing: do the joints pull them together, or past each other?"
    shape = Box((0.4 * spacing, 0.1 * spacing, 0.1 * spacing))
    bodies = []
    joints = []
    for i in range(links):
        x = stretch * (i + 0.5) * spacing
        bodies.append(Body(shape, mass, (x, 0.0, 0.0), name=f"link {i}", collision_group=-1))
        mine = (x - spacing / 2, 0.0, 0.0)
        other = (stretch * (i - 0.5) * spacing + spacing / 2, 0.0, 0.0) if i > 0 else (0.0, 0.0, 0.0)
        joints.append(Joint(BALL, i, i - 1 if i > 0 else None, mine, anchor_b=other))
    settings = {"links": links, "spacing": spacing, "mass": mass, "stretch": stretch}
    return Scene(
        "stretched-chain", why, "overshoot_m", bodies, joints, gravity=(0.0, 0.0, 0.0), frames=600, settings=settings,
        quantities={"overshoot_m": partial(_overshoot, spacing=spacing)}, tolerance=(0.05 * spacing, 0.5 * spacing),
        fastest=(stretch - 1) * links * spacing / DT,
    )  # fmt: skip


def windmill(
    columns: int = 5, layers: int = 5, rows: int = 3, mass: float = 1.0, mass_ratio: float = 100.0, speed: float = 2.0
) -> Scene:
    """A motor turns four blades into a stack of blocks of 0.4 m and `mass` (kg).

    The rotor, mass_ratio times a block in all, turns about z on a post that stands beside the stack, driven to `speed`
    (rad/s); columns, layers and rows count the blocks along x, y and z. The paper gives no sizes: these are ours.
    """
    why = "A heavy, driven rotor beats into a stack of blocks: do its fixed blades hold, and do the blocks fly?"
    half, reach, height = 0.2, 2.0, 2.4
    blade_half: Vec3 = (reach / 2, 0.1, 0.3)
    bodies = [
        Body(Plane(), 0.0, name="floor"),
        Body(Box((0.1, 0.1, 0.1)), 0.0, (0.0, height, 0.0), name="post", collision_group=1),
    ]
    rotor = mass_ratio * mass
    bodies.append(Body(Sphere(0.3), 0.2 * rotor, (0.0, height, 0.0), name="hub", collision_group=1))
    joints = [Joint(HINGE, 1, 2, (0.0, height, 0.0), motor_speed=-speed, motor_force=50 * rotor)]
    for i in range(4):
        angle = i * math.pi / 2
        centre = (math.cos(angle) * reach / 2, height + math.sin(angle) * reach / 2, 0.0)
        turn = (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2))
        joints.append(Joint(FIXED, 2, len(bodies), (0.0, height, 0.0)))
        bodies.append(Body(Box(blade_half), 0.2 * rotor, centre, turn, name=f"blade {i}", collision_group=1))
    side = 2 * half
    for layer in range(layers):
        for row in range(rows):
            for column in range(columns):
                place = (reach / 2 + half + column * side, half + layer * side, (row - (rows - 1) / 2) * side)
                bodies.append(Body(Box((half, half, half)), mass, place, name=f"block {column} {layer} {row}"))
    settings = {
        "columns": columns,
        "layers": layers,
        "rows": rows,
        "mass": mass,
        "mass_ratio": mass_ratio,
        "speed": speed,
    }
    return Scene("windmill", why, "max_joint_error_m", bodies, joints, settings=settings, frames=1000)
