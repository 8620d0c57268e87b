"""Cairn beside Bullet's own solvers: for each scene and tolerance the quickest setting of either that meets it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..bullet import STOCK_METHODS
from . import style
from .drawn import Drawn, drawn
from .profiles import TOLERANCES
from .result import Comparison, Result


@dataclass(frozen=True)
class Pair:
    """ours, bullets: the quickest run of each that meets the tolerance, None where none does."""

    scene: str
    tolerance: float  # of the scene's scale
    ours: Result | None
    bullets: Result | None

    @property
    def ratio(self) -> float:
        """Our time over Bullet's: 0 where only we meet the tolerance, infinite where only Bullet does, else NaN."""
        if self.ours is None:
            return math.nan if self.bullets is None else math.inf
        return self.ours.number("solver_ms_median") / self.bullets.number("solver_ms_median") if self.bullets else 0.0


def pairs(comparison: Comparison, scale: float, tolerances: Sequence[float] = TOLERANCES) -> list[Pair]:
    """One a tolerance. A run that failed meets none."""

    def quickest(stock: bool, most: float) -> Result | None:
        found = (
            r
            for r in comparison.results
            if (r.request.method in STOCK_METHODS) == stock
            and not r.failed
            and r.number("error") <= most
            and r.number("solver_ms_median") > 0
        )
        return min(found, key=lambda r: r.number("solver_ms_median"), default=None)

    return [Pair(comparison.scene, t, quickest(False, t * scale), quickest(True, t * scale)) for t in tolerances]


def beside_bullet(
    comparisons: Sequence[Comparison], scales: Mapping[str, tuple[float, str]], footnote: str = ""
) -> Drawn:
    """A row a scene, a mark a tolerance: left of 1 Cairn is quicker, right of it Bullet."""
    table = {c.scene: pairs(c, scales[c.scene][0]) for c in comparisons}
    order = sorted(table, key=lambda scene: [_place(pair.ratio) for pair in reversed(table[scene])])
    real = [p.ratio for found in table.values() for p in found if 0 < p.ratio < math.inf]
    low, high = min([0.3, *real]) / 1.8, max([3.0, *real]) * 1.8
    rows: list[Sequence[object]] = [
        ("scene", "tolerance", "ours", "ms", "error", "bullets", "bullets_ms", "bullets_error", "ratio")
    ]
    for scene in order:
        for pair in table[scene]:
            ratio = "" if math.isnan(pair.ratio) else f"{pair.ratio:.4g}"
            rows.append((scene, f"{pair.tolerance:g}", *_cells(pair.ours), *_cells(pair.bullets), ratio))
    with style.figure(0.2 * len(order) + 2.4) as drawing:
        panel = drawing.subplots()
        panel.axvline(1.0, color=style.INK, lw=0.8, alpha=0.6)
        for place, tolerance in enumerate(TOLERANCES):
            shown = [
                (min(max(pair.ratio, low), high), row + 0.25 * (place - 1))
                for row, scene in enumerate(order)
                for pair in table[scene]
                if pair.tolerance == tolerance and not math.isnan(pair.ratio)
            ]
            panel.plot(
                [x for x, _ in shown], [y for _, y in shown], "osD"[place], ms=5, mec=style.INK, mew=0.5,
                color=style.COLOURS["tjsoft"], alpha=0.35 + 0.3 * place, label=f"error at most {tolerance:g} of scale",
            )  # fmt: skip
        panel.set_xscale("log")
        panel.set_xlim(low / 1.2, high * 1.2)
        panel.set_yticks(range(len(order)), order)
        panel.set_ylim(len(order) - 0.4, -0.6)
        panel.set_xlabel("Cairn's quickest setting ÷ Bullet's quickest, solver time (left: Cairn is quicker)")
        drawing.legend(loc="outside upper left", ncols=3, fontsize=8.5)
        title = "Cairn beside Bullet's own solvers"
        return drawn(drawing, "beside-bullet", title, rows, summary(table), footnote)


def _place(ratio: float) -> float:
    return 1.0 if math.isnan(ratio) else ratio


def _cells(result: Result | None) -> tuple[str, str, str]:
    if result is None:
        return "", "", ""
    return (
        result.request.label,
        f"{result.number('solver_ms_median'):.6g}",
        f"{result.number('error'):.6g}",
    )


def summary(table: Mapping[str, Sequence[Pair]]) -> list[str]:
    """How often Cairn or Bullet is quicker, or alone in meeting a tolerance; where Bullet is, by how much."""
    notes = []
    for place, tolerance in enumerate(TOLERANCES):
        found = [pairs[place] for pairs in table.values()]
        behind = sorted((p for p in found if 1 < p.ratio < math.inf), key=lambda p: -p.ratio)
        words = [
            f"Cairn quicker in {sum(0 < p.ratio <= 1 for p in found)}",
            f"alone in {sum(p.ratio == 0 for p in found)}",
            f"Bullet quicker in {len(behind)}"
            + (" (" + ", ".join(f"{p.scene} ×{p.ratio:.2g}" for p in behind) + ")" if behind else ""),
        ]
        alone = [p.scene for p in found if p.ratio == math.inf]
        words.append(f"alone in {len(alone)}" + (" (" + ", ".join(alone) + ")" if alone else ""))
        neither = [p.scene for p in found if math.isnan(p.ratio)]
        words.append(f"neither in {len(neither)}" + (" (" + ", ".join(neither) + ")" if neither else ""))
        notes.append(f"At {tolerance:g} of the scale: " + ", ".join(words) + ".")
    notes.append(
        "At the left edge only Cairn meets the tolerance, at the right edge only Bullet. Cairn: the five methods, both "
        "presets, and auto; Bullet: PGS with and without substeps, NNCG, Dantzig. Times are of the whole solve behind "
        "Bullet, gathering and scattering included."
    )
    return notes


__all__ = ["Pair", "beside_bullet", "pairs"]
