"""The tables of a step: columns, which the solver reads and writes where they are.

A column is a NumPy array, or for a solver on a GPU one in CUDA memory (`__cuda_array_interface__` or `__dlpack__`).

A floating column is float32 or float64, an index column int32 or uint32, a key column uint64. Its first axis may have
any stride, positive or negative, so columns may be fields of one structured array; its last axis is contiguous.
Wherever a table is expected, a dict of such columns or a structured array with fields of these names does as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

Column = Any  # NumPy's, or an object in CUDA memory, for which there is no type

WORLD = -1  # as a body index: the immovable world, its frame at the origin
NO_GYROSCOPIC, AT_END_POSE = 1, 2  # Bodies.flags
ROUND_A, ROUND_B = 1, 2  # Contacts.flags
FREE, LOCKED, LIMITED, DRIVEN, SPRING, SERVO = 0, 1, 2, 4, 8, 16  # Joints.axes: combinations; SERVO with DRIVEN
BY_AXES, VECTOR, CONE = 0, 1, 2  # Joints.rotation


@dataclass
class Bodies:
    """n bodies. One with inverse mass and inverse inertia 0 cannot move; its velocity carries what touches it."""

    position: Column  # [n, 3] m, the centre of mass
    orientation: Column  # [n, 4] x, y, z, w, unit
    linear_velocity: Column  # [n, 3] m/s
    angular_velocity: Column  # [n, 3] rad/s, world axes
    inverse_mass: Column  # [n] 1/kg, >= 0
    inverse_inertia: Column  # [n, 3] 1/(kg m^2), >= 0, about the body's own principal axes
    force: Column | None = None  # [n, 3] N, through the whole step, gravity apart; 0
    torque: Column | None = None  # [n, 3] N m; 0
    linear_factor: Column | None = None  # [n, 3] world axes; inverse mass becomes F M^-1 F; 1
    angular_factor: Column | None = None  # [n, 3]; 1
    flags: Column | None = None  # [n] NO_GYROSCOPIC, AT_END_POSE; 0


@dataclass
class Contacts:
    """n contact points: (x_b + arm_b) - (x_a + arm_a) = separation * normal.

    Up to four consecutive ones of the same two bodies form a manifold.
    """

    body_a: Column  # [n] index or WORLD
    body_b: Column  # [n]
    normal: Column  # [n, 3] unit, from a to b
    arm_a: Column  # [n, 3] m, from a's centre of mass to the point on its surface, world axes
    arm_b: Column  # [n, 3] m
    separation: Column  # [n] m, negative when the bodies overlap
    friction: Column | None = None  # [n] Coulomb's coefficient, >= 0; 0
    restitution: Column | None = None  # [n] 0 ... 1; 0
    tangent: Column | None = None  # [n, 3] first friction direction; chosen from the normal
    key: Column | None = None  # [n] unique: finds the contact's impulse of the last step; 0: start from zero
    flags: Column | None = None  # [n] ROUND_A, ROUND_B: the surface rolls, so its anchor does not turn; 0
    friction_scale: Column | None = None  # [n, 2] >= 0, of friction along tangent and normal x tangent; 1
    surface_velocity: Column | None = None  # [n, 3] m/s of b relative to a, which friction drives to; 0
    rolling_friction: Column | None = None  # [n] m, >= 0: torque about the plane's directions / normal force; 0
    spinning_friction: Column | None = None  # [n] m, >= 0: torque about the normal / normal force; 0
    stiffness: Column | None = None  # [n] N/m, >= 0: a spring and damper, not the method's bias; 0: rigid
    damping: Column | None = None  # [n] N s/m, >= 0; 0


@dataclass
class Joints:
    """n joints of six axes, x y z of translation and x y z of rotation; `cairn.joint_axes` fills `axes` by kind."""

    body_a: Column  # [n] index or WORLD
    body_b: Column  # [n]
    anchor_a: Column  # [n, 3] m, origin of the joint's frame in a's axes, from a's centre of mass
    anchor_b: Column  # [n, 3] m
    axes: Column  # [n, 6] FREE, LOCKED, LIMITED, DRIVEN, SPRING, SERVO of tx ty tz rx ry rz
    frame_a: Column | None = None  # [n, 4] quaternion: the joint's axes in a's axes; identity
    frame_b: Column | None = None  # [n, 4]
    lower: Column | None = None  # [n, 6] m or rad, of limited axes
    upper: Column | None = None  # [n, 6] >= lower
    motor_speed: Column | None = None  # [n, 6] m/s or rad/s, of driven axes; of servos the most, >= 0
    motor_force: Column | None = None  # [n, 6] N or N m, >= 0; infinity allowed
    key: Column | None = None  # [n] as for contacts
    rotation: Column | None = None  # [n] BY_AXES, VECTOR, CONE: what rx ry rz measure (cairn.h); BY_AXES
    target: Column | None = None  # [n, 6] m or rad, of springs and servos; 0
    stiffness: Column | None = (
        None  # [n, 6] N/m or N m/rad, of springs; of servos: force by the error at most; infinity
    )
    damping: Column | None = None  # [n, 6] N s/m or N m s/rad, of springs; 0
    rate: Column | None = None  # [n, 6] 1/s, of servos: speed over error; infinity
    max_force: Column | None = None  # [n] N or N m: bounds each axis's force; infinity


@dataclass
class Rows:
    """n raw rows: J v + compliance lambda = rhs, lower <= lambda <= upper, frozen at the step's start."""

    body_a: Column  # [n] index or WORLD
    body_b: Column  # [n]
    jacobian_a: Column  # [n, 6] linear, angular
    jacobian_b: Column  # [n, 6]
    rhs: Column | None = None  # [n] m/s or rad/s; 0
    lower: Column | None = None  # [n] N s over the whole step; -infinity
    upper: Column | None = None  # [n] N s; infinity
    compliance: Column | None = None  # [n] >= 0, 1/kg; 0
    friction_index: Column | None = None  # [n] an earlier row of the same block that bounds this one, or -1
    friction: Column | None = None  # [n] coefficient of such rows, >= 0; 0
    block: Column | None = None  # [n] consecutive rows of the same bodies and block are solved together; 0
    key: Column | None = None  # [n] as for contacts


