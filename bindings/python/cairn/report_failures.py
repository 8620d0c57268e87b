"""Replays of what failed: from each scene of the report the runs that fell, flew or turned NaN, side by side."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from . import demo, replay, report_cache, workers
from .charts import style
from .charts.result import Result
from .report_cache import Entry
from .report_outcome import FAILED
from .workers import Task

MOST = 6  # takes of a replay
AFTER = 90  # frames, that a replay goes on after the last of its failures
LONGEST = 600  # frames of a replay: a failure after that is not shown
EVERY = 3  # frames, from one kept pose to the next


@dataclass(frozen=True)
class Shown:
    """A replay: its file's name in the report's folder, and what it shows from left to right."""

    scene: str
    file: str
    takes: Sequence[Entry]


def chosen(entries: Sequence[Entry]) -> list[Entry]:
    """Of each method and preset that failed the run with the most sweeps, Cairn's default preset and Bullet first."""
    failed = [e for e in entries if e.outcome.state == FAILED and 0 < (e.outcome.frame or 0) <= LONGEST]
    by_family: dict[str, Entry] = {}
    for entry in failed:
        best = by_family.setdefault(entry.task.request.family, entry)
        if entry.task.request.iterations > best.task.request.iterations:
            by_family[entry.task.request.family] = entry
    found = sorted(by_family.values(), key=lambda e: e.task.request.preset == "paper")
    return found[:MOST]


def _tasks(takes: Sequence[Entry]) -> list[Task]:
    last = max(entry.outcome.frame or 0 for entry in takes)
    frames = min(last + AFTER, LONGEST + AFTER, *(entry.task.frames for entry in takes))
    return [replace(entry.task, frames=frames, keep_poses_every=EVERY, limit_s=math.inf) for entry in takes]


def _label(entry: Entry) -> str:
    return f"{entry.task.request.label}: {entry.outcome.kind}, frame {entry.outcome.frame}"


def _take(entry: Entry, result: Result) -> replay.Take | None:
    recording = result.recording
    if recording is None or not len(recording.poses):
        return None
    return replay.Take(_label(entry), entry.scene, recording, style.COLOURS[entry.task.request.method])


def write(out: Path, groups: Sequence[Sequence[Entry]], jobs: int) -> list[Shown]:
    """Replays of each group's failures as failures-SCENE.html in `out`, a group a scene; what is there stays.

    Runs them again with their poses, as many at a time as there are jobs.
    """
    wanted = [takes for takes in map(chosen, groups) if takes]
    shown, left = [], []
    for takes in wanted:
        name = takes[0].task.request.scene
        tasks = _tasks(takes)
        keys = json.dumps([report_cache.key(task) for task in tasks], sort_keys=True)
        stamp = out / "cache" / f"failures-{name}.sha256"
        digest = hashlib.sha256(keys.encode()).hexdigest()
        shown.append(Shown(name, f"failures-{name}.html", takes))
        if not (out / shown[-1].file).exists() or not stamp.exists() or stamp.read_text() != digest:
            left.append((shown[-1], tasks, stamp, digest))
    if left:
        everything = [task for _, tasks, _, _ in left for task in tasks]
        costs = {task.request: 1.0 for task in everything}
        with workers.Pool(jobs) as pool:
            results = iter(demo.run_with_bar(pool, everything, costs, "replays of failures"))
        for one, _, stamp, digest in left:
            made = [_take(entry, next(results)) for entry in one.takes]
            whole = [take for take in made if take is not None]
            if whole:
                report_cache.write(out / one.file, replay.page(whole).html.encode())
                report_cache.write(stamp, digest.encode())
    return [one for one in shown if (out / one.file).exists()]
