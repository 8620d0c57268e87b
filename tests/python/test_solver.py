"""The Python API over laws: what moves, what is conserved, where arrays are read and written, what is refused."""

from __future__ import annotations

import doctest
import os
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import cairn

STILL = (0.0, 0.0, 0.0)

BODY = np.dtype(
    [
        ("position", "f8", 3),
        ("inverse_mass", "f8"),
        ("orientation", "f8", 4),
        ("linear_velocity", "f8", 3),
        ("angular_velocity", "f8", 3),
        ("inverse_inertia", "f8", 3),
    ]
)


def some_bodies(count: int, dtype: Any = np.float64) -> cairn.Bodies:
    """Unit masses at rest, a metre apart along x."""
    position = np.zeros((count, 3), dtype)
    position[:, 0] = np.arange(count)
    orientation = np.zeros((count, 4), dtype)
    orientation[:, 3] = 1
    return cairn.Bodies(
        position=position,
        orientation=orientation,
        linear_velocity=np.zeros((count, 3), dtype),
        angular_velocity=np.zeros((count, 3), dtype),
        inverse_mass=np.ones(count, dtype),
        inverse_inertia=np.full((count, 3), 6.0, dtype),
    )


def touching(a: int, b: int, normal: tuple[float, float, float], friction: float = 0.0) -> cairn.Contacts:
    """One contact half way between two bodies a metre apart."""
    direction = np.array([normal], dtype=float)
    return cairn.Contacts(
        body_a=np.array([a], np.int32),
        body_b=np.array([b], np.int32),
        normal=direction,
        arm_a=0.5 * direction,
        arm_b=-0.5 * direction,
        separation=np.zeros(1),
        friction=np.array([friction]),
    )


