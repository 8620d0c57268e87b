"""Random tables of a step, with every kind of contact, joint and row, and random results."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import cairn
from numpy_evaluation import Array, L, M


def random_bodies(random: np.random.Generator, n: int, plain: bool = False) -> Any:
    bodies: Any = cairn.Bodies(
        position=random.normal(size=(n, 3)),
        orientation=Rotation.random(n, random_state=int(random.integers(1 << 30))).as_quat(),
        linear_velocity=random.normal(size=(n, 3)),
        angular_velocity=random.normal(size=(n, 3)),
        inverse_mass=np.exp(random.uniform(-1, 1, n)),
        inverse_inertia=np.exp(random.uniform(-1, 2, (n, 3))),
        flags=np.full(n, cairn.NO_GYROSCOPIC, np.int32) if plain else random.integers(0, 2, n).astype(np.int32),
    )
    if not plain:
        bodies.force, bodies.torque = random.normal(size=(2, n, 3))
        bodies.linear_factor, bodies.angular_factor = np.ones((2, n, 3))
        bodies.linear_factor[3], bodies.angular_factor[4] = (0, 1, 0.5), (1, 0.5, 2)
        bodies.inverse_inertia[5, 1] = 0
    return bodies


def random_contacts(random: np.random.Generator, bodies: Any, pairs: list[tuple[int, int]], plain: bool) -> Any:
    n = len(pairs)
    a, b = np.array(pairs, np.int32).T
    normal, tangent = random.normal(size=(2, n, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    arm_a, separation = random.normal(size=(n, 3)), random.uniform(-0.02, 0.01, n)
    centre = np.vstack([bodies.position, np.zeros(3)])  # -1 is the world
    table: Any = cairn.Contacts(
        body_a=a.copy(), body_b=b.copy(), normal=normal, arm_a=arm_a, separation=separation, tangent=tangent,
        arm_b=centre[a] + arm_a + separation[:, None] * normal - centre[b], friction=random.choice([0, 0.3, 0.9], n),
    )  # fmt: skip
    if not plain:
        table.restitution = random.choice([0, 0.8], n)
        table.friction_scale = random.choice([0, 0.5, 1, 2], (n, 2))
        table.friction_scale[:, 0] = np.maximum(table.friction_scale[:, 0], 0.25)
        table.surface_velocity = random.normal(size=(n, 3))
        table.flags = random.integers(0, 4, n).astype(np.int32)
        table.stiffness = np.where(random.random(n) > 0.8, 500.0, 0)
        table.rolling_friction = np.full(n, 0.01)
    return table


KINDS: list[tuple[list[int], int]] = [
    ([L, L, L, 0, 0, 0], cairn.BY_AXES),
    ([L, L, L, L, L, 0], cairn.BY_AXES),
    ([0, L, L, L, L, L], cairn.BY_AXES),
    ([L, L, L, L, L, L], cairn.BY_AXES),
    ([M, L, L, L, M, L], cairn.BY_AXES),
    ([L, M, M, M, M, M], cairn.BY_AXES),
    ([L, L, L, M, L, M], cairn.VECTOR),
    ([L, L, L, M, M, M], cairn.CONE),
    ([cairn.DRIVEN, M | cairn.DRIVEN, L, 0, cairn.DRIVEN, cairn.SPRING], cairn.BY_AXES),
    ([L, L, L, L, L, cairn.DRIVEN | cairn.SERVO], cairn.BY_AXES),
    ([L, L, L, cairn.DRIVEN, L, L], cairn.BY_AXES),
]


def random_joints(random: np.random.Generator, bodies: Any, pairs: list[tuple[int, int]]) -> Any:
    """One of each kind, nearly satisfied at the start."""
    n = len(KINDS)
    a, b = np.array([pairs[i % len(pairs)] for i in range(n)], np.int32).T

    def turn() -> Array:
        return np.asarray(Rotation.random(n, random_state=int(random.integers(1 << 30))).as_quat())

    table: Any = cairn.Joints(
        body_a=a.copy(), body_b=b.copy(), anchor_a=random.normal(size=(n, 3)), anchor_b=np.zeros((n, 3)),
        frame_a=turn(), frame_b=turn(), axes=np.array([kind for kind, _ in KINDS], np.int32),
        rotation=np.array([rotation for _, rotation in KINDS], np.int32),
        lower=random.uniform(-0.1, 0, (n, 6)), upper=random.uniform(0, 0.1, (n, 6)),
        motor_speed=np.ones((n, 6)), motor_force=random.choice([1.0, 40.0], (n, 6)), stiffness=np.ones((n, 6)),
        max_force=random.choice([np.inf, 30.0], n),
    )  # fmt: skip
    table.upper[4, 0] = table.lower[4, 0]  # no room: locked there
    table.upper[7, 4:] = 0.2, 0.5
    for i in range(n):
        pose = [
            (np.zeros(3), Rotation.identity())
            if body < 0
            else (bodies.position[body], Rotation.from_quat(bodies.orientation[body]))
            for body in (a[i], b[i])
        ]
        gap = 0.05 * random.normal(size=3)
        table.anchor_b[i] = pose[1][1].inv().apply(pose[0][0] + pose[0][1].apply(table.anchor_a[i]) + gap - pose[1][0])
        off = Rotation.from_rotvec(0.1 * random.normal(size=3))
        table.frame_b[i] = (pose[1][1].inv() * pose[0][1] * Rotation.from_quat(table.frame_a[i]) * off).as_quat()
    return table


def random_rows(random: np.random.Generator, pairs: list[tuple[int, int]]) -> Any:
    """A block of a normal, its two friction rows, a row without bounds; one with one friction row, and a soft row."""
    pairs = [pairs[0]] * 4 + [pairs[1]] * 3
    n = len(pairs)
    a, b = np.array(pairs, np.int32).T
    return cairn.Rows(
        body_a=a.copy(), body_b=b.copy(), jacobian_a=random.normal(size=(n, 6)), jacobian_b=random.normal(size=(n, 6)),
        rhs=random.normal(size=n), lower=np.array([0, -1, -1, -np.inf, 0, -1, -np.inf]),
        upper=np.array([np.inf, 1, 1, np.inf, 0.05, 1, np.inf]), friction=np.full(n, 0.4),
        friction_index=np.array([-1, 0, 0, -1, -1, 4, -1], np.int32), compliance=np.array([0, 0, 0, 0, 0, 0, 0.1]),
    )  # fmt: skip


ONE, TWO = [2, 3, 4], [5, 6, 7]  # the islands' bodies; 0 is static, 1 kinematic, 8 on its own


def random_step(seed: int) -> tuple[Any, Any, Any, Any]:
    random = np.random.default_rng(seed)
    bodies = random_bodies(random, 9)
    bodies.inverse_mass[:2], bodies.inverse_inertia[:2] = 0, 0
    bodies.flags[1] = cairn.AT_END_POSE if seed % 2 else 0
    if seed % 3 == 0:
        bodies.inverse_mass[6] = 0  # its centre is pinned
    bodies.linear_velocity[0] = bodies.angular_velocity[0] = 0
    pairs = [(2, 3), (4, 3), (0, 2), (4, 1), (6, 5), (-1, 7), (7, 6), (1, 0), (1, 5)]
    contacts = random_contacts(random, bodies, [pairs[i] for i in random.integers(0, len(pairs), 16)], plain=False)
    joints = random_joints(random, bodies, [(2, 3), (5, 6), (-1, 4), (7, 6), (3, 4)])
    rows = random_rows(random, [(2, 4), (7, 0)])
    return bodies, contacts, joints, rows


def random_results(seed: int, bodies: Any, contacts: Any, joints: Any, rows: Any) -> Any:
    """No solver's: every quantity is far from zero."""
    random = np.random.default_rng(seed + 1000)
    n, c, j, r = (len(t) for t in (bodies.position, contacts.normal, joints.axes, rows.rhs))
    turn = Rotation.from_rotvec(0.02 * random.normal(size=(n, 3)))
    return cairn.Results(
        position=bodies.position + 0.01 * random.normal(size=(n, 3)),
        orientation=(turn * Rotation.from_quat(bodies.orientation)).as_quat(),
        linear_velocity=random.normal(size=(n, 3)), angular_velocity=random.normal(size=(n, 3)),
        contact_impulse=random.normal(size=c) + 0.5, friction_impulse=0.3 * random.normal(size=(c, 3)),
        torsion_impulse=0.01 * random.normal(size=(c, 3)), joint_impulse=random.normal(size=(j, 6)),
        joint_linear=random.normal(size=(j, 3)), joint_angular=random.normal(size=(j, 3)),
        row_impulse=random.normal(size=r),
    )  # fmt: skip
