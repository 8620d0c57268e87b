"""`cairn.evaluate` against an evaluation in NumPy, exact solutions, and broken results."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cairn
from numpy_evaluation import DT, GRAVITY, INDEX_OF, Array, Body, evaluate, row_of
from random_steps import random_bodies, random_contacts, random_results, random_step


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