@pytest.mark.parametrize("method", cairn.METHODS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_free_fall(method: str, dtype: Any) -> None:
    solver = cairn.Solver(method)
    bodies = some_bodies(3, dtype)
    dt, steps = 0.01, 50
    for _ in range(steps):
        solver.step(dt, bodies, gravity=(0, -10, 0), out=bodies)
    np.testing.assert_allclose(bodies.linear_velocity[:, 1], -10 * dt * steps, rtol=1e-5)
    # Semi-implicit Euler with substeps h: s = g t (t + h) / 2.
    h = dt / int(solver.statistics["substeps"])
    np.testing.assert_allclose(bodies.position[:, 1], -10 * dt * steps * (dt * steps + h) / 2, rtol=1e-4)


@pytest.mark.parametrize("method", cairn.METHODS)
def test_collision_conserves_momentum(method: str) -> None:
    bodies = some_bodies(2)
    bodies.linear_velocity[0] = (2, 0.5, 0)
    bodies.inverse_mass[1] = 0.25
    contacts = touching(0, 1, (1, 0, 0), friction=0.5)
    before = (bodies.linear_velocity / bodies.inverse_mass[:, None]).sum(axis=0)
    results = cairn.Solver(method).step(0.01, bodies, contacts, gravity=STILL)
    after = (results.linear_velocity / bodies.inverse_mass[:, None]).sum(axis=0)
    np.testing.assert_allclose(after, before, atol=1e-5)
    approach = results.linear_velocity[0, 0] - results.linear_velocity[1, 0]
    assert approach < (
        0.1 if "soft" in method or method == "auto" else 1e-3
    )  # 2 m/s before; a soft contact takes a few steps
    # What body b gained is the impulse along the normal.
    np.testing.assert_allclose(results.linear_velocity[1, 0] * 4, results.contact_impulse[0], rtol=1e-4)
    assert np.linalg.norm(results.friction_impulse[0]) <= 0.5 * results.contact_impulse[0] * (1 + 1e-5)


def test_ball_joint_holds_a_pendulum_on_its_circle() -> None:
    bodies = some_bodies(1)
    joints = cairn.Joints(
        body_a=np.array([cairn.WORLD], np.int32),
        body_b=np.array([0], np.int32),
        anchor_a=np.array([[-1.0, 0, 0]]),
        anchor_b=np.array([[-1.0, 0, 0]]),
        axes=cairn.joint_axes("ball")[None],
    )
    solver = cairn.Solver("tjsoft")
    for _ in range(60):
        results = solver.step(0.01, bodies, joints=joints, out=bodies)
    assert bodies.position[0, 1] < -0.3
    # Rotate the anchor by the quaternion: v + 2 u x (u x v + w v).
    u, w, v = bodies.orientation[0, :3], bodies.orientation[0, 3], joints.anchor_b[0]
    anchor = bodies.position[0] + v + 2 * np.cross(u, np.cross(u, v) + w * v)
    np.testing.assert_allclose(anchor, [-1, 0, 0], atol=1e-3)
    assert results.joint_impulse.shape == (1, 6)
    assert np.linalg.norm(results.joint_impulse[0, :3]) > 0


def test_a_belt_carries_and_a_spring_yields() -> None:
    bodies = some_bodies(1)
    bodies.position[0, 1] = 1
    contacts = touching(cairn.WORLD, 0, (0, 1, 0), friction=0.5)
    contacts.surface_velocity = np.array([[2.0, 0, 0]])
    contacts.stiffness, contacts.damping = np.array([1000.0]), np.array([500.0])
    contacts.rolling_friction = np.array([10.0])  # or the ball would rather turn
    results = cairn.Solver("tj").step(0.01, bodies, contacts, gravity=(0, -10, 0))
    load = results.contact_impulse[0]
    assert 0 < load < 0.1  # gives way under its weight
    np.testing.assert_allclose(results.friction_impulse[0], [0.5 * load, 0, 0], atol=1e-6)
    assert results.torsion_impulse[0, 2] < 0  # against the turn that friction below its centre gives it
    # of a contact at its own arm, what it does to the body is what it reports
    arm = contacts.arm_b[0] - 0.5 * contacts.separation[0] * contacts.normal[0]
    turn = np.cross(arm, results.friction_impulse[0]) + results.torsion_impulse[0]
    np.testing.assert_allclose(results.angular_velocity[0], turn * bodies.inverse_inertia[0], atol=1e-6)


def test_spring_carries_a_weight_and_a_servo_turns() -> None:
    bodies = some_bodies(1)
    state = np.zeros((1, 6), np.uint32)
    state[0] = cairn.LOCKED
    state[0, 1], state[0, 5] = cairn.SPRING, cairn.DRIVEN | cairn.SERVO
    per_axis = {name: np.zeros((1, 6)) for name in ("target", "stiffness", "damping", "motor_speed", "motor_force")}
    per_axis["stiffness"][0, [1, 5]] = 100, np.inf
    per_axis["damping"][0, 1] = 20
    per_axis["target"][0, 5] = 0.5
    per_axis["motor_speed"][0, 5] = per_axis["motor_force"][0, 5] = 1e3
    joints = cairn.Joints(
        body_a=np.array([cairn.WORLD], np.int32),
        body_b=np.array([0], np.int32),
        anchor_a=bodies.position.copy(),
        anchor_b=np.zeros((1, 3)),
        axes=state,
        **per_axis,
    )
    start, mass = bodies.position.copy(), 1 / bodies.inverse_mass[0]
    solver = cairn.Solver("tjsoft")
    for _ in range(300):
        results = solver.step(0.01, bodies, joints=joints, out=bodies)
    np.testing.assert_allclose(bodies.position - start, [[0, -mass * 9.81 / 100, 0]], atol=1e-3)
    np.testing.assert_allclose(results.joint_linear, [[0, mass * 0.0981, 0]], atol=1e-4)
    np.testing.assert_allclose(2 * np.arctan2(bodies.orientation[0, 2], bodies.orientation[0, 3]), 0.5, atol=1e-3)


def test_raw_row_reaches_its_target() -> None:
    bodies = some_bodies(2)
    rows = cairn.Rows(
        body_a=np.array([0], np.int32),
        body_b=np.array([1], np.int32),
        jacobian_a=np.array([[-1.0, 0, 0, 0, 0, 0]]),
        jacobian_b=np.array([[1.0, 0, 0, 0, 0, 0]]),
        rhs=np.array([0.5]),
    )
    results = cairn.Solver("pj").step(0.01, bodies, rows=rows, gravity=STILL)
    np.testing.assert_allclose(results.linear_velocity[:, 0], [-0.25, 0.25], atol=1e-4)
    np.testing.assert_allclose(results.row_impulse, [0.25], rtol=1e-3)


# ---- Views ---------------------------------------------------------------------------------------------------------


def fall(bodies: Any, **options: Any) -> cairn.Results:
    return cairn.Solver("pj").step(0.1, bodies, gravity=(0, -10, 0), **options)


def structured(count: int) -> npt.NDArray[np.void]:
    array = np.zeros(count, BODY)
    for name in ("orientation", "inverse_mass", "inverse_inertia"):
        array[name] = getattr(some_bodies(count), name)
    return array


def test_structured_array_is_updated_in_place() -> None:
    bodies = structured(4)
    bodies["inverse_mass"][2] = 0
    bodies["inverse_inertia"][2] = 0
    results = fall(bodies, out=bodies)
    np.testing.assert_allclose(bodies["linear_velocity"][:, 1], [-1, -1, 0, -1], rtol=1e-6)
    assert np.shares_memory(results.position, bodies)


@pytest.mark.parametrize(
    "view",
    [lambda a: a[::-1], lambda a: a[::2], lambda a: a[1:][::-3]],
    ids=["backwards", "every other", "every third, backwards"],
)
def test_any_stride_is_read_and_written_where_it_is(view: Callable[[Any], Any]) -> None:
    whole = some_bodies(8, np.float32)
    whole.linear_velocity[:, 0] = np.arange(8)
    names = ("position", "orientation", "linear_velocity", "angular_velocity", "inverse_mass", "inverse_inertia")
    bodies = {name: view(getattr(whole, name)) for name in names}
    expected = view(whole.linear_velocity).copy() + np.array([0, -1, 0], np.float32)
    fall(bodies, out=bodies)
    np.testing.assert_allclose(view(whole.linear_velocity), expected, rtol=1e-6)
    assert np.count_nonzero(whole.linear_velocity[:, 1]) == len(expected)  # and nothing beside them


def test_new_arrays_leave_the_input_alone() -> None:
    bodies = some_bodies(2, np.float32)
    bodies.inverse_mass[1] = 0
    bodies.inverse_inertia[1] = 0
    results = fall(bodies)
    assert not bodies.linear_velocity.any()
    assert results.linear_velocity.dtype == np.float32
    np.testing.assert_array_equal(results.position[1], bodies.position[1])  # static: as given


def test_no_bodies_at_all() -> None:
    assert fall(some_bodies(0)).position.shape == (0, 3)


# ---- What is refused -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "array", "error", "text"),
    [
        (
            "position",
            np.zeros((2, 3), np.int64),
            TypeError,
            "bodies.position has elements of type int64; pass float32 or",
        ),
        ("position", np.zeros((2, 3), ">f8"), TypeError, "bodies.position has elements of type >f8"),
        ("position", [[0.0, 0, 0], [1, 0, 0]], TypeError, "bodies.position is <class 'list'>; pass a NumPy array"),
        ("position", np.zeros((3, 2)).T, TypeError, "bodies.position has a last axis that is not contiguous"),
        ("position", np.zeros((2, 4)), ValueError, r"bodies.position has shape \(2, 4\); pass \(n, 3\)"),
        ("force", np.zeros((5, 3)), ValueError, "bodies.force has 5 elements; its table has 2"),
        ("force", np.broadcast_to(np.zeros(3), (2, 3)), TypeError, "bodies.force repeats one element"),
        ("flags", np.zeros(2, np.int64), TypeError, "bodies.flags has elements of type int64; pass int32 or uint32"),
        ("colour", np.zeros(2), TypeError, "bodies has no field 'colour'; it has position, "),
    ],
)
def test_arrays_that_cannot_be_read(name: str, array: Any, error: type[Exception], text: str) -> None:
    columns = {key: value for key, value in vars(some_bodies(2)).items() if value is not None}
    columns[name] = array
    with pytest.raises(error, match=text):
        fall(columns)


