"""What a scene is made of: shapes, bodies, joints. Plain data, no engine. SI units, y is up, quaternions x, y, z, w.

Every engine that runs a scene takes masses, inertias and friction from here, so that methods are compared on one world.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Callable, Union

import numpy as np
import numpy.typing as npt

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
Array = npt.NDArray[np.float64]

DT = 0.016  # s, the step of the paper's experiments
GRAVITY: Vec3 = (0.0, -9.81, 0.0)  # m/s^2


@dataclass(frozen=True)
class Box:
    half_extents: Vec3  # m, along the body's axes


@dataclass(frozen=True)
class Sphere:
    radius: float  # m


@dataclass(frozen=True)
class Capsule:
    """A cylinder about the body's y axis with a half sphere at each end."""

    radius: float  # m
    half_length: float  # m, of the cylinder between the half spheres


@dataclass(frozen=True)
class Plane:
    """The half space below a plane, for bodies that cannot move: normal . x <= offset is solid."""

    normal: Vec3 = (0.0, 1.0, 0.0)  # unit, world axes
    offset: float = 0.0  # m


@dataclass(frozen=True)
class Wedge:
    """A prism along z over a trapezoid that is the same left and right, such as an arch's stone; about its centroid."""

    half_bottom: float  # m, half width along x of the lower face
    half_top: float  # m, of the upper one
    height: float  # m, along y
    half_depth: float  # m, along z

    @property
    def centre_height(self) -> float:
        """m, of the centroid above the lower face."""
        bottom, top = self.half_bottom, self.half_top
        return self.height * (bottom + 2 * top) / (3 * (bottom + top))

    @property
    def vertices(self) -> list[Vec3]:
        """The 8 corners: the lower face's at z > 0 and z < 0, left then right, then the upper face's."""
        low, high = -self.centre_height, self.height - self.centre_height
        return [
            (side * half, y, z)
            for half, y in ((self.half_bottom, low), (self.half_top, high))
            for z in (self.half_depth, -self.half_depth)
            for side in (-1.0, 1.0)
        ]

    @property
    def faces(self) -> list[list[int]]:
        """Indices of corners, counter-clockwise from outside."""
        return [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


Shape = Union[Box, Sphere, Capsule, Plane, Wedge]


@dataclass
class Body:
    """A rigid body; its position is its centre of mass and the shape's centre."""

    shape: Shape
    mass: float  # kg; 0: it cannot move
    position: Vec3 = (0.0, 0.0, 0.0)  # m
    orientation: Quat = (0.0, 0.0, 0.0, 1.0)  # unit
    linear_velocity: Vec3 = (0.0, 0.0, 0.0)  # m/s
    angular_velocity: Vec3 = (0.0, 0.0, 0.0)  # rad/s
    friction: float = 0.5  # >= 0; a contact's coefficient is the product of its two bodies'
    restitution: float = 0.0  # 0 ... 1; a contact's is the product of its two bodies'
    name: str = ""
    collision_group: int = 0  # two bodies of the same group other than 0 do not collide; -1: collides with nothing
    force: Vec3 = (0.0, 0.0, 0.0)  # N, constant, world axes, at the centre of mass
    removed_at: int | None = None  # the frame after which it is taken out of the world; it keeps its last pose

    @property
    def inertia(self) -> Vec3:
        """Principal moments about the body's axes, kg m^2, of a solid of even density; zeros if it cannot move."""
        m = self.mass
        shape = self.shape
        if m == 0 or isinstance(shape, Plane):
            return (0.0, 0.0, 0.0)
        if isinstance(shape, Box):
            xx, yy, zz = (e * e for e in shape.half_extents)
            return (m / 3 * (yy + zz), m / 3 * (xx + zz), m / 3 * (xx + yy))
        if isinstance(shape, Sphere):
            i = 0.4 * m * shape.radius**2
            return (i, i, i)
        if isinstance(shape, Wedge):
            bottom, top = 2 * shape.half_bottom, 2 * shape.half_top
            xx = (bottom**2 + top**2) / 24  # mean squares about the centroid
            yy = shape.height**2 * (bottom**2 + 4 * bottom * top + top**2) / (18 * (bottom + top) ** 2)
            zz = shape.half_depth**2 / 3
            return (m * (yy + zz), m * (xx + zz), m * (xx + yy))
        r, length = shape.radius, 2 * shape.half_length
        ball = 4 / 3 * r  # volumes over pi r^2
        m_cylinder, m_ball = m * length / (length + ball), m * ball / (length + ball)
        along = m_cylinder * r * r / 2 + m_ball * 0.4 * r * r
        across = m_cylinder * (length * length / 12 + r * r / 4)
        across += m_ball * (0.4 * r * r + length * length / 4 + 3 / 8 * length * r)
        return (across, along, across)


BALL, HINGE, SLIDER, FIXED = "ball", "hinge", "slider", "fixed"


@dataclass
class Joint:
    """A joint between two bodies of a scene, or of a body and the world, described where the bodies start.

    The joint's frame is `frame_at_start()` in world axes, its origin the anchor. A hinge turns about the frame's z and
    a slider moves along its x, as in cairn_joint_axes(): `axis` is that direction. Coordinates are of b relative to a.
    """

    kind: str  # "ball", "hinge", "slider", "fixed"
    body_a: int  # index into Scene.bodies
    body_b: int | None  # likewise; None: the world
    anchor: Vec3  # m, world point at the start
    axis: Vec3 = (0.0, 0.0, 1.0)  # unit, world axes at the start: hinges and sliders
    motor_speed: float = 0.0  # rad/s (hinge) or m/s (slider), of b relative to a about or along `axis`
    motor_force: float = 0.0  # N m or N, the motor's strongest; 0: no motor; infinity allowed
    lower: float = -math.inf  # rad or m: limits of the free coordinate; none by default
    upper: float = math.inf
    anchor_b: Vec3 | None = None  # m, b's anchor, where that is another world point: the joint starts with an error

    @property
    def limited(self) -> bool:
        return math.isfinite(self.lower) or math.isfinite(self.upper)

    def frame_at_start(self) -> Array:
        """3x3, columns x, y, z of the joint's frame in world axes: z (hinge) or x (slider) along `axis`."""
        if self.kind in (BALL, FIXED):
            return np.eye(3)
        along = np.asarray(self.axis, dtype=np.float64)
        along = along / np.linalg.norm(along)
        other = np.eye(3)[np.argmin(np.abs(along))]
        second = np.cross(along, other)
        second /= np.linalg.norm(second)
        third = np.cross(along, second)
        columns = (second, third, along) if self.kind == HINGE else (along, second, third)
        return np.stack(columns, axis=1)


@dataclass
class Scene:
    """Bodies, joints and how to run them.

    `failure` names the one quantity that shows failure: a key of a run's summary (`cairn run --help`), of `quantities`
    or of `motions`.
    """

    name: str
    why: str  # one sentence
    failure: str
    bodies: list[Body]
    joints: list[Joint] = field(default_factory=list)
    gravity: Vec3 = GRAVITY  # m/s^2
    dt: float = DT  # s
    frames: int = 3000
    rests: bool = False  # the bodies should come to rest: then drift, settling and collapse are measured
    neighbours: list[tuple[int, int]] = field(default_factory=list)  # pairs whose separation speed is measured
    settings: dict[str, float] = field(default_factory=dict)  # the sizes that it was built with
    # Further quantities of a frame, by name: functions of positions [bodies, 3] and orientations [bodies, 4].
    quantities: Mapping[str, Callable[[Array, Array], float]] = field(default_factory=dict)
    # Likewise, of the time (s) and of linear and angular velocities [bodies, 6].
    motions: Mapping[str, Callable[[float, Array], float]] = field(default_factory=dict)
    # Of `failure`, in its unit: a run survives up to the first and fails above the second. None: the rules by kind of
    # scene (piles, joints, neighbours) in `cairn.report_outcome`.
    tolerance: tuple[float, float] | None = None
    fastest: float = 0.0  # m/s, what its bodies may rightly reach without falling; 0: what its motors' speeds allow

    @property
    def masses(self) -> Array:
        return np.array([body.mass for body in self.bodies], dtype=np.float64)

    @property
    def inertias(self) -> Array:
        return np.array([body.inertia for body in self.bodies], dtype=np.float64).reshape(-1, 3)

    @property
    def start_positions(self) -> Array:
        return np.array([body.position for body in self.bodies], dtype=np.float64).reshape(-1, 3)

    @property
    def start_orientations(self) -> Array:
        return np.array([body.orientation for body in self.bodies], dtype=np.float64).reshape(-1, 4)
