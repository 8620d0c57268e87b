"""Where a step's time goes, as the paper's Figure 9, and the timing table beside its Table 2."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from . import style
from .result import METHODS, NAMES, PRESETS, Comparison

# The paper's Table 2: ms of solver time a step, 300 iterations, RTX 3060 Laptop GPU.
PAPER_MACHINE = "RTX 3060 Laptop GPU"
PAPER_MS: Mapping[str, Mapping[str, float]] = {
    "stack": {"pj": 7.0932, "pjnj": 54.8251, "pjsoft": 7.6524, "tj": 10.3389, "tjsoft": 10.5033},
    "chain": {"pj": 7.2128, "pjnj": 53.6458, "pjsoft": 7.3764, "tj": 9.6413, "tjsoft": 9.3265},
    "overlap": {"pj": 6.8044, "pjnj": 45.2769, "pjsoft": 6.4190, "tj": 8.9208, "tjsoft": 7.8337},
}

# The stages of a step in the order in which they run, with the keys of Recording.stage_ms and a hatch for print.
STAGES = {
    "pack": ("#b0b0b0", ""),
    "build": ("#CC79A7", "//"),
    "sweep": ("#0072B2", ""),
    "position": ("#009E73", "xx"),
    "integrate": ("#F0E442", ".."),
    "finish": ("#6b6b6b", ""),
}


def time_split(comparisons: Sequence[Comparison], footnote: str = "") -> str:
    """Mean solver time of a step by stage: a panel a scene, a bar a method and preset."""
    bars = [(method, preset) for method in METHODS for preset in PRESETS]
    with style.figure(4.6) as drawing:
        axes = drawing.subplots(1, len(comparisons), sharey=True, squeeze=False)[0]
        for panel, comparison in zip(axes, comparisons):
            left = np.zeros(len(bars))
            split = [_stages(comparison, method, preset) for method, preset in bars]
            for stage, (colour, hatch) in STAGES.items():
                widths = np.array([s.get(stage, 0.0) for s in split])
                panel.barh(np.arange(len(bars)), widths, left=left, label=stage,
                           color=colour, hatch=hatch, edgecolor=style.PAPER, lw=0.5)  # fmt: skip
                left += widths
            for place, (total, (method, preset)) in enumerate(zip(left, bars)):
                result = comparison.find(method, preset)
                mark = " †" if result is not None and comparison.scattered(result) else ""
                text = f" {total:.3g} ms{mark}" if total > 0 else " no run"
                panel.text(total, place, text, va="center", fontsize=8)
            panel.set_title(comparison.scene)
            panel.set_xlabel("solver time of a step [ms]")
            panel.margins(x=0.22)
            panel.grid(axis="y", visible=False)
        axes[0].set_yticks(np.arange(len(bars)), [f"{NAMES[method]}, {preset}" for method, preset in bars])
        axes[0].invert_yaxis()
        handles, labels = axes[0].get_legend_handles_labels()
        drawing.legend(handles, labels, loc="outside upper left", ncols=len(STAGES), fontsize=9)
        return style.svg(drawing, "solver time of a step by stage, method and scene", footnote)


def _stages(comparison: Comparison, method: str, preset: str) -> Mapping[str, float]:
    result = comparison.find(method, preset)
    return {} if result is None or result.recording is None else result.recording.stage_ms


@dataclass(frozen=True)
class TimingRow:
    """A method's median solver time of a step in a scene, ms."""

    scene: str
    method: str
    by_preset: Mapping[str, float]  # NaN where it did not run
    scattered: tuple[str, ...]  # presets whose bodies flew apart, so that little was left to solve
    published: float  # the paper's own figure, on its own machine; NaN if it has none


def timing_table(comparisons: Sequence[Comparison]) -> list[TimingRow]:
    """A row a scene and method, beside what the paper published."""
    rows = []
    for comparison in comparisons:
        for method in METHODS:
            runs = {preset: comparison.find(method, preset) for preset in PRESETS}
            times = {p: math.nan if r is None else r.number("solver_ms_median") for p, r in runs.items()}
            scattered = tuple(p for p, r in runs.items() if r is not None and comparison.scattered(r))
            published = PAPER_MS.get(comparison.scene, {}).get(method, math.nan)
            rows.append(TimingRow(comparison.scene, method, times, scattered, published))
    return rows
