"""What a run of the report comes to: its error, and whether it survived, degraded or failed, when and how."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .charts import verdict
from .charts.result import Measured
from .metrics import SETTLED_FRAME
from .recording import Recording, smallest_reach
from .scenes.model import Scene
from .summary import KEYS

SURVIVED, DEGRADED, FAILED, UNKNOWN = "survived", "degraded", "failed", "unknown"
STATES = (SURVIVED, DEGRADED, FAILED, UNKNOWN)
NAN, COLLAPSED, EXPLODED = "NaN", "collapsed", "exploded"

_SLIGHT = 0.05  # of a box's or link's size: an error that is no more than this leaves a run one that survived
_FALL = 2.0  # times the speed of a free fall through the scene, or its motors': what is faster has exploded
_LEAST_SPEED = 1.0  # m/s, of that


@dataclass(frozen=True)
class Outcome:
    """state: one of STATES. kind and frame (from 1): of the first failure, if it failed."""

    state: str
    kind: str = ""
    frame: int | None = None


@dataclass(frozen=True)
class Limits:
    """From which values on a run counts as degraded, collapsed or exploded."""

    error: str  # what is compared with `slight` and `fatal`, in words
    unit: str
    slight: float  # at most this: survived
    fatal: float  # above this: failed
    fatal_kind: str  # and so it is called
    speed: float  # m/s: a centre of mass that is faster: exploded

    @property
    def text(self) -> str:
        """The rule, for people."""
        number = verdict.number
        above = "exploded: above, or" if self.fatal_kind == EXPLODED else f"{self.fatal_kind}: above; exploded:"
        return (
            f"survived: {self.error} at most {number(self.slight, self.unit)}; degraded: up to "
            f"{number(self.fatal, self.unit)}; {above} a body faster than {self.speed:.3g} m/s, {_FALL:g} times "
            "a free fall through the scene (with joints: and energy was gained; a free end whips); NaN: a number "
            "not finite. The frame is the first failure's."
        )


def size_of(scene: Scene) -> float:
    """m, what an error is small or large against: the spacing of a chain, else the smallest moving body's size."""
    spacing = scene.settings.get("spacing")
    return float(spacing) if scene.joints and spacing is not None else 2 * smallest_reach(scene)


def limits(scene: Scene) -> Limits:
    """A scene's own, or of its anchors' gap, its neighbours' speed, or how far its bodies drift or settle."""
    moving = scene.start_positions[scene.masses > 0]
    extent = float(np.linalg.norm(np.ptp(moving, axis=0))) + 2 * smallest_reach(scene) + scene.settings.get("radius", 0)
    fall = math.sqrt(2 * float(np.linalg.norm(scene.gravity)) * extent)
    given = max((float(np.linalg.norm(body.linear_velocity)) for body in scene.bodies), default=0.0)
    driven = max((abs(joint.motor_speed) * extent for joint in scene.joints), default=0.0)
    fastest = _FALL * max(fall + given, scene.fastest or driven, _LEAST_SPEED)
    size = size_of(scene)
    if scene.tolerance is not None:
        quantity = measured(scene)
        return Limits(quantity.title, quantity.unit, *scene.tolerance, COLLAPSED, fastest)
    if scene.neighbours:
        cap = verdict.limit(scene)
        assert cap is not None
        return Limits("the peak speed of separation", "m/s", cap[0], 2 * cap[0], EXPLODED, fastest)
    if scene.joints:
        return Limits("the widest anchor gap", "m", _SLIGHT * size, 0.5 * size, COLLAPSED, fastest)
    what = f"drift after frame {SETTLED_FRAME} and settling until then"
    return Limits(what, "m", _SLIGHT * size, 0.5 * size, COLLAPSED, fastest)


def exploded(recording: Recording) -> bool:
    """Whether a body was faster than the scene's limit, in any frame, and not by a whip."""
    speed = recording.summary["max_speed_m_s"]
    return speed is not None and bool(speed > limits(recording.scene).speed) and not _may_whip(recording)


