"""The paper's comparison, computed here: `python -m cairn.demo` writes a report to look at and its figures as JSON.

Runs `stack`, `chain` and `overlap` under the five methods with both presets, and under Bullet's own solver with few and
many iterations and with substeps. Takes about ten minutes on two cores, or as many frames as fit into that.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shlex
import sys
import threading
import time
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Callable

from tqdm import tqdm

from . import scenes, workers
from .charts import report
from .charts.result import METHODS, PRESETS, Comparison, Request, Result
from .cluster import Cluster

SCENES = ("stack", "chain", "overlap")
ITERATIONS = 300  # of a step in all, as in the paper
SUBSTEPS = 10
STOCK = (10, 50, 300)  # iterations
STOCK_SUBSTEPS = ((100, 10), (300, 10))  # iterations in all, substeps
FEWER = (
    (40, 4),
    (100, 10),
)  # further points of the error-against-time charts: iterations in all, substeps of TJ and TJSoft
FRAMES = 3000  # the paper's
QUICK_FRAMES = 120
LEAST_FRAMES = 300
CALIBRATION_FRAMES = 20
RUN_SECONDS = 450.0  # what the runs may take; measuring their cost, charts and replays come on top, about a minute

# The pile falls late, if it does: all of its run, quickly. Chains and overlaps show themselves at once: in real time.
WINDOWS = {
    "stack": report.Window(frames=None, every=12, speed=3.0),
    "chain": report.Window(frames=960, every=4, speed=1.0),
    "overlap": report.Window(frames=240, every=2, speed=0.5, charted=300),
}


def requests(scene: str, quick: bool = False) -> list[Request]:
    """Every run of a scene: the paper's comparison, stock PGS beside it, and fewer iterations unless quick."""

    def substeps(method: str, wanted: int) -> int:
        return wanted if method in ("tj", "tjsoft") else 1

    wanted = [
        Request(scene, method, ITERATIONS, preset, substeps(method, SUBSTEPS))
        for preset in PRESETS
        for method in METHODS
    ]
    wanted += [Request(scene, "stock", iterations) for iterations in STOCK]
    wanted += [Request(scene, "stock-substeps", iterations, None, parts) for iterations, parts in STOCK_SUBSTEPS]
    if not quick:
        wanted += [
            Request(scene, method, iterations, "default", substeps(method, parts), main=False)
            for method in METHODS
            for iterations, parts in FEWER
        ]
    return wanted


def frames_that_fit(costs: dict[str, float], seconds: float) -> dict[str, int]:
    """Frames for each scene, at most FRAMES, from what a frame of all its runs costs (s), to take `seconds` in all.

    What a cheap scene leaves over goes to the dearer ones. Never fewer than LEAST_FRAMES: then it takes longer.
    """
    fit: dict[str, int] = {}
    left = seconds
    for index, scene in enumerate(sorted(costs, key=lambda s: costs[s])):
        share = left / (len(costs) - index)
        frames = min(FRAMES, int(share / costs[scene]) if costs[scene] > 0 else FRAMES)
        fit[scene] = max(LEAST_FRAMES, frames // 100 * 100)
        left -= fit[scene] * costs[scene]
    return fit


class Bar:
    """One progress bar over many runs: its length is the runs' expected seconds, its text the runs that are going."""

    def __init__(self, costs: dict[Request, float], title: str) -> None:
        self._costs, self._title = costs, title
        self._done: dict[Request, int] = {}
        self._frames: dict[Request, int] = {}
        self._lock = threading.Lock()
        layout = "{desc} {percentage:3.0f}% |{bar:24}| {elapsed} < {remaining}"
        self._bar = tqdm(total=0.0, desc=title, bar_format=layout, disable=None)

    def expect(self, tasks: Sequence[workers.Task]) -> None:
        self._frames = {task.request: task.frames for task in tasks}
        self._bar.total = sum(self._costs[task.request] * task.frames for task in tasks)
        self._bar.refresh()

    def __call__(self, request: Request, frames: int) -> None:
        with self._lock:
            advance = (frames - self._done.get(request, 0)) * self._costs[request]
            self._done[request] = frames
            going = [r for r, done in self._done.items() if done < self._frames[r]]
            names = "; ".join(f"{r.scene} {r.label}" for r in going)
            self._bar.set_description_str(f"{self._title}: {names}" if names else self._title, refresh=False)
            self._bar.update(advance)

    def close(self) -> None:
        self._bar.set_description_str(self._title)
        self._bar.close()


def run_with_bar(
    pool: workers.Pool | Cluster,
    tasks: Sequence[workers.Task],
    costs: dict[Request, float],
    title: str,
    done: Callable[[workers.Task, Result], None] | None = None,
) -> list[Result]:
    """Run tasks, the dearest first so that no core waits at the end; results in the tasks' order.

    costs: of a frame of each request, s or another unit. done: called, from any thread, as soon as a task is.
    """
    order = sorted(tasks, key=lambda task: -costs[task.request] * task.frames)
    bar = Bar(costs, title)
    bar.expect(order)
    try:
        found = {result.request: result for result in pool.run(order, bar, done)}
    finally:
        bar.close()
    return [found[task.request] for task in tasks]


def conditions_text(jobs: int, pinned: bool) -> str:
    if jobs == 1:
        return "medians, one run at a time, one solver thread"
    how = "each pinned to its own core" if pinned else "not pinned to cores"
    return f"medians, {jobs} runs at once, {how}, one solver thread each"


def machine() -> str:
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [
            line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if line.startswith("model name")
        ]
        model = names[0] if names else model
    return f"{model}, {available_cores()} cores, {platform.system()}"


def available_cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m cairn.demo", description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, metavar="N", help=f"of every run; as many of {FRAMES} as fit by default")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR", help="default: %(default)s")
    parser.add_argument(
        "--jobs", type=int, default=min(2, available_cores()), metavar="N",
        help="runs at a time, each on a core of its own; 1 for the most careful times (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--quick", action="store_true", help=f"{QUICK_FRAMES} frames and fewer runs: to see that it works"
    )
    arguments = parser.parse_args(given)
    if arguments.frames is not None and arguments.frames < 1:
        parser.error("--frames must be at least 1")
    if arguments.jobs < 1:
        parser.error("--jobs must be at least 1")
    return arguments


