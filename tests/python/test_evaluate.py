"""`cairn.evaluate` against an evaluation in NumPy that shares nothing with it, exact solutions, and broken results."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Callable

import numpy as np
import numpy.typing as npt
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

import cairn

Array = npt.NDArray[np.float64]
GRAVITY = (0.3, -9.0, 0.5)
DT = 0.01
L, M = cairn.LOCKED, cairn.LIMITED


# ---- An evaluation from the definitions in cairn.h -------------------------------------------------------------------


def column(table: Any, name: str, default: Any, count: int) -> Any:
    value = getattr(table, name, None)
    return np.broadcast_to(default, (count, *np.shape(default))) if value is None else value


class Body:
    """One body, or the world: what goes into rows, as dense matrices."""

    def __init__(self, bodies: Any, results: Any, i: int) -> None:
        self.i = i
        if i < 0:
            self.x = self.x0 = self.x1 = np.zeros(3)
            self.q = self.q0 = self.q1 = Rotation.identity()
            self.twist = self.start_twist = np.zeros(6)
            self.inverse = np.zeros((6, 6))
            self.movable = False
            return
        n = len(bodies.position)

        def at(name: str, default: Any) -> Any:
            return column(bodies, name, default, n)[i]

        self.x, self.q = bodies.position[i], Rotation.from_quat(bodies.orientation[i])
        self.x0, self.q0 = self.x, self.q  # as given, which arms go with
        self.start_twist = np.hstack([bodies.linear_velocity[i], bodies.angular_velocity[i]])
        self.m, self.principal = bodies.inverse_mass[i], bodies.inverse_inertia[i]
        linear, angular = at("linear_factor", np.ones(3)), at("angular_factor", np.ones(3))
        turn = self.q.as_matrix()
        self.inverse = np.zeros((6, 6))
        self.inverse[:3, :3] = np.diag(linear**2 * self.m)
        self.inverse[3:, 3:] = np.diag(angular) @ turn @ np.diag(self.principal) @ turn.T @ np.diag(angular)
        self.movable = bool(self.inverse.any())
        self.flags = at("flags", 0)
        wrench = np.hstack([at("force", np.zeros(3)), at("torque", np.zeros(3))])
        weight = np.hstack([linear**2 * np.array(GRAVITY), np.zeros(3)]) if self.m > 0 else np.zeros(6)
        self.acceleration = weight + self.inverse @ wrench
        self.gyroscopic = (angular == 1).all() and (self.principal > 0).all() and not self.flags & cairn.NO_GYROSCOPIC
        if self.movable:
            self.x1, self.q1 = results.position[i], Rotation.from_quat(results.orientation[i])
            self.end_twist = np.hstack([results.linear_velocity[i], results.angular_velocity[i]])
            self.twist = np.hstack([self.x1 - self.x, (self.q1 * self.q.inv()).as_rotvec()]) / DT
        else:
            self.twist = self.start_twist
            moved = Rotation.from_rotvec(DT * self.twist[3:])
            if self.flags & cairn.AT_END_POSE:
                self.x1, self.q1 = self.x, self.q
                self.x, self.q = self.x - DT * self.twist[:3], moved.inv() * self.q
            else:
                self.x1, self.q1 = self.x + DT * self.twist[:3], moved * self.q

    def inertia(self, q: Rotation) -> Any:
        turn = q.as_matrix()
        return turn @ np.diag([1 / p if p > 0 else 0 for p in self.principal]) @ turn.T

    @property
    def mass(self) -> float:
        return 1 / self.m if self.m > 0 else 0.0


def row_of(linear: Array, arm_a: Array, arm_b: Array) -> Array:
    """[12] both bodies pushed along `linear` at the ends of the arms."""
    return np.hstack([-linear, -np.cross(arm_a, linear), linear, np.cross(arm_b, linear)])


def beyond(value: float, low: float, high: float) -> float:
    return (value - min(max(value, low), high)) / DT


def on_cone(y: Array, mu: float) -> Any:
    slip = np.hypot(y[1], y[2])
    if slip <= mu * y[0]:
        return y
    if mu * slip <= -y[0]:
        return np.zeros(3)
    ray = np.array([1, *(mu * y[1:] / slip)])
    return ray * (y @ ray) / (ray @ ray)


# Quantities of which the worst element is named, with the name of its index.
INDEX_OF = {
    "penetration": "penetration_contact",
    "contact_residual": "residual_contact",
    "joint_gap": "gap_joint",
    "joint_angle": "angle_joint",
    "joint_residual": "residual_joint",
    "joint_angular_residual": "angular_residual_joint",
    "row_residual": "residual_row",
    "momentum": "momentum_body",
    "angular_momentum": "angular_momentum_body",
}


class Judge:
    """Everything of one island. Quantities with an index are kept as (value, index) of each element."""

    def __init__(self) -> None:
        names = (*INDEX_OF, "complementarity", "coulomb_excess", "rows")
        self.each: dict[str, list[tuple[float, int]]] = {name: [] for name in names}
        self.error = self.impulse = self.energy = 0.0
        self.bodies: list[tuple[Body, Array, Array]] = []  # with what is not explained

    def add(self, name: str, value: Any, i: int) -> None:
        self.each[name].append((float(value), i))

    def residual(self, name: str, r: Any, i: int, d: float, square: float) -> None:
        self.add(name, r, i)
        self.error += r * r / d
        self.impulse += d * square

    def found(self) -> dict[str, float]:
        def most(name: str) -> tuple[float, int]:
            value = max([0.0, *(v for v, _ in self.each[name])])
            return value, min(i for v, i in self.each[name] if v == value) if value > 0 else -1

        def mean(name: str) -> float:
            return float(np.mean([v for v, _ in self.each[name]] or [0.0]))

        out: dict[str, float] = {
            "bodies": len(self.bodies),
            "contacts": len(self.each["penetration"]),
            "joints": len(self.each["joint_gap"]),
            "rows": len(self.each["rows"]),
            "kinetic_energy": self.energy,
            "relative_residual": np.sqrt(self.error / (self.error + self.impulse)) if self.error > 0 else 0.0,
        }
        for name, index in INDEX_OF.items():
            out[name], out[index] = most(name)
        for name in ("penetration", "joint_gap", "joint_angle"):
            out[name + "_mean"] = mean(name)
        for name in ("complementarity", "coulomb_excess"):
            out[name] = most(name)[0]
        mass = sum(b.mass for b, _, _ in self.bodies)
        centre = sum((b.mass * b.x for b, _, _ in self.bodies), np.zeros(3)) / (mass or 1)
        if mass == 0:
            centre = self.bodies[0][0].x
        linear = sum((p for _, p, _ in self.bodies), np.zeros(3))
        angular = sum((np.cross(b.x - centre, p) + t for b, p, t in self.bodies), np.zeros(3))
        out["momentum_total"], out["angular_momentum_total"] = map(float, map(np.linalg.norm, (linear, angular)))
        return out


def judge_contact(judge: Judge, a: Body, b: Body, c: Any, results: Any, i: int, wrench: Callable[..., None]) -> None:
    n = len(c.normal)
    normal, separation = c.normal[i], c.separation[i]
    mu = column(c, "friction", 0.0, n)[i]
    scale = column(c, "friction_scale", np.ones(2), n)[i]
    arm_a, arm_b = c.arm_a[i] + 0.5 * separation * normal, c.arm_b[i] - 0.5 * separation * normal
    first = c.tangent[i] - normal * (normal @ c.tangent[i])
    first /= np.linalg.norm(first)
    tangents = np.array([first, np.cross(normal, first)])
    if mu > 0:
        mu, scale = mu * scale.max(), scale / scale.max()
    else:
        scale = np.ones(2)
    pushed, friction, torsion = results.contact_impulse[i], results.friction_impulse[i], results.torsion_impulse[i]
    wrench(row_of(pushed * normal + friction, arm_a, arm_b) + np.hstack([np.zeros(3), -torsion, np.zeros(3), torsion]))

    # along the scaled tangents the ellipse is a disc
    lam = np.array([pushed, *(tangents @ friction / np.where(scale > 0, scale, np.inf))])
    wrong = tangents @ friction * (scale == 0)
    judge.add("coulomb_excess", np.linalg.norm([*lam[1:], *wrong]) - mu * pushed, i)

    flags = column(c, "flags", 0, n)[i]
    change_a = np.zeros(3) if flags & cairn.ROUND_A else (a.q1 * a.q0.inv()).apply(c.arm_a[i]) - c.arm_a[i]
    change_b = np.zeros(3) if flags & cairn.ROUND_B else (b.q1 * b.q0.inv()).apply(c.arm_b[i]) - c.arm_b[i]
    judge.add("penetration", max(0.0, -(separation + normal @ (b.x1 - b.x0 + change_b - a.x1 + a.x0 - change_a))), i)
    if column(c, "stiffness", 0.0, n)[i] > 0:
        return

    directions = np.vstack([normal, tangents * scale[:, None]])
    jacobian = np.array([row_of(d, arm_a, arm_b) for d in directions])
    inverse = np.zeros((12, 12))
    inverse[:6, :6], inverse[6:, 6:] = a.inverse, b.inverse
    d = np.trace(jacobian @ inverse @ jacobian.T) / 3
    w = jacobian @ np.hstack([a.twist, b.twist])
    w[1:] -= directions[1:] @ column(c, "surface_velocity", np.zeros(3), n)[i]
    start = separation
    for body, arm, rolls, sign in ((a, c.arm_a[i], cairn.ROUND_A, -1), (b, c.arm_b[i], cairn.ROUND_B, 1)):
        if body.i >= 0 and not body.movable:  # one that is given at its end is further back at the start
            back = np.zeros(3) if flags & rolls else (body.q * body.q0.inv()).apply(arm) - arm
            start += sign * normal @ (body.x - body.x0 + back)
    approach = jacobian[0] @ np.hstack([a.start_twist, b.start_twist])
    rebound = column(c, "restitution", 0.0, n)[i] * max(0.0, -approach)
    w[0] = beyond(start + DT * w[0], min(start, 0.0), DT * rebound)
    judge.add("complementarity", abs(pushed * w[0]), i)
    w[0] += mu * np.hypot(w[1], w[2])
    judge.residual("contact_residual", np.linalg.norm(d * lam - on_cone(d * lam - w, mu)), i, d, lam @ lam)


def coordinates(a: Body, b: Body, j: Any, i: int, end: bool) -> tuple[Array, Array, Array]:
    """The six coordinates of a joint, the rows of their Jacobian and the arms, from the definitions in cairn.h."""
    qa, qb = (a.q1, b.q1) if end else (a.q, b.q)
    xa, xb = (a.x1, b.x1) if end else (a.x, b.x)
    frame_a, frame_b = qa * Rotation.from_quat(j.frame_a[i]), qb * Rotation.from_quat(j.frame_b[i])
    axes, of_b = frame_a.as_matrix().T, frame_b.as_matrix().T
    arm_a, arm_b = qa.apply(j.anchor_a[i]), qb.apply(j.anchor_b[i])
    gap = xb + arm_b - xa - arm_a
    q = (frame_a.inv() * frame_b).as_quat()
    q = q if q[3] >= 0 else -q
    kinds, rotation = j.axes[i][3:], j.rotation[i]
    turns = axes.copy()
    if rotation == cairn.VECTOR:
        angles = Rotation.from_quat(q).as_rotvec()
    elif rotation == cairn.CONE:
        swing = np.cross(axes[0], of_b[0])
        theta = np.arctan2(np.linalg.norm(swing), axes[0] @ of_b[0])
        u = swing / np.linalg.norm(swing)
        y, z = 1 / j.upper[i][4], 1 / j.upper[i][5]
        uy, uz = u @ axes[1], u @ axes[2]
        along = np.hypot(uy * y, uz * z)
        across = uy * uz * (z**2 - y**2) / along
        size = np.hypot(along, across)
        angles = np.array([2 * np.arctan2(q[0], q[3]), (1 - theta * along) / size, 0])
        turns[0] = (axes[0] + of_b[0]) / (1 + axes[0] @ of_b[0])
        turns[1] = (np.cross(u, of_b[0]) * across * theta / np.sin(theta) - u * along) / size
    elif (kinds == L).all():
        angles = 2 * q[:3]
    elif (kinds == L).sum() == 2:
        k = int(np.argmax(kinds != L))
        one, two = (k + 1) % 3, (k + 2) % 3
        angles = np.zeros(3)
        angles[one], turns[one] = axes[k] @ of_b[two], np.cross(of_b[two], axes[k])
        angles[two], turns[two] = -axes[k] @ of_b[one], np.cross(axes[k], of_b[one])
        angles[k] = 2 * np.arctan2(q[k], q[3])
    elif kinds.any():
        angles = Rotation.from_matrix(axes @ of_b.T).as_euler("xyz")
        nodes = np.cross(axes[2], of_b[0])
        turns = np.array([np.cross(nodes, axes[2]), nodes, np.cross(of_b[0], nodes)])
        turns /= np.linalg.norm(turns, axis=1)[:, None]
    else:
        angles = np.zeros(3)
    arms = np.array([arm_a + gap, arm_b])
    jacobian = np.array(
        [row_of(d, *arms) for d in axes] + [np.hstack([np.zeros(3), -t, np.zeros(3), t]) for t in turns]
    )
    return np.hstack([axes @ gap, angles]), jacobian, arms


def judge_joint(judge: Judge, a: Body, b: Body, j: Any, results: Any, i: int, wrench: Callable[..., None]) -> None:
    before, jacobian, arms = coordinates(a, b, j, i, end=False)
    now, _, arms_end = coordinates(a, b, j, i, end=True)
    linear, angular = results.joint_linear[i], results.joint_angular[i]
    mean = (arms + arms_end) / 2
    wrench(row_of(linear, *mean) + np.hstack([np.zeros(3), -angular, np.zeros(3), angular]))
    inverse = np.zeros((12, 12))
    inverse[:6, :6], inverse[6:, 6:] = a.inverse, b.inverse
    errors = np.zeros(6)
    for axis in range(6):
        kind, cone = j.axes[i][axis], j.rotation[i] == cairn.CONE and axis >= 4
        if cone and axis == 5:
            continue
        low, high = (0.0, np.inf) if cone else (j.lower[i][axis], j.upper[i][axis])
        locked = bool(kind & L) or (bool(kind & M) and low == high)
        low = 0.0 if kind & L else low
        if locked:
            errors[axis] = now[axis] - low
        elif kind & M:
            errors[axis] = min(now[axis] - low, 0) + max(now[axis] - high, 0)
        d = jacobian[axis] @ inverse @ jacobian[axis]
        if d <= 0 or kind in (cairn.FREE, M | cairn.DRIVEN, cairn.DRIVEN | cairn.SERVO, cairn.SPRING):
            continue
        lam, bound = results.joint_impulse[i][axis], d * DT * j.max_force[i]
        if locked:
            w = beyond(errors[axis], min(before[axis] - low, 0), max(before[axis] - low, 0))
            r = abs(d * lam - np.clip(d * lam - w, -bound, bound))
        elif kind == cairn.DRIVEN:
            w = jacobian[axis] @ np.hstack([a.twist, b.twist]) - j.motor_speed[i][axis]
            bound = min(bound, d * DT * j.motor_force[i][axis])
            r = abs(d * lam - np.clip(d * lam - w, -bound, bound))
        else:
            each = []
            for x, gap0, gap1 in (
                (max(d * lam, 0), before[axis] - low, now[axis] - low),
                (max(-d * lam, 0), high - before[axis], high - now[axis]),
            ):
                each.append(abs(x - np.clip(x - beyond(gap1, min(gap0, 0), 0), 0, bound)))
            r = max(each)
        judge.residual("joint_residual" if axis < 3 else "joint_angular_residual", r, i, d, lam**2)
    judge.add("joint_gap", np.linalg.norm(errors[:3]), i)
    judge.add("joint_angle", np.linalg.norm(errors[3:]), i)


def judge_row(
    judge: Judge, of: Callable[[int], Body], t: Any, results: Any, i: int, wrench: Callable[..., None]
) -> None:
    def look(k: int) -> tuple[float, float, float]:
        a, b = of(t.body_a[k]), of(t.body_b[k])
        d = t.jacobian_a[k] @ a.inverse @ t.jacobian_a[k] + t.jacobian_b[k] @ b.inverse @ t.jacobian_b[k]
        return d, t.jacobian_a[k] @ a.twist + t.jacobian_b[k] @ b.twist - t.rhs[k], results.row_impulse[k]

    judge.add("rows", 1, i)
    d, w, lam = look(i)
    wrench(lam * np.hstack([t.jacobian_a[i], t.jacobian_b[i]]))
    source = t.friction_index[i]
    pair = [k for k in (i - 1, i, i + 1) if 0 <= k < len(t.rhs) and source >= 0 and t.friction_index[k] == source]
    if any(t.compliance[k] > 0 for k in (pair or [i])):
        return
    if len(pair) == 2:
        d = (look(pair[0])[0] + look(pair[1])[0]) / 2
        y = np.array([d * look(k)[2] - look(k)[1] for k in pair])
        bound = d * t.friction[i] * abs(results.row_impulse[source])
        y *= min(1, bound / np.linalg.norm(y))
        r = abs(d * lam - y[pair.index(i)])
    else:
        bound = t.friction[i] * abs(results.row_impulse[source])
        low, high = (t.lower[i], t.upper[i]) if source < 0 else (-bound, bound)
        r = abs(d * lam - np.clip(d * lam - w, d * low, d * high))
    judge.residual("row_residual", r, i, d, lam**2)


def evaluate(bodies: Any, results: Any, contacts: Any, joints: Any, rows: Any) -> tuple[list[Judge], Array]:
    """A Judge an island, the last of all; and the island of each body."""
    n = len(bodies.position)
    of = {i: Body(bodies, results, i) for i in range(-1, n)}
    ties = []
    for table in (contacts, joints, rows):
        for a, b in zip(table.body_a, table.body_b) if table else ():
            if of[a].movable and of[b].movable:
                ties.append((a, b))
    graph = coo_matrix((np.ones(len(ties)), tuple(np.array(ties, int).reshape(-1, 2).T)), (n, n))
    label = connected_components(graph, directed=False)[1]
    order: dict[int, int] = {}
    island = np.array([order.setdefault(label[i], len(order)) if of[i].movable else -1 for i in range(n)])
    judges = [Judge() for _ in range(len(order) + 1)]
    wrenches = np.zeros((n + 1, 6))  # the last is the world's

    looks: tuple[tuple[Any, Callable[..., None]], ...] = (
        (contacts, judge_contact),
        (joints, judge_joint),
        (rows, judge_row),
    )
    for table, look in looks:
        for i in range(len(table.body_a) if table else 0):
            a, b = of[table.body_a[i]], of[table.body_b[i]]

            def wrench(both: Array, a: Body = a, b: Body = b) -> None:
                wrenches[a.i] += both[:6]
                wrenches[b.i] += both[6:]

            if a.movable or b.movable:
                where = island[a.i if a.movable else b.i]
                pair: Any = (of.__getitem__,) if look is judge_row else (a, b)
                look(judges[where], *pair, table, results, i, wrench)
                look(judges[-1], *pair, table, results, i, lambda both: None)
    for i in range(n):
        body = of[i]
        if not body.movable:
            continue
        change = body.end_twist - body.start_twist - DT * body.acceleration - body.inverse @ wrenches[i]
        start, end = body.inertia(body.q), body.inertia(body.q1)
        if body.gyroscopic:
            torque = column(bodies, "torque", np.zeros(3), n)[i]
            turned = end @ body.end_twist[3:] - start @ body.start_twist[3:] - DT * torque - wrenches[i][3:]
        else:
            turned = start @ change[3:]
        gain = sum(
            s / 2 * (body.mass * v[:3] @ v[:3] + v[3:] @ inertia @ v[3:])
            for s, v, inertia in ((-1, body.start_twist, start), (1, body.end_twist, end))
        )
        force = np.hstack([body.mass * body.acceleration[:3], start @ body.acceleration[3:]])
        for judge in (judges[island[i]], judges[-1]):
            judge.impulse += DT**2 * force @ body.acceleration
            judge.bodies.append((body, body.mass * change[:3], turned))
            judge.add("momentum", np.linalg.norm(body.mass * change[:3]), i)
            judge.add("angular_momentum", np.linalg.norm(turned), i)
            judge.energy += gain - DT / 2 * force @ (body.start_twist + body.end_twist)
    return judges, island


# ---- Random steps ----------------------------------------------------------------------------------------------------


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


def agree(found: Any, wanted: dict[str, float], i: Any = ...) -> None:
    """To 1e-9; which element is worst where that is more than rounding."""
    noise = {index for name, index in INDEX_OF.items() if wanted[name] < 1e-9}
    for field in fields(cairn.Measures):
        if field.name not in noise:
            value = np.asarray(getattr(found, field.name))[i]
            np.testing.assert_allclose(value, wanted[field.name], rtol=1e-9, atol=1e-9, err_msg=field.name)


def check(step: tuple[Any, Any, Any, Any], results: Any) -> cairn.Evaluation:
    found = cairn.evaluate(DT, step[0], results, *step[1:], gravity=GRAVITY)
    judges, island = evaluate(step[0], results, *step[1:])
    np.testing.assert_array_equal(found.body_island, island)
    assert len(found.islands.bodies) == len(judges) - 1
    agree(found.whole, judges[-1].found())
    for i, judge in enumerate(judges[:-1]):
        agree(found.islands, judge.found(), i)
    return found


@pytest.mark.parametrize("seed", range(12))
def test_any_numbers_agree_with_numpy(seed: int) -> None:
    step = random_step(seed)
    found = check(step, random_results(seed, *step))
    assert found.whole.contact_residual > 0.1
    assert found.whole.row_residual > 0.1
    assert found.whole.joint_angular_residual > 0.1


@pytest.mark.parametrize("method", cairn.METHODS)
@pytest.mark.parametrize("seed", range(3))
def test_steps_of_the_solver_agree_with_numpy(method: str, seed: int) -> None:
    step = random_step(seed)
    solver = cairn.Solver(method, precision=64)
    check(step, solver.step(DT, *step, gravity=GRAVITY))
    assert len(np.unique(check(step, solver.step(DT, *step, gravity=GRAVITY)).islands.bodies)) > 1
    assert solver.statistics["islands"] == 3


# ---- Exact solutions ------------------------------------------------------------------------------------------------


class ContactStep:
    """Bodies and rigid contacts as one dense problem u = W r + q, and the step that impulses r make of it."""

    def __init__(self, seed: int, apart: bool = False) -> None:
        random = np.random.default_rng(seed)
        self.bodies = random_bodies(random, 7, plain=True)
        self.bodies.inverse_mass[0], self.bodies.inverse_inertia[0] = 0, 0
        pairs = [(-1, 1), (1, 2), (3, 2), (4, 5), (5, 0), (6, 4)]
        self.contacts = random_contacts(random, self.bodies, [pairs[i] for i in random.integers(0, 6, 14)], plain=True)
        if apart:
            self.contacts.separation = np.abs(self.contacts.separation)
            c, centre = self.contacts, np.vstack([self.bodies.position, np.zeros(3)])
            c.arm_b = centre[c.body_a] + c.arm_a + c.separation[:, None] * c.normal - centre[c.body_b]
        c, n = self.contacts, len(self.bodies.position)
        still: Any = cairn.Results(*[self.bodies.position, self.bodies.orientation], *[np.zeros((n, 3))] * 9)
        of = [Body(self.bodies, still, i) for i in range(n)]
        self.inverse, self.free = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)
        for i, body in enumerate(of):
            self.inverse[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = body.inverse
            self.free[6 * i : 6 * i + 6] = body.start_twist + DT * body.acceleration * body.movable
        self.jacobian = np.zeros((3 * len(c.normal), 6 * n))
        for i, normal in enumerate(c.normal):
            flat = c.tangent[i] - normal * (normal @ c.tangent[i])
            flat /= np.linalg.norm(flat)
            half = 0.5 * c.separation[i] * normal
            for k, d in enumerate((normal, flat, np.cross(normal, flat))):
                both = row_of(d, c.arm_a[i] + half, c.arm_b[i] - half)
                for body, part in ((c.body_a[i], both[:6]), (c.body_b[i], both[6:])):
                    if body >= 0:
                        self.jacobian[3 * i + k, 6 * body : 6 * body + 6] = part
        self.W = self.jacobian @ self.inverse @ self.jacobian.T
        self.W = (self.W + self.W.T) / 2
        self.q = self.jacobian @ self.free
        self.q[::3] += np.maximum(c.separation, 0) / DT

    def evaluate(self, r: Array) -> cairn.Evaluation:
        c, n = self.contacts, len(self.bodies.position)
        twist = (self.free + self.inverse @ self.jacobian.T @ r).reshape(n, 6)
        directions = np.array([self.jacobian[i, 6 * b : 6 * b + 3] for i, b in enumerate(np.repeat(c.body_b, 3))])
        push = (directions * r[:, None]).reshape(-1, 3, 3)
        turn = Rotation.from_rotvec(DT * twist[:, 3:])
        results = {
            "position": self.bodies.position + DT * twist[:, :3],
            "orientation": (turn * Rotation.from_quat(self.bodies.orientation)).as_quat(),
            "linear_velocity": twist[:, :3].copy(),
            "angular_velocity": twist[:, 3:].copy(),
            "contact_impulse": r[::3].copy(),
            "friction_impulse": push[:, 1:].sum(axis=1),
        }
        return cairn.evaluate(DT, self.bodies, results, c, gravity=GRAVITY)


@pytest.mark.parametrize("seed", range(8))
def test_an_exact_solution_has_no_residual(seed: int) -> None:
    reference = pytest.importorskip("cairn.reference", reason="cairn was built without Eigen", exc_type=ImportError)
    step = ContactStep(seed)
    solution = reference.solve(step.W, step.q, step.contacts.friction)
    assert np.abs(solution.impulse).max() > 0.1
    exact = step.evaluate(solution.impulse)
    for measures in (exact.whole, exact.islands):
        for name in (
            "contact_residual", "relative_residual", "complementarity", "coulomb_excess", "momentum",
            "angular_momentum", "momentum_total", "angular_momentum_total",
        ):  # fmt: skip
            assert np.max(getattr(measures, name)) < 1e-9, name
    nothing = step.evaluate(np.zeros_like(solution.impulse))  # explains the motion, but violates the contacts
    assert 0.5 < nothing.whole.relative_residual < 1
    assert nothing.whole.contact_residual > 0.1
    assert nothing.whole.momentum < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_the_residual_is_the_reference_solver_s(seed: int) -> None:
    """Of bodies that are not overlapping: the reference knows no overlaps."""
    reference = pytest.importorskip("cairn.reference", reason="cairn was built without Eigen", exc_type=ImportError)
    step = ContactStep(seed, apart=True)
    r = np.random.default_rng(seed).normal(size=len(step.q))
    whole = step.evaluate(r).whole
    d = np.repeat([np.trace(step.W[i : i + 3, i : i + 3]) / 3 for i in range(0, len(r), 3)], 3)
    ratio = whole.relative_residual / np.sqrt(1 - whole.relative_residual**2)
    mass = (1 / step.bodies.inverse_mass[1:]).sum()
    error = ratio * np.sqrt((d * r) @ r + mass * DT**2 * np.square(GRAVITY).sum())
    wanted = reference.evaluate(step.W, step.q, step.contacts.friction, r).relative * np.linalg.norm(
        step.q / np.sqrt(d)
    )
    assert error == pytest.approx(wanted, rel=1e-9)


def test_more_sweeps_leave_less() -> None:
    step = ContactStep(3, apart=True)
    left = []
    for iterations in (3, 30, 300, 3000):
        solver = cairn.Solver("pj", iterations=iterations, relax_share=0, precision=64, acceleration="none")
        results = solver.step(DT, step.bodies, step.contacts, gravity=GRAVITY)
        found = cairn.evaluate(DT, step.bodies, results, step.contacts, gravity=GRAVITY).whole
        assert found.momentum < 1e-12  # whatever is left of the contacts' law
        left.append(found.relative_residual)
    assert left[1] < left[0] / 2
    assert left[2] < left[1] / 2
    assert left[3] < 1e-4


# ---- Broken results -------------------------------------------------------------------------------------------------


def broken(break_it: Callable[[Any], None]) -> tuple[Any, Any, dict[int, set[str]]]:
    """Measures of the islands before and after, and which of each island's have changed."""
    step = random_step(1)
    step[1].restitution = None
    solver = cairn.Solver("pj", relax_share=0, precision=64)  # rows of one pose alone: then impulses explain the motion
    results = solver.step(DT, *step, gravity=GRAVITY)
    before = cairn.evaluate(DT, step[0], results, *step[1:], gravity=GRAVITY).islands
    break_it(results)
    after = cairn.evaluate(DT, step[0], results, *step[1:], gravity=GRAVITY).islands
    changed: dict[int, set[str]] = {0: set(), 1: set(), 2: set()}
    for field in fields(cairn.Measures):
        for i in np.flatnonzero(getattr(before, field.name) != getattr(after, field.name)):
            changed[int(i)].add(field.name)
    return before, after, changed