def _may_whip(recording: Recording) -> bool:
    """Joints may hand the energy of all to one body, as at the end of a chain; what they hand out is not gained."""
    change = recording.summary["energy_change_J"]
    return bool(recording.scene.joints) and change is not None and bool(change < 0)


def outcome(recording: Recording) -> Outcome:
    """Judge a run of a scene that rests, of joints or of neighbours by its `limits`; the first failure counts."""
    scene, summary, series = recording.scene, recording.summary, recording.frames
    bounds = limits(scene)
    failures: list[tuple[int, str]] = []

    def first(values: np.ndarray, bound: float, kind: str) -> None:
        above = np.flatnonzero(values > bound)
        if len(above):
            failures.append((int(above[0]) + 1, kind))

    if not _may_whip(recording):
        first(series["max_speed_m_s"], bounds.speed, EXPLODED)
    errors: list[float | None]
    if scene.tolerance is not None:
        errors = [error_of(recording)] if summary["frames"] else []
        first(np.abs(series[scene.failure]), bounds.fatal, bounds.fatal_kind)
    elif scene.neighbours:
        errors = [summary["max_separation_speed_m_s"]]
        first(series["separation_speed_m_s"], bounds.fatal, bounds.fatal_kind)
    elif scene.joints:
        errors = [summary["max_joint_error_m"]]
        first(series["max_joint_error_m"], bounds.fatal, bounds.fatal_kind)
    else:
        errors = [summary["max_drift_m"], summary["settling_m"]]
        if summary["collapsed_at_frame"] is not None:
            failures.append((summary["collapsed_at_frame"], COLLAPSED))
        if summary["settling_m"] is not None and summary["settling_m"] > bounds.fatal:
            failures.append((SETTLED_FRAME, COLLAPSED))  # or earlier: where it is then counts as its place
    if not summary["finite"]:
        failures.append((summary["frames"] + 1, NAN))
    if failures:
        frame, kind = min(failures)
        return Outcome(FAILED, kind, frame)
    known = [error for error in errors if error is not None]
    if not known:
        return Outcome(UNKNOWN)  # too short a run
    worst = max(known)
    if worst > bounds.fatal:
        return Outcome(FAILED, bounds.fatal_kind, summary["frames"])
    return Outcome(SURVIVED if worst <= bounds.slight else DEGRADED)


def error_of(recording: Recording) -> float:
    """The scene's `failure` quantity, the largest of the run in size; NaN if the run does not have it."""
    name = recording.scene.failure
    if name in KEYS:
        value = recording.summary[name]
        return math.nan if value is None else abs(float(value))
    values = recording.frames[name]
    return float(np.abs(values).max()) if len(values) else math.nan


_UNITS = {"_m_s": "m/s", "_m": "m", "_J": "J", "_rad": "rad"}


def measured(scene: Scene) -> Measured:
    """How a chart names `error_of`, which stands under the key "error" in the summaries of the report."""
    suffix = next((s for s in _UNITS if scene.failure.endswith(s)), "")
    words = scene.failure[: len(scene.failure) - len(suffix)].replace("_", " ").replace("max ", "worst ")
    return Measured("error", words, _UNITS.get(suffix, "1"))


def scale(scene: Scene) -> tuple[float, str]:
    """What a scene's error is divided by for a tolerance that fits all scenes, and what that is."""
    if scene.tolerance is not None:
        return 2 * scene.tolerance[1], "twice the error at which it fails"
    unit = measured(scene).unit
    if unit == "m":
        return size_of(scene), "size of a body or link"
    if unit == "m/s":
        return verdict.PUSH_SPEED, "cap on the push-out speed"
    heights = scene.start_positions @ -np.asarray(scene.gravity)
    spins = np.array([body.angular_velocity for body in scene.bodies])
    speeds = np.array([body.linear_velocity for body in scene.bodies])
    kinetic = 0.5 * float(np.sum(scene.masses[:, None] * speeds**2) + np.sum(scene.inertias * spins**2))
    return kinetic + float(scene.masses @ np.maximum(heights, 0)), "energy at the start"
