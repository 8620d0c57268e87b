"""How deep bodies are inside each other, from FCL: nothing of the engine's own contact points is in it.

>>> from cairn import fcl, scenes
>>> found = fcl.penetration(scenes.build("overlap"))
>>> round(found.worst, 6), found.overlapping
(0.25, 9)
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Union, cast

import numpy as np
import numpy.typing as npt

from .scenes.model import Array, Box, Capsule, Plane, Scene, Shape, Sphere, Vec3, Wedge

if TYPE_CHECKING:
    from ._fcl import Shapes


@dataclass(frozen=True)
class Convex:
    """A convex mesh, in the body's axes."""

    vertices: Sequence[Vec3]  # m
    faces: Sequence[Sequence[int]]  # flat polygons of indices into vertices, counter-clockwise seen from outside


AnyShape = Union[Shape, Convex]


@dataclass(frozen=True)
class Penetration:
    """Depths of pairs of bodies: the depth is the length of the shortest translation that parts the two."""

    worst: float  # m, of the deepest pair; 0 if none overlaps
    mean: float  # m, over the pairs that overlap; 0 if none does
    overlapping: int  # pairs that overlap
    pairs: npt.NDArray[np.int64]  # [n, 2] indices of bodies, ascending: pairs at most `margin` apart
    distances: Array  # [n] m, their signed distances: -depth, or how far they are apart


def penetration(
    bodies: Scene | Sequence[AnyShape], poses: npt.ArrayLike | None = None, margin: float = 0.0
) -> Penetration:
    """The depths of a scene's bodies, or of shapes, in given poses.

    poses: [bodies, 7], positions (m) and orientations (x, y, z, w, unit), as `BulletWorld.poses` or a recording's have
    them; default: where the scene starts. A plane moves with its body's pose. margin: m, pairs up to so far apart are
    listed too. Of a scene, pairs count that can touch in `BulletWorld`: at least one of them moves, they are not joined
    by a joint, and their collision groups let them. Of shapes, all pairs do, save two planes.

    Exact to rounding in double precision. ValueError for poses that are not finite, not unit or too few, and for shapes
    that are none; ImportError where cairn was built without FCL.
    """
    scene = bodies if isinstance(bodies, Scene) else None
    shapes = [body.shape for body in scene.bodies] if scene else list(cast("Sequence[AnyShape]", bodies))
    if poses is None:
        if scene is None:
            raise ValueError("shapes need poses")
        poses = np.hstack([scene.start_positions, scene.start_orientations])
    posed = _posed(shapes)
    pairs, distances = posed.distances(np.asarray(poses, dtype=np.float64), margin)
    if scene:
        counts = _may_touch(scene, pairs)
        pairs, distances = pairs[counts], distances[counts]
    depths = -distances[distances < 0]
    return Penetration(
        worst=float(depths.max(initial=0.0)),
        mean=float(depths.mean()) if len(depths) else 0.0,
        overlapping=len(depths),
        pairs=pairs,
        distances=distances,
    )


def _posed(shapes: Sequence[AnyShape]) -> Shapes:
    try:
        module = importlib.import_module(f"{__package__}._fcl")
    except ModuleNotFoundError as missing:
        raise ImportError(
            "cairn was built without FCL: install libfcl-dev (apt-get install libfcl-dev), then install cairn again"
        ) from missing
    posed = cast("Shapes", module.Shapes())
    for index, shape in enumerate(shapes):
        try:
            if isinstance(shape, Box):
                posed.add_box(shape.half_extents)
            elif isinstance(shape, Sphere):
                posed.add_sphere(shape.radius)
            elif isinstance(shape, Capsule):
                posed.add_capsule(shape.radius, shape.half_length)
            elif isinstance(shape, Plane):
                posed.add_plane(shape.normal, shape.offset)
            elif isinstance(shape, (Convex, Wedge)):
                posed.add_convex(shape.vertices, shape.faces)
            else:
                raise ValueError(f"{shape!r} is a shape that FCL is not given")
        except ValueError as wrong:
            raise ValueError(f"shape {index}: {wrong}") from None
    return posed


def _may_touch(scene: Scene, pairs: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """[n] whether each pair can touch."""
    group = np.array([body.collision_group for body in scene.bodies], dtype=np.int64)[pairs].reshape(-1, 2)
    moves = (scene.masses > 0)[pairs].reshape(-1, 2).any(axis=1)
    apart = (group < 0).any(axis=1) | ((group[:, 0] == group[:, 1]) & (group[:, 0] != 0))
    joined = {tuple(sorted((joint.body_a, joint.body_b))) for joint in scene.joints if joint.body_b is not None}
    free = np.array([tuple(pair) not in joined for pair in pairs.tolist()], dtype=bool)
    return np.asarray(moves & ~apart & free, dtype=np.bool_)


__all__ = ["AnyShape", "Convex", "Penetration", "penetration"]
