"""Drives libcairn from one symbol, cairn_get_api, with nothing but ctypes: what a binding in any language has to do."""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import cairn

ABI_VERSION = 1
OK, STRUCT_SIZE, INVALID_DATA = 0, 3, 2
F64, I32 = 1, 2
PJ, PRESET_DEFAULT = 0, 0

Status = c.c_int32
Solver = c.c_void_p


class View(c.Structure):
    _fields_ = (("data", c.c_void_p), ("stride", c.c_int64), ("type", c.c_uint32), ("device", c.c_uint32))


def table(name: str, columns: str) -> type[c.Structure]:
    head = [("struct_size", c.c_uint32), ("count", c.c_uint32), ("revision", c.c_uint64)]
    return type(name, (c.Structure,), {"_fields_": head + [(column, View) for column in columns.split()]})


Bodies = table(
    "Bodies",
    "position orientation linear_velocity angular_velocity inverse_mass inverse_inertia force torque linear_factor "
    "angular_factor flags",
)
Contacts = table(
    "Contacts",
    "body_a body_b normal arm_a arm_b separation friction restitution tangent key flags friction_scale "
    "surface_velocity rolling_friction spinning_friction stiffness damping",
)
RESULTS = (
    "position orientation linear_velocity angular_velocity contact_impulse friction_impulse joint_impulse row_impulse "
    "torsion_impulse joint_linear joint_angular"
)


class Step(c.Structure):
    _fields_ = (
        ("struct_size", c.c_uint32),
        ("reserved", c.c_uint32),
        ("dt", c.c_double),
        ("gravity", c.c_double * 3),
        ("bodies", c.c_void_p),
        ("contacts", c.c_void_p),
        ("joints", c.c_void_p),
        ("rows", c.c_void_p),
    )


class Results(c.Structure):
    _fields_ = (("struct_size", c.c_uint32), ("reserved", c.c_uint32), *((name, View) for name in RESULTS.split()))


WHOLE_PARAMS = (
    "struct_size method iterations substeps position_iterations restitution_iterations splitting "
    "friction_model acceleration residual_trace"
)
REAL_PARAMS = (
    "contact_warm_start joint_warm_start relax_share contact_baumgarte joint_baumgarte contact_hertz "
    "contact_damping_ratio joint_hertz joint_damping_ratio hertz_limit static_hertz_scale max_push_speed "
    "restitution_threshold residual_tolerance contact_hertz_floor tolerance"
)


WORST = (
    "penetration_contact residual_contact gap_joint angle_joint residual_joint angular_residual_joint residual_row "
    "momentum_body angular_momentum_body"
)
QUANTITIES = (
    "penetration penetration_mean joint_gap joint_gap_mean joint_angle joint_angle_mean contact_residual "
    "joint_residual joint_angular_residual row_residual relative_residual complementarity coulomb_excess momentum "
    "angular_momentum momentum_total angular_momentum_total kinetic_energy"
)


class Params(c.Structure):
    _fields_ = (
        *((name, c.c_uint32) for name in WHOLE_PARAMS.split()),
        *((name, c.c_double) for name in REAL_PARAMS.split()),
    )


class Evaluation(c.Structure):
    _fields_ = (
        *((name, c.c_uint32) for name in ("struct_size", "bodies", "contacts", "joints", "rows")),
        *((name, c.c_int32) for name in WORST.split()),
        *((name, c.c_double) for name in QUANTITIES.split()),
    )


