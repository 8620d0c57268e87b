"""One run of a comparison, as the charts and the report see it: what was asked for, and what came of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..recording import Recording
    from ..scenes.model import Array
    from ..solver import ParamValue

METHODS = ("pj", "pjnj", "pjsoft", "tj", "tjsoft")
PRESETS = ("paper", "default")
NAMES = {
    "pj": "PJ",
    "pjnj": "PJNJ",
    "pjsoft": "PJSoft",
    "tj": "TJ",
    "tjsoft": "TJSoft",
    "auto": "auto",
    "stock": "stock PGS",
    "stock-substeps": "stock + substeps",
    "nncg": "NNCG",
    "dantzig": "Dantzig",
}


def family_name(method: str, preset: str | None) -> str:
    """ "TJSoft, default"; "stock PGS"."""
    return NAMES[method] + (f", {preset}" if preset else "")


@dataclass(frozen=True)
class Request:
    """What to run. iterations are those of a step in all, shared out over its substeps."""

    scene: str
    method: str
    iterations: int
    preset: str | None = None  # None: Bullet's own solver, which has no presets
    substeps: int = 1
    position_iterations: int | None = None  # PJNJ; None: the preset's
    changes: tuple[tuple[str, ParamValue], ...] = ()  # sizes of the scene and parameters of the method, by name
    dt: float | None = None  # s, of a step; None: the scene's
    main: bool = True  # one of the paper's comparison, not a further point of the error-against-time chart

    @property
    def settings(self) -> str:
        """Iterations, as `substeps x iterations of a substep` where there are substeps: "300", "10x30".

        Of auto its tolerance: "0.001 m/s".
        """
        tolerance = dict(self.changes).get("tolerance")
        if tolerance is not None:
            return f"{float(tolerance):g} m/s"
        if self.substeps > 1:
            return f"{self.substeps}×{self.iterations // self.substeps}"
        return str(self.iterations)

    @property
    def family(self) -> str:
        """Method and preset: the runs of a curve."""
        return family_name(self.method, self.preset)

    @property
    def label(self) -> str:
        """ "TJ 10×30, paper"; "stock PGS 50"."""
        return f"{NAMES[self.method]} {self.settings}" + (f", {self.preset}" if self.preset else "")


@dataclass(frozen=True)
class Result:
    """A request and its recording, or the reason why there is none."""

    request: Request
    recording: Recording | None = None
    error: str = ""
    seconds: float = 0.0  # wall-clock time of the whole run
    stopped: bool = False  # it has no recording because its time was up
    exploded: bool = False  # a body was faster than anything in its scene could make it
    collapsed: bool = False  # its error is more than its scene tolerates, where the scene says so

    def number(self, key: str) -> float:
        """A figure of the summary; NaN if the run did not finish or does not have it."""
        value = self.summary.get(key)
        return float(value) if isinstance(value, (int, float)) else math.nan

    @property
    def summary(self) -> Mapping[str, object]:
        return {} if self.recording is None else self.recording.summary

    @property
    def collapsed_at(self) -> int | None:
        frame = self.summary.get("collapsed_at_frame")
        return int(frame) if isinstance(frame, (int, float)) else None

    @property
    def failed(self) -> bool:
        """No recording, numbers that are not finite, what fell, or bodies that flew."""
        unsound = self.recording is None or self.exploded or not self.summary.get("finite", True)
        return unsound or self.collapsed or self.collapsed_at is not None

    def series(self, key: str) -> Array:
        """A figure of every frame; empty if the run did not finish."""
        return np.zeros(0) if self.recording is None else self.recording.frames[key]


@dataclass(frozen=True)
class Measured:
    """A quantity that a chart or a table shows."""

    key: str  # of Recording.frames or Recording.summary
    title: str
    unit: str

    @property
    def axis(self) -> str:
        return f"{self.title} [{self.unit}]"


@dataclass(frozen=True)
class Comparison:
    """All results of one scene."""

    scene: str
    results: Sequence[Result]
    frames: int = field(default=0)

    def find(self, method: str, preset: str | None = None, *, iterations: int | None = None) -> Result | None:
        """The first main run of that method and preset, with so many iterations if that is asked for."""
        for result in self.results:
            request = result.request
            fits = request.main and request.method == method and request.preset == preset
            if fits and iterations in (None, request.iterations):
                return result
        return None

    def preset(self, preset: str) -> list[Result]:
        """The five methods with a preset, those that were run, in the paper's order."""
        found = (self.find(method, preset) for method in METHODS)
        return [result for result in found if result is not None]

    def scattered(self, result: Result) -> bool:
        """Whether a run solved under half the rows of the fullest one, its bodies having flown: its time misleads."""
        rows = [r.number("rows") for r in self.results]
        return result.number("rows") < max((n for n in rows if math.isfinite(n)), default=0.0) / 2

    @property
    def stock(self) -> Result | None:
        """Bullet's own solver with as many iterations as the methods have, else its most."""
        runs = [r for r in self.results if r.request.method == "stock" and r.request.main]
        return max(runs, key=lambda r: r.request.iterations, default=None)
