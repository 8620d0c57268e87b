"""The paper's claims about its figures, each put to our own runs with the paper's preset.

Every answer is computed from the recordings; none is written down beforehand.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..scenes.model import Array, Scene
from .frames import ENERGY_CHANGE
from .result import METHODS, NAMES, Comparison, Result
from .verdict import JOINT_ERROR, SEPARATION_SPEED, joint_limit, number

if TYPE_CHECKING:
    from ..recording import Recording

SETTLED = 60  # frames that a pile takes to settle, left out where steadiness is judged
FALL = 2000  # the frame after which the paper's PJ and TJ fall

TIMED = ("stack", "chain", "overlap")  # the scenes of the paper's Table 2

YES, NO, UNKNOWN = "yes", "no", "cannot tell"


@dataclass(frozen=True)
class Claim:
    scene: str
    claim: str  # what the paper says
    answer: str  # YES, NO or UNKNOWN
    evidence: str  # our figures
    figure: str = ""  # the paper's, or its table
    why: str = ""  # what explains a NO, as far as we know


_SIZES = (
    "The paper gives no sizes. With those of its authors' public engine a share of 0.6 of the error a substep, or "
    "300 Hz, without a cap on the speed, throws small boxes that overlap."
)
_NONLINEAR = (
    "The authors' public code divides by an inverse in the position sweeps, which may be where the jitter comes from; "
    "here the equation is as printed."
)
_STIFF = (
    "Soft constraints at 300 Hz take away more of an error in a step of 16 ms than Baumgarte's share of 0.2 does: they "
    "are the stiffer of the two."
)
_HARDER = (
    "The preset, from the authors' public code, takes 0.6 of an error in each of ten substeps under TJ, and 0.2 in a "
    "step under PJ: TJ pushes harder."
)
_RESIDUAL = "Ours is the size of a sweep's step in the metric of D; the paper does not say what its residual is."
_GAP = "The paper calls a slight gap at the joints good; here more than half a link's spacing counts as apart."
_PICTURES = "The paper has pictures alone: neither sizes nor figures. Sizes and threshold are ours."
_TIMES = "The paper's times are of a GPU, where building rows anew costs other shares than on a processor."


def derived(recording: Recording) -> dict[str, float]:
    """What the claims need of a run beside its summary, for runs of which no series are kept."""
    found = {f"{stage}_ms": time for stage, time in recording.stage_ms.items()}
    roughness = _roughness_of(recording.frames[ENERGY_CHANGE.key])
    if math.isfinite(roughness):
        found["energy_roughness_J"] = roughness
    trace = np.asarray(recording.residual_trace)
    if len(trace):
        found["residual_rate"] = _rate(trace)
        found["residual_jumps"], found["residual_starts"] = _jumps(trace, int(recording.summary["substeps"]))
    return {name: float(value) for name, value in found.items() if math.isfinite(value)}


def claims(comparisons: Mapping[str, Comparison], scenes: Mapping[str, Scene]) -> list[Claim]:
    """All claims that can be put to these scenes; a run that is missing makes its claim UNKNOWN."""
    found: list[Claim] = []
    for name, comparison in comparisons.items():
        if name == "stack":
            found += _stack(comparison)
        elif name == "chain":
            found += _chain(comparison, scenes[name])
        elif name == "overlap":
            found += _overlap(comparison)
        elif name == "joints":
            found += _joints(comparison, scenes[name])
        elif name == "crank":
            found += _crank(comparison, scenes[name])
        elif name == "jeep-bridge":
            found += _bridge(comparison)
        elif name == "windmill":
            found += _windmill(comparison)
        if name in TIMED:
            found.append(_timing(comparison))
    return found


def _paper(comparison: Comparison, *methods: str) -> list[Result]:
    """The runs with the paper's preset, those that gave a recording."""
    found = (comparison.find(method, "paper") for method in methods)
    return [result for result in found if result is not None and result.recording is not None]