def test_data_that_the_library_refuses() -> None:
    bodies = some_bodies(2)
    bodies.position[1, 2] = np.nan
    before = bodies.linear_velocity.copy()
    with pytest.raises(cairn.Error, match=r"bodies\.position\[1\].*nan") as refused:
        fall(bodies, out=bodies)
    assert refused.value.status == 2
    assert isinstance(refused.value, RuntimeError)
    np.testing.assert_array_equal(bodies.linear_velocity, before)


def test_results_that_cannot_be_written() -> None:
    bodies = some_bodies(2)
    frozen = np.zeros((2, 3))
    frozen.flags.writeable = False
    with pytest.raises(ValueError, match=r"out\.position is read-only"):
        fall(bodies, out={"position": frozen})
    with pytest.raises(ValueError, match=r"out\.position has 3 elements"):
        fall(bodies, out={"position": np.zeros((3, 3))})
    with pytest.raises(TypeError, match="out has a field 'postion', which is no result"):
        fall(bodies, out={"postion": np.zeros((2, 3))})
    with pytest.raises(TypeError, match="bodies is a float"):
        fall(1.0)


# ---- Parameters, statistics, cache ---------------------------------------------------------------------------------


def test_parameters_by_name() -> None:
    solver = cairn.Solver("tj", iterations=40, substeps=4, splitting="manifold")
    assert (solver.params.method, solver.params.iterations, solver.params["splitting"]) == ("tj", 40, "manifold")
    solver.params.friction_model = "pyramid"
    solver.params.update(iterations=8, substeps=8)
    assert dict(solver.params) == {**cairn.preset("tj"), "iterations": 8, "substeps": 8} | {
        "splitting": "manifold",
        "friction_model": "pyramid",
    }
    with pytest.raises(cairn.Error, match="substeps"):
        solver.params.update(iterations=9, substeps=10)
    assert solver.params.substeps == 8
    with pytest.raises(TypeError, match=r"no parameter is called 'iteration'; there are .*iterations"):
        solver.params.iteration = 3
    with pytest.raises(AttributeError, match="no parameter is called 'iteration'"):
        _ = solver.params.iteration
    with pytest.raises(TypeError, match="iterations = -1 is not a whole number"):
        solver.params.iterations = -1
    with pytest.raises(ValueError, match="splitting 'row' is unknown; there are point, manifold"):
        solver.params.splitting = "row"


