"""Speed against accuracy, and where methods fail: what `cairn report` runs, keeps and writes.

Work and precision of every setting of every method in every scene, maps of where methods fail, and performance
profiles over all scenes: one page, with each chart as PNG and CSV beside it, and replays of the failures. Every run is
kept as soon as it is done; what is kept is not run again.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

from . import demo, report_cache, report_failures, report_outcome, report_plan, scenes, workers
from .charts import auto, beside_bullet, paper, profiles, style
from .charts.ablation import ablation
from .charts.atlas import atlas
from .charts.drawn import Drawn
from .charts.result import NAMES, Comparison, Request, Result
from .charts.work_precision import work_precision
from .cluster import Cluster
from .report_cache import Entry
from .report_plan import FULL, QUICK, AblationPlan, MapPlan, Plan
from .run import build_text
from .workers import Task


@dataclass(frozen=True)
class Part:
    """A part of the page: its charts, each with a sentence above it and its name in the index."""

    id: str
    title: str
    about: str
    charts: Sequence[tuple[str, str, Drawn]]  # name in the index, sentence, chart
    rows: Sequence[paper.Row] = ()  # of the paper's comparison; written to paper.csv, too


def run(
    tasks: Sequence[Task], cache: Path, jobs: int, resume: bool = True, scheduler: str | None = None
) -> dict[Task, Entry]:
    """Results of all tasks: those kept in `cache`, and the rest run now, as many at a time as there are jobs.

    Each is kept as soon as it is done; resume false runs all of them anew. scheduler: the address of a Dask scheduler
    whose workers run them, in place of this machine's cores. Raises KeyboardInterrupt as the user does, and what
    `cairn.cluster.Cluster` raises.
    """
    alike: dict[Path, list[Task]] = {}  # two charts may ask for one run in different words
    for task in dict.fromkeys(tasks):
        alike.setdefault(report_cache.path_of(cache, task), []).append(task)
    wanted = [same[0] for same in alike.values()]
    found: dict[Task, Entry] = {}
    if resume:
        kept = ((task, report_cache.load(cache, task)) for task in wanted)
        found = {task: entry for task, entry in kept if entry is not None}
    left = [task for task in wanted if task not in found]
    print(f"{len(wanted)} runs, {len(found)} of them kept from before", flush=True)
    lock = threading.Lock()
    if left:
        with workers.Pool(jobs) if scheduler is None else Cluster(scheduler) as pool:
            conditions = demo.conditions_text(jobs, pool.pinned) if isinstance(pool, workers.Pool) else pool.conditions

            def done(task: Task, result: Result) -> None:
                judged = report_cache.entry(task, result, conditions)
                report_cache.save(cache, judged)
                with lock:
                    found[task] = judged

            demo.run_with_bar(pool, left, {task.request: _cost(task.request) for task in left}, "running", done)
    return {task: found[same[0]].of(task) for same in alike.values() for task in same if same[0] in found}


def _cost(request: Request) -> float:
    """About what a frame costs, in no unit: for the order of runs and the progress bar."""
    sizes = dict(request.changes)
    built = scenes.build(
        request.scene, **{k: float(v) for k, v in sizes.items() if k in scenes.settings_of(request.scene)}
    )
    sweeps = 10 * request.substeps + request.iterations
    if request.method == "dantzig":
        sweeps = 4 * len(built.bodies)
    return 100.0 + 0.2 * len(built.bodies) * sweeps


def _frames(counts: Mapping[str, int]) -> str:
    """How many frames of each scene, in words."""
    most = max(counts.values())
    others = ", ".join(f"{scene} {count}" for scene, count in counts.items() if count != most)
    return f"{most} frames of each scene" + (f", but of {others}" if others else "") + "."


def parts(
    found: dict[Task, Entry],
    by_scene: dict[str, list[Task]],
    maps: Sequence[MapPlan],
    changes: Sequence[AblationPlan],
    theirs: Mapping[str, Sequence[Task]],
    footnote: str,
) -> list[Part]:
    """Draw everything."""
    comparisons, shown, scales = [], [], {}
    for scene, tasks in by_scene.items():
        entries = [found[task] for task in tasks]
        built = entries[0].scene
        comparison = Comparison(scene, [e.result for e in entries], max(t.frames for t in tasks))
        comparisons.append(comparison)
        scales[scene] = report_outcome.scale(built)
        sizes = {k: v for k, v in dict(tasks[0].request.changes).items() if not isinstance(v, str)}
        drawn = work_precision(comparison, report_outcome.measured(built), sizes, footnote)
        shown.append((scene, built.why, drawn))
    frames = _frames({c.scene: c.frames for c in comparisons})
    made = [
        Part(
            "work-precision",
            "Work and precision",
            "A scene’s error is the quantity that shows its failure. Down is more accurate, left is quicker. Filled "
            "marks: default preset; hollow: the paper’s. Lines join the iteration counts of one method, preset and "
            "number of substeps; the dark steps are the Pareto front, whose runs are named.",
            shown,
        )
    ]
    if maps:
        made.append(
            Part(
                "atlas",
                "The stability atlas",
                "Where methods stand and where they fail, over two sizes of a scene. Each map says its thresholds.",
                [(plan.scene, "", atlas(plan.map(found), footnote)) for plan in maps],
            )
        )
    if theirs:
        made.append(_paper(found, theirs))
    if changes:
        made.append(
            Part(
                "ablations",
                "Ablations",
                "One option of the default preset changed at a time, all else as it is: what it does to each scene’s "
                "error and to the time of a step. ×10: the error is ten times that of the unchanged run; t 0.8: a step "
                "takes 0.8 of its time. Red is worse, green better, grey the same.",
                [(NAMES[plan.method], "", ablation(plan.ablation(found), footnote)) for plan in changes],
            )
        )
    made.append(
        Part(
            "profiles",
            "Performance profiles",
            "For each solver the share of all scenes in which it meets the tolerance within τ times the time of the "
            "quickest solver that does. At τ = 1: how often it is the quickest; at the right edge: how often it gets "
            "there at all.",
            [("All scenes", "", profiles.profiles(comparisons, scales, frames, footnote))],
        )
    )
    made.append(
        Part(
            "beside-bullet",
            "Where Cairn wins and where it loses",
            "For each scene and three tolerances the quickest setting of Cairn's that meets it, beside the quickest of "
            "Bullet’s own solvers. A scene’s scale is as in the profiles.",
            [("All scenes", "", beside_bullet.beside_bullet(comparisons, scales, footnote))],
        )
    )
    made.append(
        Part(
            "auto",
            "The method auto",
            "It picks a schedule for each island and stops where its tolerance is met. For each of its runs: its time "
            "over that of the quickest setting picked by hand with no more error. Left of 1: quicker than any.",
            [("All scenes", "", auto.auto(comparisons, footnote))],
        )
    )
    return made


def _paper(found: Mapping[Task, Entry], theirs: Mapping[str, Sequence[Task]]) -> Part:
    """The paper's figures and tables, of the runs with its preset."""
    entries = {scene: [found[task] for task in tasks] for scene, tasks in theirs.items()}
    comparisons = {
        scene: Comparison(scene, [e.result for e in some], max(e.task.frames for e in some))
        for scene, some in entries.items()
    }
    built = {scene: some[0].scene for scene, some in entries.items()}
    fine = (report_outcome.SURVIVED, report_outcome.DEGRADED)
    stood = {s: {e.task.request.method: e.outcome.state in fine for e in some} for s, some in entries.items()}
    rows = paper.rows(comparisons, built, stood)
    return Part(
        "paper",
        "The paper, figure by figure",
        f"Its five methods with its preset and 300 iterations a step. {paper.summary(rows)} Each answer is computed "
        f"from the runs. {_frames({scene: c.frames for scene, c in comparisons.items()})} (The paper’s: 3000; its "
        "Figures 1 and 2 are a sketch and a flow chart, the latter is core/method/schedule.h; Figure 9 is its Table 2 "
        "split up, which ./dev demo draws.)",
        [],
        rows,
    )