_FIGURES = {"joints": 3, "crank": 4, "stack": 5, "chain": 6, "overlap": 7, "jeep-bridge": 10, "windmill": 11}


def _decide(
    comparison: Comparison, claim: str, complete: bool, holds: bool, evidence: str, why: str = "", figure: str = ""
) -> Claim:
    answer = (YES if holds else NO) if complete else UNKNOWN
    return Claim(comparison.scene, claim, answer, evidence, figure or f"Figure {_FIGURES[comparison.scene]}", why)


def _fate(result: Result) -> str:
    name, fallen = NAMES[result.request.method], result.collapsed_at
    return f"{name} {'stands to the end' if fallen is None else f'falls at frame {fallen}'}"


def _roughness(result: Result) -> float:
    kept = result.number("energy_roughness_J")
    return (
        kept
        if math.isfinite(kept) or result.recording is None
        else _roughness_of(result.recording.frames.get(ENERGY_CHANGE.key, ()))
    )


def _roughness_of(changes: npt.ArrayLike) -> float:
    """J, how much the energy change of a step differs from the one before: root mean square, once settled.

    At rest the energy change is not 0 but constant: the solve takes away what gravity gave.
    """
    jumps = np.diff(np.asarray(changes, dtype=np.float64)[SETTLED:])
    return float(np.sqrt(np.mean(jumps**2))) if len(jumps) else math.nan


def _roughnesses(results: list[Result]) -> str:
    figures = ", ".join(f"{NAMES[r.request.method]} {number(_roughness(r), 'J')}" for r in results)
    return f"rms jump of the energy change from step to step: {figures}"


def _stack(comparison: Comparison) -> list[Claim]:
    biased = _paper(comparison, "pj", "tj")
    soft = _paper(comparison, "pjsoft", "tjsoft")
    stepwise = _paper(comparison, "pj", "pjnj", "pjsoft")
    last = f"of {comparison.frames} frames"
    falls = [r.collapsed_at is not None and r.collapsed_at > FALL for r in biased]
    early = any(r.collapsed_at is not None and r.collapsed_at <= FALL for r in biased)
    jitter = {r.request.method: _roughness(r) for r in biased + soft + stepwise}
    return [
        _decide(
            comparison,
            f"PJ and TJ stand for {FALL} frames and fall afterwards",
            len(biased) == 2 and (early or comparison.frames > FALL),
            all(falls),
            "; ".join(map(_fate, biased)) + f"; {last}",
            _SIZES,
        ),
        _decide(
            comparison,
            "PJNJ jitters: its energy jumps more than PJ's and PJSoft's, which take the same steps",
            len(stepwise) == 3,
            jitter.get("pjnj", 0.0) > max(jitter.get("pj", math.inf), jitter.get("pjsoft", math.inf)),
            _roughnesses(stepwise),
            _NONLINEAR,
        ),
        _decide(
            comparison,
            "PJSoft and TJSoft stay standing",
            len(soft) == 2,
            all(r.collapsed_at is None for r in soft),
            "; ".join(map(_fate, soft)) + f"; {last}",
            _SIZES,
        ),
        _decide(
            comparison,
            "soft constraints disturb the energy less than Baumgarte's bias: PJSoft less than PJ, TJSoft less than TJ",
            len(biased) == len(soft) == 2,
            jitter.get("pjsoft", math.inf) < jitter.get("pj", 0)
            and jitter.get("tjsoft", math.inf) < jitter.get("tj", 0),
            _roughnesses(biased + soft),
            _STIFF,
        ),
    ]