class Api(c.Structure):
    _fields_ = (
        ("struct_size", c.c_uint32),
        ("abi_version", c.c_uint32),
        ("last_error", c.CFUNCTYPE(c.c_char_p)),
        ("status_name", c.CFUNCTYPE(c.c_char_p, Status)),
        ("method_name", c.CFUNCTYPE(c.c_char_p, c.c_uint32)),
        ("get_info", c.CFUNCTYPE(Status, c.c_void_p)),
        ("params_preset", c.CFUNCTYPE(Status, c.c_uint32, c.c_uint32, c.POINTER(Params))),
        ("joint_axes", c.CFUNCTYPE(Status, c.c_uint32, c.POINTER(c.c_uint32))),
        ("solver_create", c.CFUNCTYPE(Status, c.c_void_p, c.POINTER(Solver))),
        ("solver_destroy", c.CFUNCTYPE(None, Solver)),
        ("solver_set_params", c.CFUNCTYPE(Status, Solver, c.POINTER(Params))),
        ("solver_get_params", c.CFUNCTYPE(Status, Solver, c.POINTER(Params))),
        ("solver_step", c.CFUNCTYPE(Status, Solver, c.POINTER(Step), c.POINTER(Results))),
        ("solver_get_statistics", c.CFUNCTYPE(Status, Solver, c.c_void_p)),
        ("solver_residual_trace", c.CFUNCTYPE(Status, Solver, c.c_void_p, c.c_size_t, c.POINTER(c.c_size_t))),
        ("solver_split_counts", c.CFUNCTYPE(Status, Solver, c.c_void_p, c.c_size_t, c.POINTER(c.c_size_t))),
        ("solver_reset", c.CFUNCTYPE(Status, Solver)),
        ("solver_save_cache", c.CFUNCTYPE(Status, Solver, c.c_void_p, c.c_size_t, c.POINTER(c.c_size_t))),
        ("solver_load_cache", c.CFUNCTYPE(Status, Solver, c.c_void_p, c.c_size_t)),
        ("solver_step_async", c.CFUNCTYPE(Status, Solver, c.POINTER(Step), c.POINTER(Results))),
        ("solver_wait", c.CFUNCTYPE(Status, Solver)),
        ("solver_parallel_for", c.CFUNCTYPE(Status, Solver, c.c_uint32, c.c_void_p, c.c_void_p)),
        (
            "evaluate",
            c.CFUNCTYPE(
                Status,
                c.POINTER(Step),
                c.POINTER(Results),
                c.POINTER(Evaluation),
                c.POINTER(Evaluation),
                c.c_size_t,
                c.POINTER(c.c_size_t),
                c.POINTER(c.c_int32),
            ),
        ),
        ("reason_text", c.CFUNCTYPE(c.c_char_p, c.c_uint32)),
        ("solver_choices", c.CFUNCTYPE(Status, Solver, c.c_void_p, c.c_size_t, c.POINTER(c.c_size_t))),
    )


@pytest.fixture(scope="module")
def api() -> Any:
    (path,) = Path(cairn.__file__).parent.glob("libcairn.so")
    get_api = c.CDLL(str(path)).cairn_get_api
    get_api.restype, get_api.argtypes = c.POINTER(Api), [c.c_uint32]
    assert not get_api(ABI_VERSION + 1)
    table = get_api(ABI_VERSION).contents
    assert table.abi_version == ABI_VERSION
    assert table.struct_size >= c.sizeof(Api)
    return table


def view(values: Sequence[float], kind: int = F64) -> View:
    """A packed view; the array lives as long as the view."""
    element: Any = c.c_double if kind == F64 else c.c_int32
    array = (element * len(values))(*values)
    made = View(c.addressof(array), 0, kind, 0)
    made.array = array
    return made


class World:
    """A ball of 2 kg that rests on the world at its origin."""

    def __init__(self) -> None:
        self.position, self.velocity = view([0, 0.5, 0]), view([0, 0, 0])
        self.columns = {
            "position": self.position,
            "orientation": view([0, 0, 0, 1]),
            "linear_velocity": self.velocity,
            "angular_velocity": view([0, 0, 0]),
            "inverse_mass": view([0.5]),
            "inverse_inertia": view([5, 5, 5]),
        }
        self.bodies = Bodies(struct_size=c.sizeof(Bodies), count=1, **self.columns)
        self.contact_columns = {
            "body_a": view([-1], I32),
            "body_b": view([0], I32),
            "normal": view([0, 1, 0]),
            "arm_a": view([0, 0, 0]),
            "arm_b": view([0, -0.5, 0]),
            "separation": view([0]),
        }
        self.contacts = Contacts(struct_size=c.sizeof(Contacts), count=1, **self.contact_columns)
        self.impulse = view([0])
        self.step = Step(struct_size=c.sizeof(Step), dt=0.01, gravity=(0, -10, 0))
        self.step.bodies, self.step.contacts = c.addressof(self.bodies), c.addressof(self.contacts)
        self.results = Results(struct_size=c.sizeof(Results), position=self.position, linear_velocity=self.velocity)
        self.results.contact_impulse = self.impulse


