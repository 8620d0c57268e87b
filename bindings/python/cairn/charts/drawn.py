"""A chart of the report: as SVG for its page, as PNG to stand alone, and what it shows as CSV."""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from . import style

_LINE = 165  # letters of a footnote's line on a chart of the usual width


@dataclass(frozen=True)
class Drawn:
    """name: of the files, without suffix, and the anchor in the page. notes: what the chart shows, in sentences."""

    name: str
    title: str
    svg: str
    png: bytes
    csv: str
    notes: Sequence[str]


def drawn(
    drawing: Figure, name: str, title: str, rows: Sequence[Sequence[object]], notes: Sequence[str], footnote: str
) -> Drawn:
    """Finish a figure. rows: of the CSV, its heading first. The notes and the footnote stand under the chart."""
    lines = [line for text in (*notes, footnote) for line in textwrap.wrap(text, _LINE)]
    svg = style.svg(drawing, title, "\n".join(lines))
    picture = io.BytesIO()
    style.png(drawing, picture)
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows(rows)
    return Drawn(name, title, svg, picture.getvalue(), table.getvalue(), notes)
