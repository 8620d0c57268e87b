"""What is kept of each run of the report, a file a run, so that an interrupted report goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import report_outcome, scenes
from .charts import claims
from .charts.result import Result
from .recording import Recording
from .report_outcome import Outcome
from .run import STOCK, build_text, split_settings
from .scenes.model import Scene
from .solver import preset
from .workers import Task

FORMAT = 3  # of the files; grows when what they hold, or how a run is judged, changes


@dataclass(frozen=True)
class Entry:
    """A run as the report sees it."""

    task: Task
    result: Result  # its summary alone, and with it the scene's "error"; no series, no poses
    outcome: Outcome
    conditions: str  # how its time was taken

    @property
    def scene(self) -> Scene:
        return scene_of(self.task)

    def of(self, task: Task) -> Entry:
        """The same run as another task's, which asks for it in other words."""
        return replace(self, task=task, result=replace(self.result, request=task.request))


def scene_of(task: Task) -> Scene:
    """The scene that a task runs, at its sizes."""
    request = task.request
    sizes, _ = split_settings(request.scene, request.method, dict(request.changes))
    return scenes.build(request.scene, **sizes)


def key(task: Task) -> dict[str, Any]:
    """All that a run depends on: scene, sizes, method, parameters, and the build of libcairn and the machine."""
    request = task.request
    sizes, changes = split_settings(request.scene, request.method, dict(request.changes))
    built = scenes.build(request.scene, **sizes)
    params: Mapping[str, Any] = {} if request.method in STOCK else preset(request.method, request.preset or "default")
    return {
        "format": FORMAT,
        "scene": request.scene,
        "sizes": dict(built.settings),
        "dt": request.dt or built.dt,
        "frames": task.frames,
        "method": request.method,
        "iterations": request.iterations,
        "substeps": request.substeps,
        "position_iterations": request.position_iterations,
        "params": {**params, **changes},
        "limit_s": None if math.isinf(task.limit_s) else task.limit_s,
        "build": build_text(),
    }


def path_of(folder: Path, task: Task) -> Path:
    digest = hashlib.sha256(json.dumps(key(task), sort_keys=True).encode()).hexdigest()
    return folder / f"{task.request.scene}-{task.request.method}-{digest[:20]}.json"


def entry(task: Task, result: Result, conditions: str) -> Entry:
    """Judge a run."""
    recording = result.recording
    if recording is None:
        return Entry(task, result, Outcome(report_outcome.UNKNOWN, "out of time" if result.stopped else ""), conditions)
    error = report_outcome.error_of(recording)
    summary = {**recording.summary, **claims.derived(recording), "error": error if math.isfinite(error) else None}
    outcome = report_outcome.outcome(recording)
    flew, fell = report_outcome.exploded(recording), _fell(recording.scene, outcome)
    kept = Result(result.request, _bare(summary, recording.scene), "", result.seconds, exploded=flew, collapsed=fell)
    return Entry(task, kept, outcome, conditions)


def _fell(scene: Scene, outcome: Outcome) -> bool:
    return scene.tolerance is not None and outcome.kind == report_outcome.COLLAPSED


def _bare(summary: dict[str, Any], scene: Scene) -> Recording:
    return Recording(summary, {}, {}, np.zeros(0), np.zeros((0, len(scene.bodies), 7)), np.zeros(0), scene)


def save(folder: Path, kept: Entry) -> None:
    """Write a run's file, whole or not at all. A run without a result is not kept, unless its time was up."""
    result = kept.result
    if result.recording is None and not result.stopped:
        return
    content = {
        "key": key(kept.task),
        "summary": None if result.recording is None else result.recording.summary,
        "error": result.error,
        "seconds": result.seconds,
        "outcome": asdict(kept.outcome),
        "conditions": kept.conditions,
    }
    write(path_of(folder, kept.task), (json.dumps(content, indent=1) + "\n").encode())


def load(folder: Path, task: Task) -> Entry | None:
    """What is kept of a task; None if it was not run, or its file cannot be read."""
    try:
        content = json.loads(path_of(folder, task).read_text(encoding="utf-8"))
        outcome = Outcome(**content["outcome"])
        summary, error, seconds = content["summary"], str(content["error"]), float(content["seconds"])
        conditions = str(content["conditions"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    recording = None if summary is None else _bare(summary, scene_of(task))
    flew = recording is not None and report_outcome.exploded(recording)
    fell = recording is not None and _fell(recording.scene, outcome)
    result = Result(task.request, recording, error, seconds, stopped=summary is None, exploded=flew, collapsed=fell)
    return Entry(task, result, outcome, conditions)


def write(target: Path, content: bytes) -> None:
    """Write a file, whole or not at all."""
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=target.name, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(name).chmod(0o644)
        Path(name).replace(target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
