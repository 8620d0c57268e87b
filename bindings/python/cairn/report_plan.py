"""What the report runs: the settings of every method for work and precision, and the atlas's maps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from . import report_outcome, scenes
from .charts.ablation import Ablation
from .charts.atlas import Cell, Map
from .charts.result import METHODS, NAMES, PRESETS, Request, family_name
from .charts.verdict import number
from .metrics import SETTLED_FRAME
from .report_cache import Entry
from .solver import ParamValue
from .workers import Task

Sizes = Mapping[str, float]


@dataclass(frozen=True)
class Plan:
    """How much is run: all of it, or quickly."""

    frames: int | None  # of a run; None: the scene's, at most `longest`
    atlas_seconds: float  # simulated, of a map's run; frames are these divided by the step
    limit_s: float  # processor time of a run
    iterations: Sequence[int]  # of a step in all, where there are no substeps
    substeps: Sequence[tuple[int, int]]  # iterations of a step in all, substeps
    sizes: Mapping[str, Sizes] = field(default_factory=dict)  # by scene, other than its own
    longest: int = 1500  # frames; kapla's runs of an hour are made by `cairn simbenchmark`
    tolerances: Sequence[float] = (1e-1, 1e-2, 1e-3, 1e-4)  # m/s, of the method auto
    coarse: bool = False  # whether the maps have four columns and rows or so, not six

    def __post_init__(self) -> None:
        if self.frames is not None and self.frames <= SETTLED_FRAME:
            raise ValueError(f"{self.frames} frames are too few: drift counts from frame {SETTLED_FRAME} on")

    def frames_of(self, scene: str) -> int:
        """How many frames a run of that scene has, maps apart."""
        return self.frames or min(scenes.build(scene).frames, self.longest)


FULL = Plan(
    frames=None,
    atlas_seconds=24.0,
    limit_s=60.0,
    iterations=(10, 30, 100, 300),
    substeps=((20, 2), (40, 2), (40, 4), (100, 4), (100, 10), (300, 4), (300, 10)),
    # Nearly a hundred runs each: the largest scenes are for `./dev bench`.
    sizes={"joint-grid": {"columns": 24, "rows": 24}, "hub": {"balls": 12}, "pile": {"bodies": 300}},
)
QUICK = Plan(
    frames=200,
    atlas_seconds=3.2,
    limit_s=8.0,
    iterations=(10, 40, 160),
    substeps=((20, 2), (40, 4), (100, 10), (160, 4)),
    sizes={
        "stack": {"columns": 3, "layers": 4, "rows": 3},
        "stack-1m": {"columns": 3, "layers": 6, "rows": 3},
        "chain": {"links": 20},
        "chain-1m": {"links": 20},
        "windmill": {"columns": 3, "layers": 3, "rows": 3},
        "column": {"boxes": 12},
        "pyramid": {"base": 7},
        "hub": {"balls": 7},
        "pile": {"bodies": 48},
        "heavy-pendulum": {"links": 20},
        "joint-grid": {"columns": 10, "rows": 10},
        "cantilever": {"boxes": 10},
        "bounce": {"balls": 4},
        "666": {"edge": 3},
        "jeep-bridge": {"planks": 15},
        "stretched-chain": {"links": 12},
        "card-house": {"levels": 3},
        "kapla": {"floors": 3, "bases": 4},
        "warm-removal": {"side": 3, "layers": 3},
        "far": {"columns": 3, "layers": 4, "rows": 3},
        "far-chain": {"links": 20},
    },
    coarse=True,
)


def _task(plan: Plan, request: Request, frames: int) -> Task:
    return Task(request, frames, limit_s=plan.limit_s)


def work_precision(plan: Plan, scene: str) -> list[Task]:
    """Every setting of every method in a scene."""
    changes = tuple(plan.sizes.get(scene, {}).items())
    found = [
        Request(scene, method, iterations, preset, parts, changes=changes)
        for method in METHODS
        for preset in PRESETS
        for iterations, parts in (plan.substeps if method in ("tj", "tjsoft") else [(n, 1) for n in plan.iterations])
    ]
    found += [  # at most what the preset has of sweeps and substeps
        Request(scene, "auto", 300, "default", 10, changes=(*changes, ("tolerance", t))) for t in plan.tolerances
    ]
    found += [Request(scene, name, n, changes=changes) for name in ("stock", "nncg") for n in plan.iterations]
    # Direct: iterations are for the steps in which it gives up and Bullet takes PGS.
    found.append(Request(scene, "dantzig", plan.iterations[-1], changes=changes))
    found += [Request(scene, "stock-substeps", n, None, parts, changes=changes) for n, parts in plan.substeps]
    frames = plan.frames_of(scene)
    return [_task(plan, request, frames) for request in found]


# ---- The atlas ---------------------------------------------------------------------------------------------------

DEFAULT_SUBSTEPS = {"tj": 10, "tjsoft": 10, "auto": 10, "stock-substeps": 10}  # where a map does not vary them
_ALL = (*METHODS, "auto", "stock", "stock-substeps", "nncg", "dantzig")


@dataclass(frozen=True)
class MapPlan:
    """A map and its runs, by panel and (row, column)."""

    scene: str
    title: str
    across: str
    up: str
    columns: Sequence[str]
    rows: Sequence[str]
    panels: Mapping[str, Mapping[tuple[int, int], Task]]
    about: Sequence[str]

    @property
    def tasks(self) -> list[Task]:
        return [task for cells in self.panels.values() for task in cells.values()]

    def map(self, found: Mapping[Task, Entry]) -> Map:
        """The map, of what its runs came to."""
        panels = {
            title: {place: _cell(found[task]) for place, task in cells.items()} for title, cells in self.panels.items()
        }
        frames = sorted({task.frames for task in self.tasks})
        used = f"{frames[0]}" if len(frames) == 1 else f"{frames[0]} to {frames[-1]}"
        bounds = [report_outcome.limits(found[task].scene) for task in self.tasks]
        rule = min(bounds, key=lambda one: one.speed).text
        if min(b.speed for b in bounds) < max(b.speed for b in bounds):
            rule = rule.replace("m/s, ", "m/s (in the smallest scene), ")
        notes = [f"{used} frames. {' '.join(self.about)}", f"{rule[0].upper()}{rule[1:]}"]
        return Map(self.scene, self.title, self.across, self.up, self.columns, self.rows, panels, notes)


def _cell(kept: Entry) -> Cell:
    outcome = kept.outcome
    kind = outcome.kind or ("" if kept.result.recording is not None else "no result")
    return Cell(outcome.state, "out of\ntime" if kept.result.stopped else kind, outcome.frame)


def _request(scene: str, method: str, iterations: int, changes: Sizes, dt: float | None = None) -> Request:
    parts = min(DEFAULT_SUBSTEPS.get(method, 1), iterations)
    preset = "default" if method in (*METHODS, "auto") else None
    return Request(scene, method, iterations, preset, parts, changes=tuple(changes.items()), dt=dt)


def _frames(plan: Plan, dt: float) -> int:
    return max(SETTLED_FRAME + 1, math.ceil(plan.atlas_seconds / dt))


def heavy_pendulum(plan: Plan) -> MapPlan:
    ratios = [1, 30, 300, 10000] if plan.coarse else [1, 10, 100, 300, 1000, 10000, 50000]
    links = [5, 10, 20, 40] if plan.coarse else [5, 10, 20, 30, 50, 100]
    iterations = 100
    panels = {
        NAMES[method]: {
            (row, column): _task(
                plan,
                _request("heavy-pendulum", method, iterations, {"links": links[column], "mass_ratio": ratios[row]}),
                _frames(plan, 0.016),
            )
            for row in range(len(ratios))
            for column in range(len(links))
        }
        for method in _ALL
    }
    about = (
        f"Default preset, {iterations} iterations a step in all; TJ, TJSoft and stock + substeps take 10 substeps; "
        "auto at most both."
    )
    title = "Mass ratio and length of a chain (heavy-pendulum)"
    rows = [f"{r:g}" for r in ratios]
    return MapPlan("heavy-pendulum", title, "links", "mass ratio", [str(n) for n in links], rows, panels, [about])


def column(plan: Plan) -> MapPlan:
    boxes = [5, 10, 15, 25] if plan.coarse else [5, 10, 15, 20, 30, 40]
    iterations = [10, 30, 100, 200] if plan.coarse else [10, 20, 40, 100, 200, 300]
    panels = {
        NAMES[method]: {
            (row, place): _task(
                plan, _request("column", method, iterations[row], {"boxes": boxes[place]}), _frames(plan, 0.016)
            )
            for row in range(len(iterations))
            for place in range(len(boxes))
        }
        for method in _ALL
    }
    about = (
        "Default preset; TJ, TJSoft and stock + substeps take 10 substeps, auto at most as many. Where Dantzig's "
        "fails, Bullet takes PGS."
    )
    title = "Height of a stack and iterations (column)"
    rows = [str(n) for n in iterations]
    return MapPlan(
        "column", title, "boxes high", "iterations of a step", [str(n) for n in boxes], rows, panels, [about]
    )


def stack(plan: Plan) -> MapPlan:
    steps = [0.004, 0.008, 0.016, 0.033] if plan.coarse else [0.002, 0.004, 0.008, 0.016, 0.033]
    substeps = [1, 2, 5, 10] if plan.coarse else [1, 2, 4, 5, 10, 20]
    iterations = 10 if plan.coarse else 20
    changes = plan.sizes.get("stack-1m", {})

    def task(method: str, dt: float, parts: int) -> Task:
        name = "stock" if method == "stock-substeps" and parts == 1 else method
        preset = "default" if method in METHODS else None
        request = Request("stack-1m", name, iterations, preset, parts, changes=tuple(changes.items()), dt=dt)
        return _task(plan, request, _frames(plan, dt))

    panels = {
        NAMES[method]: {
            (row, place): task(method, steps[place], substeps[row])
            for row in range(len(substeps))
            for place in range(len(steps))
        }
        for method in ("tj", "tjsoft", "stock-substeps")
    }
    size = " × ".join(f"{int(changes.get(name, 5))}" for name in ("columns", "layers", "rows"))
    about = (
        f"{size} boxes, default preset, {iterations} iterations of a step in all, shared out over its substeps; "
        f"{plan.atlas_seconds:g} s, or {SETTLED_FRAME + 1} frames if that is longer. "
        "With one substep stock + substeps is stock PGS."
    )
    return MapPlan(
        "stack-1m", "Step and substeps (stack-1m)", "step [ms]", "substeps", [f"{1e3 * dt:g}" for dt in steps],
        [str(n) for n in substeps], panels, [about],
    )  # fmt: skip


def overlap(plan: Plan) -> MapPlan:
    depths = [0.01, 0.05, 0.1, 0.25, 0.5] if plan.coarse else [0.01, 0.02, 0.05, 0.1, 0.25, 0.4, 0.5]
    iterations = 100
    solvers = [(method, preset) for method in METHODS for preset in PRESETS]
    solvers.append(("auto", "default"))
    solvers += [(method, "") for method in ("stock", "stock-substeps", "nncg", "dantzig")]
    solvers.reverse()  # rows count upwards
    rows = [family_name(method, preset) for method, preset in solvers]

    def task(method: str, preset: str, depth: float) -> Task:
        parts = DEFAULT_SUBSTEPS.get(method, 1)
        changes = (("spacing", 1.0 - depth),)
        return _task(
            plan, Request("overlap", method, iterations, preset or None, parts, changes=changes), _frames(plan, 0.016)
        )

    cells = {
        (row, place): task(method, preset, depth)
        for row, (method, preset) in enumerate(solvers)
        for place, depth in enumerate(depths)
    }
    about = (
        f"Boxes 1 m long; {iterations} iterations of a step in all, TJ, TJSoft and stock + substeps in 10 substeps, "
        "auto in at most as many."
    )
    return MapPlan(
        "overlap", "Depth of an overlap and method (overlap)", "depth at the start [m]", "method",
        [f"{d:g}" for d in depths], rows, {"overlap": cells}, [about],
    )  # fmt: skip


MAPS = {"heavy-pendulum": heavy_pendulum, "column": column, "stack-1m": stack, "overlap": overlap}


# ---- The paper ---------------------------------------------------------------------------------------------------

PAPER_SCENES = ("joints", "crank", "stack", "chain", "overlap", "jeep-bridge", "windmill")  # Figures 3 to 11


def paper(plan: Plan, chosen: Sequence[str]) -> dict[str, list[Task]]:
    """The paper's runs by scene: its five methods and preset, 300 iterations a step in all, 10 substeps of TJ's."""
    found = {}
    for scene in PAPER_SCENES:
        if scene in chosen:
            changes = tuple(plan.sizes.get(scene, {}).items())
            frames = plan.frames_of(scene)
            parts = {method: DEFAULT_SUBSTEPS.get(method, 1) for method in METHODS}
            requests = [Request(scene, method, 300, "paper", parts[method], changes=changes) for method in METHODS]
            found[scene] = [_task(plan, request, frames) for request in requests]
    return found


# ---- Ablations ---------------------------------------------------------------------------------------------------

ABLATED = ("stack", "stack-1m", "chain-1m", "overlap", "pyramid", "inverted", "arch")  # scenes

# One option of the default preset changed at a time: name, parameters.
_BOTH: Sequence[tuple[str, Mapping[str, ParamValue]]] = (
    ("no acceleration", {"acceleration": "none"}),
    ("split by point, not manifold", {"splitting": "point"}),
    ("contacts start cold", {"contact_warm_start": 0.0}),
    ("joints start warm, by half", {"joint_warm_start": 0.5}),
    ("no relaxation", {"relax_share": 0.0}),
    ("friction: pyramid, not cone", {"friction_model": "pyramid"}),
    ("push-out speed without a cap", {"max_push_speed": math.inf}),
)
_SOFT: Sequence[tuple[str, Mapping[str, ParamValue]]] = (
    ("static bodies no stiffer", {"static_hertz_scale": 1.0}),
    ("soft frequency without a limit", {"hertz_limit": math.inf}),
    ("contacts at 60 Hz, not 30", {"contact_hertz": 60.0}),
    ("damping ratio 1, not 5", {"contact_damping_ratio": 1.0, "joint_damping_ratio": 1.0}),
)


@dataclass(frozen=True)
class AblationPlan:
    """The runs of an ablation: the unchanged one of each scene, and each option's."""

    method: str
    settings: str
    base: Mapping[str, Task]
    changed: Mapping[str, Mapping[str, Task]]

    @property
    def tasks(self) -> list[Task]:
        return [*self.base.values(), *(task for tasks in self.changed.values() for task in tasks.values())]

    def ablation(self, found: Mapping[Task, Entry]) -> Ablation:
        """The chart's content, of what its runs came to."""
        changed = {o: {s: found[t].result for s, t in tasks.items()} for o, tasks in self.changed.items()}
        base = {scene: found[task].result for scene, task in self.base.items()}
        errors = ", ".join(f"{scene} {measured_text(found[task])}" for scene, task in self.base.items())
        notes = [
            f"{NAMES[self.method]} {self.settings}, default preset, with one option changed. A cell: the scene's error "
            "over the unchanged run's, and below it the time of a step, likewise. Errors unchanged: " + errors + ".",
        ]
        title = f"{NAMES[self.method]} {self.settings}: one option changed at a time"
        return Ablation(f"ablation-{self.method}", title, list(self.base), base, changed, notes)


