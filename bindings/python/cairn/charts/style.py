"""How every chart looks: one colour, marker and line a method, the same everywhere, told apart without colour as well.

Charts are SVG, to stand in a page: text and axes take the page's own colour, so that they read in light and dark.
Those that stand alone are PNG.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import jinja2
import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Okabe and Ito's palette, safe for the colour-blind: cool colours step once, warm ones substep, the light one is soft.
COLOURS = {
    "pj": "#0072B2",
    "pjnj": "#009E73",
    "pjsoft": "#56B4E9",
    "tj": "#D55E00",
    "tjsoft": "#E69F00",
    "auto": "#6a3d9a",
    "stock": "#8a8a8a",
    "stock-substeps": "#8a8a8a",
    "nncg": "#CC79A7",
    "dantzig": "#9c6b4e",
}
MARKERS = {"pj": "o", "pjnj": "X", "pjsoft": "s", "tj": "^", "tjsoft": "D", "auto": "h", "stock": "P",
           "stock-substeps": "*", "nncg": "v", "dantzig": "p"}  # fmt: skip
DASHES = {"pj": "-", "pjnj": (0, (1, 1)), "pjsoft": (0, (5, 1.5)), "tj": "-", "tjsoft": (0, (5, 1.5)), "stock": "-"}

INK = "#010203"  # stands for the page's text colour until the SVG is written
PAPER = "#fefdfc"  # and this one for its background
WIDTH = 10.0  # inches of every chart; text is set for it

_RC: dict[Any, Any] = {
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "grid.color": "#8a8a8a",
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.unicode_minus": True,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


@contextmanager
def figure(height: float, width: float = WIDTH) -> Iterator[Figure]:
    """A figure in the house style, of width x height inches; charts draw on it and end with `svg`."""
    with mpl.rc_context(_RC):
        drawing = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(drawing)  # what measures text, for the labels
        yield drawing


def layout(drawing: Figure) -> None:
    """Fix limits, scales and places, for labels that depend on them."""
    drawing.draw_without_rendering()


def svg(drawing: Figure, description: str, footnote: str = "") -> str:
    """The figure as an <svg> element that names itself `description` to those who cannot see it."""
    if footnote:
        drawing.supxlabel(footnote, fontsize=8, x=0.01, ha="left", alpha=0.75)
    buffer = io.StringIO()
    drawing.savefig(
        buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
    )
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = text.replace(INK, "currentColor").replace(PAPER, "var(--page, #fff)")
    text = re.sub(r"(\d+\.\d\d)\d+", r"\1", text)  # a hundredth of a point is finer than any screen
    # The page scales it: width and height go, the view box stays.
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    return re.sub(r"^<svg", f'<svg role="img" aria-label="{_attribute(description)}"', text)


def png(drawing: Figure, target: Path | BinaryIO, footnote: str = "") -> None:
    """The figure as a file to stand on its own: dark on white."""
    if footnote:
        drawing.supxlabel(footnote, fontsize=8, x=0.01, ha="left", alpha=0.75)
    drawing.savefig(target, format="png", dpi=150, facecolor="white", metadata={"Software": None})


def template(name: str) -> jinja2.Template:
    """A page's template, of the files beside this one."""
    loader = jinja2.FileSystemLoader(Path(__file__).parent, encoding="utf-8")
    return jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined).get_template(name)


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")


End = tuple[float, float, str, str]  # x, y, name and colour of a curve


def label_ends(axes: Axes, ends: list[End], gap: float = 11.0) -> None:
    """Name curves at their right ends: (x, y, text, colour), moved apart until the names are `gap` points apart.

    The figure must have been laid out (`layout`), so that the axes are where they will be.
    """
    points = 72.0 / axes.figure.dpi
    placed = sorted(((axes.transData.transform((x, y))[1] * points, x, y, text, colour) for x, y, text, colour in ends))
    heights: list[float] = []
    for height, *_ in placed:
        heights.append(height if not heights else max(height, heights[-1] + gap))
    # Pushing up only would leave the lot too high: move it back by the mean push, though not below the axes.
    shift = sum(h - p[0] for h, p in zip(heights, placed)) / len(placed) if placed else 0.0
    shift = min([shift, *(height - axes.bbox.y0 * points - gap / 2 for height in heights[:1])])
    for target, (height, x, y, text, colour) in zip(heights, placed):
        offset = target - shift - height
        axes.annotate(text, (x, y), xytext=(6, offset), textcoords="offset points", va="center", fontsize=9,
                      color=INK, annotation_clip=False)  # fmt: skip
        line = {"arrowstyle": "-", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (x, y), xytext=(5, offset), textcoords="offset points", annotation_clip=False,
                      arrowprops=line)  # fmt: skip
