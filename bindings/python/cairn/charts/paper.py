"""The paper, figure by figure and table by table: what it shows, what the same runs show here, and why they differ."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..scenes.model import Scene
from .claims import NO, TIMED, UNKNOWN, YES, Claim, claims
from .result import METHODS, NAMES, Comparison
from .timing import PAPER_MACHINE, PAPER_MS

# The paper's Table 1: stars for numerical stability, accuracy and performance.
STARS: Mapping[str, tuple[int, int, int]] = {
    "pj": (2, 2, 3),
    "pjsoft": (3, 2, 3),
    "tj": (4, 3, 2),
    "tjsoft": (5, 3, 2),
    "pjnj": (2, 2, 1),
}
HEADING = ("item", "scene", "theirs", "ours", "reproduced", "why")


@dataclass(frozen=True)
class Row:
    """A line of the comparison. why: what explains a difference; empty where there is none."""

    item: str  # "Figure 5", "Table 2"
    scene: str
    theirs: str
    ours: str
    answer: str  # YES, NO or UNKNOWN
    why: str = ""


def rows(
    comparisons: Mapping[str, Comparison], scenes: Mapping[str, Scene], stood: Mapping[str, Mapping[str, bool]]
) -> list[Row]:
    """Everything that can be put to these scenes, in the paper's order.

    stood: by scene, whether each method's run with the paper's preset survived or no more than degraded.
    """
    found = [_row(claim) for claim in claims(comparisons, scenes) if claim.figure != "Table 2"]
    found += _times(comparisons)
    if stood:
        found.append(_stars(stood))
    return sorted(found, key=_place)


def _place(row: Row) -> tuple[bool, int]:
    kind, _, place = row.item.partition(" ")
    return kind == "Table", int(place)


def _row(claim: Claim) -> Row:
    return Row(
        claim.figure, claim.scene, claim.claim, claim.evidence, claim.answer, claim.why if claim.answer == NO else ""
    )


def _times(comparisons: Mapping[str, Comparison]) -> list[Row]:
    """Table 2, a row a scene: milliseconds and their ratio to PJ's."""
    made = []
    for scene, published in PAPER_MS.items():
        comparison = comparisons.get(scene)
        if comparison is None:
            continue
        found = {m: comparison.find(m, "paper") for m in METHODS}
        times = {m: r.number("solver_ms_median") for m, r in found.items() if r is not None}
        gone = [m for m, r in found.items() if r is not None and comparison.scattered(r)]
        complete = len(times) == len(METHODS) and all(math.isfinite(t) for t in times.values())

        def listed(values: Mapping[str, float]) -> str:
            return ", ".join(f"{NAMES[m]} {values[m]:.3g} ms (×{values[m] / values['pj']:.2f})" for m in values)

        same = complete and _order(times) == _order(published)
        answer = UNKNOWN if not complete or gone else (YES if same else NO)
        ours = listed(times) if complete else "runs are missing"
        if gone:
            ours += "; the bodies of " + ", ".join(NAMES[m] for m in gone) + " flew apart, which leaves little to solve"
        theirs = f"{PAPER_MACHINE}: {listed(published)}"
        why = _TIME_WHY if answer == NO else ""
        made.append(Row("Table 2", scene, theirs, ours, answer, why))
    return made


_TIME_WHY = "Their times are a GPU's, where a sweep is bound by latency; here a processor does the arithmetic."


def _order(times: Mapping[str, float]) -> list[tuple[str, ...]]:
    """Methods from the quickest, those without substeps and without position sweeps together, likewise those with."""
    groups = {("pj", "pjsoft"), ("tj", "tjsoft"), ("pjnj",)}
    return sorted(groups, key=lambda group: max(times[m] for m in group))


def _stars(stood: Mapping[str, Mapping[str, bool]]) -> Row:
    """Table 1: the order of stability, by the number of scenes that each method stands."""
    order = ("tjsoft", "tj", "pjsoft", "pj", "pjnj")
    counts = {m: sum(runs[m] for runs in stood.values() if m in runs) for m in order}
    complete = all(m in runs for runs in stood.values() for m in order) and set(TIMED) <= set(stood)
    holds = all(counts[a] >= counts[b] for a, b in zip(order, order[1:])) and counts["tjsoft"] > counts["pj"]
    theirs = "stability: " + ", ".join(f"{NAMES[m]} {'★' * STARS[m][0]}" for m in order)
    ours = f"of {len(stood)} scenes stand: " + ", ".join(f"{NAMES[m]} {counts[m]}" for m in order)
    answer = (YES if holds else NO) if complete else UNKNOWN
    why = (
        "The stars are the authors' judgement of their own runs; with the sizes and equations here soft is not gentler."
    )
    return Row("Table 1", ", ".join(stood), theirs, ours, answer, why if answer == NO else "")


def summary(found: Sequence[Row]) -> str:
    """How many are reproduced, in a sentence."""
    counts = {answer: sum(row.answer == answer for row in found) for answer in (YES, NO, UNKNOWN)}
    text = f"{counts[YES]} of {len(found)} reproduced, {counts[NO]} not"
    return text + (f", {counts[UNKNOWN]} cannot be told from these runs." if counts[UNKNOWN] else ".")


def as_csv(found: Sequence[Row]) -> str:
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(HEADING)
    writer.writerows((r.item, r.scene, r.theirs, r.ours, r.answer, r.why) for r in found)
    return table.getvalue()


__all__ = ["HEADING", "STARS", "Row", "as_csv", "rows", "summary"]