def measured_text(entry: Entry) -> str:
    """The error of a run, for people, or how it failed."""
    if entry.result.failed:
        return "fails"
    return number(entry.result.number("error"), report_outcome.measured(entry.scene).unit)


def ablations(plan: Plan, chosen: Sequence[str]) -> list[AblationPlan]:
    """TJSoft in 4 substeps of 10 and PJSoft with 40 sweeps, in those scenes that are chosen."""
    names = [scene for scene in ABLATED if scene in chosen]
    if not names:
        return []

    def task(scene: str, method: str, parts: int, options: Mapping[str, ParamValue], preset: str = "default") -> Task:
        changes = (*plan.sizes.get(scene, {}).items(), *options.items())
        request = Request(scene, method, 40, preset, parts, changes=changes)
        return _task(plan, request, plan.frames_of(scene))

    made = []
    for method, parts, rigid in (("tjsoft", 4, "tj"), ("pjsoft", 1, "pj")):
        changed = {
            option: {scene: task(scene, method, parts, options) for scene in names}
            for option, options in (*_BOTH, *_SOFT)
        }
        changed[f"rigid: {NAMES[rigid]}"] = {scene: task(scene, rigid, parts, {}) for scene in names}
        if method == "tjsoft":
            for others in (2, 10):
                changed[f"{others} substeps, not {parts}"] = {s: task(s, method, others, {}) for s in names}
            changed["no substeps: PJSoft"] = {scene: task(scene, "pjsoft", 1, {}) for scene in names}
        changed["all of the paper's preset"] = {scene: task(scene, method, parts, {}, "paper") for scene in names}
        base = {scene: task(scene, method, parts, {}) for scene in names}
        settings = base[names[0]].request.settings
        made.append(AblationPlan(method, settings, base, changed))
    return made


def everything(plan: Plan, chosen: Sequence[str]) -> tuple[dict[str, list[Task]], list[MapPlan]]:
    """Tasks for work and precision by scene, and the maps of those scenes that have one."""
    return {s: work_precision(plan, s) for s in chosen}, [MAPS[s](plan) for s in MAPS if s in chosen]