def write(
    out: Path,
    found: dict[Task, Entry],
    by_scene: dict[str, list[Task]],
    maps: Sequence[MapPlan],
    changes: Sequence[AblationPlan],
    theirs: Mapping[str, Sequence[Task]],
    failures: Sequence[report_failures.Shown],
    command: str,
) -> Path:
    """Write index.html, and a PNG and a CSV a chart, into `out`; returns the page's path."""
    conditions = "; ".join(sorted({entry.conditions for entry in found.values()}))
    footnote = f"{build_text()}; {conditions}"
    made = parts(found, by_scene, maps, changes, theirs, footnote)
    for part in made:
        for _, _, drawn in part.charts:
            report_cache.write(out / f"{drawn.name}.png", drawn.png)
            report_cache.write(out / f"{drawn.name}.csv", drawn.csv.encode())
        if part.rows:
            report_cache.write(out / f"{part.id}.csv", paper.as_csv(part.rows).encode())
    missing = [e for e in found.values() if e.result.recording is None]
    frames = {scene: max(task.frames for task in tasks) for scene, tasks in by_scene.items()}
    page = style.template("study.html").render(
        parts=[
            {
                "id": part.id,
                "title": part.title,
                "about": part.about,
                "rows": part.rows,
                "charts": [
                    {"name": d.name, "title": d.title, "short": short, "why": why, "svg": d.svg}
                    for short, why, d in part.charts
                ],
            }
            for part in made
        ],
        failures=[
            {
                "scene": one.scene,
                "file": one.file,
                "takes": [
                    {"label": e.task.request.label, "kind": e.outcome.kind, "frame": e.outcome.frame} for e in one.takes
                ],
            }
            for one in failures
        ],
        missing=[
            {"scene": e.task.request.scene, "label": e.task.request.label, "why": e.result.error} for e in missing
        ],
        total=len(found),
        frames=_frames(frames),
        footnote=footnote,
        facts=[
            ("machine and build", build_text()),
            ("times", conditions),
            ("runs", f"{len(found)}, {len(missing)} without a result"),
            ("date", datetime.now(timezone.utc).strftime("%Y-%m-%d")),
        ],
        command=command,
    )
    target = out / "index.html"
    report_cache.write(target, page.encode())
    return target


