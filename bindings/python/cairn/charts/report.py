"""The report of the paper's comparison: a page that stands alone, and the same figures as JSON."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from .. import replay
from ..scenes.model import Scene
from . import claims, error_time, frames, residual, style, timing, verdict
from .result import METHODS, NAMES, PRESETS, Comparison, Measured, Result
from .verdict import number

FORMAT = 1  # of results.json; grows when a key changes its meaning
_FIGURES = {"stack": 5, "chain": 6, "overlap": 7}  # in the paper
TITLES = {"stack": "Box stack", "chain": "Chain and ball", "overlap": "Overlap"}


@dataclass(frozen=True)
class Window:
    """Which frames of a scene its replay and its charts show, and how fast the replay goes."""

    frames: int | None  # the first so many; None: all of the run
    every: int  # frames from one pose to the next
    speed: float  # times real time
    charted: int | None = None  # as frames, for the charts against the frame


@dataclass(frozen=True)
class Facts:
    """What the figures depend on, said beside them."""

    machine: str
    build: str  # compiler, flags and commit
    conditions: str  # how the times were taken
    when: str  # ISO date
    command: str  # that repeats the figures

    @property
    def footnote(self) -> str:
        return f"{self.machine}; {self.build}; {self.conditions}"


@dataclass(frozen=True)
class Study:
    """Everything that a report shows, scene by scene."""

    comparisons: Mapping[str, Comparison]
    scenes: Mapping[str, Scene]
    windows: Mapping[str, Window]
    facts: Facts


def results(study: Study) -> dict[str, Any]:
    """The content of results.json: facts, frames used, and of every run its request, summary and stage times."""
    runs = []
    for comparison in study.comparisons.values():
        for result in comparison.results:
            recording = result.recording
            runs.append(
                {
                    "label": result.request.label,
                    "request": asdict(result.request),
                    "error": result.error or None,
                    "verdict": verdict.judge(study.scenes[comparison.scene], result).text,
                    "summary": None if recording is None else dict(recording.summary),
                    "stage_ms": None if recording is None else dict(recording.stage_ms),
                }
            )
    return {
        "format": FORMAT,
        **asdict(study.facts),
        "frames": {scene: comparison.frames for scene, comparison in study.comparisons.items()},
        "claims": [asdict(claim) for claim in claims.claims(study.comparisons, study.scenes)],
        "runs": runs,
    }


def html(study: Study) -> str:
    """The page. It loads nothing: charts, replays and their viewer are inside."""
    template = style.template("page.html")
    everything = [result for comparison in study.comparisons.values() for result in comparison.results]
    pages = {scene: _replays(study, scene) for scene in study.comparisons}
    viewer = next((page.viewer for scene in pages.values() for _, page in scene), "")
    comparisons = list(study.comparisons.values())
    return template.render(
        scenes=[_scene(study, comparison, pages[comparison.scene]) for comparison in comparisons],
        claims=claims.claims(study.comparisons, study.scenes),
        missing=sum(result.recording is None for result in everything),
        total=len(everything),
        footnote=study.facts.footnote,
        timing=_timing(comparisons),
        scattered=any(row.scattered for row in timing.timing_table(comparisons)),
        paper_machine=timing.PAPER_MACHINE,
        split=timing.time_split(comparisons, study.facts.footnote),
        facts=_facts(study),
        command=study.facts.command,
        viewer=base64.b64encode(viewer.encode()).decode(),
    )


def _facts(study: Study) -> list[tuple[str, str]]:
    facts = study.facts
    used = ", ".join(f"{scene} {comparison.frames}" for scene, comparison in study.comparisons.items())
    return [
        ("machine", facts.machine),
        ("build", facts.build),
        ("times", facts.conditions),
        ("frames", f"{used} (the paper's: 3000)"),
        ("date", facts.when),
    ]


def _scene(study: Study, comparison: Comparison, pages: Sequence[tuple[str, replay.Page]]) -> dict[str, Any]:
    scene, foot = study.scenes[comparison.scene], study.facts.footnote
    headline, error = verdict.headline(scene), verdict.error_of(scene)
    charted = study.windows[comparison.scene].charted
    part = f" The first {charted} frames." if charted is not None and charted < comparison.frames else ""
    columns = [headline] + ([error] if error != headline else [])
    figures = [
        (
            "cost",
            "What accuracy costs",
            error_time.error_against_time(comparison, headline, foot, verdict.limit(scene)),
            "Down is more accurate, left is quicker. Filled marks: default preset; hollow: the paper's; grey: stock "
            "PGS. Numbers are iterations, or substeps × iterations of each. The dark line joins the runs that none "
            "beats in both.",
        ),
        (
            "energy",
            "Energy change of a step",
            frames.energy_change(comparison, foot, charted),
            f"Kinetic energy after the solve less that before it; the paper's Figure {_FIGURES[comparison.scene]}b. "
            f"Grey: {_stock(comparison)}. "
            f"Where frames outnumber pixels the band runs from the lowest to the highest.{part}",
        ),
        (
            "error",
            "Constraint error",
            frames.constraint_error(comparison, error, foot, charted),
            f"{error.title.capitalize()} at every frame; the paper's Figure {_FIGURES[comparison.scene]}c. "
            f"Grey: {_stock(comparison)}. Errors below 1 µm are drawn at 1 µm.{part}",
        ),
    ]
    if comparison.scene == "overlap":
        figures.append(
            (
                "residual",
                "Residual against iteration",
                residual.residual_trace(comparison, 1, foot),
                "Within the first frame; the paper's Figure 8. A substep is a new problem: its residual starts anew.",
            )
        )
    window = study.windows[comparison.scene]
    shown = comparison.frames if window.frames is None else min(window.frames, comparison.frames)
    return {
        "name": comparison.scene,
        "title": TITLES.get(comparison.scene, comparison.scene),
        "why": scene.why,
        "frames": comparison.frames,
        "dt_ms": f"{1e3 * scene.dt:g}",
        "rule": verdict.rule(scene),
        "glance": _glance(scene, comparison),
        "columns": [q.title for q in columns] + ["largest energy change of a step"],
        "groups": _groups(scene, comparison, columns),
        "figures": [dict(zip(("id", "title", "svg", "caption"), figure)) for figure in figures],
        "residual": comparison.scene == "overlap",
        "replays": [
            {"id": f"replay-{comparison.scene}-{p}", "title": f"{p} preset", "data": page.data} for p, page in pages
        ],
        "replay_note": f"frames 0 to {shown}, {window.speed:.2g} × real time",
    }


def _stock(comparison: Comparison) -> str:
    return comparison.stock.request.label + " iterations" if comparison.stock is not None else "no stock run"


def _glance(scene: Scene, comparison: Comparison) -> list[str]:
    """What the scene's runs come to, in a few lines."""

    def of(results: Sequence[Result]) -> str:
        good = [r for r in results if verdict.judge(scene, r).good]
        names = ", ".join(NAMES[r.request.method] for r in good)
        return f"{len(good)} of {len(results)} pass" + (f" ({names})" if 0 < len(good) < len(results) else "")

    lines = [f"{preset} preset: {of(comparison.preset(preset))}" for preset in PRESETS]
    stock = [r for r in comparison.results if r.request.method in ("stock", "stock-substeps") and r.request.main]
    passed = [r.request for r in stock if verdict.judge(scene, r).good]
    settings = ", ".join(request.settings for request in passed)
    lines.append(f"stock PGS: {len(passed)} of {len(stock)} pass" + (f" ({settings})" if passed else ""))
    headline = verdict.headline(scene)
    passing = [r for r in comparison.results if verdict.judge(scene, r).good and math.isfinite(r.number(headline.key))]
    for title, key in (("quickest that passes", "solver_ms_median"), (f"least {headline.title}", headline.key)):
        if passing:
            best = min(passing, key=lambda r: r.number(key))
            figures = f"{number(best.number(headline.key), headline.unit)} in {best.number('solver_ms_median'):.2g} ms"
            lines.append(f"{title}: {best.request.label}: {figures}")
    return lines


