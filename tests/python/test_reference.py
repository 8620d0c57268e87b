"""The reference solver against closed formulas and an evaluation of its own residual in NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

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
