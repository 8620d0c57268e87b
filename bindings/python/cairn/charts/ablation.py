"""Ablations: one option of the solver changed at a time; what it does to each scene's error and to a step's time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.patches import Rectangle

from . import style
from .drawn import Drawn, drawn
from .error_time import FLOOR
from .result import Result

WORSE, BETTER, EVEN = (0.91, 0.55, 0.42), (0.42, 0.74, 0.62), (0.93, 0.93, 0.92)  # colours of the cells
_TEXT = "#16191c"  # on the cells' own colours, which stay the same in the dark
_FULL = 2.0  # decades of error from which on a cell has its full colour


@dataclass(frozen=True)
class Ablation:
    """Options in rows, scenes in columns. `base`: the unchanged run of each scene; `changed`: those of each option."""

    name: str  # of the files
    title: str
    scenes: Sequence[str]
    base: Mapping[str, Result]
    changed: Mapping[str, Mapping[str, Result]]  # by option, then by scene; a scene may be missing
    notes: Sequence[str]


@dataclass(frozen=True)
class Effect:
    """error, time: the changed run's over the unchanged one's; NaN where it cannot be told. fails: the changed run."""

    error: float
    time: float
    fails: bool
    base_fails: bool

    @property
    def text(self) -> str:
        if self.base_fails and self.fails:
            return "both fail"
        if self.fails:
            return "fails"
        error = "holds" if self.base_fails else f"×{_short(self.error)}"
        return error + (f"\nt {_short(self.time)}" if math.isfinite(self.time) else "")

    @property
    def colour(self) -> str:
        if self.fails:
            share = 0.0 if self.base_fails else 1.0
        elif self.base_fails:
            share = -1.0
        else:
            share = max(-1.0, min(1.0, math.log10(self.error) / _FULL)) if math.isfinite(self.error) else 0.0
        end = WORSE if share > 0 else BETTER
        red, green, blue = (even + abs(share) * (other - even) for even, other in zip(EVEN, end))
        return to_hex((red, green, blue))


def _short(ratio: float) -> str:
    if not math.isfinite(ratio):
        return "–"
    if ratio >= 1000 or ratio < 0.001:
        return f"1e{round(math.log10(ratio))}"
    return f"{ratio:.2g}" if ratio < 100 else f"{ratio:.0f}"


def effect(base: Result, changed: Result) -> Effect:
    """What the change does. Errors below FLOOR are all alike."""
    errors = [max(r.number("error"), FLOOR) if math.isfinite(r.number("error")) else math.nan for r in (changed, base)]
    times = [r.number("solver_ms_median") for r in (changed, base)]
    fails = [r.failed or not math.isfinite(e) for r, e in zip((changed, base), errors)]
    comparable = not any(fails)
    return Effect(errors[0] / errors[1] if comparable else math.nan, times[0] / times[1], *fails)


def summary(shown: Ablation) -> list[str]:
    """The options without which most is lost, and those without which nothing is, in sentences."""
    worst: dict[str, float] = {}
    for option, results in shown.changed.items():
        effects = [effect(shown.base[scene], result) for scene, result in results.items()]
        losses = [math.inf if e.fails and not e.base_fails else e.error for e in effects]
        worst[option] = max((loss for loss in losses if not math.isnan(loss)), default=math.nan)
    fatal = [option for option, loss in worst.items() if math.isinf(loss)]
    costly = [f"{option} (×{_short(loss)})" for option, loss in worst.items() if 2 <= loss < math.inf]
    idle = [option for option, loss in worst.items() if loss < 1.1]
    sentences = []
    if fatal:
        sentences.append("Makes a scene fail that stands: " + "; ".join(fatal) + ".")
    if costly:
        sentences.append("Worst growth of an error by 2 or more: " + "; ".join(costly) + ".")
    if idle:
        sentences.append("No error grows by a tenth: " + "; ".join(idle) + ".")
    return sentences


def ablation(shown: Ablation, footnote: str = "") -> Drawn:
    """A table of cells: error over the unchanged run's, and time likewise; red is worse, green better."""
    options = list(shown.changed)
    with style.figure(0.42 * len(options) + 2.2) as drawing:
        panel = drawing.subplots()
        rows: list[Sequence[object]] = [
            ("option", "scene", "error_ratio", "time_ratio", "error", "base_error", "fails", "base_fails")
        ]
        for row, option in enumerate(options):
            for column, scene in enumerate(shown.scenes):
                result = shown.changed[option].get(scene)
                if result is None:
                    continue
                found = effect(shown.base[scene], result)
                _cell(panel, column, row, found)
                numbers = (found.error, found.time, result.number("error"), shown.base[scene].number("error"))
                figures = [f"{n:.6g}" if math.isfinite(n) else "" for n in numbers]
                rows.append((option, scene, *figures, int(found.fails), int(found.base_fails)))
        panel.set_xlim(-0.5, len(shown.scenes) - 0.5)
        panel.set_ylim(len(options) - 0.5, -0.5)
        panel.set_xticks(range(len(shown.scenes)), shown.scenes)
        panel.set_yticks(range(len(options)), options)
        panel.xaxis.tick_top()
        panel.tick_params(length=0)
        panel.grid(False)
        for spine in panel.spines.values():
            spine.set_visible(False)
        return drawn(drawing, shown.name, shown.title, rows, [*summary(shown), *shown.notes], footnote)


def _cell(panel: Axes, column: int, row: int, found: Effect) -> None:
    panel.add_patch(Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, facecolor=found.colour, lw=0))
    panel.text(column, row, found.text, ha="center", va="center", fontsize=7.5, color=_TEXT, linespacing=1.1)
