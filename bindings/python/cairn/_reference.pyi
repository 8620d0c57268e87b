from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

def evaluate(W: Array, q: Array, mu: Array, impulse: Array) -> dict[str, float]: ...
def solve(W: Array, q: Array, mu: Array, tolerance: float) -> dict[str, Any]: ...
def solve_joints(
    jacobian: Any, inverse_mass: Any, free_velocity: Array, rhs: Array, compliance: Array, tolerance: float
) -> dict[str, Any]: ...
