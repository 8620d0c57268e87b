"""`far` and `far-chain`: scenes moved away from the origin, where single precision has few digits left for places."""

from __future__ import annotations

from dataclasses import replace

from .chain import chain
from .model import Scene
from .stack import stack


def moved(scene: Scene, metres: float) -> Scene:
    """The same scene so many metres along x, joints and all. What stands on the origin's plane stands on it there."""
    bodies = [
        replace(body, position=(body.position[0] + metres, *body.position[1:])) if body.mass > 0 else body
        for body in scene.bodies
    ]
    joints = [replace(joint, anchor=(joint.anchor[0] + metres, *joint.anchor[1:])) for joint in scene.joints]
    return replace(scene, bodies=bodies, joints=joints)


def far(kilometres: float = 10.0, columns: int = 5, layers: int = 5, rows: int = 5) -> Scene:
    """`stack`, so many kilometres from the origin; columns, layers and rows as there."""
    scene = moved(stack(columns=columns, layers=layers, rows=rows), 1e3 * kilometres)
    why = "The block of light boxes ten kilometres from the origin: does it stand as it does at home?"
    settings = {"kilometres": kilometres, "columns": columns, "layers": layers, "rows": rows}
    return replace(scene, name="far", why=why, settings=settings)


def far_chain(kilometres: float = 10.0, links: int = 50, spacing: float = 0.1) -> Scene:
    """`chain`, so many kilometres from the origin; links and spacing (m) as there."""
    scene = moved(chain(links=links, spacing=spacing), 1e3 * kilometres)
    why = "The chain and its ball ten kilometres from the origin: do the anchors hold as they do at home?"
    settings = {"kilometres": kilometres, "links": links, "spacing": spacing}
    return replace(scene, name="far-chain", why=why, settings=settings)