def _chain(comparison: Comparison, scene: Scene) -> list[Claim]:
    limit = joint_limit(scene)
    parted = []
    for methods, claim, apart in (
        (("pj", "pjnj", "pjsoft"), "without substeps every method fails: the joints come apart", True),
        (("tj", "tjsoft"), "with substeps the joints hold", False),
    ):
        results = _paper(comparison, *methods)
        fails = [not r.summary["finite"] or not r.number(JOINT_ERROR.key) <= limit for r in results]
        evidence = ", ".join(f"{NAMES[r.request.method]} {number(r.number(JOINT_ERROR.key), 'm')}" for r in results)
        parted.append(
            _decide(
                comparison,
                claim,
                len(results) == len(methods),
                all(f == apart for f in fails),
                f"worst anchor gap: {evidence}",
                _GAP,
            )
        )
    return parted


def _overlap(comparison: Comparison) -> list[Claim]:
    runs = {r.request.method: r for r in _paper(comparison, *METHODS)}
    speed = {method: r.number(SEPARATION_SPEED.key) for method, r in runs.items()}

    def said(*methods: str) -> str:
        return "peak speed of separation: " + ", ".join(
            f"{NAMES[m]} {number(speed[m], 'm/s')}" for m in methods if m in speed
        )

    found = []
    for slow, fast, claim in (
        ("pjsoft", "pj", "PJ overshoots, PJSoft parts the boxes more slowly"),
        ("tjsoft", "tj", "with substeps too, soft constraints part them more slowly"),
        ("tj", "pj", "substeps ease the overshoot of Baumgarte's bias"),
    ):
        found.append(
            _decide(
                comparison,
                claim,
                slow in speed and fast in speed,
                speed.get(slow, 0.0) < speed.get(fast, 0.0),
                said(slow, fast),
                _HARDER if slow == "tj" else _STIFF if slow == "pjsoft" else _SIZES,
            )
        )
    known = {m: _residuals(r) for m, r in runs.items()}
    rates = {m: known[m]["residual_rate"] for m in ("pj", "pjnj", "pjsoft") if "residual_rate" in known.get(m, {})}
    even = bool(rates) and max(rates.values()) <= 1.5 * min(rates.values())
    found.append(
        _decide(
            comparison,
            "without substeps the residual falls at much the same rate (within half) for every method",
            len(rates) == 3,
            even,
            "decades in a hundred iterations: " + ", ".join(f"{NAMES[m]} {100 * r:.2g}" for m, r in rates.items()),
            _RESIDUAL,
            "Figure 8",
        )
    )
    jumps = {
        m: (int(known[m]["residual_jumps"]), int(known[m]["residual_starts"]))
        for m in ("tj", "tjsoft")
        if "residual_jumps" in known.get(m, {})
    }
    found.append(
        _decide(
            comparison,
            "with substeps the residual jumps up where a substep begins",
            len(jumps) == 2,
            all(up == of for up, of in jumps.values()),
            ", ".join(f"{NAMES[m]}: up at {up} of {of} starts" for m, (up, of) in jumps.items()),
            _RESIDUAL,
            "Figure 8",
        )
    )
    return found


def _residuals(result: Result) -> Mapping[str, float]:
    """`derived`, from the summary where it is kept there."""
    kept = {key: result.number(key) for key in ("residual_rate", "residual_jumps", "residual_starts")}
    kept = {key: value for key, value in kept.items() if math.isfinite(value)}
    return kept if kept or result.recording is None else derived(result.recording)


def _errors(results: list[Result], key: str, unit: str) -> str:
    return ", ".join(f"{NAMES[r.request.method]} {number(r.number(key), unit)}" for r in results)


def _joints(comparison: Comparison, scene: Scene) -> list[Claim]:
    results, limit = _paper(comparison, *METHODS), 0.01 * float(scene.settings["arm"])
    return [
        _decide(
            comparison,
            "ball, hinge, slider and fixed joints hold what they lock (here: to a hundredth of the arm)",
            len(results) == len(METHODS),
            all(r.number(JOINT_ERROR.key) <= limit for r in results),
            f"worst anchor gap: {_errors(results, JOINT_ERROR.key, 'm')}; limit {number(limit, 'm')}",
            _PICTURES,
        )
    ]


