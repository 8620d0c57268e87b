"""`stack` and `stack-1m`: a block of boxes on a plane, the paper's stability test."""

from __future__ import annotations

import math

from .model import Body, Box, Plane, Scene


def _block(
    name: str,
    why: str,
    columns: int,
    layers: int,
    rows: int,
    half_extent: float,
    mass: float,
    friction: float,
    gap: float,
) -> Scene:
    surface = math.sqrt(friction)  # on each body: a contact's coefficient is the product
    bodies = [Body(Plane(), 0.0, friction=surface, name="floor")]
    side = 2 * half_extent
    for layer in range(layers):
        for row in range(rows):
            for column in range(columns):
                x = (column - (columns - 1) / 2) * side
                y = half_extent + gap + layer * (side + gap)
                z = (row - (rows - 1) / 2) * side
                body_name = f"box {column} {layer} {row}"
                shape = Box((half_extent, half_extent, half_extent))
                bodies.append(Body(shape, mass, (x, y, z), friction=surface, name=body_name))
    settings = {
        "columns": columns,
        "layers": layers,
        "rows": rows,
        "half_extent": half_extent,
        "mass": mass,
        "friction": friction,
        "gap": gap,
    }
    return Scene(name, why, "max_drift_m", bodies, rests=True, settings=settings)


def stack(
    columns: int = 5,
    layers: int = 5,
    rows: int = 5,
    half_extent: float = 0.1,
    mass: float = 0.8,
    friction: float = 0.5,
    gap: float = 0.001,
) -> Scene:
    """A block of light boxes a hand wide: does it stand, or does the solver's noise walk it apart?

    columns, layers and rows count the boxes along x, y and z. half_extent in m, mass in kg, friction is the coefficient
    at a contact. gap in m is the air between layers and below the lowest one, so that the top settles by layers * gap;
    neighbours of a layer touch.
    """
    why = "A block of 125 light boxes: does it stand, or does the solver's noise walk it apart?"
    return _block("stack", why, columns, layers, rows, half_extent, mass, friction, gap)


def stack_1m(
    columns: int = 5,
    layers: int = 5,
    rows: int = 5,
    half_extent: float = 0.5,
    mass: float = 1.0,
    friction: float = 0.25,
    gap: float = 0.0,
) -> Scene:
    """The same block at the sizes that engines are tuned for: boxes of 1 m and 1 kg, no gaps. Settings: see `stack`."""
    why = "The same block at the sizes that engines are tuned for: 1 m, 1 kg, no gaps, half the friction."
    return _block("stack-1m", why, columns, layers, rows, half_extent, mass, friction, gap)
