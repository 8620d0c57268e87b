"""`cairn.evaluate`: how good a step was, whoever solved it, per island."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _cairn
from .tables import Bodies, Contacts, Joints, Results, Rows, Table, columns_of

Number = Any  # of one island or of all; in `Evaluation.islands` an array [islands]


@dataclass(frozen=True)
class Measures:
    """What `evaluate` says: 0 is exact, but for the counts and kinetic_energy. cairn.h has the formulas.

    An index is one in its table, of the element where the quantity is largest; -1 where the quantity is 0.
    """

    bodies: Number  # that can move
    contacts: Number  # of which a body can move, likewise:
    joints: Number
    rows: Number
    penetration: Number  # m, at the end's poses
    penetration_mean: Number  # m, over all contacts
    penetration_contact: Number  # index
    joint_gap: Number  # m, at the end's poses: translations that are locked, or beyond their limits
    joint_gap_mean: Number  # m, over all joints
    gap_joint: Number  # index
    joint_angle: Number  # rad, likewise the rotations
    joint_angle_mean: Number  # rad
    angle_joint: Number  # index
    contact_residual: Number  # m/s, natural map of Coulomb's law
    residual_contact: Number  # index
    joint_residual: Number  # m/s, likewise of locked and limited translations and motors
    residual_joint: Number  # index
    joint_angular_residual: Number  # rad/s, of rotations
    angular_residual_joint: Number  # index
    row_residual: Number  # in the row's unit
    residual_row: Number  # index
    relative_residual: Number  # 0 ... 1: all residuals beside all impulses, external ones too, as energies
    complementarity: Number  # J: a contact that pushes while apart, or pulls
    coulomb_excess: Number  # N s of friction beyond the cone
    momentum: Number  # N s, of a body: what reported impulses and external forces do not explain
    momentum_body: Number  # index
    angular_momentum: Number  # N m s, likewise
    angular_momentum_body: Number  # index
    momentum_total: Number  # N s, the same added as vectors: what came from nowhere
    angular_momentum_total: Number  # N m s, about the centre of mass
    kinetic_energy: Number  # J that the constraints added, external work apart; negative: took


@dataclass(frozen=True)
class Evaluation:
    """A step judged as a whole and island by island."""

    whole: Measures  # numbers
    islands: Measures  # arrays [islands], numbered by their first body, as the solver numbers them
    body_island: npt.NDArray[np.int32]  # [bodies] -1: cannot move


def evaluate(
    dt: float,
    bodies: Bodies | Table,
    results: Results | Table,
    contacts: Contacts | Table | None = None,
    joints: Joints | Table | None = None,
    rows: Rows | Table | None = None,
    gravity: Sequence[float] = (0.0, -9.81, 0.0),
) -> Evaluation:
    """How good a step of dt seconds was: in double, against the problem as the tables state it, not a softer one.

    bodies, contacts, joints and rows are what went in, as it was before the step; results is what came out, of
    `Solver.step` (without `out=bodies`, which overwrites what went in) or of any other solver. NumPy arrays, which are
    only read. A mean velocity over the step is taken from the poses: in float32 their rounding / dt is in it.

    TypeError or ValueError for an array that cannot be read, cairn.Error for data that the library refuses.
    """
    tables = {
        "bodies": columns_of(bodies, "bodies"),
        "contacts": columns_of(contacts, "contacts"),
        "joints": columns_of(joints, "joints"),
        "rows": columns_of(rows, "rows"),
    }
    outcome, known = columns_of(results, "results"), [field.name for field in fields(Results)]
    for name in outcome:
        if name not in known:
            raise TypeError(f"results has a field '{name}', which is no result; results are {', '.join(known)}")
    found, islands, body_island = _cairn.evaluate(dt, gravity, **tables, results=outcome)
    return Evaluation(Measures(**found), Measures(**islands), body_island)


__all__ = ["Evaluation", "Measures", "evaluate"]
