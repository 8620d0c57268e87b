"""SimBenchmark's measures of `kapla`, `666` and `rolling`, for the figures that its authors published.

SimBenchmark (Kang and Hwangbo, https://leggedrobotics.github.io/SimBenchmark) is by RaiSim's authors. Its Bullet is the
multibody world with the sequential-impulse solver; ours is `btDiscreteDynamicsWorld`, in single precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Callable

import numpy as np

from . import scenes
from .bullet import STOCK_METHODS, BulletWorld
from .charts.result import Request

SECONDS = {"666": 10.0, "rolling": 4.0}
STEPS_KAPLA = 60_000
STEPS_666 = (0.001, 0.004, 0.01)  # s
STEP_ROLLING = 0.001  # s
SIZES_666 = {"radius": 0.1, "gap": 0.01, "drop": 1.001}

# (solver, step of collapse of kapla, mean squared depth of 666 at STEPS_666, mean squared velocity error of rolling)
PUBLISHED = (
    ("Bullet, 10 to 1000 iterations, no ERP", "24 to 147", ("0.382", "5.78", "37.4"), "1.7e-6 (10 iterations)"),
    ("Bullet, 10 to 1000 iterations, ERP", "52 to 55 058", ("", "", ""), ""),
    ("RaiSim", "", ("1.35e-4", "2.11e-3", "1.53e-2"), ""),
)

SOLVERS = (
    Request("", "tjsoft", 100, "default", 10),
    Request("", "tj", 100, "default", 10),
    Request("", "pjsoft", 100, "default"),
    Request("", "pj", 100, "default"),
    Request("", "stock", 10),
    Request("", "stock", 100),
    Request("", "stock-substeps", 100, None, 10),
)


@dataclass(frozen=True)
class Figures:
    """collapse: the step of kapla's collapse, None if it stands to the end."""

    solver: str
    steps: int  # of kapla, at most
    collapse: int | None
    depths: Sequence[float]  # m^2, of 666
    velocity: float  # m^2/s^2, of rolling


def _world(scene: scenes.Scene, request: Request) -> BulletWorld:
    chosen = {} if request.method in STOCK_METHODS else {"preset": request.preset or "default"}
    return BulletWorld(
        scene,
        request.method,
        iterations=request.iterations,
        substeps=request.substeps,
        threads=1,
        **chosen,  # type: ignore[arg-type]
    )


def collapse(request: Request, steps: int) -> int | None:
    """The step after which the last block of kapla's top wall is 0.15 m below its start."""
    scene = scenes.build("kapla")
    sinks, limit = scene.quantities[scene.failure], scene.tolerance
    assert limit is not None
    world = _world(scene, request)
    for step in range(1, steps + 1):
        world.step()
        if not sinks(world.positions, world.orientations) <= limit[1]:
            return step
    return None


def mean_squared_depth(request: Request, dt: float, seconds: float) -> float:
    """m^2: the mean over the steps of the sum of all squared depths of 666."""
    scene = replace(scenes.build("666", **SIZES_666), dt=dt)
    squared = scene.quantities["squared_depths_m2"]
    world = _world(scene, request)
    found = []
    for _ in range(round(seconds / dt)):
        found.append(squared(world.positions, world.orientations))
        world.step()
    return float(np.mean(found))


def mean_squared_velocity_error(request: Request, dt: float, seconds: float) -> float:
    """m^2/s^2: the mean over the steps of the squared error of the plate's and the first ball's velocity in rolling."""
    scene = replace(scenes.build("rolling"), dt=dt)
    error = scene.motions[scene.failure]
    world = _world(scene, request)
    found = []
    for step in range(round(seconds / dt)):
        found.append(error(step * dt, world.velocities) ** 2)
        world.step()
    return float(np.mean(found))


def figures(
    request: Request, steps: int = STEPS_KAPLA, share: float = 1.0, told: Callable[[str], None] = lambda _: None
) -> Figures:
    """Everything of one solver.

    steps: of kapla, at most. share: of the other scenes' durations, 0 ... 1. told: called before each run. cairn.Error
    if Cairn refuses a step, as it does where numbers are no longer finite.
    """
    label = request.label.replace(", default", "")
    told(f"{label}: kapla")
    fell = collapse(request, steps)
    depths = []
    for dt in STEPS_666:
        told(f"{label}: 666 at {1e3 * dt:g} ms")
        depths.append(mean_squared_depth(request, dt, share * SECONDS["666"]))
    told(f"{label}: rolling")
    velocity = mean_squared_velocity_error(request, STEP_ROLLING, share * SECONDS["rolling"])
    return Figures(label, steps, fell, depths, velocity)


def table(found: Sequence[Figures]) -> str:
    """Markdown: what was published, then ours."""
    heads = [f"666, {1e3 * dt:g} ms" for dt in STEPS_666]
    lines = [
        "| | kapla falls at step | " + " | ".join(heads) + " | rolling, 1 ms |",
        "|---|" + "---|" * (2 + len(heads)),
    ]
    for name, fell, depths, velocity in PUBLISHED:
        lines.append(f"| *{name}* | {fell} | " + " | ".join(depths) + f" | {velocity} |")
    for one in found:
        fell = f"stands, {one.steps}" if one.collapse is None else str(one.collapse)
        lines.append(
            f"| {one.solver} | {fell} | " + " | ".join(f"{d:.3g}" for d in one.depths) + f" | {one.velocity:.2g} |"
        )
    return "\n".join(lines)


__all__ = ["PUBLISHED", "SOLVERS", "Figures", "collapse", "figures", "mean_squared_depth", "table"]
