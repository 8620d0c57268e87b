"""Frictional contact problems that other people recorded (FCLIB's HDF5 files), as raw rows for the solver.

https://github.com/FrictionalContactLibrary/fclib describes the format. A *global* problem has bodies: M v = H r + f,
u = H^T v + w. A *local* one has none: u = W r + q; nothing says which two bodies a contact of it joins, so the
reference solves it and the sweeps do not.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from . import reference
from .solver import METHODS, PRESETS, ParamValue, Solver
from .tables import NO_GYROSCOPIC, WORLD, Bodies, Rows

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Global:
    """M v = H r + f, u = H^T v + w: six rows of M a body, translation first."""

    M: Any  # [6 b, 6 b] scipy.sparse
    H: Any  # [6 b, 3 n]
    f: Array  # [6 b] N s: momentum at the step's end, were there no contacts
    w: Array  # [3 n] m/s


@dataclass(frozen=True)
class Problem:
    """n contacts. Of each the normal component comes first, then two tangents."""

    name: str
    title: str
    description: str
    mu: Array  # [n]
    bodies: Global | None  # None: the file has the local form alone
    W: Array  # [3 n, 3 n] 1/kg, symmetric
    q: Array  # [3 n] m/s

    def __len__(self) -> int:
        return len(self.mu)

    @cached_property
    def solution(self) -> reference.Solution:
        return reference.solve(self.W, self.q, self.mu)

    def residual(self, impulse: Array) -> reference.Residual:
        return reference.evaluate(self.W, self.q, self.mu, impulse)

    @property
    def coupled(self) -> bool | None:
        """Whether some contact joins two bodies that move; None where the form does not say."""
        if self.bodies is None:
            return None
        row, column = self.bodies.H.nonzero()
        pairs = np.unique(np.stack([column // 3, row // 6]), axis=1)
        return bool(np.bincount(pairs[0]).max(initial=0) > 1)


def read(path: Path | str) -> Problem:
    """OSError if there is no such HDF5 file, ValueError if it is not FCLIB's or not three-dimensional."""
    path = Path(path)
    with h5py.File(path) as file:
        form = next((form for form in ("fclib_global", "fclib_local") if form in file), None)
        if form is None:
            raise ValueError(
                f"{path} has neither /fclib_global nor /fclib_local: it holds {', '.join(file) or 'nothing'}"
            )
        group = file[form]
        if int(group["spacedim"][0]) != 3:
            raise ValueError(f"{path} is of {int(group['spacedim'][0])} dimensions: only three are supported")
        vectors = {name: np.asarray(data[()], dtype=float) for name, data in group["vectors"].items()}
        title, description = _text(group, "info/title"), _text(group, "info/description")
        mu = vectors["mu"]
        if form == "fclib_local":
            bodies, w, q = None, _matrix(group["W"]).toarray(), vectors["q"]
        else:
            if "G" in group:
                raise ValueError(f"{path} has equality constraints (/fclib_global/G), which are not supported")
            bodies = Global(_matrix(group["M"]), _matrix(group["H"]), vectors["f"], vectors["w"])
            factor = splu(bodies.M.tocsc())
            w = bodies.H.T @ factor.solve(bodies.H.toarray())
            q = bodies.H.T @ factor.solve(bodies.f) + bodies.w
    return Problem(path.stem, title, description, mu=mu, bodies=bodies, W=(w + w.T) / 2, q=q)


def _text(group: Any, name: str) -> str:
    value = group[name][()] if name in group else b""
    return value.decode(errors="replace").strip("\0\n ") if isinstance(value, bytes) else str(value)


def _matrix(group: Any) -> Any:
    """nz >= 0: triplets; -1: compressed columns; -2: compressed rows."""
    rows, columns, kind = (int(group[name][0]) for name in ("m", "n", "nz"))
    i, p, x = (np.asarray(group[name][()]) for name in ("i", "p", "x"))
    if kind >= 0:
        return sparse.coo_matrix((x[:kind], (i[:kind], p[:kind])), (rows, columns)).tocsr()
    if kind == -1:
        return sparse.csc_matrix((x, i, p), (rows, columns)).tocsr()
    return sparse.csr_matrix((x, i, p), (rows, columns))


