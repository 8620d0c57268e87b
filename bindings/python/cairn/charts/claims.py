"""The paper's claims about its figures, each put to our own runs with the paper's preset.

Every answer is computed from the recordings; none is written down beforehand.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..scenes.model import Array, Scene
from .frames import ENERGY_CHANGE
from .result import METHODS, NAMES, Comparison, Result
from .verdict import JOINT_ERROR, SEPARATION_SPEED, joint_limit, number

SETTLED = 60  # frames that a pile takes to settle, left out where steadiness is judged
FALL = 2000  # the frame after which the paper's PJ and TJ fall

YES, NO, UNKNOWN = "yes", "no", "cannot tell"


@dataclass(frozen=True)
class Claim:
    scene: str
    claim: str  # what the paper says
    answer: str  # YES, NO or UNKNOWN
    evidence: str  # our figures


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
        found.append(_timing(comparison))
    return found


def _paper(comparison: Comparison, *methods: str) -> list[Result]:
    """The runs with the paper's preset, those that gave a recording."""
    found = (comparison.find(method, "paper") for method in methods)
    return [result for result in found if result is not None and result.recording is not None]


def _decide(comparison: Comparison, claim: str, complete: bool, holds: bool, evidence: str) -> Claim:
    return Claim(comparison.scene, claim, (YES if holds else NO) if complete else UNKNOWN, evidence)


def _fate(result: Result) -> str:
    name, fallen = NAMES[result.request.method], result.collapsed_at
    return f"{name} {'stands to the end' if fallen is None else f'falls at frame {fallen}'}"


def _roughness(result: Result) -> float:
    """J, how much the energy change of a step differs from the one before: root mean square, once settled.

    At rest the energy change is not 0 but constant: the solve takes away what gravity gave.
    """
    jumps = np.diff(np.asarray(result.series(ENERGY_CHANGE.key), dtype=np.float64)[SETTLED:])
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
        ),
        _decide(
            comparison,
            "PJNJ jitters: its energy jumps more than PJ's and PJSoft's, which take the same steps",
            len(stepwise) == 3,
            jitter.get("pjnj", 0.0) > max(jitter.get("pj", math.inf), jitter.get("pjsoft", math.inf)),
            _roughnesses(stepwise),
        ),
        _decide(
            comparison,
            "PJSoft and TJSoft stay standing",
            len(soft) == 2,
            all(r.collapsed_at is None for r in soft),
            "; ".join(map(_fate, soft)) + f"; {last}",
        ),
        _decide(
            comparison,
            "soft constraints disturb the energy less than Baumgarte's bias: PJSoft less than PJ, TJSoft less than TJ",
            len(biased) == len(soft) == 2,
            jitter.get("pjsoft", math.inf) < jitter.get("pj", 0)
            and jitter.get("tjsoft", math.inf) < jitter.get("tj", 0),
            _roughnesses(biased + soft),
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
            )
        )
    traces = {m: np.asarray(r.recording.residual_trace) for m, r in runs.items() if r.recording is not None}
    rates = {m: _rate(traces[m]) for m in ("pj", "pjnj", "pjsoft") if m in traces and len(traces[m])}
    even = bool(rates) and max(rates.values()) <= 1.5 * min(rates.values())
    found.append(
        _decide(
            comparison,
            "without substeps the residual falls at much the same rate (within half) for every method",
            len(rates) == 3,
            even,
            "decades in a hundred iterations: " + ", ".join(f"{NAMES[m]} {100 * r:.2g}" for m, r in rates.items()),
        )
    )
    jumps = {m: _jumps(traces[m], runs[m].request.substeps) for m in ("tj", "tjsoft") if m in traces and len(traces[m])}
    found.append(
        _decide(
            comparison,
            "with substeps the residual jumps up where a substep begins",
            len(jumps) == 2,
            all(up == of for up, of in jumps.values()),
            ", ".join(f"{NAMES[m]}: up at {up} of {of} starts" for m, (up, of) in jumps.items()),
        )
    )
    return found


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
    )
