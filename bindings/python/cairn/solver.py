"""`cairn.Solver`: one solver of the library, over NumPy arrays and arrays in CUDA memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _cairn
from ._cairn import Error
from .tables import Bodies, Column, Contacts, Joints, Results, Rows, Table, columns_of

METHODS = tuple(_cairn.method_names())
REASONS = tuple(_cairn.reason_texts())  # why `auto` solves an island as it does
PRESETS = ("default", "paper")
INSTRUCTIONS = ("auto", "scalar", "sse2", "avx2", "avx512")
BACKENDS = ("auto", "cpu", "cuda")
EXECUTORS = ("none", "block", "grid", "graph")  # how a device runs the schedule; none: it ran on the CPU
NOT_FINITE = 7  # an Error's status: the solve left the range of numbers
SAME_AS_SWEEPS = 0xFFFFFFFF  # for restitution_iterations: the sweeps of a substep

ParamValue = Union[int, float, str]

# Parameters whose values have names, in the order of their numbers.
_NAMES: dict[str, tuple[str, ...]] = {
    "method": METHODS,
    "splitting": ("point", "manifold"),
    "friction_model": ("none", "cone", "pyramid"),
    "acceleration": ("none", "nesterov"),
}


def _number(what: str, value: ParamValue, names: Sequence[str]) -> int:
    if value not in names:
        raise ValueError(f"{what} '{value}' is unknown; there are {', '.join(names)}")
    return names.index(str(value))


def _to_library(values: Mapping[str, ParamValue]) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for name, value in values.items():
        if name in _NAMES:
            numbers[name] = _number(name, value, _NAMES[name])
        elif isinstance(value, str):
            raise TypeError(f"{name} = '{value}' is not a number")
        else:
            numbers[name] = value
    return numbers


def _from_library(numbers: Mapping[str, float]) -> dict[str, ParamValue]:
    return {name: _NAMES[name][int(n)] if name in _NAMES else n for name, n in numbers.items()}


def preset(method: str, preset: str = "default") -> dict[str, ParamValue]:
    """The parameters of a method (one of METHODS) in a preset ("default", "paper"), by name.

    cairn.Error for "auto" in "paper", which does not have it.
    """
    numbers = _cairn.preset(_number("method", method, METHODS), _number("preset", preset, PRESETS))
    return _from_library(numbers)


def presets_of(method: str) -> tuple[str, ...]:
    """The presets that a method has; none if it is Bullet's own."""
    if method not in METHODS:
        return ()
    return ("default",) if method == "auto" else PRESETS


def joint_axes(kind: str) -> npt.NDArray[np.int32]:
    """[6] what a "ball", "hinge", "slider" or "fixed" joint does on each axis: a row of Joints.axes."""
    return np.array(_cairn.joint_axes(_number("joint", kind, ("ball", "hinge", "slider", "fixed"))), dtype=np.int32)


def info() -> dict[str, int | str]:
    """version, abi_version, instructions (the widest here), build (compiler, flags, commit), cuda (its state)."""
    found = _cairn.info()
    found["instructions"] = INSTRUCTIONS[int(found["instructions"])]
    return found


class Params(Mapping[str, ParamValue]):
    """A solver's parameters, read and set by name: `solver.params.iterations = 40`, or several at once by `update`.

    Names, units and ranges are those of cairn_params in cairn.h; method, splitting ("point", "manifold"),
    friction_model ("none", "cone", "pyramid") and acceleration ("none", "nesterov") are words. The library checks every
    change: cairn.Error if a value is out of range, TypeError for an unknown name; then nothing was changed.
    """

    _solver: _cairn.Solver

    def __init__(self, solver: _cairn.Solver) -> None:
        object.__setattr__(self, "_solver", solver)

    def update(self, **changes: ParamValue) -> None:
        """Set several at once, for values that depend on each other such as iterations and substeps."""
        self._solver.set_params(_to_library(changes))

    def _all(self) -> dict[str, ParamValue]:
        return _from_library(self._solver.params())

    def __getitem__(self, name: str) -> ParamValue:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def __getattr__(self, name: str) -> ParamValue:
        values = self._all()
        if name not in values:
            raise AttributeError(f"no parameter is called '{name}'; there are {', '.join(values)}")
        return values[name]

    def __setattr__(self, name: str, value: ParamValue) -> None:
        self.update(**{name: value})

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._all()]

    def __repr__(self) -> str:
        return f"Params({', '.join(f'{name}={value!r}' for name, value in self._all().items())})"


