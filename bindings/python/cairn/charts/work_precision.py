"""Work against precision: a scene's error against the solver's time for every setting of every method."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from adjustText import adjust_text  # type: ignore[import-untyped]
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from ..bullet import STOCK_METHODS
from . import style
from .drawn import Drawn, drawn
from .error_time import FLOOR, Point, line_at, pareto, points, top_of
from .result import NAMES, Comparison, Measured, Request, Result, family_name

HEADING = (
    "scene",
    "method",
    "preset",
    "iterations",
    "substeps",
    "solver_ms",
    "error",
    "unit",
    "failed",
    "pareto",
    "tolerance",
)


def beats(one: Point, other: Point) -> bool:
    """Whether one is no worse in time and error, and better in one of them; a run that failed beats none."""
    if one.error is None:
        return False
    if other.error is None:
        return one.milliseconds <= other.milliseconds
    no_worse = one.milliseconds <= other.milliseconds and one.error <= other.error
    return no_worse and (one.milliseconds, one.error) != (other.milliseconds, other.error)


def standing(found: Sequence[Point]) -> list[str]:
    """How each method stands beside Bullet's own, in sentences: who is on the front, and who loses at every setting."""
    front = pareto(found)
    stock = [p for p in found if p.result.request.method in STOCK_METHODS]
    ours: dict[str, list[Point]] = {}
    for point in found:
        if point.result.request.method not in STOCK_METHODS:
            ours.setdefault(point.result.request.family, []).append(point)
    on_front = dict.fromkeys(p.result.request.family for p in front)
    sentences = ["On the Pareto front: " + ("; ".join(on_front) if on_front else "none, for no run stands") + "."]
    failed = [name for name, group in ours.items() if all(p.error is None for p in group)]
    losing = [
        name
        for name, group in ours.items()
        if name not in failed and all(p.error is None or any(beats(s, p) for s in stock) for p in group)
    ]
    if losing:
        sentences.append("Lose to one of Bullet's own at every setting: " + "; ".join(losing) + ".")
    if failed:
        sentences.append("Fail at every setting: " + "; ".join(failed) + ".")
    if front and all(p.result.request.method in STOCK_METHODS for p in front):
        sentences.append("Bullet's own are ahead throughout.")
    return sentences


def work_precision(comparison: Comparison, quantity: Measured, sizes: Mapping[str, float], footnote: str = "") -> Drawn:
    """Log-log: down is more accurate, left is quicker. Filled marks: default preset; hollow: the paper's.

    The settings of a method, preset and number of substeps are joined; those on the Pareto front are named.
    """
    raw = points(comparison, quantity)
    # Errors below the floor are all alike: none of them beats another.
    found = [p if p.error is None else replace(p, error=p.height) for p in raw]
    front = pareto(found)
    with style.figure(6.6) as drawing:
        panel = drawing.subplots()
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlabel("solver time of a step, median [ms]")
        panel.set_ylabel(quantity.axis)
        size = ", ".join(f"{name} {value:g}" for name, value in sizes.items())
        frames = f"{comparison.frames} frames"
        panel.set_title(f"{comparison.scene}: {frames}" + (f"; {size}" if size else ""), fontsize=9.5)
        top = top_of([p.height for p in found if p.error is not None])
        _draw(panel, found, top)
        panel.step([p.milliseconds for p in front], [p.height for p in front], where="post", color=style.INK, lw=1.3,
                   alpha=0.7, zorder=1)  # fmt: skip
        if any(p.error is None for p in found):
            line_at(panel, top, "", "--")
            panel.annotate("failed: fell, flew, or not finite", (1, top), xycoords=("axes fraction", "data"),
                           xytext=(-4, 8), textcoords="offset points", ha="right", fontsize=8.5)  # fmt: skip
        _legend(panel, found)
        panel.margins(x=0.08, y=0.08)
        style.layout(drawing)
        _ticks(panel)
        texts = [panel.text(p.milliseconds, p.height, _name(p.result.request),
                            fontsize=8, zorder=5) for p in front]  # fmt: skip
        if texts:
            thread = {"arrowstyle": "-", "color": style.INK, "lw": 0.4, "alpha": 0.5}
            x, y = [p.milliseconds for p in found], [top if p.error is None else p.height for p in found]
            adjust_text(texts, x, y, ax=panel, expand=(1.25, 1.5), arrowprops=thread)
        notes = [*standing(found), *_missing(comparison.results, found)]
        if any(p.error is not None and p.error < FLOOR for p in raw):
            notes.append(f"Errors below {FLOOR:g} are drawn there, and count as alike.")
        title = f"{comparison.scene}: {quantity.title} against solver time"
        rows = [HEADING, *(_row(result, quantity, front, found) for result in comparison.results)]
        return drawn(drawing, f"work-precision-{comparison.scene}", title, rows, notes, footnote)


