"""What a run is judged by: pure functions of poses and velocities, in double precision.

Arrays are [bodies, 3] (positions in m, velocities in m/s and rad/s) and [bodies, 4] (orientations x, y, z, w, unit); a
track is [frames, bodies, 3]. Bodies that cannot move have mass 0 and inertia 0. Frame k is the state after k steps.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from .scenes.model import FIXED, HINGE, SLIDER, Array, Scene, Vec3

SETTLED_FRAME = 60  # drift, collapse and penetration are measured from here, so that settling does not count


def rotation_matrices(orientations: Array) -> Array:
    """[..., 3, 3]; columns are the body's axes in world axes."""
    q = np.asarray(orientations, dtype=np.float64)
    product = 2 * q[..., :, None] * q[..., None, :]
    x, y, z = (product[..., i, :] for i in range(3))  # x[..., 1] is 2 q_x q_y
    matrices = np.empty((*q.shape[:-1], 3, 3))
    matrices[..., 0, 0] = 1 - y[..., 1] - z[..., 2]
    matrices[..., 0, 1] = x[..., 1] - z[..., 3]
    matrices[..., 0, 2] = x[..., 2] + y[..., 3]
    matrices[..., 1, 0] = x[..., 1] + z[..., 3]
    matrices[..., 1, 1] = 1 - x[..., 0] - z[..., 2]
    matrices[..., 1, 2] = y[..., 2] - x[..., 3]
    matrices[..., 2, 0] = x[..., 2] - y[..., 3]
    matrices[..., 2, 1] = y[..., 2] + x[..., 3]
    matrices[..., 2, 2] = 1 - x[..., 0] - y[..., 1]
    return matrices


def kinetic_energy(
    masses: Array, inertias: Array, orientations: Array, linear_velocities: Array, angular_velocities: Array
) -> float:
    """J, of translation and rotation. inertias are the principal moments about the bodies' axes [bodies, 3]."""
    linear = np.asarray(linear_velocities, dtype=np.float64)
    # R^T omega: each body's angular velocity along its own axes.
    local = np.einsum("bij,bi->bj", rotation_matrices(orientations), np.asarray(angular_velocities, dtype=np.float64))
    return float(0.5 * np.sum(masses * np.sum(linear * linear, axis=1)) + 0.5 * np.sum(inertias * local * local))


def potential_energy(masses: Array, positions: Array, gravity: Vec3) -> float:
    """J, against the world's origin."""
    return float(-np.sum(masses * (np.asarray(positions, dtype=np.float64) @ np.asarray(gravity))))


def penetration(distances: npt.ArrayLike) -> float:
    """m, of the deepest contact, 0 if nothing overlaps. distances: the contacts' signed distances, negative inside."""
    array = np.asarray(distances, dtype=np.float64)
    return max(0.0, -float(array.min())) if array.size else 0.0


def _horizontal(offsets: Array, gravity: Vec3) -> Array:
    up = -np.asarray(gravity, dtype=np.float64)
    norm = np.linalg.norm(up)
    if norm == 0:
        return offsets
    up = up / norm
    return np.asarray(offsets - (offsets @ up)[..., None] * up)


def drift(track: Array, place: Array, gravity: Vec3) -> float:
    """m, the longest horizontal distance of any body at any frame of the track from its place."""
    return float(np.linalg.norm(_horizontal(track - place, gravity), axis=-1).max(initial=0.0))


def settling(start: Array, place: Array, gravity: Vec3) -> float:
    """m, the longest vertical distance of any body from its start to its place."""
    offsets = place - start
    return float(np.linalg.norm(offsets - _horizontal(offsets, gravity), axis=-1).max(initial=0.0))


def collapsed_at(track: Array, place: Array, reach: Array) -> int | None:
    """The track's first frame where a body is further than its `reach` (m, [bodies]) from its place, or None."""
    fallen = np.any(np.linalg.norm(track - place, axis=-1) > reach, axis=-1)
    return int(np.argmax(fallen)) if fallen.any() else None


def max_speed(linear_velocities: Array) -> float:
    """m/s, of the fastest centre of mass."""
    return float(np.linalg.norm(linear_velocities, axis=-1).max(initial=0.0))


def separation_speed(positions: Array, linear_velocities: Array, pairs: Sequence[tuple[int, int]]) -> float:
    """m/s, at which the fastest of the pairs moves apart along the line of its centres; 0 if none does."""
    if not len(pairs):
        return 0.0
    first, second = np.asarray(pairs).T
    line = positions[second] - positions[first]
    line = line / np.linalg.norm(line, axis=-1, keepdims=True)
    return float(np.sum((linear_velocities[second] - linear_velocities[first]) * line, axis=-1).max(initial=0.0))


