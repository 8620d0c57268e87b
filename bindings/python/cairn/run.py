"""Runs a scene in Bullet under one method and judges it: `run` gives a `Recording`.

    >>> from cairn.run import run
    >>> run("stack", "tjsoft", frames=300).summary["max_drift_m"]

What the summary's keys mean is in `cairn.summary` and in `cairn run --help`.
"""

from __future__ import annotations

import os
import platform
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Callable

import numpy as np

from . import scenes
from .bullet import STOCK_METHODS as STOCK
from .bullet import BulletWorld
from .recording import Judge, Recording, Times
from .scenes.model import Array, Scene
from .solver import METHODS as CAIRN_METHODS
from .solver import NOT_FINITE, REASONS, Error, ParamValue, info
from .solver import preset as preset_of

METHODS = (*CAIRN_METHODS, *STOCK)
STAGES = ("pack", "build", "sweep", "position", "integrate", "finish")  # of cairn_statistics


def check_method(method: str) -> None:
    """ValueError for an unknown method."""
    if method not in METHODS:
        raise ValueError(f"no method is called '{method}'; there are {', '.join(METHODS)}")


def split_settings(
    scene: str | Scene, method: str, settings: Mapping[str, ParamValue]
) -> tuple[dict[str, float], dict[str, ParamValue]]:
    """Settings by whose they are: the scene's sizes and the solver's parameters. ValueError for a name of neither."""
    sizes = [] if isinstance(scene, Scene) else list(scenes.settings_of(scene))
    params = [] if method in STOCK else list(preset_of(method))
    of_scene: dict[str, float] = {}
    of_solver: dict[str, ParamValue] = {}
    for name, value in settings.items():
        if name in sizes:
            try:
                of_scene[name] = float(value)
            except ValueError:
                raise ValueError(f"{name} = '{value}' is not a number") from None
        elif name in params:
            of_solver[name] = value
        else:
            raise ValueError(
                f"nothing is called '{name}' here; sizes of the scene: {', '.join(sizes) or 'none'}; "
                f"parameters of {method}: {', '.join(params) or 'none'}"
            )
    return of_scene, of_solver


