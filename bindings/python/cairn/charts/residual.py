"""Residual against iteration within one step, as the paper's Figure 8."""

from __future__ import annotations

import numpy as np

from . import style
from .result import NAMES, PRESETS, Comparison


def residual_trace(comparison: Comparison, frame: int, footnote: str = "") -> str:
    """How each method converges within the traced step (`frame` counts from 1), a panel a preset, logarithmic.

    The residual is the step of the impulses in the metric of the splitting's diagonal, sqrt(J). Methods with substeps
    solve a new problem in each, so theirs jumps where a substep begins.
    """
    with style.figure(4.0) as drawing:
        axes = drawing.subplots(1, len(PRESETS), sharey=True, squeeze=False)[0]
        ends: dict[str, list[style.End]] = {preset: [] for preset in PRESETS}
        for panel, preset in zip(axes, PRESETS):
            panel.set_yscale("log", nonpositive="mask")
            panel.set_title(f"{preset} preset")
            panel.set_xlabel("iteration of the step")
            for result in comparison.preset(preset):
                if result.recording is None:
                    continue
                trace = np.asarray(result.recording.residual_trace, dtype=np.float64)
                trace = np.where(np.isfinite(trace) & (trace > 0), trace, np.nan)
                drawn = np.flatnonzero(np.isfinite(trace))
                if not len(drawn):
                    continue
                method = result.request.method
                iteration = np.arange(1, len(trace) + 1)
                panel.plot(
                    iteration,
                    trace,
                    color=style.COLOURS[method],
                    lw=1.5,
                    ls=style.DASHES[method],
                    label=result.request.label,
                )
                ends[preset].append(
                    (float(iteration[drawn[-1]]), float(trace[drawn[-1]]), NAMES[method], style.COLOURS[method])
                )
            panel.margins(x=0.01)
        axes[0].set_ylabel("residual [√J]")
        style.layout(drawing)
        for panel, preset in zip(axes, PRESETS):
            style.label_ends(panel, ends[preset])
        return style.svg(drawing, f"residual against iteration in frame {frame}, {comparison.scene}", footnote)