def test_presets_differ_from_each_other_and_name_their_method() -> None:
    for method in cairn.METHODS[:-1]:
        assert cairn.preset(method, "paper")["method"] == method
        assert cairn.preset(method, "paper") != cairn.preset(method, "default")
    with pytest.raises(ValueError, match="method 'sor' is unknown; there are pj, pjnj, pjsoft, tj, tjsoft, auto"):
        cairn.Solver("sor")


def test_auto_says_what_it_chose_and_whether_it_met_the_tolerance() -> None:
    bodies = some_bodies(3)  # two that meet, and one alone
    bodies.linear_velocity[0] = (2, 0.5, 0)
    contacts = touching(0, 1, (1, 0, 0), friction=0.5)
    solver = cairn.Solver("auto", tolerance=1e-4)
    solver.step(0.01, bodies, contacts, gravity=STILL)
    found = solver.choices
    assert [cairn.REASONS[reason].split(":")[0] for reason in found["reason"]] == [
        "contacts between bodies of like mass",
        "no constraints",
    ]
    np.testing.assert_array_equal(found["bodies"], [2, 1])
    np.testing.assert_array_equal(found["first_body"], [0, 2])
    assert cairn.METHODS[found["method"][0]] == "tjsoft"
    assert found["met"].all() and (found["residual"] < 1e-4).all()
    assert 0 < found["swept"][0] < found["iterations"][0] == 300
    solver.params.update(iterations=1, substeps=1)
    bodies.linear_velocity[0] = (9, 0.5, 0)
    solver.step(0.01, bodies, contacts, gravity=STILL)
    assert solver.choices["met"][0] == 0 and solver.choices["residual"][0] >= 1e-4
    with pytest.raises(cairn.Error, match="the method auto is not in the paper"):
        cairn.preset("auto", "paper")
    assert len(cairn.Solver("tj").choices["reason"]) == 0