def test_a_changed_impulse_is_seen_in_its_island_s_momentum() -> None:
    step = random_step(1)
    joint = int(np.flatnonzero(step[2].body_a == 5)[0])  # of bodies 5 and 6

    def break_it(results: Any) -> None:
        results.joint_linear[joint] += (100, 0, 0)

    before, after, changed = broken(break_it)
    assert before.momentum[1] < 1e-9
    assert after.momentum[1] == pytest.approx(100, rel=1e-9)
    assert after.momentum_body[1] in (5, 6)
    assert after.momentum_total[1] == pytest.approx(
        before.momentum_total[1], abs=1e-9
    )  # one takes what the other gives
    assert all("momentum" in name for name in changed[1])
    assert not changed[0]
    assert not changed[2]


def test_a_changed_contact_impulse_is_seen_in_the_residual() -> None:
    contact = int(np.flatnonzero(random_step(1)[1].body_b == 5)[0])

    def break_it(results: Any) -> None:
        results.contact_impulse[contact] = -100

    before, after, changed = broken(break_it)
    assert after.contact_residual[1] > before.contact_residual[1] + 10
    assert after.residual_contact[1] == contact
    assert after.momentum[1] > before.momentum[1] + 10
    assert "joint_gap" not in changed[1]
    assert not changed[0]
    assert not changed[2]


