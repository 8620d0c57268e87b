"""Performance profiles (Dolan and Moré, 2002): in what share of the scenes is a method within a factor of the best?

For each scene s and solver i let t(s, i) be the least time in which i meets the tolerance, infinite if it never does,
and r(s, i) = t(s, i) / min over i of t(s, i). The profile of i is the share of all scenes with r(s, i) <= tau.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from . import style
from .drawn import Drawn, drawn
from .result import Comparison, family_name

Costs = Mapping[str, Sequence[float]]  # solver: its least time in each problem, infinite where it has none

TOLERANCES = (1e-1, 1e-2, 1e-3)  # of a scene's scale


def ratios(costs: Costs) -> dict[str, list[float]]:
    """r(s, i) by solver; infinite where the solver has no time, and in a problem that none solves."""
    problems = range(max((len(times) for times in costs.values()), default=0))
    best = [min(times[s] for times in costs.values()) for s in problems]
    return {
        name: [t / b if math.isfinite(t) and b > 0 else math.inf for t, b in zip(times, best)]
        for name, times in costs.items()
    }


def profile(costs: Costs) -> dict[str, list[tuple[float, float]]]:
    """The steps of each solver's profile: (tau, share of all problems within tau), tau rising; none if it solves none.

    Problems that no solver solves count in the share.
    """
    steps: dict[str, list[tuple[float, float]]] = {}
    for name, found in ratios(costs).items():
        solved = sorted(r for r in found if math.isfinite(r))
        steps[name] = [(tau, sum(r <= tau for r in solved) / len(found)) for tau in dict.fromkeys(solved)]
    return steps


def costs(comparisons: Sequence[Comparison], scales: Mapping[str, float], tolerance: float) -> dict[str, list[float]]:
    """The least solver time (ms) of each method and preset whose error is at most tolerance x the scene's scale.

    A run that failed meets no tolerance. Errors stand in the summaries under "error".
    """
    found: dict[str, list[float]] = {}
    for place, comparison in enumerate(comparisons):
        for result in comparison.results:
            times = found.setdefault(result.request.family, [math.inf] * len(comparisons))
            error, milliseconds = result.number("error"), result.number("solver_ms_median")
            if not result.failed and error <= tolerance * scales[comparison.scene] and milliseconds > 0:
                times[place] = min(times[place], milliseconds)
    return found


def profiles(
    comparisons: Sequence[Comparison], scales: Mapping[str, tuple[float, str]], frames: str, footnote: str = ""
) -> Drawn:
    """A panel a tolerance. scales: of each scene, with what it is. frames: how many were used, in words."""
    sizes = {scene: value for scene, (value, _) in scales.items()}
    names = list(dict.fromkeys((r.request.method, r.request.preset) for c in comparisons for r in c.results))
    heading = ["tolerance", "solver", *(f"{c.scene}_ms" for c in comparisons)]
    rows: list[Sequence[object]] = [heading]
    notes = []
    with style.figure(5.6) as drawing:
        axes = drawing.subplots(1, len(TOLERANCES), sharey=True, squeeze=False)[0]
        for panel, tolerance in zip(axes, TOLERANCES):
            table = costs(comparisons, sizes, tolerance)
            rows += [[f"{tolerance:g}", name, *(f"{t:.6g}" for t in times)] for name, times in table.items()]
            steps = profile(table)
            last = max((tau for curve in steps.values() for tau, _ in curve), default=1.0)
            end = max(10.0, last * 1.5)
            for method, preset in names:
                name = family_name(method, preset)
                curve = steps.get(name, [])
                if not curve:
                    continue
                shares = [share for _, share in curve]
                panel.step(
                    [1.0, *(tau for tau, _ in curve), end], [0.0, *shares, shares[-1]], where="post",
                    color=style.COLOURS[method], lw=1.2 if preset == "paper" else 1.8, label=name,
                    ls=(0, (1, 1.2)) if preset == "paper" else "--" if method == "stock-substeps" else "-",
                )  # fmt: skip
            panel.set_xscale("log")
            panel.set_xlim(1.0, end)
            panel.set_ylim(0.0, 1.02)
            panel.set_title(f"error at most {tolerance:g} of its scale", fontsize=9.5)
            panel.set_xlabel("τ: time ÷ the best time")
            notes += _words(table, comparisons, tolerance)
        axes[0].set_ylabel(f"share of {len(comparisons)} scenes within τ")
        handles: dict[str, Any] = {}
        for panel in axes:
            for handle, label in zip(*panel.get_legend_handles_labels()):
                handles.setdefault(label, handle)
        if handles:
            order = [family_name(m, p) for m, p in names]
            shown = [name for name in order if name in handles]
            drawing.legend(handles=[handles[n] for n in shown], labels=shown, loc="outside upper left",
                           ncols=5, fontsize=8.5)  # fmt: skip
        kinds = ", ".join(dict.fromkeys(what for _, what in scales.values()))
        notes.append(f"A scene's scale: {kinds}. Each solver with the quickest of its settings that meets it. {frames}")
        return drawn(drawing, "profiles", "Performance profiles over all scenes", rows, notes, footnote)


def _words(table: Costs, comparisons: Sequence[Comparison], tolerance: float) -> list[str]:
    """Who solves most and who is quickest most often, and what none solves."""
    if not table:
        return []
    found = ratios(table)
    solved = {name: sum(math.isfinite(r) for r in values) for name, values in found.items()}
    wins = {name: sum(r == 1.0 for r in values) for name, values in found.items()}
    most, quickest = max(solved.values()), max(wins.values())
    none = [
        c.scene for place, c in enumerate(comparisons) if all(math.isinf(values[place]) for values in found.values())
    ]
    text = (
        f"At {tolerance:g}: most scenes, {most} of {len(comparisons)}, by {_best(solved, most)}; "
        f"quickest most often, in {quickest}, {_best(wins, quickest)}"
    )
    return [text + (f"; met by none: {', '.join(none)}." if none else ".")]


def _best(counts: Mapping[str, int], most: int) -> str:
    return "; ".join(name for name, count in counts.items() if count == most) if most else "none"