def test_statistics_trace_and_split_counts() -> None:
    bodies = some_bodies(3)
    bodies.linear_velocity[0, 0] = 1
    bodies.linear_velocity[2, 0] = -1
    pair = [touching(0, 1, (1, 0, 0)), touching(1, 2, (1, 0, 0))]
    contacts = {
        name: np.concatenate([vars(c)[name] for c in pair]) for name, v in vars(pair[0]).items() if v is not None
    }
    solver = cairn.Solver("pj", iterations=30, residual_trace=1)
    assert solver.residual_trace.size == 0
    solver.step(0.01, bodies, contacts, gravity=STILL)
    assert solver.statistics["contacts"] == 2
    assert solver.statistics["bodies"] == 3
    assert solver.statistics["backend"] == ("cuda" if os.environ.get("CAIRN_BACKEND") == "cuda" else "cpu")
    assert float(solver.statistics["kinetic_energy_change"]) < -0.5  # they stop each other
    np.testing.assert_array_equal(solver.split_counts, [1, 2, 1])
    assert len(solver.residual_trace) == 30
    assert solver.residual_trace[-1] < 1e-3 * solver.residual_trace[0]


def test_cache_continues_with_the_same_bits() -> None:
    def contacts() -> cairn.Contacts:
        table = touching(cairn.WORLD, 0, (0, 1, 0))
        table.arm_a = np.zeros((1, 3))
        table.key = np.array([7], np.uint64)
        return table

    options: dict[str, Any] = {"method": "pjsoft", "iterations": 3}
    first, second = cairn.Solver(**options), cairn.Solver(**options)
    bodies = some_bodies(1)
    bodies.position[:] = (0, 0.5, 0)
    first.step(0.01, bodies, contacts(), out=bodies)
    second.load_cache(first.save_cache())
    expected = first.step(0.01, bodies, contacts())
    np.testing.assert_array_equal(second.step(0.01, bodies, contacts()).contact_impulse, expected.contact_impulse)
    assert second.statistics["warm_started"] == 1
    second.reset()
    second.step(0.01, bodies, contacts())
    assert second.statistics["warm_started"] == 0
    with pytest.raises(cairn.Error):
        second.load_cache(b"not a cache")


def test_one_solver_used_from_several_threads() -> None:
    solver = cairn.Solver("pj", threads=1)
    tables = [some_bodies(50) for _ in range(4)]

    def work(bodies: cairn.Bodies) -> None:
        for _ in range(20):
            solver.step(0.01, bodies, gravity=(0, -10, 0), out=bodies)

    workers = [threading.Thread(target=work, args=(bodies,)) for bodies in tables]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for bodies in tables:
        np.testing.assert_allclose(bodies.linear_velocity[:, 1], -2, rtol=1e-5)


def test_info() -> None:
    facts = cairn.info()
    assert facts["version"] == cairn.__version__
    assert facts["abi_version"] == 1
    assert "CUDA" in str(facts["cuda"])  # present and its version, or what is missing
    assert facts["instructions"] in ("scalar", "sse2", "avx2", "avx512")


def test_example_of_the_package() -> None:
    outcome = doctest.testmod(cairn)
    assert outcome.attempted > 0
    assert outcome.failed == 0
