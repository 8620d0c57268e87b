"""What comes of a run: per-frame series gathered while it runs, and the summary made of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from . import metrics
from .metrics import SETTLED_FRAME
from .scenes.model import Array, Body, Box, Capsule, Scene, Sphere, Wedge
from .summary import KEYS, Summary

SERIES = (
    "solver_ms",  # as solver_ms_median, of each step
    "step_ms",
    "kinetic_energy_change_J",  # as kinetic_energy_change_max_J, of each step
    "kinetic_energy_J",
    "potential_energy_J",
    "max_penetration_m",  # deepest contact that Bullet found in the step
    "max_joint_error_m",
    "max_joint_error_rad",
    "max_speed_m_s",
    "separation_speed_m_s",  # as max_separation_speed_m_s, of each step; 0 without neighbours
    "contacts",
)


@dataclass(frozen=True)
class Recording:
    """A finished run."""

    summary: Summary  # the keys of `cairn.summary`, in their order
    frames: dict[str, Array]  # by name [frames]: SERIES and what the scene itself has; entry k is after step k + 1
    stage_ms: dict[str, float]  # ms of a step in each stage of Cairn, median; empty for Bullet's own solver
    residual_trace: Array  # [sweeps] of the step asked for; empty for Bullet's own solver
    poses: Array  # [samples, bodies, 7] positions (m) and orientations (x, y, z, w), the start first
    pose_frames: Array  # [samples] the frame of each
    scene: Scene
    choices: str | None = None  # what the method auto did in the last step, in words; None for the others


@dataclass(frozen=True)
class Times:
    """ms of a step."""

    solver: float
    step: float


def _reach(body: Body) -> float:
    """m, half of a body's smallest size; infinite if it cannot move."""
    if body.mass == 0:
        return math.inf
    if isinstance(body.shape, Box):
        return min(body.shape.half_extents)
    if isinstance(body.shape, Wedge):
        return min(body.shape.half_bottom, body.shape.half_top, body.shape.height / 2, body.shape.half_depth)
    return body.shape.radius if isinstance(body.shape, (Sphere, Capsule)) else math.inf


def smallest_reach(scene: Scene) -> float:
    """m, half of the smallest size of any body that can move; infinite if none can."""
    return min((_reach(body) for body in scene.bodies), default=math.inf)


def _extreme(values: Array) -> float | None:
    """The value of largest size, with its sign."""
    return float(values[np.argmax(np.abs(values))]) if len(values) else None


_quiet = np.errstate(over="ignore", invalid="ignore")  # a run that blows up says so in its summary


