"""The method auto beside the settings picked by hand: its time over that of the quickest with no more error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from . import style
from .drawn import Drawn, drawn
from .error_time import FLOOR
from .result import METHODS, Comparison, Result

NEAR = 1.5  # times the best: near the front


@dataclass(frozen=True)
class Beside:
    """A run of auto. ratio: its time over the best's; 0 if no setting's error is as small, infinite if it failed."""

    tolerance: float
    result: Result
    best: Result | None
    ratio: float


def _error(result: Result) -> float:
    error = result.number("error")
    return math.inf if result.failed or math.isnan(error) else max(error, FLOOR)


def beside(comparison: Comparison) -> list[Beside]:
    """The runs of auto, loosest tolerance first, each beside the five methods in all their settings and presets."""
    made = []
    timed = [r for r in comparison.results if r.number("solver_ms_median") > 0]
    for result in comparison.results:
        if result.request.method != "auto":
            continue
        error, time = _error(result), result.number("solver_ms_median")
        best = min(
            (r for r in timed if r.request.method in METHODS and math.isfinite(_error(r)) and _error(r) <= error),
            key=lambda r: r.number("solver_ms_median"),
            default=None,
        )
        if not math.isfinite(error) or not time > 0:
            ratio = math.inf
        else:
            ratio = time / best.number("solver_ms_median") if best else 0.0
        tolerance = float(dict(result.request.changes)["tolerance"])
        made.append(Beside(tolerance, result, best if math.isfinite(ratio) else None, ratio))
    return sorted(made, key=lambda one: -one.tolerance)


def typical(found: Sequence[Beside]) -> float:
    """The median of a scene's ratios; infinite if half of its runs fail."""
    return median(one.ratio for one in found)


def auto(comparisons: Sequence[Comparison], footnote: str = "") -> Drawn:
    """A row a scene, a mark a tolerance; scenes by their median."""
    table = [(c.scene, found) for c in comparisons if (found := beside(c))]
    table.sort(key=lambda row: (typical(row[1]), row[0]))
    tolerances = sorted({one.tolerance for _, found in table for one in found}, reverse=True)
    ratios = [one.ratio for _, found in table for one in found]
    real = [r for r in ratios if 0 < r < math.inf]
    low, high = min([0.5, *real]) / 1.6, max([3.0, *real]) * 1.6
    rows: list[Sequence[object]] = [("scene", "tolerance", "ms", "error", "best", "best_ms", "best_error", "ratio")]
    with style.figure(0.2 * len(table) + 2.4) as drawing:
        panel = drawing.subplots()
        panel.axvspan(low / 2, NEAR, color=style.INK, alpha=0.06, lw=0)
        panel.axvline(1.0, color=style.INK, lw=0.8, alpha=0.5)
        for place, tolerance in enumerate(tolerances):
            lift = 0.6 * ((place + 0.5) / len(tolerances) - 0.5)
            marks = [
                (min(max(one.ratio, low), high), row + lift, one.ratio)
                for row, (_, found) in enumerate(table)
                for one in found
                if one.tolerance == tolerance
            ]
            share = place / max(1, len(tolerances) - 1)
            for shape, here in (
                ("o", [m for m in marks if m[2] < math.inf]),
                ("x", [m for m in marks if m[2] == math.inf]),
            ):
                panel.plot(
                    [x for x, _, _ in here], [y for _, y, _ in here], shape, ms=5, color=style.COLOURS["auto"],
                    alpha=0.35 + 0.65 * share, mec=style.INK if shape == "o" else style.COLOURS["auto"],
                    mew=0.5 if shape == "o" else 1.5, label=f"{tolerance:g} m/s" if shape == "o" else None,
                )  # fmt: skip
        for scene, found in table:
            for one in found:
                best = ("", "", "") if one.best is None else (
                    one.best.request.label, f"{one.best.number('solver_ms_median'):.6g}", f"{_error(one.best):.6g}"
                )  # fmt: skip
                mine = (f"{one.result.number('solver_ms_median'):.6g}", f"{_error(one.result):.6g}")
                rows.append((scene, f"{one.tolerance:g}", *mine, *best, f"{one.ratio:.4g}"))
        panel.set_xscale("log")
        panel.set_xlim(low / 1.2, high * 1.2)
        panel.set_yticks(range(len(table)), [scene for scene, _ in table])
        panel.set_ylim(len(table) - 0.4, -0.6)
        panel.set_xlabel("solver time of auto ÷ that of the quickest setting with no more error")
        ticks = [t for t in (0.25, 0.5, 1, 1.5, 2, 3, 5, 10, 20, 50, 100) if low <= t <= high]
        panel.set_xticks(ticks, [f"{t:g}" for t in ticks])
        panel.set_xticks([], minor=True)
        panel.legend(title="tolerance", loc="lower left", fontsize=8)  # the last rows are those of runs that failed
        return drawn(drawing, "auto", "auto beside what is picked by hand", rows, summary(table, ratios), footnote)


def summary(table: Sequence[tuple[str, Sequence[Beside]]], ratios: Sequence[float]) -> list[str]:
    """In how many scenes it is near the best, and where it is not."""
    if not table:
        return []
    far = [f"{scene} (×{typical(found):.2g})" for scene, found in table if NEAR < typical(found) < math.inf]
    lost = [scene for scene, found in table if typical(found) == math.inf]
    near = len(table) - len(far) - len(lost)
    notes = [
        f"Within {NEAR:g} of the best by hand: {near} of {len(table)} scenes by the median over the tolerances, "
        f"{sum(r <= NEAR for r in ratios)} of {len(ratios)} runs. By hand: PJ, PJNJ, PJSoft, TJ and TJSoft."
    ]
    if far:
        notes.append("Farther: " + ", ".join(far) + ".")
    if lost:
        notes.append("Fails at half of the tolerances or more: " + ", ".join(lost) + ".")
    notes.append("At the left edge: no setting by hand is as accurate. A cross at the right edge: failed.")
    return notes


__all__ = ["NEAR", "Beside", "auto", "beside", "typical"]