def _crank(comparison: Comparison, scene: Scene) -> list[Claim]:
    results, limit = _paper(comparison, *METHODS), 0.02 * float(scene.settings["crank_length"])
    return [
        _decide(
            comparison,
            "the crank drives the piston to and fro (here: as the closed formula has it, to a fiftieth of the crank)",
            len(results) == len(METHODS),
            all(r.number("error") <= limit for r in results),
            f"worst distance of the piston: {_errors(results, 'error', 'm')}; limit {number(limit, 'm')}",
            _PICTURES,
        )
    ]


def _bridge(comparison: Comparison) -> list[Claim]:
    results = _paper(comparison, *METHODS)
    gap = {r.request.method: r.number(JOINT_ERROR.key) for r in results}
    complete = len(gap) == len(METHODS) and all(math.isfinite(value) for value in gap.values())
    evidence = f"worst anchor gap: {_errors(results, JOINT_ERROR.key, 'm')}"
    others = [gap[m] for m in ("pj", "pjsoft", "tj", "tjsoft") if m in gap]
    better = [gap.get(m, math.inf) < gap.get("pj", 0.0) for m in ("pjsoft", "tj", "tjsoft")]
    return [
        _decide(
            comparison,
            "PJNJ hardly holds the bridge's joints",
            complete,
            gap.get("pjnj", 0) > max(others, default=0),
            evidence,
            _NONLINEAR,
        ),
        _decide(
            comparison,
            "soft constraints and substeps each hold the joints better than PJ",
            complete,
            all(better),
            evidence,
            _PICTURES,
        ),
    ]


def _windmill(comparison: Comparison) -> list[Claim]:
    results = _paper(comparison, *METHODS)
    speed = {r.request.method: r.number("max_speed_m_s") for r in results}
    complete = len(speed) == len(METHODS) and all(math.isfinite(value) for value in speed.values())
    slower = [speed.get(m, math.inf) < speed.get("pj", 0.0) for m in ("pjsoft", "tj", "tjsoft")]
    return [
        _decide(
            comparison,
            "soft constraints and substeps each keep the force of the blow down: slower blocks than PJ's",
            complete,
            all(slower),
            f"fastest body: {_errors(results, 'max_speed_m_s', 'm/s')}",
            _PICTURES,
        )
    ]


def _rate(trace: Array) -> float:
    """Decades an iteration that a residual falls by, from its first to its last that is above rounding."""
    usable = np.flatnonzero(np.isfinite(trace) & (trace > 1e-6 * trace[0]))
    if len(usable) < 2:
        return math.nan
    first, last = usable[0], usable[-1]
    return float(np.log10(trace[first] / trace[last]) / (last - first))


def _jumps(trace: Array, substeps: int) -> tuple[int, int]:
    """(substeps after the first at whose start the residual grew, all of those)."""
    each = len(trace) // substeps
    starts = np.arange(1, substeps) * each
    return int(np.sum(trace[starts] > trace[starts - 1])), len(starts)


def _timing(comparison: Comparison) -> Claim:
    results = _paper(comparison, *METHODS)
    times = {r.request.method: r.number("solver_ms_median") for r in results}
    empty = [NAMES[r.request.method] for r in results if comparison.scattered(r)]
    complete = len(times) == len(METHODS) and all(math.isfinite(t) for t in times.values()) and not empty
    ordered = (
        complete
        and times["pjnj"] == max(times.values())
        and min(times["tj"], times["tjsoft"]) > max(times["pj"], times["pjsoft"])
    )
    listed = ", ".join(f"{NAMES[m]} {t:.3g} ms" for m, t in sorted(times.items(), key=lambda kv: kv[1]))
    gone = f"; {', '.join(empty)} had little left to solve" if empty else ""
    return _decide(
        comparison,
        "PJ and PJSoft are the quickest, TJ and TJSoft a little slower, PJNJ the slowest",
        complete,
        ordered,
        f"solver time of a step: {listed}{gone}",
        _TIMES,
        "Table 2",
    )
