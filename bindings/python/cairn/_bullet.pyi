from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

PRECISION: int
BULLET_VERSION: int

_Floats = npt.NDArray[np.float64]

class World:
    def __init__(
        self,
        gravity: Sequence[float] = (0.0, -9.81, 0.0),
        solver: str = "pgs",
        params: Mapping[str, float] | bytes | None = None,
        *,
        threads: int = 0,
        instructions: int = 0,
        precision: int = 32,
        sleeping: bool = False,
    ) -> None: ...
    def add_box(
        self,
        half_extents: Sequence[float],
        *,
        mass: float,
        inertia: Sequence[float] | None = None,
        position: Sequence[float] = ...,
        orientation: Sequence[float] = ...,
        linear_velocity: Sequence[float] = ...,
        angular_velocity: Sequence[float] = ...,
        friction: float = 0.5,
        restitution: float = 0.0,
        group: int = 0,
        force: Sequence[float] = ...,
    ) -> int: ...
    def add_sphere(
        self,
        radius: float,
        *,
        mass: float,
        inertia: Sequence[float] | None = None,
        position: Sequence[float] = ...,
        orientation: Sequence[float] = ...,
        linear_velocity: Sequence[float] = ...,
        angular_velocity: Sequence[float] = ...,
        friction: float = 0.5,
        restitution: float = 0.0,
        group: int = 0,
        force: Sequence[float] = ...,
    ) -> int: ...
    def add_capsule(
        self,
        radius: float,
        half_length: float,
        *,
        mass: float,
        inertia: Sequence[float] | None = None,
        position: Sequence[float] = ...,
        orientation: Sequence[float] = ...,
        linear_velocity: Sequence[float] = ...,
        angular_velocity: Sequence[float] = ...,
        friction: float = 0.5,
        restitution: float = 0.0,
        group: int = 0,
        force: Sequence[float] = ...,
    ) -> int: ...
    def add_hull(
        self,
        points: Sequence[Sequence[float]],
        *,
        mass: float,
        inertia: Sequence[float] | None = None,
        position: Sequence[float] = ...,
        orientation: Sequence[float] = ...,
        linear_velocity: Sequence[float] = ...,
        angular_velocity: Sequence[float] = ...,
        friction: float = 0.5,
        restitution: float = 0.0,
        group: int = 0,
        force: Sequence[float] = ...,
    ) -> int: ...
    def add_plane(
        self,
        normal: Sequence[float],
        offset: float,
        *,
        mass: float,
        inertia: Sequence[float] | None = None,
        position: Sequence[float] = ...,
        orientation: Sequence[float] = ...,
        linear_velocity: Sequence[float] = ...,
        angular_velocity: Sequence[float] = ...,
        friction: float = 0.5,
        restitution: float = 0.0,
        group: int = 0,
        force: Sequence[float] = ...,
    ) -> int: ...
    def add_joint(
        self,
        kind: str,
        body_a: int,
        body_b: int,
        anchor: Sequence[float],
        axes: Sequence[float],
        *,
        motor_speed: float = 0.0,
        motor_force: float = 0.0,
        lower: float = ...,
        upper: float = ...,
        anchor_b: Sequence[float] | None = None,
    ) -> int: ...
    def add_six_dof(
        self,
        body_a: int,
        body_b: int,
        anchor: Sequence[float],
        axes: Sequence[float],
        lower: Sequence[float],
        upper: Sequence[float],
        *,
        motor_speed: Sequence[float] = ...,
        motor_force: Sequence[float] = ...,
    ) -> int: ...
    def step(self, dt: float, substeps: int = 1) -> None: ...
    @property
    def body_count(self) -> int: ...
    def poses(self) -> _Floats: ...
    def velocities(self) -> _Floats: ...
    def set_velocity(self, body: int, linear: Sequence[float], angular: Sequence[float]) -> None: ...
    def remove_body(self, body: int) -> None: ...
    def contacts(self) -> dict[str, npt.NDArray[np.float64]]: ...
    def joint_errors(self) -> _Floats: ...
    iterations: int
    split_impulse: bool
    @property
    def last_status(self) -> int: ...
    @property
    def solver_seconds(self) -> float: ...
    @property
    def step_seconds(self) -> float: ...
    @property
    def params(self) -> dict[str, float]: ...
    @params.setter
    def params(self, given: Mapping[str, float] | bytes) -> None: ...
    def statistics(self) -> dict[str, float]: ...
    def choices(self) -> dict[str, npt.NDArray[np.generic]]: ...
    def residual_trace(self) -> _Floats: ...
