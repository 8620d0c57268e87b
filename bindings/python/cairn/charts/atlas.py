"""The stability atlas: maps over two sizes of where a run survives, degrades or fails, and how and when it fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from . import style
from .drawn import Drawn, drawn

# state: colour and a letter for those who cannot tell colours
COLOURS = {"survived": "#7fc8ae", "degraded": "#f3d978", "failed": "#e8916b", "unknown": "#c9ccd0"}
LETTERS = {"survived": "✓", "degraded": "~", "failed": "✗", "unknown": "?"}
_TEXT = "#16191c"  # on the cells' own colours, which stay the same in the dark


@dataclass(frozen=True)
class Cell:
    state: str  # one of COLOURS
    kind: str = ""  # how it failed, or why nothing is known
    frame: int | None = None  # of the failure

    @property
    def text(self) -> str:
        lines = [self.kind or LETTERS[self.state]]
        return "\n".join([*lines, f"{self.frame}"] if self.frame is not None else lines)


@dataclass(frozen=True)
class Map:
    """A map of one or more panels, all over the same rows and columns."""

    name: str  # of the scene
    title: str
    across: str  # what grows to the right
    up: str  # and upwards
    columns: Sequence[str]
    rows: Sequence[str]
    panels: Mapping[str, Mapping[tuple[int, int], Cell]]  # by title: cells by (row, column)
    notes: Sequence[str]  # the rules of the states, the frames used


def summary(shown: Map) -> list[str]:
    """How many cells of each panel survive, the most first; for a map of one panel, of each of its rows."""
    counts: dict[str, tuple[int, int]] = {}
    for title, cells in shown.panels.items():
        groups = {title: list(cells.values())}
        if len(shown.panels) == 1:
            groups = {label: [c for (row, _), c in cells.items() if row == i] for i, label in enumerate(shown.rows)}
        for label, group in groups.items():
            counts[label] = (sum(c.state == "survived" for c in group), len(group))
    order = sorted(counts, key=lambda label: -counts[label][0])
    return [
        "Cells survived: " + "; ".join(f"{label} {counts[label][0]} of {counts[label][1]}" for label in order) + "."
    ]


def atlas(shown: Map, footnote: str = "") -> Drawn:
    """Draw a map: a panel a method, at most three side by side, or the one panel across the chart."""
    wide = min(3, len(shown.panels))
    high = -(-len(shown.panels) // wide)
    cell = 0.38 if any(c.frame is not None for cells in shown.panels.values() for c in cells.values()) else 0.3
    height = high * (0.75 + cell * len(shown.rows)) + 1.9
    with style.figure(height) as drawing:
        axes = drawing.subplots(high, wide, sharex=True, sharey=True, squeeze=False)
        for panel in axes.flat[len(shown.panels) :]:
            panel.set_visible(False)
        for index, (panel, (title, cells)) in enumerate(zip(axes.flat, shown.panels.items())):
            _panel(panel, shown, cells)
            panel.set_title(title if len(shown.panels) > 1 else "", fontsize=10, pad=3)
            below = index + wide >= len(shown.panels)
            panel.tick_params(labelbottom=below)
            if below:
                panel.set_xlabel(shown.across)
            if index % wide == 0:
                panel.set_ylabel(shown.up)
        states = dict.fromkeys(c.state for cells in shown.panels.values() for c in cells.values())
        names = {"failed": "failed: kind and frame", "unknown": "no result"}
        patches = [Patch(facecolor=COLOURS[s], label=f"{LETTERS[s]} {names.get(s, s)}") for s in COLOURS if s in states]
        drawing.legend(handles=patches, loc="outside upper left", ncols=4, fontsize=9)
        rows: list[Sequence[object]] = [("panel", shown.up, shown.across, "state", "kind", "frame")]
        for title, cells in shown.panels.items():
            rows += [
                (title, shown.rows[row], shown.columns[column], c.state, c.kind, "" if c.frame is None else c.frame)
                for (row, column), c in sorted(cells.items())
            ]
        notes = [*summary(shown), *shown.notes]
        return drawn(drawing, f"atlas-{shown.name}", shown.title, rows, notes, footnote)


def _panel(panel: Axes, shown: Map, cells: Mapping[tuple[int, int], Cell]) -> None:
    for (row, column), cell in cells.items():
        panel.add_patch(_square(column, row, COLOURS[cell.state]))
        panel.text(column, row, cell.text, ha="center", va="center", fontsize=7.5, color=_TEXT, linespacing=1.05)
    panel.set_xlim(-0.5, len(shown.columns) - 0.5)
    panel.set_ylim(-0.5, len(shown.rows) - 0.5)
    panel.set_xticks(range(len(shown.columns)), shown.columns)
    panel.set_yticks(range(len(shown.rows)), shown.rows)
    panel.tick_params(length=0)
    panel.grid(False)
    for spine in panel.spines.values():
        spine.set_visible(False)


def _square(column: int, row: int, colour: str) -> Patch:
    return Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, facecolor=colour, lw=0)
