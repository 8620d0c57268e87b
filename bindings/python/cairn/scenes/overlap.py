"""`overlap`: boxes that start inside each other, the paper's test of how violently overlaps are resolved."""

from __future__ import annotations

import math

from .model import Body, Box, Plane, Scene

DENSITY = 100.0  # kg/m^3


def overlap(
    boxes: int = 10, half_width: float = 0.325, half_length: float = 0.5, spacing: float = 0.75, friction: float = 0.5
) -> Scene:
    """A row of boxes on a plane, each inside the next: do they part gently or fly?

    The row runs along z. half_width is the half size along x and y, half_length along z, spacing that between centres
    (m): neighbours overlap by 2 half_length - spacing. friction is the coefficient at a contact; density 100 kg/m^3.
    """
    why = "Ten boxes in a row, each a quarter inside the next: do they part gently or fly?"
    surface = math.sqrt(friction)
    mass = 8 * half_width * half_width * half_length * DENSITY
    shape = Box((half_width, half_width, half_length))
    bodies = [Body(Plane(), 0.0, friction=surface, name="floor")]
    for i in range(boxes):
        z = (i - (boxes - 1) / 2) * spacing
        bodies.append(Body(shape, mass, (0.0, half_width, z), friction=surface, name=f"box {i}"))
    settings = {
        "boxes": boxes,
        "half_width": half_width,
        "half_length": half_length,
        "spacing": spacing,
        "friction": friction,
    }
    neighbours = [(i, i + 1) for i in range(1, boxes)]
    return Scene("overlap", why, "max_separation_speed_m_s", bodies, neighbours=neighbours, settings=settings)