def _used(frames: dict[str, int]) -> str:
    return ", ".join(f"{scene} {count}" for scene, count in frames.items())


def _run(
    pool: workers.Pool, wanted: dict[str, list[Request]], arguments: argparse.Namespace
) -> tuple[list[Result], dict[str, int]]:
    """Results of everything that is wanted, and how many frames each scene was given."""
    everything = [request for requests_of in wanted.values() for request in requests_of]
    tasks = [workers.Task(request, CALIBRATION_FRAMES) for request in everything]
    tried = run_with_bar(pool, tasks, dict.fromkeys(everything, 1.0), "measuring what each run costs")
    cost = {result.request: result.seconds / CALIBRATION_FRAMES for result in tried}
    per_frame = {scene: sum(cost[request] for request in wanted[scene]) for scene in wanted}

    fixed = arguments.frames or (QUICK_FRAMES if arguments.quick else None)
    fit = frames_that_fit(per_frame, RUN_SECONDS * arguments.jobs)
    frames = {scene: fixed or fit[scene] for scene in wanted}
    expected = sum(per_frame[scene] * frames[scene] for scene in wanted) / arguments.jobs
    print(
        f"{len(everything)} runs; frames: {_used(frames)} (the paper's: {FRAMES}); "
        f"about {expected / 60 + 0.5:.0f} min on this machine",
        flush=True,
    )
    tasks = [
        workers.Task(request, frames[request.scene], WINDOWS[request.scene].every if request.main else 0)
        for request in everything
    ]
    return run_with_bar(pool, tasks, cost, "running"), frames


def main(given: Sequence[str] | None = None) -> int:
    """The command line: 0, or 1 if a run gave no recording."""
    from .solver import info

    arguments = _arguments(given)
    began = time.monotonic()
    wanted = {scene: requests(scene, arguments.quick) for scene in SCENES}
    with workers.Pool(arguments.jobs) as pool:
        conditions = conditions_text(arguments.jobs, pool.pinned)
        results, frames = _run(pool, wanted, arguments)
    by_scene = {scene: [r for r in results if r.request.scene == scene] for scene in SCENES}
    used = _used(frames)

    study = report.Study(
        comparisons={scene: Comparison(scene, by_scene[scene], frames[scene]) for scene in SCENES},
        scenes={scene: scenes.build(scene) for scene in SCENES},
        windows=WINDOWS,
        facts=report.Facts(
            machine=machine(),
            build=str(info()["build"]),
            conditions=conditions,
            when=datetime.now(timezone.utc).strftime("%Y-%m-%d"),
            command="./dev demo " + shlex.join(sys.argv[1:] if given is None else given),
        ),
    )
    print("drawing the charts and replays", flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    page, data = arguments.out / "index.html", arguments.out / "results.json"
    data.write_text(json.dumps(report.results(study), indent=1) + "\n", encoding="utf-8")
    page.write_text(report.html(study), encoding="utf-8")

    failed = [result for result in results if result.recording is None]
    for result in failed:
        print(f"no result: {result.request.scene} {result.request.label}: {result.error}", file=sys.stderr)
    print(f"\nFrames used: {used}. Took {(time.monotonic() - began) / 60:.1f} min.")
    print(f"Look at  {page.resolve().as_uri()}\nFigures  {data.resolve()}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