@dataclass
class Results:
    """What a step gave. Impulses are sums over the whole step. None: of a table in CUDA memory, and not in `out`."""

    position: Column  # [bodies, 3] m
    orientation: Column  # [bodies, 4]
    linear_velocity: Column  # [bodies, 3] m/s
    angular_velocity: Column  # [bodies, 3] rad/s
    contact_impulse: Column  # [contacts] N s, along the normal, >= 0
    friction_impulse: Column  # [contacts, 3] N s, world axes, on body b
    joint_impulse: Column  # [joints, 6] N s and N m s, on body b, in the joint's axes
    row_impulse: Column  # [rows]
    torsion_impulse: Column  # [contacts, 3] N m s, world axes, on body b: of rolling and spinning friction
    joint_linear: Column  # [joints, 3] N s, on body b at its anchor, world axes
    joint_angular: Column  # [joints, 3] N m s, likewise


# A table as given: one of the classes above, a dict of columns, or a structured array.
Table = Union[Bodies, Contacts, Joints, Rows, Results, Mapping[str, Column], npt.NDArray[np.void]]


def columns_of(table: Table | None, name: str) -> dict[str, Column]:
    """The table's columns by name, without copies. TypeError if it is none of the forms above."""
    if table is None:
        return {}
    if isinstance(table, Mapping):
        return {key: column for key, column in table.items() if column is not None}
    if isinstance(table, np.ndarray) and table.dtype.names is not None:
        return {key: table[key] for key in table.dtype.names}
    if is_dataclass(table) and not isinstance(table, type):
        values = ((field.name, getattr(table, field.name)) for field in fields(table))
        return {key: column for key, column in values if column is not None}
    raise TypeError(f"{name} is a {type(table).__name__}; pass a cairn table, a dict of arrays or a structured array")
