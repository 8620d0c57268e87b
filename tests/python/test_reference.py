"""The reference solver against closed formulas and an evaluation of its own residual in NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.sparse
from scipy.spatial.transform import Rotation

import cairn

reference = pytest.importorskip("cairn.reference", reason="cairn was built without Eigen", exc_type=ImportError)

Array = npt.NDArray[np.float64]


def project(y: Array, mu: Array) -> Array:
    """On the friction cones, from the definition: the nearest of the points of the cone."""
    out = np.zeros_like(y)
    for i, (normal, *tangent) in enumerate(y):
        slip = np.hypot(*tangent)
        if slip <= mu[i] * normal:
            out[i] = y[i]
        elif mu[i] * slip > -normal:
            along = np.array([1, *(mu[i] * np.array(tangent) / slip)])  # the boundary's ray nearest to y
            out[i] = along * (y[i] @ along) / (along @ along)
    return out


def natural_map(W: Array, q: Array, mu: Array, r: Array) -> float:
    u = (W @ r + q).reshape(-1, 3)
    u[:, 0] += mu * np.hypot(u[:, 1], u[:, 2])
    return float(np.linalg.norm(r - project(r.reshape(-1, 3) - u, mu).ravel()))


def relative(W: Array, q: Array, mu: Array, r: Array) -> float:
    root = np.sqrt(np.repeat(np.trace(W.reshape(len(mu), 3, len(mu), 3).diagonal(axis1=0, axis2=2)) / 3, 3))
    size = np.linalg.norm(q / root)
    return natural_map(W / np.outer(root, root), q / root / size, mu, r * root / size)


def random_problem(seed: int, contacts: int, bodies: int) -> tuple[Array, Array, Array]:
    """Contacts between random pairs of bodies, more rows than the bodies have freedom: W is singular."""
    random = np.random.default_rng(seed)
    jacobian = np.zeros((3 * contacts, 6 * bodies))
    for i in range(contacts):
        normal, first = np.linalg.qr(random.normal(size=(3, 2)))[0].T
        frame = np.stack([normal, first, np.cross(normal, first)])
        for sign, body in zip((-1, 1), random.choice(bodies, 2, replace=False)):
            arm = random.normal(size=3)
            jacobian[3 * i : 3 * i + 3, 6 * body : 6 * body + 6] = sign * np.hstack([frame, np.cross(arm, frame)])
    mass = np.exp(random.uniform(-2, 2, 6 * bodies))
    mu = random.uniform(0, 1.2, contacts) * (random.random(contacts) > 0.2)
    W = jacobian / mass @ jacobian.T
    return (W + W.T) / 2, jacobian @ random.normal(size=6 * bodies), mu


def block(mass: float, push: float, weight: float, mu: float) -> Any:
    """A block of `mass` on a floor, pushed along the first tangent; impulses of one step."""
    return reference.solve(np.eye(3) / mass, [-weight / mass, push / mass, 0], [mu])


def test_a_block_sticks_then_slides() -> None:
    stuck = block(2, push=3, weight=10, mu=0.5)
    np.testing.assert_allclose(stuck.impulse, [10, -3, 0], atol=1e-12)
    np.testing.assert_allclose(stuck.velocity, 0, atol=1e-12)
    sliding = block(2, push=8, weight=10, mu=0.5)
    np.testing.assert_allclose(sliding.impulse, [10, -5, 0], atol=1e-12)
    np.testing.assert_allclose(sliding.velocity, [0, 1.5, 0], atol=1e-12)
    smooth = block(2, push=8, weight=10, mu=0)
    np.testing.assert_allclose(smooth.impulse, [10, 0, 0], atol=1e-12)
    leaving = block(2, push=8, weight=-10, mu=0.5)
    np.testing.assert_allclose(leaving.impulse, 0, atol=1e-12)


def test_four_corners_of_a_box_share_its_weight() -> None:
    """More contacts than freedom: impulses are a choice, the velocity and what they add up to are not."""
    arms = np.array([[x, -0.5, z] for x in (-1, 1) for z in (-1, 1)], dtype=float)
    frame = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1]], dtype=float)
    jacobian = np.vstack([np.hstack([frame, np.cross(arm, frame)]) for arm in arms])
    found = reference.solve(jacobian @ jacobian.T, jacobian @ [0.3, -1, 0, 0, 0, 0], np.full(4, 0.2))
    wrench = jacobian.T @ found.impulse
    np.testing.assert_allclose(wrench[:3], [-0.2, 1, 0], atol=1e-11)
    np.testing.assert_allclose(found.velocity.reshape(4, 3), [[0, 0.1, 0]] * 4, atol=1e-11)
    assert found.residual.relative < 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_random_problems(seed: int) -> None:
    W, q, mu = random_problem(seed, contacts=4 + 3 * seed, bodies=3 + seed)
    found = reference.solve(W, q, mu)
    assert found.residual.relative < 1e-10
    assert relative(W, q, mu, found.impulse) < 1e-10
    r, u = found.impulse.reshape(-1, 3), found.velocity.reshape(-1, 3)
    scale = np.abs(r).max()
    assert np.all(np.hypot(r[:, 1], r[:, 2]) <= mu * r[:, 0] + 1e-8 * scale)  # Coulomb
    assert np.all(u[:, 0] > -1e-8)  # apart
    assert np.all(np.abs(r[:, 0] * u[:, 0]) < 1e-8 * scale)  # complementary


@pytest.mark.parametrize("seed", range(4))
def test_residuals_agree_with_numpy(seed: int) -> None:
    W, q, mu = random_problem(seed, contacts=20, bodies=9)
    random = np.random.default_rng(seed)
    for size in (0, 1e-3, 1, 1e3):
        r = size * random.normal(size=len(q))
        found = reference.evaluate(W, q, mu, r)
        assert found.natural_map == pytest.approx(natural_map(W, q, mu, r), rel=1e-12)
        assert found.relative == pytest.approx(relative(W, q, mu, r), rel=1e-12)


def test_refusals() -> None:
    W, q, mu = random_problem(1, contacts=3, bodies=3)
    bad: list[tuple[tuple[Array, Array, Array], str]] = [
        ((W[:6, :6], q, mu), "W has 6 x 6 elements and q 9"),
        ((W, q, mu - 5), r"mu\[0\] is -.*must be finite and >= 0"),
        ((W, q * np.nan, mu), r"q\[0\] is not finite"),
        ((W + np.triu(np.ones((9, 9)), 1), q, mu), "W must be symmetric"),
        ((np.zeros((9, 9)), q, mu), "contact 0: .* neither of its bodies can move"),
    ]
    for problem, text in bad:
        with pytest.raises(ValueError, match=text):
            reference.solve(*problem)
    with pytest.raises(ValueError, match="impulse has 2 elements"):
        reference.evaluate(W, q, mu, [1, 2])


# ---- Joints ----


def chain(seed: int, links: int, ratio: float = 1, loops: int = 0) -> tuple[Array, Array, Array]:
    """Links tied one to the next, the first to the world, by balls and by fixed joints; `loops` more ties at random."""
    random = np.random.default_rng(seed)
    position = np.cumsum(random.normal(size=(links, 3)), axis=0)
    ties = [(i - 1, i) for i in range(links)]
    ties += [tuple(random.choice(links, 2, replace=False)) for _ in range(loops)]
    rows = []
    for a, b in ties:
        point = position[b] + 0.3 * random.normal(size=3)
        for k in range(6 if random.random() < 0.3 else 3):
            row = np.zeros(6 * links)
            for body, sign in ((a, -1), (b, 1)):
                if body >= 0:
                    arm, axis = point - position[body], np.eye(3)[k % 3]
                    both = np.hstack([axis, np.cross(arm, axis)]) if k < 3 else np.hstack([np.zeros(3), axis])
                    row[6 * body : 6 * body + 6] = sign * both
            rows.append(row)
    inverse = np.zeros((6 * links, 6 * links))
    for i in range(links):
        heavy = ratio if i == links - 1 else 1
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        inverse[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = np.eye(3) / heavy
        inverse[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = turn * random.uniform(1, 3, 3) @ turn.T / heavy
    return np.array(rows), (inverse + inverse.T) / 2, random.normal(size=6 * links)


@pytest.mark.parametrize(
    ("links", "ratio", "loops"), [(1, 1, 0), (8, 1, 0), (8, 1, 6), (50, 300, 0), (50, 300, 10), (50, 5e4, 0)]
)
def test_joints_agree_with_dense_algebra(links: int, ratio: float, loops: int) -> None:
    """The velocity is the nearest that the rows allow, in the metric of M: by singular values."""
    J, inverse, free = chain(links, links, ratio, loops)
    rhs = J @ np.random.default_rng(1).normal(size=len(free))  # what some motion fulfils, however many rows there are
    found = reference.solve_joints(J, inverse, free, rhs)
    root = np.linalg.cholesky(inverse)
    u, s, vt = np.linalg.svd(J @ root, full_matrices=False)
    kept = s > 1e-10 * s[0]
    wanted = free + root @ (vt[kept].T @ (u[:, kept].T @ (rhs - J @ free) / s[kept]))
    np.testing.assert_allclose(found.velocity, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
    np.testing.assert_allclose(free + inverse @ J.T @ found.impulse, found.velocity, atol=1e-9 * np.abs(wanted).max())
    assert found.residual == pytest.approx(np.abs(J @ found.velocity - rhs).max(), abs=1e-12)
    assert found.residual < 1e-10


def test_soft_joints() -> None:
    J, inverse, free = chain(3, 10, loops=8)
    compliance = np.random.default_rng(0).uniform(0, 0.1, len(J))
    found = reference.solve_joints(scipy.sparse.csr_matrix(J), scipy.sparse.csr_matrix(inverse), free, None, compliance)
    wanted = np.linalg.solve(J @ inverse @ J.T + np.diag(compliance), -J @ free)
    np.testing.assert_allclose(found.impulse, wanted, rtol=1e-8, atol=1e-10)


def test_joints_that_contradict_each_other() -> None:
    found = reference.solve_joints([[1, 0], [1, 0]], np.eye(2), [0, 5], rhs=[1, 3])
    assert found.residual == pytest.approx(1)  # the best is halfway
    np.testing.assert_allclose(found.velocity, [2, 5], atol=1e-4)
    nothing = reference.solve_joints(np.zeros((0, 2)), np.eye(2), [0, 5])
    assert (nothing.residual, nothing.impulse.size) == (0, 0)


def test_the_solver_finds_the_same_velocities() -> None:
    """As raw rows, and cairn.evaluate sees no residual in the exact solution."""
    J, inverse, free = chain(5, 6)
    links, found = 6, reference.solve_joints(J, inverse, free)
    turns, moments = zip(*(np.linalg.eigh(inverse[i + 3 : i + 6, i + 3 : i + 6])[::-1] for i in range(0, 36, 6)))
    quaternion = np.array([Rotation.from_matrix(t * np.linalg.det(t)).as_quat() for t in turns])
    twist = free.reshape(links, 6)
    bodies = cairn.Bodies(
        position=np.zeros((links, 3)), orientation=quaternion, linear_velocity=twist[:, :3].copy(),
        angular_velocity=twist[:, 3:].copy(), inverse_mass=np.ones(links), inverse_inertia=np.array(moments),
        flags=np.full(links, cairn.NO_GYROSCOPIC, np.int32),
    )  # fmt: skip
    pairs = [[b for b in range(links) if row[6 * b : 6 * b + 6].any()] for row in J]
    a, b = np.array([[-1, *pair][-2:] for pair in pairs], np.int32).T
    padded = np.hstack([J, np.zeros((len(J), 6))]).reshape(len(J), links + 1, 6)  # the last is the world's
    of_a, of_b = padded[np.arange(len(J)), a], padded[np.arange(len(J)), b]
    rows = cairn.Rows(body_a=a.copy(), body_b=b.copy(), jacobian_a=of_a, jacobian_b=of_b)
    step: dict[str, Any] = {"rows": rows, "gravity": (0, 0, 0)}
    solved = cairn.Solver("pj", iterations=20000, precision=64).step(1e-3, bodies, **step)
    velocity = np.hstack([solved.linear_velocity, solved.angular_velocity]).ravel()
    np.testing.assert_allclose(velocity, found.velocity, atol=1e-7)

    exact = found.velocity.reshape(links, 6)
    results = {
        "position": 1e-3 * exact[:, :3],
        "orientation": (Rotation.from_rotvec(1e-3 * exact[:, 3:]) * Rotation.from_quat(quaternion)).as_quat(),
        "linear_velocity": exact[:, :3].copy(),
        "angular_velocity": exact[:, 3:].copy(),
        "row_impulse": found.impulse,
    }
    whole = cairn.evaluate(1e-3, bodies, results, **step).whole
    assert whole.row_residual < 1e-9
    assert whole.relative_residual < 1e-9
    assert whole.momentum < 1e-9
    assert whole.angular_momentum < 1e-9


def test_refusals_of_joints() -> None:
    J, inverse, free = chain(1, 2)
    m = len(J)
    bad: list[tuple[tuple[Any, ...], str]] = [
        ((J, inverse[:6, :6], free), "inverse_mass has 6 x 6 elements: must have 12 x 12"),
        ((J, inverse, free[:5]), "free_velocity has 5 elements: must have 12"),
        ((J, inverse, free, np.zeros(m + 1)), f"rhs has {m + 1} elements: must have {m}"),
        ((J, inverse, free * np.nan), r"free_velocity\[0\] is not finite"),
        ((J + np.nan, inverse, free), r"jacobian\[0, 0\] is not finite"),
        ((J, inverse + np.triu(np.ones((12, 12)), 1), free), "it must be symmetric"),
        ((J, inverse, free, None, np.full(m, -1.0)), r"compliance\[0\] is -1.0+: must be >= 0"),
    ]
    for problem, text in bad:
        with pytest.raises(ValueError, match=text):
            reference.solve_joints(*problem)
