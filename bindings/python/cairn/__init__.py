"""Cairn: a rigid-body constraint solver for physics engines that already exist.

    >>> import numpy as np, cairn
    >>> solver = cairn.Solver("tjsoft", iterations=40, substeps=4)
    >>> ball = cairn.Bodies(
    ...     position=np.zeros((1, 3)), orientation=np.array([[0.0, 0, 0, 1]]),
    ...     linear_velocity=np.zeros((1, 3)), angular_velocity=np.zeros((1, 3)),
    ...     inverse_mass=np.ones(1), inverse_inertia=np.ones((1, 3)))
    >>> solver.step(1 / 60, ball, out=ball).linear_velocity.round(4)
    array([[ 0.    , -0.1635,  0.    ]])

`cairn.Solver` is the library itself, `cairn.evaluate` says how good a step was; `cairn.scenes`, `cairn.bullet`,
`cairn.run`, `cairn.metrics` and `cairn.charts` run and judge whole scenes. The command line is `cairn --help`.
"""

from . import _cairn
from .evaluation import Evaluation, Measures, evaluate
from .solver import METHODS, PRESETS, REASONS, Error, Params, Solver, info, joint_axes, preset
from .tables import (
    AT_END_POSE,
    BY_AXES,
    CONE,
    DRIVEN,
    FREE,
    LIMITED,
    LOCKED,
    NO_GYROSCOPIC,
    ROUND_A,
    ROUND_B,
    SERVO,
    SPRING,
    VECTOR,
    WORLD,
    Bodies,
    Contacts,
    Joints,
    Results,
    Rows,
)

__version__ = _cairn.version

__all__ = [
    "AT_END_POSE", "BY_AXES", "CONE", "DRIVEN", "FREE", "LIMITED", "LOCKED", "METHODS", "NO_GYROSCOPIC", "PRESETS",
    "REASONS", "ROUND_A", "ROUND_B", "SERVO", "SPRING", "VECTOR", "WORLD", "Bodies", "Contacts", "Error", "Evaluation",
    "Joints", "Measures", "Params", "Results", "Rows", "Solver", "evaluate", "info", "joint_axes", "preset",
]  # fmt: skip