def _name(request: Request) -> str:
    """As Request.label, but the default preset goes without saying."""
    return f"{NAMES[request.method]} {request.settings}" + (", paper" if request.preset == "paper" else "")


def _ticks(panel: Axes) -> None:
    """Numbers at 1, 2 and 5 where the axis is too short for powers of ten alone."""
    low, high = panel.get_xlim()
    if high / low > 200:
        panel.xaxis.set_minor_formatter(NullFormatter())
        return
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    panel.xaxis.set_minor_locator(LogLocator(subs=range(2, 10)))
    panel.xaxis.set_minor_formatter(NullFormatter())


def _row(result: Result, quantity: Measured, front: Sequence[Point], found: Sequence[Point]) -> tuple[object, ...]:
    request = result.request
    error, milliseconds = result.number(quantity.key), result.number("solver_ms_median")
    stands = any(p.result is result and p.error is not None for p in found)
    return (
        *(request.scene, request.method, request.preset or "", request.iterations, request.substeps),
        f"{milliseconds:.6g}" if math.isfinite(milliseconds) else "",
        f"{error:.6g}" if math.isfinite(error) else "",
        quantity.unit,
        int(not stands),
        int(any(p.result is result for p in front)),
        dict(request.changes).get("tolerance", ""),
    )


def _missing(results: Sequence[Result], found: Sequence[Point]) -> list[str]:
    """Runs that have no place on the chart, and why."""
    shown = {id(p.result) for p in found}
    gone = [r for r in results if id(r) not in shown]
    slow = [r.request.label for r in gone if r.stopped]
    rest = [f"{r.request.label} ({r.error or 'not finite from the first frames on'})" for r in gone if not r.stopped]
    sentences = []
    if slow:
        sentences.append("Out of time, so not on the chart: " + "; ".join(slow) + ".")
    if rest:
        sentences.append("No result: " + "; ".join(rest) + ".")
    return sentences


def _draw(panel: Axes, found: Sequence[Point], top: float) -> None:
    groups: dict[tuple[str, str | None, int], list[Point]] = {}
    for point in found:
        request = point.result.request
        groups.setdefault((request.method, request.preset, request.substeps), []).append(point)
    for (method, preset, _), group in groups.items():
        colour, marker = style.COLOURS[method], style.MARKERS[method]
        face = style.PAPER if preset == "paper" else colour
        group.sort(key=lambda p: p.result.request.iterations)
        standing = [p for p in group if p.error is not None]
        panel.plot([p.milliseconds for p in standing], [p.height for p in standing], marker, ls="-", lw=0.9, alpha=0.9,
                   color=colour, ms=7, mfc=face, mec=colour, mew=1.4, zorder=3)  # fmt: skip
        fallen = [p.milliseconds for p in group if p.error is None]
        panel.plot(fallen, [top] * len(fallen), "x", ms=8, mew=1.8, color=colour, zorder=4)


def _legend(panel: Axes, found: Sequence[Point]) -> None:
    handles = []
    names = {(p.result.request.method, p.result.request.preset) for p in found}
    for method, preset in sorted(names, key=lambda name: (list(NAMES).index(name[0]), name[1] or "")):
        colour = style.COLOURS[method]
        face = style.PAPER if preset == "paper" else colour
        label = family_name(method, preset)
        handles += panel.plot([], [], style.MARKERS[method], color=colour, mfc=face, mec=colour, mew=1.4, label=label)
    if handles:
        panel.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8.5)