def report(
    out: Path,
    plan: Plan = FULL,
    chosen: Sequence[str] | None = None,
    jobs: int | None = None,
    resume: bool = True,
    command: str = "./dev report",
    scheduler: str | None = None,
) -> Path:
    """Run what is not kept in out/cache, and write the report; returns the page's path.

    chosen: scenes, of `cairn.scenes.SCENES`; None for all. jobs: runs at a time, each on a core of its own; None for
    one a core. scheduler: as in `run`. ValueError for a scene that does not exist.
    """
    names = list(scenes.SCENES) if chosen is None else list(chosen)
    for name in names:
        scenes.settings_of(name)
    by_scene, maps = report_plan.everything(plan, names)
    changes, theirs = report_plan.ablations(plan, names), report_plan.paper(plan, names)
    tasks = [task for some in by_scene.values() for task in some]
    tasks += [task for one in maps for task in one.tasks] + [task for one in changes for task in one.tasks]
    tasks += [task for some in theirs.values() for task in some]
    found = run(tasks, out / "cache", jobs or demo.available_cores(), resume, scheduler)
    groups = [[found[task] for task in some] for some in by_scene.values()]
    failures = report_failures.write(out, groups, jobs or demo.available_cores())
    print("drawing the charts", flush=True)
    return write(out, found, by_scene, maps, changes, theirs, failures, command)


__all__ = ["FULL", "QUICK", "Plan", "report", "run", "write"]
