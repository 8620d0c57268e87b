"""What an accuracy costs: a scene's error against the solver's time, every method on one chart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from adjustText import adjust_text  # type: ignore[import-untyped]
from matplotlib.axes import Axes
from matplotlib.text import Text

from . import style
from .result import NAMES, Comparison, Measured, Result

FLOOR = 1e-7  # m or m/s: errors below are drawn there


@dataclass(frozen=True)
class Point:
    result: Result
    milliseconds: float
    error: float | None  # None: the run failed

    @property
    def height(self) -> float:
        """Where it is drawn; what is below FLOOR counts as none."""
        return max(self.error or 0.0, FLOOR)


def points(comparison: Comparison, quantity: Measured) -> list[Point]:
    """Every run with a time; what never gave one (it could not start) has no place on the chart and is left out."""
    found = []
    for result in comparison.results:
        milliseconds = result.number("solver_ms_median")
        if not (math.isfinite(milliseconds) and milliseconds > 0):
            continue
        error = result.number(quantity.key)
        stands = not result.failed and math.isfinite(error)
        found.append(Point(result, milliseconds, error if stands else None))
    return found


def pareto(found: Sequence[Point]) -> list[Point]:
    """The points that no other beats in both time and error, quickest first."""
    front: list[Point] = []
    for point in sorted((p for p in found if p.error is not None), key=lambda p: (p.milliseconds, p.error)):
        if not front or (point.error or 0.0) < (front[-1].error or 0.0):
            front.append(point)
    return front


def error_against_time(
    comparison: Comparison, quantity: Measured, footnote: str = "", limit: tuple[float, str] | None = None
) -> str:
    """Log-log: down is more accurate, left is quicker. Filled marks are the default preset, hollow ones the paper's.

    Runs of one method and preset are joined by a line; each mark says its iterations, `substeps x iterations` where
    there are substeps. The dark line is the Pareto front. Failed runs stand at the top edge as crosses. limit: an error
    to draw a line at, and what it means.
    """
    found = points(comparison, quantity)
    front = pareto(found)
    with style.figure(6.0) as drawing:
        panel = drawing.subplots()
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlabel("solver time of a step, median [ms]")
        panel.set_ylabel(quantity.axis)
        top = top_of([p.height for p in found if p.error is not None])
        texts = [text for group in _groups(found) for text in _draw(panel, group, top)]
        panel.step([p.milliseconds for p in front], [p.height for p in front], where="post", color=style.INK, lw=1.1,
                   alpha=0.55, zorder=1)  # fmt: skip
        if any(p.error is None for p in found):
            line_at(panel, top, "failed", "--")
        if limit is not None:
            line_at(panel, *limit, ":")
        panel.margins(x=0.1, y=0.08)
        style.layout(drawing)
        thread = {"arrowstyle": "-", "color": style.INK, "lw": 0.4, "alpha": 0.5}
        x, y = [p.milliseconds for p in found], [top if p.error is None else p.height for p in found]
        adjust_text(texts, x, y, ax=panel, expand=(1.25, 1.5), arrowprops=thread)
        return style.svg(drawing, f"{quantity.title} against solver time, {comparison.scene}", footnote)


def top_of(heights: Sequence[float]) -> float:
    """Where failed runs stand: above the highest that did not, by an eighth of the range."""
    if not heights:
        return 1.0
    decades = max(1.0, math.log10(max(heights) / min(heights)))
    return float(max(heights) * 10 ** (decades / 8))


def line_at(panel: Axes, height: float, text: str, dashes: str) -> None:
    panel.axhline(height, color=style.INK, lw=0.8, ls=dashes, alpha=0.6)
    panel.annotate(text, (0, height), xycoords=("axes fraction", "data"), xytext=(4, 3), textcoords="offset points",
                   fontsize=8.5)  # fmt: skip


def _draw(panel: Axes, group: Sequence[Point], top: float) -> list[Text]:
    """The marks of one method and preset, joined; returns their labels, yet to be moved apart."""
    first = group[0].result.request
    colour, marker = style.COLOURS[first.method], style.MARKERS[first.method]
    filled = first.preset != "paper"
    standing = [p for p in group if p.error is not None]
    panel.plot([p.milliseconds for p in standing], [p.height for p in standing], color=colour, lw=1.0, alpha=0.6)
    texts = []
    for point in group:
        request = point.result.request
        y = top if point.error is None else point.height
        if point.error is None:
            panel.plot(point.milliseconds, y, "x", ms=9, mew=2, color=colour, zorder=4)
        else:
            face = colour if filled else style.PAPER
            panel.plot(point.milliseconds, y, marker, ms=8, mfc=face, mec=colour, mew=1.6, zorder=3)
        name = f"{NAMES[request.method]} {request.settings}" if point is group[0] else request.settings
        texts.append(panel.text(point.milliseconds, y, name, fontsize=8, zorder=5))
    return texts


def _groups(found: Sequence[Point]) -> list[list[Point]]:
    """Points of one method and preset together, quickest first."""
    groups: dict[tuple[str, str | None], list[Point]] = {}
    for point in found:
        request = point.result.request
        groups.setdefault((request.method, request.preset), []).append(point)
    return [sorted(group, key=lambda p: p.milliseconds) for group in groups.values()]