class Solver:
    """A constraint solver with its warm-start cache, threads and buffers.

    method: "pj", "pjnj", "pjsoft", "tj", "tjsoft", or "auto", which chooses for every island and stops where
    `tolerance` (m/s; see cairn_params) is met: `choices` says what it did. preset: "default" or "paper". threads: 0
    for as many as the process may use. instructions ("auto", "scalar", "sse2", "avx2", "avx512") is for tests and
    measurements: results do not depend on it, nor on threads. precision: 32, or 64 for the slow reference. params:
    changes to the preset.

    backend: "auto" (the CPU, unless the environment variable CAIRN_BACKEND is "cuda"), "cpu", or "cuda", the CUDA
    device that is current. executor ("auto", "block", "grid", "graph"): how the device runs the schedule; results do
    not depend on it. stream: the cudaStream_t as an int that it works on, kept alive by the caller; 0 for one of its
    own, which is ordered with the legacy default stream (what CuPy, PyTorch and Numba use unless told otherwise) but
    no other.

    Under "cuda" a column may be an array in CUDA memory: any object with `__cuda_array_interface__` or `__dlpack__`.
    It is read and written there, in stream order; a key column may be int64 then.

    Distinct solvers may run in distinct threads; calls to one solver wait for each other. cairn.Error where the library
    refuses: its text says what is wrong.
    """

    def __init__(
        self,
        method: str = "tjsoft",
        preset: str = "default",
        threads: int = 0,
        instructions: str = "auto",
        precision: int = 32,
        backend: str = "auto",
        executor: str = "auto",
        stream: int = 0,
        **params: ParamValue,
    ) -> None:
        numbers = _number("method", method, METHODS), _number("preset", preset, PRESETS)
        self._solver = _cairn.Solver(
            threads,
            _number("instructions", instructions, INSTRUCTIONS),
            precision,
            _number("backend", backend, BACKENDS),
            _number("executor", executor, ("auto", *EXECUTORS[1:])),
            stream,
        )
        self._in_flight: Results | None = None
        self._solver.load_preset(*numbers, _to_library(params))

    @property
    def params(self) -> Params:
        return Params(self._solver)

    def step(
        self,
        dt: float,
        bodies: Bodies | Table,
        contacts: Contacts | Table | None = None,
        joints: Joints | Table | None = None,
        rows: Rows | Table | None = None,
        gravity: Sequence[float] = (0.0, -9.81, 0.0),
        out: Table | None = None,
    ) -> Results:
        """One step of dt seconds: forces, constraints, poses. gravity in m/s^2.

        Results go into those columns of `out` that bear a result's name, and into new arrays for the rest; `out=bodies`
        updates the bodies in place. The returned Results hold all of them. Of a table in CUDA memory there are only the
        results in `out`, the others are None. TypeError or ValueError for an array that the solver cannot read where it
        is, cairn.Error for data that it refuses; both name it, and nothing is changed.
        """
        tables, results = self._arrays(bodies, contacts, joints, rows, out)
        self._solver.step(dt, gravity, **tables, out=results)
        return Results(**results)

    def step_async(
        self,
        dt: float,
        bodies: Bodies | Table,
        contacts: Contacts | Table | None = None,
        joints: Joints | Table | None = None,
        rows: Rows | Table | None = None,
        gravity: Sequence[float] = (0.0, -9.81, 0.0),
        out: Table | None = None,
    ) -> None:
        """As `step`, but only checks, sends and queues; `wait` gives the Results.

        Until then the arrays must not be changed, NumPy arrays hold no results yet, and every other call is refused
        (cairn.Error). On the CPU the step is done here.
        """
        tables, results = self._arrays(bodies, contacts, joints, rows, out)
        self._solver.step_async(dt, gravity, **tables, out=results)
        self._in_flight = Results(**results)

    def wait(self) -> Results | None:
        """Wait for the step that `step_async` began, and give its results; None if there is none.

        cairn.Error for what only the device could see: bad data in its memory, a body out of the range of numbers.
        """
        results, self._in_flight = self._in_flight, None
        self._solver.wait()
        return results

    def _arrays(
        self,
        bodies: Bodies | Table,
        contacts: Contacts | Table | None,
        joints: Joints | Table | None,
        rows: Rows | Table | None,
        out: Table | None,
    ) -> tuple[dict[str, dict[str, Column]], dict[str, Any]]:
        tables = {
            "bodies": columns_of(bodies, "bodies"),
            "contacts": columns_of(contacts, "contacts"),
            "joints": columns_of(joints, "joints"),
            "rows": columns_of(rows, "rows"),
        }
        return tables, self._results(tables, columns_of(out, "out"))

    @staticmethod
    def _results(tables: Mapping[str, dict[str, Column]], given: Mapping[str, Column]) -> dict[str, Any]:
        """Every result's array: the given one, else a new one of the type of the bodies' positions."""
        known = {field.name for table in (Bodies, Results) for field in fields(table)}
        for name in given:
            if name not in known:
                names = ", ".join(field.name for field in fields(Results))
                raise TypeError(f"out has a field '{name}', which is no result; results are {names}")
        bodies = tables["bodies"]
        results: dict[str, Any] = {}
        for name in ("position", "orientation", "linear_velocity", "angular_velocity"):
            if name in given:
                results[name] = given[name]
            elif name in bodies and isinstance(bodies[name], np.ndarray):
                results[name] = np.array(bodies[name])  # a copy: the solver leaves bodies that cannot move unwritten
            elif name in bodies:
                results[name] = None
        positions = bodies.get("position")
        real = positions.dtype if isinstance(positions, np.ndarray) else np.dtype(np.float32)
        shapes = {
            "contact_impulse": ("contacts", ()),
            "friction_impulse": ("contacts", (3,)),
            "torsion_impulse": ("contacts", (3,)),
            "joint_impulse": ("joints", (6,)),
            "row_impulse": ("rows", ()),
            "joint_linear": ("joints", (3,)),
            "joint_angular": ("joints", (3,)),
        }
        for name, (table, shape) in shapes.items():
            body_a = tables[table].get("body_a", ())
            if name in given:
                results[name] = given[name]
            elif isinstance(body_a, (np.ndarray, tuple)):
                results[name] = np.zeros((len(body_a), *shape), dtype=real)
            else:
                results[name] = None
        return results

    @property
    def statistics(self) -> dict[str, float | str]:
        """What the last step did, by the names of cairn_statistics in cairn.h; times in s, energies in J."""
        values: dict[str, float | str] = dict(self._solver.statistics())
        values["instructions"] = INSTRUCTIONS[int(values["instructions"])]
        values["backend"] = BACKENDS[int(values["backend"])]
        values["executor"] = EXECUTORS[int(values["executor"])]
        return values

    @property
    def residual_trace(self) -> npt.NDArray[np.float64]:
        """[sweeps] sqrt(J), the residual of every velocity sweep of the last step, if params.residual_trace is 1."""
        return self._solver.residual_trace()

    @property
    def split_counts(self) -> npt.NDArray[np.uint32]:
        """[bodies] how many blocks shared each body in the last step: n_i of the paper's eq. 19."""
        return self._solver.split_counts()

    @property
    def choices(self) -> dict[str, npt.NDArray[Any]]:
        """What `auto` did with each island in the last step, as columns by the names of cairn_choice in cairn.h.

        [islands] each, in the order of their first bodies; empty under another method. reason indexes REASONS, method
        METHODS; residual in m/s.
        """
        return self._solver.choices()

    def reset(self) -> None:
        """Forget the warm-start cache."""
        self._solver.reset()

    def save_cache(self) -> bytes:
        """The warm-start cache, with which another solver continues with the same bits."""
        return self._solver.save_cache()

    def load_cache(self, cache: bytes) -> None:
        """cairn.Error if these bytes are no whole cache; then nothing was changed."""
        self._solver.load_cache(cache)


__all__ = ["METHODS", "PRESETS", "REASONS", "Error", "Params", "Solver", "info", "joint_axes", "preset", "presets_of"]