def _groups(scene: Scene, comparison: Comparison, columns: Sequence[Measured]) -> list[dict[str, Any]]:
    def rows(results: Sequence[Result]) -> list[dict[str, Any]]:
        made = []
        for result in results:
            judged = verdict.judge(scene, result)
            numbers = [number(result.number(q.key), q.unit) for q in columns]
            numbers.append(number(result.number("kinetic_energy_change_max_J"), "J"))
            numbers += [number(result.number(key)) for key in ("solver_ms_median", "step_ms_median")]
            request = result.request
            made.append(
                {
                    "label": f"{NAMES[request.method]} {request.settings}",
                    "colour": style.COLOURS[request.method],
                    "good": judged.good,
                    "verdict": judged.text,
                    "numbers": numbers,
                }
            )
        return made

    main = [r for r in comparison.results if r.request.main]
    groups = [(f"{preset} preset", comparison.preset(preset)) for preset in PRESETS]
    groups.append(("Bullet's own solver", [r for r in main if r.request.preset is None]))
    groups.append(("default preset, fewer iterations", [r for r in comparison.results if not r.request.main]))
    return [{"title": title, "rows": rows(results)} for title, results in groups if results]


def _timing(comparisons: Sequence[Comparison]) -> list[dict[str, Any]]:
    table = timing.timing_table(comparisons)
    reference = {row.scene: row for row in table if row.method == METHODS[0]}

    def ratio(value: float, of: float, comparable: bool = True) -> str:
        return f"{value / of:.2f}" if comparable and math.isfinite(value / of) else "–"

    def ours(row: timing.TimingRow, preset: str) -> str:
        return number(row.by_preset[preset]) + (" †" if preset in row.scattered else "")

    return [
        {
            "scene": row.scene,
            "method": NAMES[row.method],
            "first": row.method == METHODS[0],
            "ours": [ours(row, preset) for preset in PRESETS],
            "published": f"{row.published:.4f}" if math.isfinite(row.published) else "–",
            "ratio": ratio(
                row.by_preset["paper"],
                reference[row.scene].by_preset["paper"],
                "paper" not in row.scattered + reference[row.scene].scattered,
            ),
            "published_ratio": ratio(row.published, reference[row.scene].published),
        }
        for row in table
    ]


def _replays(study: Study, scene: str) -> list[tuple[str, replay.Page]]:
    """A replay a preset: its five methods and stock PGS, with and without substeps, side by side."""
    comparison, window = study.comparisons[scene], study.windows[scene]
    pages = []
    for preset in PRESETS:
        shown = [*comparison.preset(preset), comparison.stock, comparison.find("stock-substeps")]
        takes = [_take(study.scenes[scene], r, window) for r in shown if r is not None and r.recording is not None]
        takes = [take for take in takes if len(take.recording.poses)]
        if takes:
            seconds = window.every * study.scenes[scene].dt / window.speed
            pages.append((preset, replay.page(takes, seconds_per_sample=seconds)))
    return pages


def _take(scene: Scene, result: Result, window: Window) -> replay.Take:
    recording = result.recording
    assert recording is not None
    kept = len(recording.poses) if window.frames is None else window.frames // window.every + 1
    recording = replace(recording, poses=recording.poses[:kept], pose_frames=recording.pose_frames[:kept])
    request = result.request
    name = NAMES[request.method] if request.preset else f"stock {request.settings}"
    return replay.Take(name, scene, recording, style.COLOURS[request.method])