def test_a_moved_body_is_seen_in_errors_of_position() -> None:
    def break_it(results: Any) -> None:
        results.position[7] += (3, 0, 0)

    before, after, changed = broken(break_it)
    assert after.joint_gap[1] > before.joint_gap[1] + 1
    assert after.joint_residual[1] > before.joint_residual[1] + 100  # 3 m in 10 ms
    assert {"penetration", "contact_residual", "row_residual"} & changed[1]
    assert "momentum" not in changed[1]
    assert "joint_angle" not in changed[1]
    assert not changed[0]
    assert not changed[2]


def test_a_changed_velocity_is_seen_in_momentum_and_energy() -> None:
    def break_it(results: Any) -> None:
        results.linear_velocity[8] += (0, 7, 0)

    _, after, changed = broken(break_it)
    assert changed[2] >= {"momentum", "momentum_total", "kinetic_energy"}
    assert after.momentum_body[2] == 8
    assert not changed[0]
    assert not changed[1]


# ---- What is refused ------------------------------------------------------------------------------------------------


def test_refusals() -> None:
    step = random_step(0)
    results = random_results(0, *step)
    with pytest.raises(TypeError, match="results has a field 'postion', which is no result; results are position, "):
        cairn.evaluate(DT, step[0], {"postion": results.position}, *step[1:])
    with pytest.raises(ValueError, match=r"results\.position has 3 elements; its table has 9"):
        cairn.evaluate(DT, step[0], {"position": np.zeros((3, 3))}, *step[1:])
    with pytest.raises(cairn.Error, match=r"results\.torsion_impulse is absent"):
        cairn.evaluate(DT, step[0], {**vars(results), "torsion_impulse": None}, *step[1:])
    in_place = {**vars(results), "position": step[0].position}
    with pytest.raises(cairn.Error, match=r"results\.position is in place of bodies\.position: .* keep a copy"):
        cairn.evaluate(DT, step[0], in_place, *step[1:])
    results.joint_linear[2, 1] = np.nan
    with pytest.raises(cairn.Error, match=r"results\.joint_linear\[2\]\[1\] is nan") as refused:
        cairn.evaluate(DT, step[0], results, *step[1:])
    assert refused.value.status == 2


def test_single_precision_is_read_as_it_is() -> None:
    def cast(table: Any, real: Any) -> Any:
        return {k: v.astype(real) if v.dtype.kind == "f" else v for k, v in table.items() if v is not None}

    step = random_step(4)
    tables: list[Any] = [cast(vars(table), np.float32) for table in (step[0], random_results(4, *step), *step[1:])]
    narrow = cairn.evaluate(DT, *tables)
    wide = cairn.evaluate(DT, *(cast(table, np.float64) for table in tables))
    assert narrow.whole == wide.whole


def test_what_is_read_alone_may_be_read_only() -> None:
    step = random_step(0)
    results = random_results(0, *step)
    wanted = cairn.evaluate(DT, step[0], results, *step[1:])
    for array in vars(results).values():
        array.flags.writeable = False
    again = cairn.evaluate(DT, step[0], results, *step[1:])
    assert again.whole == wanted.whole
