"""Exact solutions of frictional contact problems and of joints, which the solver's own answers are measured against.

A contact problem is in local form: u = W r + q with the contacts' relative velocities u [3 n] m/s and impulses r [3 n]
N s, of each contact the normal component first, then two tangents; W [3 n, 3 n] symmetric, positive semidefinite;
mu [n] >= 0. Coulomb's law: r is in the friction cones K, u + mu |u_t| n in their dual, and the two are orthogonal (De
Saxcé and Feng 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix

try:
    from . import _reference
except ImportError as error:  # built where Eigen was missing
    raise ImportError(
        "cairn was built without Eigen: install it (Debian: libeigen3-dev), then build cairn again"
    ) from error

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Residual:
    """How far impulses are from Coulomb's law; 0 for a solution."""

    natural_map: float  # |r - P_K(r - (u + mu |u_t| n))|, the numbers as they come
    relative: float  # the same with r sqrt(D) and u / sqrt(D), D = trace(W_ii) / 3, over |q / sqrt(D)|: no unit


@dataclass(frozen=True)
class Solution:
    """Impulses to rounding. Where W is singular there may be others, with friction also other velocities."""

    impulse: Array  # [3 n] r
    velocity: Array  # [3 n] u
    residual: Residual
    convex_problems: int  # with the slip fixed: how often it was updated
    interior_steps: int  # of the interior-point method, in all of them
    newton_steps: int


def solve(W: npt.ArrayLike, q: npt.ArrayLike, mu: npt.ArrayLike, tolerance: float = 1e-12) -> Solution:
    """Until residual.relative <= tolerance or no more progress is made. Dense, in double: n up to some hundreds.

    ValueError for sizes that do not fit, numbers that are not finite, mu < 0, W not symmetric.
    """
    w, offset = np.asarray(W, dtype=float), np.asarray(q, dtype=float)
    found: dict[str, Any] = _reference.solve(w, offset, np.asarray(mu, dtype=float), tolerance)
    residual = Residual(found.pop("natural_map"), found.pop("relative"))
    return Solution(velocity=w @ found["impulse"] + offset, residual=residual, **found)


def evaluate(W: npt.ArrayLike, q: npt.ArrayLike, mu: npt.ArrayLike, impulse: npt.ArrayLike) -> Residual:
    """The residual of any impulses [3 n]. ValueError as for `solve`."""
    arrays = (np.asarray(a, dtype=float) for a in (W, q, mu, impulse))
    return Residual(**_reference.evaluate(*arrays))


@dataclass(frozen=True)
class JointSolution:
    """Velocities to rounding. Where rows depend on each other there may be other impulses, of the same velocities."""

    impulse: Array  # [m] lambda
    velocity: Array  # [n] v
    residual: float  # the largest |J v + compliance lambda - rhs|; not small where rows contradict each other
    refinements: int


def solve_joints(
    jacobian: Any,
    inverse_mass: Any,
    free_velocity: npt.ArrayLike,
    rhs: npt.ArrayLike | None = None,
    compliance: npt.ArrayLike | None = None,
    tolerance: float = 1e-14,
) -> JointSolution:
    """J v + compliance lambda = rhs with v = free_velocity + M^-1 J^T lambda, by a sparse LDL^T, refined to rounding.

    jacobian J [m, n] and inverse_mass M^-1 [n, n], symmetric and positive semidefinite: SciPy's sparse matrices or
    arrays; free_velocity [n] m/s and rad/s: without the joints, after external forces; rhs [m], 0 unless given: what
    J v is to be; compliance [m] >= 0, 0 unless given. Rows may depend on each other. Refined until the residual is
    `tolerance` of what it was without impulses, or falls no further.

    ValueError for sizes that do not fit, numbers that are not finite, compliance < 0, inverse_mass not symmetric.
    """
    rows = csc_matrix(jacobian, dtype=float)
    target, softness = (np.zeros(rows.shape[0]) if a is None else np.asarray(a, dtype=float) for a in (rhs, compliance))
    mass, velocity = csc_matrix(inverse_mass, dtype=float), np.asarray(free_velocity, dtype=float)
    return JointSolution(**_reference.solve_joints(rows, mass, velocity, target, softness, tolerance))
