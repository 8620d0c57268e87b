"""What a run amounts to in a word: stands, falls, holds, comes apart. The rules are here, and shown with the words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..scenes.model import Scene
from . import frames
from .result import Measured, Result

PUSH_SPEED = 3.0  # m/s, the default preset's cap on the speed that pushes overlapping bodies apart
_SLACK = 1.05  # centres of boxes that turn part a little faster than their contacts

DRIFT = Measured("max_drift_m", "worst drift of a box", "m")
SEPARATION_SPEED = Measured("max_separation_speed_m_s", "peak speed of separation", "m/s")
JOINT_ERROR = frames.JOINT_ERROR
PENETRATION = frames.PENETRATION


@dataclass(frozen=True)
class Verdict:
    good: bool
    text: str


def joint_limit(scene: Scene) -> float:
    """m, the anchor gap from which a chain counts as apart: half a link's spacing."""
    return 0.5 * float(scene.settings["spacing"])


def rule(scene: Scene) -> str:
    """How `judge` decides in a scene, for people."""
    if scene.rests:
        return "A pile has fallen when a box's centre is more than half its size from where it was at frame 60."
    if scene.joints:
        return f"A chain holds while no anchors are more than {joint_limit(scene):g} m apart, half a link's spacing."
    return (
        f"Boxes part gently when no neighbours separate faster than {PUSH_SPEED * _SLACK:g} m/s: the default "
        f"preset's cap on the speed of contacts, {PUSH_SPEED:g} m/s, and a twentieth."
    )


def limit(scene: Scene) -> tuple[float, str] | None:
    """The value of `headline` from which a run fails, and what it then does; None where another rule decides."""
    if scene.rests:
        return None
    return (joint_limit(scene), "comes apart above") if scene.joints else (PUSH_SPEED * _SLACK, "flies apart above")


def judge(scene: Scene, result: Result) -> Verdict:
    if result.recording is None:
        return Verdict(False, f"did not run: {result.error}")
    if not result.summary["finite"]:
        return Verdict(False, f"numbers blow up at frame {result.summary['frames']}")
    if scene.rests:
        fallen = result.collapsed_at
        return Verdict(True, "stands") if fallen is None else Verdict(False, f"falls, frame {fallen}")
    if scene.joints:
        gap = result.number(JOINT_ERROR.key)
        return Verdict(True, "holds") if gap <= joint_limit(scene) else Verdict(False, "comes apart")
    speed = result.number(SEPARATION_SPEED.key)
    gentle = speed <= PUSH_SPEED * _SLACK
    return Verdict(gentle, "parts gently" if gentle else "flies apart")


def headline(scene: Scene) -> Measured:
    """The one quantity that shows failure in a scene: the vertical axis of its error-against-time chart."""
    known = {q.key: q for q in (DRIFT, SEPARATION_SPEED, JOINT_ERROR, PENETRATION)}
    return known[scene.failure]


def error_of(scene: Scene) -> Measured:
    """The constraint error of a scene, frame by frame."""
    return JOINT_ERROR if scene.joints else PENETRATION


def number(value: float, unit: str = "") -> str:
    """Three figures with a unit that keeps them short: 0.0123 m is 12.3 mm. A dash for what is not known."""
    if not math.isfinite(value):
        return "–"
    sign, value = ("−" if value < 0 else ""), abs(value)
    for scale, prefix in ((1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"), (1e6, "M")):
        if unit in ("m", "J") and (value < 1000 * scale or prefix == "M"):
            return f"{sign}{value / scale:.3g} {prefix}{unit}"
    return f"{sign}{value:.3g}" + (f" {unit}" if unit else "")
