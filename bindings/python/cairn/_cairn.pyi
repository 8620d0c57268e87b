from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

version: str  # without the look for a GPU that info() takes

class Error(RuntimeError):
    status: int

class Solver:
    def __init__(
        self, threads: int, instructions: int, precision: int, backend: int, executor: int, stream: int
    ) -> None: ...
    def load_preset(self, method: int, preset: int, changes: dict[str, float]) -> None: ...
    def set_params(self, changes: dict[str, float]) -> None: ...
    def params(self) -> dict[str, float]: ...
    def step(
        self,
        dt: float,
        gravity: Sequence[float],
        bodies: Mapping[str, Any],
        contacts: Mapping[str, Any],
        joints: Mapping[str, Any],
        rows: Mapping[str, Any],
        out: Mapping[str, Any],
    ) -> None: ...
    def step_async(
        self,
        dt: float,
        gravity: Sequence[float],
        bodies: Mapping[str, Any],
        contacts: Mapping[str, Any],
        joints: Mapping[str, Any],
        rows: Mapping[str, Any],
        out: Mapping[str, Any],
    ) -> None: ...
    def wait(self) -> None: ...
    def statistics(self) -> dict[str, float]: ...
    def residual_trace(self) -> npt.NDArray[np.float64]: ...
    def split_counts(self) -> npt.NDArray[np.uint32]: ...
    def choices(self) -> dict[str, npt.NDArray[Any]]: ...
    def reset(self) -> None: ...
    def save_cache(self) -> bytes: ...
    def load_cache(self, cache: bytes) -> None: ...

def info() -> dict[str, int | str]: ...
def method_names() -> list[str]: ...
def reason_texts() -> list[str]: ...
def preset(method: int, preset: int) -> dict[str, float]: ...
def joint_axes(joint: int) -> list[int]: ...
def evaluate(
    dt: float,
    gravity: Sequence[float],
    bodies: Mapping[str, Any],
    contacts: Mapping[str, Any],
    joints: Mapping[str, Any],
    rows: Mapping[str, Any],
    results: Mapping[str, Any],
) -> tuple[dict[str, Any], dict[str, Any], npt.NDArray[np.int32]]: ...
def sweep_bytes(
    points: Sequence[float],
    manifolds: float,
    joints: float,
    bodies: float,
    sides: float,
    pyramid: bool,
    manifold_blocks: bool,
    reduces: bool,
) -> float: ...
