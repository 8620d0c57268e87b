"""Runs many scenes at once, in processes that each have a processor core of their own and one solver thread.

A process that dies takes nothing with it but the run that it was at, whose error says how it died.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import queue
import signal
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Callable, cast

from .charts.result import Request, Result

_REPORT = 0.3  # s between two words of a run on how far it is
_STUCK = 50.0  # times its processor time and 5 s: wall-clock time after which a run is stuck, within a step

Progress = Callable[[Request, int], None]  # a request and how many of its frames are done


@dataclass(frozen=True)
class Task:
    request: Request
    frames: int
    keep_poses_every: int = 0
    limit_s: float = math.inf  # processor time after which the run is given up


def cores(jobs: int) -> list[int | None]:
    """A core for each of so many jobs, or None where the system cannot pin processes or has fewer cores than jobs."""
    if not hasattr(os, "sched_getaffinity"):
        return [None] * jobs
    allowed = sorted(os.sched_getaffinity(0))
    return [*allowed[:jobs]] if len(allowed) >= jobs else [None] * jobs


class Pool:
    """Processes that wait for tasks, one a job; a context manager. A process that dies is replaced."""

    def __init__(self, jobs: int) -> None:
        self.pinned = all(core is not None for core in cores(jobs))
        self._jobs = jobs
        self._free: queue.Queue[_Worker] = queue.Queue()
        for core in cores(jobs):
            self._free.put(_Worker(core))

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        while not self._free.empty():
            self._free.get().stop()

    def run(
        self, tasks: Sequence[Task], progress: Progress, done: Callable[[Task, Result], None] | None = None
    ) -> list[Result]:
        """Run tasks, as many at a time as there are jobs; results in their order.

        progress, and done as soon as a task is, may come from any thread.
        """

        def one(task: Task) -> Result:
            worker = self._free.get()
            try:
                result = worker.run(task, progress)
            finally:
                self._free.put(worker)
            if done is not None:
                done(task, result)
            return result

        with ThreadPoolExecutor(self._jobs) as threads:
            return list(threads.map(one, tasks))


class _Worker:
    def __init__(self, core: int | None) -> None:
        self._core = core
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(self._core, theirs), daemon=True)
        self._process.start()
        theirs.close()

    def run(self, task: Task, progress: Progress) -> Result:
        try:
            self._pipe.send(task)
            deadline = time.monotonic() + _STUCK * (task.limit_s + 5)
            while True:
                if math.isfinite(deadline) and not self._pipe.poll(max(0.0, deadline - time.monotonic())):
                    self._process.kill()
                    self._process.join()
                    self._start()
                    return Result(task.request, error=f"given up after {task.limit_s:g} s, within a step", stopped=True)
                kind, value = self._pipe.recv()
                if kind == "done":
                    return cast(Result, value)
                if kind in ("failed", "stopped"):
                    return Result(task.request, error=value, stopped=kind == "stopped")
                progress(task.request, value)
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode or 0
            self._start()
            how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
            return Result(task.request, error=f"its process ended with {how}")
        finally:
            progress(task.request, task.frames)

    def stop(self) -> None:
        self._pipe.close()  # the process reads the end of its tasks
        self._process.join()


class _TimeUpError(Exception):
    """A run's time is up."""


def _work(core: int | None, pipe: Connection) -> None:
    """The process: works until there are no more tasks, or the user interrupts the program."""
    with suppress(KeyboardInterrupt):
        _loop(core, pipe)


def _loop(core: int | None, pipe: Connection) -> None:
    """A task in, words of progress and a recording out."""
    if core is not None:
        os.sched_setaffinity(0, {core})
    while True:
        try:
            task: Task = pipe.recv()
        except EOFError:
            return
        result = perform(task, lambda frames: pipe.send(("frames", frames)))
        if result.recording is not None:
            pipe.send(("done", result))
        else:
            pipe.send(("stopped" if result.stopped else "failed", result.error))


def perform(task: Task, tell: Callable[[int], None] = lambda frames: None) -> Result:
    """Run a task here, with one solver thread; a result that can be sent to another process.

    tell: called with the frames that are done, every third of a second.
    """
    from .run import run

    request = task.request
    began, spent = time.monotonic(), time.thread_time()
    last = began

    def progress(frames: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last > _REPORT:
            last = now
            tell(frames)
        if time.thread_time() - spent > task.limit_s and frames < task.frames:
            raise _TimeUpError(f"given up after {task.limit_s:g} s, at frame {frames} of {task.frames}")

    try:
        recording = run(
            request.scene,
            request.method,
            preset=request.preset,
            iterations=request.iterations,
            position_iterations=request.position_iterations,
            substeps=request.substeps,
            frames=task.frames,
            dt=request.dt,
            settings=dict(request.changes),
            threads=1,
            keep_poses_every=task.keep_poses_every,
            trace_frame=0,
            progress=progress,
        )
    except _TimeUpError as error:
        return Result(request, error=str(error), stopped=True)
    except Exception as error:  # whatever it is, it is this run's, and the report shows it
        return Result(request, error=f"{type(error).__name__}: {error}")
    # Without the functions that made its series, which need not be such as can be sent.
    recording = replace(recording, scene=replace(recording.scene, quantities={}, motions={}))
    return Result(request, recording, seconds=time.monotonic() - began)
