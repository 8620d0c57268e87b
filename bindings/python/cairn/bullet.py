"""Scenes in the real Bullet: the same bodies and joints under Cairn's methods or under Bullet's own solvers.

>>> from cairn import scenes
>>> from cairn.bullet import BulletWorld
>>> world = BulletWorld(scenes.build("stack-1m"), "tjsoft", iterations=40, substeps=4)
>>> for _ in range(60):
...     world.step()
>>> world.positions.shape
(126, 3)
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import ModuleType
from typing import Any, cast

import numpy as np

from .scenes.model import Array, Body, Box, Capsule, Plane, Scene, Sphere, Wedge
from .solver import INSTRUCTIONS, METHODS, Error, ParamValue, _to_library
from .solver import preset as preset_of

# Bullet's own: one step with its default solver (projected Gauss-Seidel), the same through
# stepSimulation(dt, n, dt / n), the nonlinear conjugate gradient variant, and the direct (Dantzig) one.
STOCK_METHODS = ("stock", "stock-substeps", "nncg", "dantzig")
ALL_METHODS = (*METHODS, *STOCK_METHODS)
STOCK_ITERATIONS = 10  # Bullet's default, of one solve
STOCK_SUBSTEPS = 10

_STOCK_SOLVERS = {"stock": "pgs", "stock-substeps": "pgs", "nncg": "nncg", "dantzig": "dantzig"}


def _module(bullet_precision: int) -> ModuleType:
    if bullet_precision not in (32, 64):
        raise ValueError(f"Bullet comes with 32 and with 64 bits, not {bullet_precision}")
    name = "_bullet" if bullet_precision == 32 else "_bullet64"
    try:
        return importlib.import_module(f"{__package__}.{name}")
    except ModuleNotFoundError as missing:
        raise ImportError(
            f"cairn was built without Bullet's {bullet_precision}-bit library: install libbullet-dev and pkg-config "
            "(apt-get install libbullet-dev pkg-config), then install cairn again"
        ) from missing


class BulletWorld:
    """A scene in a btDiscreteDynamicsWorld, ready to step.

    method: one of ALL_METHODS. iterations: velocity iterations of a whole step, shared out over its substeps; default:
    the preset's, or 10 for each solve of a stock method. substeps: default the preset's; 10 for "stock-substeps"; the
    other stock methods take 1. preset ("default", "paper"), position_iterations, params (further fields of
    cairn_params), threads, instructions and precision (of Cairn's arithmetic) are Cairn's. bullet_precision: 32 or 64,
    Bullet's own arithmetic. sleeping: whether bodies at rest may be put to sleep.

    Bodies and joints keep the scene's order. ValueError or cairn.Error for what does not fit; ImportError where cairn
    was built without Bullet.
    """

    def __init__(
        self,
        scene: Scene,
        method: str = "tjsoft",
        *,
        preset: str = "default",
        iterations: int | None = None,
        position_iterations: int | None = None,
        substeps: int | None = None,
        params: Mapping[str, ParamValue] | None = None,
        threads: int = 0,
        instructions: str = "auto",
        precision: int = 32,
        bullet_precision: int = 32,
        sleeping: bool = False,
    ) -> None:
        if method not in ALL_METHODS:
            raise ValueError(f"no method is called '{method}'; there are {', '.join(ALL_METHODS)}")
        self.scene = scene
        self.method = method
        self.dt = scene.dt
        self._solves = 1  # internal steps of Bullet in one step of ours
        module = _module(bullet_precision)
        if method in STOCK_METHODS:
            if params or position_iterations is not None:
                raise ValueError(f"'{method}' is Bullet's own solver: it takes iterations and substeps only")
            self._solves = _stock_substeps(method, substeps)
            each = STOCK_ITERATIONS if iterations is None else iterations // self._solves
            if each < 1:
                raise ValueError(f"{iterations} iterations cannot be shared out over {self._solves} substeps")
            world = module.World(scene.gravity, _STOCK_SOLVERS[method], sleeping=sleeping)
            world.iterations = each
            self.iterations, self.substeps, self.position_iterations = each * self._solves, self._solves, 0
        else:
            chosen = preset_of(method, preset)
            changes = {"iterations": iterations, "position_iterations": position_iterations, "substeps": substeps}
            chosen.update({name: value for name, value in changes.items() if value is not None})
            for name, value in (params or {}).items():
                if name not in chosen:
                    raise ValueError(f"no parameter is called '{name}'; there are {', '.join(chosen)}")
                chosen[name] = value
            if instructions not in INSTRUCTIONS:
                raise ValueError(f"instructions '{instructions}' are unknown; there are {', '.join(INSTRUCTIONS)}")
            world = module.World(
                scene.gravity,
                "cairn",
                _to_library(chosen),
                threads=threads,
                instructions=INSTRUCTIONS.index(instructions),
                precision=precision,
                sleeping=sleeping,
            )
            self.iterations, self.substeps = int(chosen["iterations"]), int(chosen["substeps"])
            self.position_iterations = int(chosen["position_iterations"])
        self._world = world
        for body in scene.bodies:
            _add_body(world, body)
        for joint in scene.joints:
            world.add_joint(
                joint.kind,
                joint.body_a,
                -1 if joint.body_b is None else joint.body_b,
                joint.anchor,
                joint.frame_at_start().reshape(-1).tolist(),
                motor_speed=joint.motor_speed,
                motor_force=joint.motor_force,
                lower=joint.lower,
                upper=joint.upper,
                anchor_b=joint.anchor_b,
            )

    @property
    def is_cairn(self) -> bool:
        return self.method in METHODS

    def step(self) -> None:
        """One step of the scene's dt. cairn.Error if Cairn refuses it (the text says why)."""
        try:
            self._world.step(self.dt, self._solves)
        except RuntimeError as refused:
            error = Error(str(refused))
            error.status = self._world.last_status
            raise error from None

    @property
    def poses(self) -> Array:
        """[bodies, 7] positions (m) and orientations (x, y, z, w)."""
        return cast(Array, self._world.poses())

    @property
    def positions(self) -> Array:
        """[bodies, 3] m, of the centres of mass."""
        return self.poses[:, :3]

    @property
    def orientations(self) -> Array:
        """[bodies, 4] x, y, z, w, unit."""
        return self.poses[:, 3:]

    @property
    def velocities(self) -> Array:
        """[bodies, 6] linear (m/s) and angular (rad/s)."""
        return cast(Array, self._world.velocities())

    @property
    def contacts(self) -> dict[str, Array]:
        """Contact points as Bullet found them at the start of the last (internal) step, with that step's impulses.

        body_a, body_b [n] indices; separation [n] m, negative where bodies overlap; position [n, 3] m; normal [n, 3],
        from a to b; impulse [n] N s; friction_impulse [n, 3] N s, on b.
        """
        return cast("dict[str, Array]", self._world.contacts())

    @property
    def joint_errors(self) -> Array:
        """[joints, 2] m and rad: how far each joint's bodies are from what it holds, in double from the poses now."""
        return cast(Array, self._world.joint_errors())

    @property
    def solver_seconds(self) -> float:
        """Wall-clock time of the last step's solves, gathering and scattering included: the same span for all."""
        return float(self._world.solver_seconds)

    @property
    def step_seconds(self) -> float:
        """Wall-clock time of the whole last step: collision detection, solver, integration."""
        return float(self._world.step_seconds)

    @property
    def params(self) -> dict[str, float]:
        """cairn_params in use, by field, as numbers; RuntimeError behind a stock solver."""
        return cast("dict[str, float]", self._world.params)

    def set_params(self, **changes: ParamValue) -> None:
        """Change fields of cairn_params between steps. ValueError for what does not fit; then nothing was changed."""
        self._world.params = {**self._world.params, **_to_library(changes)}

    @property
    def statistics(self) -> dict[str, float]:
        """cairn_statistics of the last step, by field, as numbers; RuntimeError behind a stock solver."""
        return cast("dict[str, float]", self._world.statistics())

    @property
    def residual_trace(self) -> Array:
        """[sweeps] sqrt(J), of the last step, if params has residual_trace = 1; RuntimeError behind a stock solver."""
        return cast(Array, self._world.residual_trace())

    @property
    def choices(self) -> dict[str, Array]:
        """What the method "auto" did with each island in the last step: as cairn.Solver.choices."""
        return cast("dict[str, Array]", self._world.choices())

    def set_velocity(self, body: int, linear: Any, angular: Any = (0.0, 0.0, 0.0)) -> None:
        """Give a body another velocity, m/s and rad/s."""
        self._world.set_velocity(
            body, np.asarray(linear, dtype=float).tolist(), np.asarray(angular, dtype=float).tolist()
        )

    def remove(self, body: int) -> None:
        """Take a body out of the world. It keeps its last pose, at rest. ValueError if a joint holds it."""
        self._world.remove_body(body)


def _stock_substeps(method: str, substeps: int | None) -> int:
    if method == "stock-substeps":
        count = STOCK_SUBSTEPS if substeps is None else substeps
        if count < 2:
            raise ValueError(f"'stock-substeps' needs at least 2 substeps, not {count}; 'stock' takes 1")
        return count
    if substeps not in (None, 1):
        raise ValueError(f"'{method}' has no substeps; 'stock-substeps' has")
    return 1


def _add_body(world: Any, body: Body) -> None:
    common = {
        "mass": body.mass,
        "inertia": body.inertia,
        "position": body.position,
        "orientation": body.orientation,
        "linear_velocity": body.linear_velocity,
        "angular_velocity": body.angular_velocity,
        "friction": body.friction,
        "restitution": body.restitution,
        "group": body.collision_group,
        "force": body.force,
    }
    shape = body.shape
    if isinstance(shape, Box):
        world.add_box(shape.half_extents, **common)
    elif isinstance(shape, Sphere):
        world.add_sphere(shape.radius, **common)
    elif isinstance(shape, Capsule):
        world.add_capsule(shape.radius, shape.half_length, **common)
    elif isinstance(shape, Wedge):
        world.add_hull(shape.vertices, **common)
    elif isinstance(shape, Plane):
        world.add_plane(shape.normal, shape.offset, **common)
    else:
        raise TypeError(f"body '{body.name}' has a shape that Bullet is not given: {shape!r}")


__all__ = ["ALL_METHODS", "STOCK_METHODS", "BulletWorld"]
