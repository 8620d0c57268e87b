"""No more model than a scene needs: what each feature costs where it is used, and where it is not.

Each case runs a small scene twice, with the feature and without it, and counts rows, bytes of a velocity sweep (by
core/scene/traffic.h, as `./dev bench` does) and sweeps of a step, and what it does to an error. Times are measured only
when asked for, and kept in a file: they need a quiet machine, the counts do not.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Callable

import numpy as np

from . import _cairn, scenes
from .bullet import BulletWorld
from .metrics import JointErrors, rotation_matrices
from .run import build_text
from .scenes.model import BALL, Scene
from .solver import ParamValue, Solver
from .tables import NO_GYROSCOPIC, ROUND_B, WORLD, Bodies, Contacts

TORSIONAL, SPECIAL, FRICTIONAL, SMOOTH = range(4)  # ContactKind of core/scene/frame.h
ITERATIONS, SUBSTEPS = 40, 4  # of TJSoft, default preset
FORMAT = 1  # of the file of times
_DT = 0.016


@dataclass(frozen=True)
class Cost:
    """Of one run of a case, at its last step."""

    rows: int
    sweep_bytes: float
    sweeps: int  # of a step, restitution's included
    error: float
    milliseconds: float  # a step's, the library's own time, median


@dataclass(frozen=True)
class Case:
    """A feature: `with_it` and `without` run the same scene; `note` says what is paid where it is not used."""

    name: str
    scene: str
    error: str  # what is measured, with its unit
    note: str
    with_it: Callable[[], Cost]
    without: Callable[[], Cost]


def _bytes(
    statistics: Mapping[str, Any], params: Mapping[str, Any], kind: int, points: float, manifolds: float, sides: float
) -> float:
    by_kind = [0.0] * 4
    by_kind[kind] = points
    pyramid, manifold_blocks = params["friction_model"] in (2, "pyramid"), params["splitting"] in (1, "manifold")
    reduces = params["acceleration"] not in (0, "none") or params["residual_tolerance"] > 0
    joints, bodies = statistics["joints"], statistics["bodies"]
    return _cairn.sweep_bytes(by_kind, manifolds, joints, bodies, sides, pyramid, manifold_blocks, reduces)


def _cost(statistics: Mapping[str, Any], size: float, error: float, times: Sequence[float]) -> Cost:
    sweeps = int(statistics["iterations"] + statistics["restitution_iterations"])
    return Cost(int(statistics["rows"]), size, sweeps, error, 1e3 * float(np.median(times)))


def _in_bullet(
    scene: Scene,
    frames: int,
    error: Callable[[BulletWorld], float],
    kind: int = FRICTIONAL,
    sleeping: bool = False,
    last: bool = False,
    **params: ParamValue,
) -> Cost:
    """A scene in Bullet: the costs of its fullest step and the largest error, or both at the last step."""
    world = BulletWorld(
        scene, "tjsoft", iterations=ITERATIONS, substeps=SUBSTEPS, params=params, threads=1, sleeping=sleeping
    )
    masses = np.append(scene.masses, 0.0)  # the world's last
    joints = [(j.body_a, -1 if j.body_b is None else j.body_b) for j in scene.joints]
    worst, times, before = 0.0, [], -1.0
    fullest = Cost(0, 0.0, 0, 0.0, 0.0)
    for _ in range(frames):
        world.step()
        now = error(world)
        worst = now if last else max(worst, now)
        statistics = world.statistics
        if statistics["time_total"] == before:  # Bullet did not call the solver: what it says is the last call's
            this = Cost(0, 0.0, 0, 0.0, 0.0)
        else:
            ends = np.stack([world.contacts["body_a"], world.contacts["body_b"]], axis=1)
            pairs = np.unique(ends, axis=0)
            touched = [np.array(some, dtype=int).reshape(-1, 2) for some in (pairs, joints)]
            sides = float(sum(np.count_nonzero(masses[some]) for some in touched))
            size = _bytes(statistics, world.params, kind, statistics["contacts"], statistics["manifolds"], sides)
            times.append(statistics["time_total"])
            this = _cost(statistics, size, 0.0, times)
        before = statistics["time_total"]
        if last or (this.rows, this.sweeps) > (fullest.rows, fullest.sweeps):
            fullest = this
    return replace(fullest, error=worst, milliseconds=1e3 * float(np.median(times)))


def _balls(
    rolling: float = 0.0, copies: int = 1, immovable: int = 0, speed: float = 1.0, count: int = 64, steps: int = 60
) -> Cost:
    """Balls that roll over a floor, each on one point: exact contacts without an engine.

    rolling: coefficient (m) of rolling and spinning friction; copies: how often each point is given; immovable:
    contacts between bodies that cannot move, besides. The error is the speed that is left (m/s), or with speed 0 the
    sinking (m).
    """
    radius = 0.5
    x = 2.0 * np.arange(count)
    zero = np.zeros((count, 3))
    bodies = Bodies(
        position=np.stack([x, np.full(count, radius), np.zeros(count)], axis=1),
        orientation=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        linear_velocity=np.add(zero, [0.0, 0.0, speed]),
        angular_velocity=np.add(zero, [speed / radius, 0.0, 0.0]),
        inverse_mass=np.ones(count),
        inverse_inertia=np.full((count, 3), 1 / (0.4 * radius**2)),
    )
    if immovable:
        for name in ("position", "orientation", "linear_velocity", "angular_velocity"):
            setattr(bodies, name, np.concatenate([getattr(bodies, name), getattr(bodies, name)[:1]]))
        bodies.linear_velocity[-1] = bodies.angular_velocity[-1] = 0.0
        bodies.position[-1] = [-9.0, radius, 0.0]
        bodies.inverse_mass = np.append(bodies.inverse_mass, 0.0)
        bodies.inverse_inertia = np.concatenate([bodies.inverse_inertia, zero[:1]])
    on_floor = np.repeat(np.arange(count), copies)
    body = np.append(on_floor, np.full(immovable, count)).astype(np.int32)
    solver = Solver("tjsoft", threads=1, iterations=ITERATIONS, substeps=SUBSTEPS)
    times = []
    for _ in range(steps):
        place = np.asarray(bodies.position)[body]
        down = np.tile([0.0, -radius, 0.0], (len(body), 1))
        contacts = Contacts(
            body_a=np.full(len(body), WORLD, dtype=np.int32),
            body_b=body,
            normal=np.tile([0.0, 1.0, 0.0], (len(body), 1)),
            arm_a=place * [1.0, 0.0, 1.0],
            arm_b=down,
            separation=place[:, 1] - radius,
            friction=np.full(len(body), 0.5),
            key=np.arange(1, len(body) + 1, dtype=np.uint64),
            flags=np.full(len(body), ROUND_B, dtype=np.uint32),
        )
        if rolling:
            contacts.rolling_friction = contacts.spinning_friction = np.full(len(body), rolling)
        solver.step(_DT, bodies, contacts, out=bodies)
        times.append(float(solver.statistics["time_total"]))
    statistics = solver.statistics
    points = float(statistics["contacts"])
    manifolds = float(statistics["manifolds"])
    kind = TORSIONAL if rolling else FRICTIONAL
    size = _bytes(statistics, solver.params, kind, points, manifolds, manifolds)
    moving = np.asarray(bodies.linear_velocity)[:count]
    error = np.linalg.norm(moving, axis=1).max() if speed else (radius - np.asarray(bodies.position)[:count, 1]).max()
    return _cost(statistics, size, float(error), times)


def _tumbling(flag: int, steps: int = 625) -> Cost:
    """A box about its middle axis in free flight; the error is the change of its angular momentum, as a share."""
    scene = scenes.build("tumble")
    body = scene.bodies[0]
    inertia = np.array(body.inertia)
    bodies = Bodies(
        position=np.zeros((1, 3)),
        orientation=np.array([[0.0, 0.0, 0.0, 1.0]]),
        linear_velocity=np.zeros((1, 3)),
        angular_velocity=np.array([body.angular_velocity]),
        inverse_mass=np.ones(1),
        inverse_inertia=1 / inertia[None],
        flags=np.array([flag], dtype=np.uint32),
    )
    solver = Solver("tjsoft", threads=1, iterations=ITERATIONS, substeps=SUBSTEPS)

    def momentum() -> Any:
        turn = rotation_matrices(np.asarray(bodies.orientation))[0]
        return turn @ (inertia * (turn.T @ np.asarray(bodies.angular_velocity)[0]))

    start, worst, times = momentum(), 0.0, []
    for _ in range(steps):
        solver.step(_DT, bodies, gravity=(0.0, 0.0, 0.0), out=bodies)
        worst = max(worst, float(np.linalg.norm(momentum() - start) / np.linalg.norm(start)))
        times.append(float(solver.statistics["time_total"]))
    statistics = solver.statistics
    return _cost(statistics, _bytes(statistics, solver.params, SMOOTH, 0, 0, 0), worst, times)


def _quantity(scene: Scene) -> Callable[[BulletWorld], float]:
    value = scene.quantities[scene.failure]
    return lambda world: abs(value(world.positions, world.orientations))


def _slope(model: str) -> Cost:
    scene = scenes.build("slope")
    kind = SMOOTH if model == "none" else FRICTIONAL
    return _in_bullet(scene, 60, _quantity(scene), kind, friction_model=model)


def _joints(ball: bool) -> Cost:
    scene = scenes.build("cantilever", boxes=20)
    if ball:
        scene = replace(scene, joints=[replace(joint, kind=BALL) for joint in scene.joints])
    errors = JointErrors(scene)
    return _in_bullet(scene, 60, lambda world: float(errors(world.positions, world.orientations)[0].max()))


def _bounce(restitution: float) -> Cost:
    """From 20 cm: after 25 steps, 0.4 s, the balls should be up there again."""
    scene = scenes.build("bounce", balls=5, height=0.2, restitution=restitution)
    top = scene.bodies[1].position[1]
    costs = _in_bullet(scene, 16, lambda world: 0.0, SMOOTH)  # the step of the bounce is the fullest
    return replace(
        costs, error=_in_bullet(scene, 25, lambda world: top - float(world.positions[1, 1]), last=True).error
    )


def _spheres() -> Cost:
    scene = scenes.build("666", edge=4)

    def deepest(world: BulletWorld) -> float:
        return max(0.0, -float(world.contacts["separation"].min(initial=0.0)))

    return _in_bullet(scene, 60, deepest, SMOOTH)


def _settled(sleeping: bool) -> Cost:
    scene = scenes.build("stack", columns=3, layers=3, rows=3)
    track: list[Any] = []

    def drift(world: BulletWorld) -> float:
        track.append(world.positions)
        return float(np.linalg.norm((track[-1] - track[min(len(track) - 1, 60)])[:, [0, 2]], axis=1).max())

    return _in_bullet(scene, 400, drift, sleeping=sleeping, last=True)


CASES = (
    Case(
        "friction", "`slope`, `friction_model` cone or none", "creep [m]", "nothing: one row a point, not three",
        lambda: _slope("cone"), lambda: _slope("none"),
    ),
    Case(
        "rolling and spinning friction", "64 balls that roll", "speed left [m/s]",
        "nothing: contacts without keep three rows",
        lambda: _balls(rolling=0.05), lambda: _balls(),
    ),
    Case(
        "angular part of frictionless spheres", "`666`, edge 4: always there", "deepest contact [m]",
        "**all of it**: arms (24 bytes a point) and angular velocities are swept, though no impulse turns a sphere",
        _spheres, _spheres,
    ),
    Case(
        "locked rotations of joints", "`cantilever`, fixed or ball joints", "anchor gap [m]",
        "**all but the rows' unknowns**: a joint's block is stored and solved for six axes, whichever are free",
        lambda: _joints(False), lambda: _joints(True),
    ),
    Case(
        "restitution", "`bounce` from 20 cm, restitution 1 or 0", "height lost in a bounce [m]",
        "nothing: the pass is left out",
        lambda: _bounce(1.0), lambda: _bounce(0.0),
    ),
    Case(
        "gyroscopic term", "`tumble`, 10 s", "angular momentum [share]",
        "nothing: bodies with three equal moments, and those flagged, skip it",
        lambda: _tumbling(0), lambda: _tumbling(NO_GYROSCOPIC),
    ),
    Case(
        "islands at rest", "`stack` 3x3x3, Bullet's sleeping forbidden or allowed", "drift [m]",
        "nothing, if the engine leaves them out: libcairn puts nothing to sleep by itself",
        lambda: _settled(False), lambda: _settled(True),
    ),
    Case(
        "pairs that cannot move", "64 balls, 64 contacts of a post with the floor besides, or none", "sinking [m]",
        "nothing: they are dropped before rows are made",
        lambda: _balls(immovable=64, speed=0.0), lambda: _balls(speed=0.0),
    ),
    Case(
        "duplicate points", "64 balls, each point given twice, or once", "sinking [m]",
        "**all of it**: points that coincide are not merged; Bullet's manifolds have none",
        lambda: _balls(copies=2, speed=0.0), lambda: _balls(speed=0.0),
    ),
)  # fmt: skip


def measure(cases: Sequence[Case] = CASES) -> list[tuple[Case, Cost, Cost]]:
    """Every case with its cost with the feature and without; one that is always there has a single run."""
    found = []
    for case in cases:
        with_it = case.with_it()
        found.append((case, with_it, with_it if case.without is case.with_it else case.without()))
    return found


def save_times(found: Sequence[tuple[Case, Cost, Cost]], path: Path) -> None:
    """Write the times of a quiet run: a JSON file that `table` takes."""
    times = {case.name: [with_it.milliseconds, without.milliseconds] for case, with_it, without in found}
    content = {"format": FORMAT, "machine": build_text(), "ms": times}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def load_times(path: Path) -> tuple[str, dict[str, list[float]]]:
    """The machine, and ms of a step with and without, by feature. ValueError for a file that is none of ours."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format"] != FORMAT:
            raise ValueError(f"format {content['format']}, not {FORMAT}")
        return str(content["machine"]), {str(k): [float(v[0]), float(v[1])] for k, v in content["ms"].items()}
    except (KeyError, TypeError, IndexError, ValueError) as wrong:
        raise ValueError(f"{path} is no file of `cairn features --measure`: {wrong}") from None


def table(found: Sequence[tuple[Case, Cost, Cost]], times: Mapping[str, Sequence[float]] | None = None) -> str:
    """Markdown. times: ms of a step with and without, by feature; None: no column of times."""
    heads = [
        "feature",
        "scene",
        "rows",
        "KiB a sweep",
        "sweeps",
        *(["ms a step"] if times is not None else []),
        "error",
        "paid without it",
    ]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for case, one, other in found:
        both = [(f"{c.rows}", f"{c.sweep_bytes / 1024:.3g}", f"{c.sweeps}") for c in (one, other)]
        cells = [a if a == b else f"{a} / {b}" for a, b in zip(*both)]
        if times is not None:
            cells.append(" / ".join(f"{t:.2g}" for t in times[case.name]) if case.name in times else "")
        errors = [f"{c.error:.2g}" for c in (one, other)]
        error = errors[0] if errors[0] == errors[1] else " / ".join(errors)
        lines.append("| " + " | ".join([case.name, case.scene, *cells, f"{case.error}: {error}", case.note]) + " |")
    return "\n".join(lines)


__all__ = ["CASES", "Case", "Cost", "load_times", "measure", "save_times", "table"]
