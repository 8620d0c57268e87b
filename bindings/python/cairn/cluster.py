"""Runs many scenes on a Dask cluster, in place of the processes of `cairn.workers`: `cairn report --scheduler ADDRESS`.

Needs dask.distributed here and `cairn`, of the same build, on every worker. Each run takes one thread of a worker.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Callable

from .charts.result import Result
from .solver import info
from .workers import Progress, Task, perform

_CONNECT_S = 20  # s to find the scheduler in


class Cluster:
    """The workers of a Dask scheduler; a context manager, with the `run` of a `workers.Pool`.

    address: of the scheduler, as "tcp://10.0.0.1:8786". ImportError where there is no dask.distributed, OSError if the
    scheduler does not answer, ValueError if it has no workers or those run another build of cairn.
    """

    pinned = False

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ModuleNotFoundError as missing:
            raise ImportError(
                f"--scheduler needs dask.distributed, which is not installed ({missing}): "
                "python -m pip install distributed, here and on every worker"
            ) from missing
        self._completed: Any = distributed.as_completed
        self._client: Any = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
        try:
            self.threads = sum(
                worker["nthreads"] for worker in self._client.scheduler_info(n_workers=-1)["workers"].values()
            )
            if self.threads == 0:
                raise ValueError(f"the scheduler at {address} has no workers")
            builds = self._client.run(_build)
            others = {worker: build for worker, build in builds.items() if build != _build()}
            if others:
                worker, build = next(iter(others.items()))
                raise ValueError(f"worker {worker} runs another build of cairn, '{build}'; here it is '{_build()}'")
        except BaseException:
            self._client.close()
            raise

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    @property
    def conditions(self) -> str:
        """How times are taken, for people."""
        return f"medians, on a Dask cluster of {self.threads} threads, one run and one solver thread each"

    def run(
        self, tasks: Sequence[Task], progress: Progress, done: Callable[[Task, Result], None] | None = None
    ) -> list[Result]:
        """Run tasks, the first ones first; results in their order.

        A run whose worker dies is run again elsewhere, and has an error instead of a recording if that happens often.
        """
        futures = {
            self._client.submit(perform, task, pure=False, priority=-place): task for place, task in enumerate(tasks)
        }
        found: dict[Task, Result] = {}
        try:
            for future in self._completed(list(futures), loop=self._client.loop):
                task = futures[future]
                failed = future.exception()
                result = (
                    Result(task.request, error=f"its worker: {failed!r}") if failed is not None else future.result()
                )
                found[task] = result
                progress(task.request, task.frames)
                if done is not None:
                    done(task, result)
        finally:
            for future in futures:
                future.cancel()
        return [found[task] for task in tasks]


def _build() -> str:
    return str(info()["build"])


__all__ = ["Cluster"]
