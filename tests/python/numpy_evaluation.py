"""What `cairn.evaluate` says, from the definitions in cairn.h, in NumPy: dense, slow, and sharing nothing with it."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

import cairn

Array = npt.NDArray[np.float64]
GRAVITY = (0.3, -9.0, 0.5)
DT = 0.01
L, M = cairn.LOCKED, cairn.LIMITED


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