def test_a_ball_at_rest(api: Any) -> None:
    assert [api.method_name(method) for method in range(7)] == [
        b"pj", b"pjnj", b"pjsoft", b"tj", b"tjsoft", b"auto", None,
    ]  # fmt: skip
    solver = Solver()
    assert api.solver_create(None, c.byref(solver)) == OK
    params = Params(struct_size=c.sizeof(Params))
    assert api.params_preset(PJ, PRESET_DEFAULT, c.byref(params)) == OK
    params.iterations = 20
    assert api.solver_set_params(solver, c.byref(params)) == OK
    read = Params(struct_size=c.sizeof(Params))
    assert api.solver_get_params(solver, c.byref(read)) == OK
    assert bytes(read) == bytes(params)

    world = World()
    assert api.solver_step(solver, c.byref(world.step), c.byref(world.results)) == OK, api.last_error()
    assert world.velocity.array[1] == pytest.approx(0, abs=1e-5)
    assert world.impulse.array[0] == pytest.approx(2 * 10 * 0.01, rel=1e-4)

    counts, count = (c.c_uint32 * 1)(), c.c_size_t()
    assert api.solver_split_counts(solver, counts, 1, c.byref(count)) == OK
    assert (count.value, counts[0]) == (1, 1)
    api.solver_destroy(solver)


def test_how_good_a_step_was(api: Any) -> None:
    solver = Solver()
    assert api.solver_create(None, c.byref(solver)) == OK
    world = World()
    for name, values in (("position", [0, 0.5, 0]), ("orientation", [0, 0, 0, 1]), ("angular_velocity", [0, 0, 0])):
        setattr(world.results, name, view(values))
    world.results.linear_velocity = view([0, 0, 0])
    assert api.solver_step(solver, c.byref(world.step), c.byref(world.results)) == OK, api.last_error()
    api.solver_destroy(solver)

    whole, count, island = Evaluation(struct_size=c.sizeof(Evaluation)), c.c_size_t(), c.c_int32()
    islands = (Evaluation * 1)(Evaluation(struct_size=c.sizeof(Evaluation)))
    arguments = c.byref(world.step), c.byref(world.results), c.byref(whole), islands, 1, c.byref(count), c.byref(island)
    assert api.evaluate(*arguments) == OK, api.last_error()
    assert (count.value, island.value, whole.contacts) == (1, 0, 1)
    assert bytes(whole) == bytes(islands[0])
    assert whole.contact_residual == pytest.approx(0, abs=0.01)
    assert whole.momentum == pytest.approx(0, abs=1e-6)

    world.impulse.array[0] += 3
    assert api.evaluate(*arguments) == OK
    assert (whole.momentum, whole.momentum_body) == (pytest.approx(3, rel=1e-6), 0)


def test_a_caller_that_is_older_or_wants_more(api: Any) -> None:
    solver = Solver()
    assert api.solver_create(None, c.byref(solver)) == OK
    world = World()
    world.contacts.struct_size = Contacts.friction_scale.offset
    world.contacts.friction_scale.type = 99  # beyond its end
    world.results.struct_size = Results.torsion_impulse.offset
    assert api.solver_step(solver, c.byref(world.step), c.byref(world.results)) == OK, api.last_error()

    world = World()
    spin, torsion, rolling = view([0, 3, 0]), view([0, 0, 0]), view([0.01])
    world.bodies.angular_velocity = world.results.angular_velocity = spin
    world.contacts.spinning_friction, world.results.torsion_impulse = rolling, torsion
    assert api.solver_step(solver, c.byref(world.step), c.byref(world.results)) == OK, api.last_error()
    assert torsion.array[1] == pytest.approx(-0.01 * world.impulse.array[0], rel=1e-5)
    assert spin.array[1] == pytest.approx(3 + 5 * torsion.array[1], rel=1e-5)
    api.solver_destroy(solver)


def test_what_is_refused(api: Any) -> None:
    solver = Solver()
    assert api.solver_create(None, c.byref(solver)) == OK
    world = World()
    world.velocity.array[2] = float("inf")
    assert api.solver_step(solver, c.byref(world.step), c.byref(world.results)) == INVALID_DATA
    assert b"bodies.linear_velocity[0]" in api.last_error()
    assert world.position.array[1] == 0.5
    assert api.status_name(INVALID_DATA) == b"invalid data"

    world = World()
    world.step.struct_size = 3
    assert api.solver_step(solver, c.byref(world.step), c.byref(world.results)) == STRUCT_SIZE

    longer = (c.c_char * (c.sizeof(Params) + 8))()  # a caller of the future
    params = Params.from_buffer(longer)
    params.struct_size = len(longer)
    assert api.params_preset(PJ, PRESET_DEFAULT, c.byref(params)) == OK
    params.struct_size = len(longer)
    assert api.solver_set_params(solver, c.byref(params)) == OK
    longer[len(longer) - 1] = b"\1"  # with a setting that this library does not know
    assert api.solver_set_params(solver, c.byref(params)) == STRUCT_SIZE
    api.solver_destroy(solver)