def build_text() -> str:
    """How libcairn was built, and the machine."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        model = names[0] if names else model
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{info()['build']}; {model}, {cores} cores"


def run(
    scene: str | Scene,
    method: str,
    preset: str | None = None,
    iterations: int | None = None,
    position_iterations: int | None = None,
    substeps: int | None = None,
    frames: int | None = None,
    dt: float | None = None,
    threads: int | None = None,
    settings: Mapping[str, ParamValue] | None = None,
    keep_poses_every: int = 0,
    trace_frame: int | None = 0,
    progress: Callable[[int], None] | None = None,
) -> Recording:
    """Run a scene and record it.

    scene: a name of `cairn.scenes.SCENES`, or a Scene. method: "pj", "pjnj", "pjsoft", "tj", "tjsoft", or Bullet's own:
    "stock" and "stock-substeps" (PGS), "nncg", "dantzig". preset: "default" or "paper". iterations, position_iterations
    and substeps as in the preset unless given; iterations are those of a step in all, shared out over its substeps.
    Bullet's own take 10 each substep, and "stock-substeps" 10 substeps, unless told otherwise. frames: steps to make;
    dt: s, of each; both the scene's unless given. threads: 0 or None for as many as the process may use. settings:
    sizes of the scene and parameters of the solver, by name. keep_poses_every: 0 for no poses, else one sample every so
    many frames. trace_frame: the step, counted from 0, whose residuals are recorded; None for none. progress: called
    after every frame with their number.

    A run that turns infinite or NaN ends early with summary["finite"] false. ValueError for a name or number that is
    unknown or out of range; cairn.Error where the library refuses.
    """
    check_method(method)
    sizes, params = split_settings(scene, method, settings or {})
    built = scene if isinstance(scene, Scene) else scenes.build(scene, **sizes)
    built = replace(built, dt=built.dt if dt is None else dt)
    frames = built.frames if frames is None else frames
    if frames < 1:
        raise ValueError(f"frames = {frames} must be at least 1")
    if method in STOCK:
        if preset is not None or position_iterations is not None:
            raise ValueError(f"{method} is Bullet's own solver: it has no presets and no position iterations")
        runner: _Runner = _Stock(built, method, iterations, substeps)
    else:
        given = {"iterations": iterations, "position_iterations": position_iterations, "substeps": substeps}
        params.update({name: value for name, value in given.items() if value is not None})
        runner = _Cairn(built, method, preset or "default", params, threads or 0, trace_frame)

    judge = Judge(built, frames)
    poses = [runner.world.poses] if keep_poses_every else []
    pose_frames = [0] if keep_poses_every else []
    leaving = [(body.removed_at, index) for index, body in enumerate(built.bodies) if body.removed_at is not None]
    for frame in range(frames):
        for last, index in leaving:
            if last == frame:
                runner.world.remove(index)
        if not (runner.step(frame, judge) and judge.finite):
            break
        if keep_poses_every and judge.frames % keep_poses_every == 0:
            poses.append(runner.world.poses)
            pose_frames.append(judge.frames)
        if progress is not None:
            progress(judge.frames)

    request = {"scene": built.name, "method": method, "dt": built.dt, **runner.request}
    return Recording(
        summary=judge.summary(request, runner.rows, build_text()),
        frames=judge.finished_series(),
        stage_ms={stage: float(np.median(times)) for stage, times in runner.stage_ms.items() if times},
        residual_trace=runner.residual_trace,
        poses=np.array(poses, dtype=np.float64).reshape(-1, len(built.bodies), 7),
        pose_frames=np.array(pose_frames, dtype=np.float64),
        scene=built,
        choices=runner.choices,
    )


def _state(world: BulletWorld) -> Array:
    return np.hstack([world.poses, world.velocities])


class _Runner(ABC):
    """Steps a world and tells the judge; `request` holds those keys of the summary that say what was asked for."""

    world: BulletWorld
    request: dict[str, object]

    def __init__(self) -> None:
        self.rows: list[float] = []
        self.stage_ms: dict[str, list[float]] = {}
        self.residual_trace: Array = np.zeros(0)

    @property
    def choices(self) -> str | None:
        """What the method auto did in the last step."""
        return None

    @abstractmethod
    def step(self, frame: int, judge: Judge) -> bool:
        """False if the step left the range of numbers."""


class _Cairn(_Runner):
    def __init__(
        self,
        scene: Scene,
        method: str,
        preset: str,
        params: Mapping[str, ParamValue],
        threads: int,
        trace_frame: int | None,
    ) -> None:
        super().__init__()
        self.world = BulletWorld(scene, method, preset=preset, params=params, threads=threads)
        self._traces = bool(self.world.params["residual_trace"])
        self._trace_frame = trace_frame
        self.stage_ms = {stage: [] for stage in STAGES}
        names = ("iterations", "position_iterations", "substeps")
        self.request = {"preset": preset, **{name: int(self.world.params[name]) for name in names}}

    def step(self, frame: int, judge: Judge) -> bool:
        traced = frame == self._trace_frame
        if traced and not self._traces:  # only now: a traced sweep costs more, which the times should not show
            self.world.set_params(residual_trace=1)
        try:
            self.world.step()
        except Error as error:
            if error.status != NOT_FINITE:
                raise
            judge.finite = False
            return False
        if traced:
            self.residual_trace = self.world.residual_trace
            self.world.set_params(residual_trace=int(self._traces))
        statistics = self.world.statistics
        for stage, spans in self.stage_ms.items():
            spans.append(1e3 * statistics[f"time_{stage}"])
        self.rows.append(statistics["rows"])
        spent = Times(1e3 * self.world.solver_seconds, 1e3 * self.world.step_seconds)
        change = statistics["kinetic_energy_change"]
        return judge.see(_state(self.world), self.world.contacts["separation"], change, spent)

    @property
    def choices(self) -> str | None:
        return choices_text(self.world.choices) if self.world.method == "auto" else None


def choices_text(choices: Mapping[str, Array]) -> str:
    """`choices` of a solver in words, a clause for each reason that there is."""
    clauses = []
    for reason, text in enumerate(REASONS):
        these = choices["reason"] == reason
        count = int(these.sum())
        if count == 0:
            continue
        method = CAIRN_METHODS[int(choices["method"][these][0])]
        swept, substeps = int(choices["swept"][these].max()), int(choices["substeps"][these][0])
        met = int((choices["met"][these] != 0).sum())
        clauses.append(
            f"{count} x {text} ({method}, substeps {substeps}, at most {swept} sweeps made, tolerance met by {met})"
        )
    return "; ".join(clauses)


class _Stock(_Runner):
    """Bullet's own solver.

    Substeps are taken one by one, as stepSimulation(dt, n, dt / n) does, to see what each makes of the energy.
    """

    def __init__(self, scene: Scene, method: str, iterations: int | None, substeps: int | None) -> None:
        super().__init__()
        # The world that would take them in one go checks them, and says how they are shared out.
        whole = BulletWorld(scene, method, iterations=iterations, substeps=substeps)
        self._substeps = whole.substeps
        self.request = {
            "preset": None,
            "iterations": whole.iterations,
            "position_iterations": None,
            "substeps": whole.substeps,
        }
        each = whole.iterations // whole.substeps
        once = "stock" if method == "stock-substeps" else method
        self.world = BulletWorld(replace(scene, dt=scene.dt / whole.substeps), once, iterations=each)

    def step(self, frame: int, judge: Judge) -> bool:
        states = [_state(self.world)]
        solver = step = 0.0
        for _ in range(self._substeps):
            self.world.step()
            states.append(_state(self.world))
            solver += self.world.solver_seconds
            step += self.world.step_seconds
        change = judge.kinetic_energy_change(np.array(states), self.world.dt)
        return judge.see(states[-1], self.world.contacts["separation"], change, Times(1e3 * solver, 1e3 * step))


__all__ = ["METHODS", "STAGES", "STOCK", "Recording", "build_text", "check_method", "run", "split_settings"]
