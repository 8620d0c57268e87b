"""Quantities of every frame, as the paper's Figures 5 to 7: energy change and constraint error against the frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from . import style
from .result import METHODS, NAMES, PRESETS, Comparison, Measured, Result

ENERGY_CHANGE = Measured("kinetic_energy_change_J", "kinetic energy change of a step", "J")
PENETRATION = Measured("max_penetration_m", "worst penetration", "m")
JOINT_ERROR = Measured("max_joint_error_m", "worst anchor gap", "m")

FLOOR = 1e-6  # m or rad: below this an error is none, and is drawn there
_COLUMNS = 420  # buckets of a panel: more frames than that are drawn as the range of a bucket

Array = npt.NDArray[np.float64]


def buckets(values: npt.ArrayLike) -> tuple[Array, Array, Array]:
    """(frame, lowest, highest) of at most `_COLUMNS` equal runs of frames. What is not finite is left out."""
    array = np.asarray(values, dtype=np.float64)
    array = np.where(np.isfinite(array), array, np.nan)
    count = min(len(array), _COLUMNS)
    if count == 0:
        return array, array, array
    edges = np.linspace(0, len(array), count + 1).astype(int)
    pieces = [array[a:b] for a, b in zip(edges, edges[1:])]
    low = np.array([np.fmin.reduce(piece) for piece in pieces])
    high = np.array([np.fmax.reduce(piece) for piece in pieces])
    return (edges[:-1] + edges[1:] - 1) / 2 + 1.0, low, high


def _threshold(results: Sequence[Result], key: str) -> float:
    """Where a symlog axis turns linear: the tenth of the runs' median size, a power of ten."""
    sizes = [np.abs(np.asarray(result.series(key), dtype=np.float64)) for result in results]
    sizes = [s[np.isfinite(s) & (s > 0)] for s in sizes]
    medians = [float(np.median(s)) for s in sizes if len(s)]
    return 10.0 ** math.floor(math.log10(min(medians))) if medians else 1e-6


def energy_change(comparison: Comparison, footnote: str = "", frames: int | None = None) -> str:
    """A strip a method, a column a preset: what the solve changes of the kinetic energy, stock PGS in grey behind.

    Where frames outnumber pixels, the band runs from the lowest to the highest frame of each pixel. frames: the first
    so many are drawn; None for all.
    """
    shown = [result for preset in PRESETS for result in comparison.preset(preset)]
    stock = comparison.stock
    with style.figure(7.2) as drawing:
        axes = drawing.subplots(len(METHODS), len(PRESETS), sharex=True, sharey=True, squeeze=False)
        for row, method in enumerate(METHODS):
            for column, preset in enumerate(PRESETS):
                panel = axes[row, column]
                if stock is not None:
                    frame, low, high = buckets(stock.series(ENERGY_CHANGE.key)[:frames])
                    panel.fill_between(frame, low, high, color=style.COLOURS["stock"], alpha=0.45, lw=0.8)
                result = comparison.find(method, preset)
                title = f"{NAMES[method]}, {preset}"
                if result is None or result.recording is None:
                    panel.text(
                        0.5, 0.5, "did not run" if result is None else "failed", transform=panel.transAxes, ha="center"
                    )
                else:
                    frame, low, high = buckets(result.series(ENERGY_CHANGE.key)[:frames])
                    panel.fill_between(frame, low, high, color=style.COLOURS[method], alpha=0.9, lw=0.8)
                    _mark_collapse(panel, result)
                panel.set_title(title, fontsize=9.5, pad=2)
        axes[0, 0].set_yscale("symlog", linthresh=_threshold(shown, ENERGY_CHANGE.key), linscale=0.7)
        ticks = axes[0, 0].get_yticks()
        axes[0, 0].set_yticks(_thin(ticks))
        for column in range(len(PRESETS)):
            axes[-1, column].set_xlabel("frame")
        drawing.supylabel(ENERGY_CHANGE.axis, fontsize=10)
        return style.svg(drawing, f"{ENERGY_CHANGE.title} against frame, {comparison.scene}", footnote)


def _thin(ticks: Array) -> list[float]:
    """Every symlog tick is a power of ten: keep 0 and about two a side."""
    positive = sorted(t for t in ticks if t > 0)
    step = max(1, math.ceil(len(positive) / 2))
    kept = positive[::-1][::step]
    return [-t for t in kept] + [0.0] + kept[::-1]


def _mark_collapse(panel: Axes, result: Result) -> None:
    frame = result.collapsed_at
    if frame is not None:
        panel.axvline(frame, color=style.INK, lw=0.9, ls=":")
        panel.annotate(f"falls, frame {frame}", (frame, 0.98), xycoords=("data", "axes fraction"), xytext=(3, 0),
                       textcoords="offset points", va="top", fontsize=8)  # fmt: skip


def constraint_error(comparison: Comparison, quantity: Measured, footnote: str = "", frames: int | None = None) -> str:
    """The worst constraint error of every frame, a panel a preset, logarithmic from FLOOR up; stock PGS in grey.

    frames: the first so many are drawn; None for all.
    """
    stock = comparison.stock
    with style.figure(4.3) as drawing:
        axes = drawing.subplots(1, len(PRESETS), sharey=True, squeeze=False)[0]
        ends: dict[str, list[style.End]] = {preset: [] for preset in PRESETS}
        for panel, preset in zip(axes, PRESETS):
            panel.set_yscale("log", nonpositive="mask")
            panel.set_title(f"{preset} preset")
            panel.set_xlabel("frame")
            for result in ([stock] if stock is not None else []) + comparison.preset(preset):
                method = result.request.method
                frame, low, high = buckets(result.series(quantity.key)[:frames])
                colour = style.COLOURS[method]
                low, high = np.maximum(low, FLOOR), np.maximum(high, FLOOR)
                standing = frame <= (result.collapsed_at or np.inf)  # the rest is told faintly: it is no pile any more
                panel.fill_between(frame, low, high, where=standing, color=colour, alpha=0.25, lw=0)
                panel.plot(frame, high, color=colour, lw=0.5, alpha=0.35)
                panel.plot(frame[standing], high[standing], color=colour, lw=1.4, ls=style.DASHES[method])
                drawn = np.flatnonzero(np.isfinite(high))
                if len(drawn):
                    name = NAMES[method] + (" (fallen)" if result.collapsed_at is not None else "")
                    ends[preset].append((float(frame[drawn[-1]]), float(high[drawn[-1]]), name, colour))
            panel.margins(x=0.01)
        axes[0].set_ylabel(quantity.axis)
        style.layout(drawing)
        for panel, preset in zip(axes, PRESETS):
            style.label_ends(panel, ends[preset])
        return style.svg(drawing, f"{quantity.title} against frame, {comparison.scene}", footnote)