def finite(*arrays: npt.ArrayLike) -> bool:
    """Whether no number is NaN or infinite."""
    return all(bool(np.isfinite(array).all()) for array in arrays)


def state_hash(positions: Array, orientations: Array, linear_velocities: Array, angular_velocities: Array) -> str:
    """SHA-256 (hexadecimal) of the state as little-endian floats, array after array: equal runs give equal text."""
    digest = hashlib.sha256()
    for array in (positions, orientations, linear_velocities, angular_velocities):
        digest.update(np.ascontiguousarray(array, dtype="<f4").tobytes())
    return digest.hexdigest()


class JointErrors:
    """How far a scene's joints are from holding what they lock.

    Calling it with positions [bodies, 3] and orientations [bodies, 4] gives (metres [joints], radians [joints]):
    the distance of the anchors (for a slider: across its axis), and the angle between the two axes (hinge) or from the
    relative orientation at the start (slider, fixed; a ball has none). What a joint frees, or limits, is no error.
    """

    def __init__(self, scene: Scene) -> None:
        self._kinds = np.array([joint.kind for joint in scene.joints])
        world = len(scene.bodies)  # the world is one more body, at the origin
        self._a = np.array([joint.body_a for joint in scene.joints], dtype=int)
        self._b = np.array([world if joint.body_b is None else joint.body_b for joint in scene.joints], dtype=int)
        positions, rotations = self._with_world(scene.start_positions, scene.start_orientations)
        frames = np.array([joint.frame_at_start() for joint in scene.joints]).reshape(-1, 3, 3)
        anchors = np.array([joint.anchor for joint in scene.joints], dtype=np.float64).reshape(-1, 3)
        self._anchor_a, self._frame_a = self._local(positions, rotations, self._a, anchors, frames)
        others = [joint.anchor if joint.anchor_b is None else joint.anchor_b for joint in scene.joints]
        anchors = np.array(others, dtype=np.float64).reshape(-1, 3)
        self._anchor_b, self._frame_b = self._local(positions, rotations, self._b, anchors, frames)

    @staticmethod
    def _with_world(positions: Array, orientations: Array) -> tuple[Array, Array]:
        rotations = rotation_matrices(orientations)
        return np.vstack([positions, np.zeros((1, 3))]), np.concatenate([rotations, np.eye(3)[None]])

    @staticmethod
    def _local(
        positions: Array, rotations: Array, body: npt.NDArray[np.int_], anchors: Array, frames: Array
    ) -> tuple[Array, Array]:
        turn = np.swapaxes(rotations[body], -1, -2)
        return np.einsum("jik,jk->ji", turn, anchors - positions[body]), turn @ frames

    def __call__(self, positions: Array, orientations: Array) -> tuple[Array, Array]:
        if not len(self._kinds):
            return np.zeros(0), np.zeros(0)
        position, rotation = self._with_world(np.asarray(positions, dtype=np.float64), orientations)
        turn_a, turn_b = rotation[self._a], rotation[self._b]
        gap = position[self._b] + np.einsum("jik,jk->ji", turn_b, self._anchor_b)
        gap = gap - position[self._a] - np.einsum("jik,jk->ji", turn_a, self._anchor_a)
        frame_a, frame_b = turn_a @ self._frame_a, turn_b @ self._frame_b

        slider = self._kinds == SLIDER
        along = np.sum(gap * frame_a[:, :, 0], axis=-1)
        gap = np.where(slider[:, None], gap - along[:, None] * frame_a[:, :, 0], gap)

        z_a, z_b = frame_a[:, :, 2], frame_b[:, :, 2]
        tilt = np.arctan2(np.linalg.norm(np.cross(z_a, z_b), axis=-1), np.sum(z_a * z_b, axis=-1))
        locked = slider | (self._kinds == FIXED)
        radians = np.where(self._kinds == HINGE, tilt, np.where(locked, _angle(frame_a, frame_b), 0.0))
        return np.linalg.norm(gap, axis=-1), radians


def _angle(first: Array, second: Array) -> Array:
    """rad, of the turn from one frame to another: |first - second| = 2 sqrt(2) sin(angle / 2), exact near 0 as well."""
    chord = np.linalg.norm(first - second, axis=(-2, -1)) / (2 * np.sqrt(2.0))
    return np.asarray(2 * np.arcsin(np.minimum(chord, 1.0)))


def joint_errors(scene: Scene, positions: Array, orientations: Array) -> tuple[Array, Array]:
    """(metres [joints], radians [joints]) of a single frame; see JointErrors."""
    return JointErrors(scene)(positions, orientations)