class Judge:
    """Watches a run: `see` after every frame, then `summary`."""

    def __init__(self, scene: Scene, frames: int) -> None:
        self.scene = scene
        self.frames = 0
        self.finite = True
        self.series = {name: np.zeros(frames) for name in (*SERIES, *scene.quantities, *scene.motions)}
        self._masses, self._inertias = scene.masses, scene.inertias
        self._reach = np.array([_reach(body) for body in scene.bodies])
        self._joint_errors = metrics.JointErrors(scene)
        self._start = scene.start_positions
        self._start_energy = self._energies(*_split(_start_of(scene)))
        self._place: Array | None = None
        self._drift = 0.0
        self._collapsed: int | None = None
        self._state = _start_of(scene)

    def _energies(self, positions: Array, orientations: Array, linear: Array, angular: Array) -> tuple[float, float]:
        kinetic = metrics.kinetic_energy(self._masses, self._inertias, orientations, linear, angular)
        return kinetic, metrics.potential_energy(self._masses, positions, self.scene.gravity)

    @_quiet
    def kinetic_energy_change(self, states: Array, h: float) -> float:
        """J, of Bullet's own solver: what its solves made of the free velocities, summed over substeps of h seconds.

        states [substeps + 1, bodies, 13]: before the first substep and after each.
        """
        substeps = len(states) - 1
        masses, inertias = np.tile(self._masses, substeps), np.tile(self._inertias, (substeps, 1))
        _, orientations, linear, angular = _split(states[:-1].reshape(-1, 13))
        free = linear + h * np.asarray(self.scene.gravity) * (masses > 0)[:, None]
        _, _, solved, solved_angular = _split(states[1:].reshape(-1, 13))
        old = metrics.kinetic_energy(masses, inertias, orientations, free, angular)
        return metrics.kinetic_energy(masses, inertias, orientations, solved, solved_angular) - old

    @_quiet
    def see(self, state: Array, separations: Array, energy_change: float, times: Times) -> bool:
        """Takes in one more frame. False, and the run is over, if it holds a number that is not finite."""
        if not metrics.finite(state, separations, energy_change):
            self.finite = False
            return False
        positions, orientations, linear, angular = _split(state)
        metres, radians = self._joint_errors(positions, orientations)
        kinetic, potential = self._energies(positions, orientations, linear, angular)
        values = {
            "solver_ms": times.solver,
            "step_ms": times.step,
            "kinetic_energy_change_J": energy_change,
            "kinetic_energy_J": kinetic,
            "potential_energy_J": potential,
            "max_penetration_m": metrics.penetration(separations),
            "max_joint_error_m": metres.max(initial=0.0),
            "max_joint_error_rad": radians.max(initial=0.0),
            "max_speed_m_s": metrics.max_speed(linear),
            "separation_speed_m_s": metrics.separation_speed(positions, linear, self.scene.neighbours),
            "contacts": len(separations),
            **{name: quantity(positions, orientations) for name, quantity in self.scene.quantities.items()},
            **self._motions(linear, angular),
        }
        if not metrics.finite(list(values.values())):  # finite velocities, but their energy is not
            self.finite = False
            return False
        for name, value in values.items():
            self.series[name][self.frames] = value
        self.frames += 1
        self._state = state
        if self.scene.rests:
            self._follow(positions)
        return True

    def _motions(self, linear: Array, angular: Array) -> dict[str, float]:
        time = (self.frames + 1) * self.scene.dt
        return {name: motion(time, np.hstack([linear, angular])) for name, motion in self.scene.motions.items()}

    def _follow(self, positions: Array) -> None:
        if self.frames == SETTLED_FRAME:
            self._place = positions.copy()
        if self._place is None:
            return
        self._drift = max(self._drift, metrics.drift(positions[None], self._place, self.scene.gravity))
        fallen = metrics.collapsed_at(positions[None], self._place, self._reach)
        if fallen is not None and self._collapsed is None:
            self._collapsed = self.frames

    def finished_series(self) -> dict[str, Array]:
        return {name: values[: self.frames] for name, values in self.series.items()}

    @_quiet
    def summary(self, request: Mapping[str, object], rows: Sequence[float], build: str) -> Summary:
        """The keys of `cairn.summary`. request has those that were asked for; rows are of each step, if known."""
        series = self.finished_series()
        joints = len(self.scene.joints) > 0
        seen = self.frames > 0
        settled = series["max_penetration_m"][SETTLED_FRAME:]
        energy = series["kinetic_energy_J"] + series["potential_energy_J"] - sum(self._start_energy)
        rested = self._place is not None
        values: dict[str, object] = {
            **request,
            "frames": self.frames,
            "contacts": float(np.median(series["contacts"])) if seen else None,
            "rows": float(np.median(rows)) if len(rows) else None,
            "solver_ms_median": float(np.median(series["solver_ms"])) if seen else None,
            "step_ms_median": float(np.median(series["step_ms"])) if seen else None,
            "max_penetration_m": float(settled.max()) if len(settled) else None,
            "max_drift_m": self._drift if rested else None,
            "settling_m": metrics.settling(self._start, self._place, self.scene.gravity)
            if self._place is not None
            else None,
            "max_joint_error_m": float(series["max_joint_error_m"].max()) if joints and seen else None,
            "max_joint_error_rad": float(series["max_joint_error_rad"].max()) if joints and seen else None,
            "max_speed_m_s": float(series["max_speed_m_s"].max()) if seen else None,
            "max_separation_speed_m_s": float(series["separation_speed_m_s"].max(initial=0.0))
            if self.scene.neighbours
            else None,
            "energy_change_J": _extreme(energy),
            "kinetic_energy_change_max_J": _extreme(series["kinetic_energy_change_J"]),
            "collapsed_at_frame": self._collapsed,
            "finite": self.finite,
            "state_hash": metrics.state_hash(*_split(self._state)),
            "build": build,
        }
        return {key: values[key] for key in KEYS}


def _start_of(scene: Scene) -> Array:
    velocities = [(*body.linear_velocity, *body.angular_velocity) for body in scene.bodies]
    columns = (scene.start_positions, scene.start_orientations, np.array(velocities, dtype=np.float64).reshape(-1, 6))
    return np.hstack(columns)


def _split(state: Array) -> tuple[Array, Array, Array, Array]:
    """Positions, orientations, linear and angular velocities of a state [bodies, 13]."""
    return state[:, :3], state[:, 3:7], state[:, 7:10], state[:, 10:]