def rows_of(problem: Problem) -> tuple[Bodies, Rows]:
    """A global problem as bodies that fly freely and a block of three raw rows a contact; row i has impulse r_i.

    ValueError for a local problem, a mass matrix that is not of rigid bodies, a contact of more than two bodies.
    """
    if problem.bodies is None:
        raise ValueError(f"{problem.name} is a local problem: it does not say which bodies its contacts join")
    given = problem.bodies
    count = given.M.shape[0] // 6
    orientation, inverse_mass, inverse_inertia = np.zeros((count, 4)), np.zeros(count), np.zeros((count, 3))
    free = splu(given.M.tocsc()).solve(given.f).reshape(count, 6)
    for body in range(count):
        at = slice(6 * body, 6 * body + 6)
        block = given.M[at, at].toarray()
        if block.shape != (6, 6) or abs(given.M[at]).sum() - abs(block).sum() > 1e-12 * abs(block).sum():
            raise ValueError(f"{problem.name}: M couples body {body} to others")
        mass, inertia = block[0, 0], block[3:, 3:]
        if not np.allclose(block[:3, :3], mass * np.eye(3), rtol=1e-12, atol=0) or np.any(block[:3, 3:]) or mass <= 0:
            raise ValueError(
                f"{problem.name}: M's block of body {body} is not that of a rigid body at its centre of mass"
            )
        moments, axes = np.linalg.eigh(inertia)
        orientation[body] = _quaternion(axes * np.sign(np.linalg.det(axes)))
        inverse_mass[body], inverse_inertia[body] = 1 / mass, 1 / moments
    bodies = Bodies(
        position=np.zeros((count, 3)),
        orientation=orientation,
        linear_velocity=np.ascontiguousarray(free[:, :3]),
        angular_velocity=np.ascontiguousarray(free[:, 3:]),
        inverse_mass=inverse_mass,
        inverse_inertia=inverse_inertia,
        flags=np.full(count, NO_GYROSCOPIC, dtype=np.uint32),
    )
    n = len(problem)
    pair = np.full((2, n), WORLD, dtype=np.int32)
    jacobian = np.zeros((2, n, 3, 6))
    columns = given.H.tocsc()
    for contact in range(n):
        part = columns[:, 3 * contact : 3 * contact + 3]
        touched = np.unique(part.nonzero()[0] // 6)
        if not 1 <= len(touched) <= 2:
            raise ValueError(f"{problem.name}: contact {contact} is of {len(touched)} bodies: must be one or two")
        for side, body in zip((1,) if len(touched) == 1 else (0, 1), touched):
            pair[side, contact] = body
            jacobian[side, contact] = part[6 * body : 6 * body + 6].toarray().T
    normal = np.arange(3 * n) % 3 == 0
    first = np.arange(3 * n, dtype=np.int32) // 3 * 3
    rows = Rows(
        body_a=np.repeat(pair[0], 3),
        body_b=np.repeat(pair[1], 3),
        jacobian_a=jacobian[0].reshape(3 * n, 6),
        jacobian_b=jacobian[1].reshape(3 * n, 6),
        rhs=-given.w,
        lower=np.where(normal, 0, -np.inf),
        friction_index=np.where(normal, -1, first).astype(np.int32),
        friction=np.repeat(problem.mu, 3),
        block=np.repeat(np.arange(n, dtype=np.int32), 3),
    )
    return bodies, rows


def _quaternion(rotation: Array) -> Array:
    """x, y, z, w of a rotation matrix: the eigenvector of Bar-Itzhack's (2000) symmetric matrix."""
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
        ]
    )
    vector: Array = np.linalg.eigh(k)[1][:, -1]
    return vector


@dataclass(frozen=True)
class Reached:
    """Where the sweeps first had a residual: `iterations` of them, and the time of the solve, s."""

    tolerance: float
    iterations: int | None  # None: not within the most that were allowed
    seconds: float | None


class Sweeps:
    """A global problem under one method. On raw rows the methods differ by nothing but their parameters."""

    def __init__(
        self, problem: Problem, method: str, precision: int = 32, preset: str = "default", **params: ParamValue
    ) -> None:
        self._problem = problem
        self._bodies, self._rows = rows_of(problem)
        self._solver = Solver(method, preset, threads=1, precision=precision)
        self._solver.params.update(substeps=1, joint_warm_start=0.0, relax_share=0.0, **params)
        self._known: dict[int, float] = {}

    def impulse(self, iterations: int) -> Array:
        """[3 n] after that many sweeps from zero."""
        self._solver.params.iterations = iterations
        self._solver.reset()
        results = self._solver.step(1.0, self._bodies, rows=self._rows, gravity=(0, 0, 0))
        return np.asarray(results.row_impulse, dtype=float)

    def residual(self, iterations: int) -> float:
        """The relative residual after that many sweeps from zero."""
        if iterations not in self._known:
            self._known[iterations] = self._problem.residual(self.impulse(iterations)).relative
        return self._known[iterations]

    def seconds(self, iterations: int, runs: int = 5) -> float:
        """The median time of that many sweeps."""
        times = []
        for _ in range(runs):
            self.impulse(iterations)
            times.append(float(self._solver.statistics["time_total"]))
        return float(np.median(times))

    def reach(self, tolerances: Sequence[float], most: int = 1 << 16) -> Iterator[Reached]:
        """For each tolerance, large to small, the least number of sweeps, to 1/16, by doubling and bisection."""
        high, failed = 1, 0
        for tolerance in tolerances:
            while self.residual(high) > tolerance and high < most:
                high, failed = min(2 * high, most), high
            if self.residual(high) > tolerance:
                yield Reached(tolerance, None, None)
                continue
            low, end = failed, high
            while end - low > max(1, low // 16):
                middle = (low + end) // 2
                low, end = (low, middle) if self.residual(middle) <= tolerance else (middle, end)
            yield Reached(tolerance, end, self.seconds(end))


def compare(problem: Problem, tolerances: Sequence[float], most: int, precision: int = 32) -> dict[str, Any]:
    """The reference's residual and time, and how far every method in every preset gets; plain values, for JSON."""
    start = time.perf_counter()
    solution = problem.solution
    seconds = time.perf_counter() - start
    sweeps = []
    if problem.bodies is not None:
        for preset in PRESETS:
            for method in METHODS:
                if method == "auto":  # it decides itself how many sweeps it makes
                    continue
                reached = Sweeps(problem, method, precision, preset=preset).reach(tolerances, most)
                sweeps.append({"method": method, "preset": preset, "reached": [asdict(one) for one in reached]})
    return {
        "name": problem.name,
        "title": problem.title,
        "contacts": len(problem),
        "form": "local" if problem.bodies is None else "global",
        "coupled": problem.coupled,
        "precision": precision,
        "reference": {**asdict(solution.residual), "seconds": seconds},
        "sweeps": sweeps,
    }
