"""Python's Solver on the CUDA backend, with arrays in CUDA memory. CTest has _cairn over the emulated runtime."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

MODULE = os.environ["CAIRN_EMULATED_MODULE"]  # a whole path
sys.path.insert(0, str(Path(__file__).parents[2] / "bindings" / "python"))
specification = importlib.util.spec_from_file_location("cairn._cairn", MODULE)
assert specification and specification.loader
module = importlib.util.module_from_spec(specification)
sys.modules["cairn._cairn"] = module
specification.loader.exec_module(module)

import cairn  # noqa: E402

runtime = ctypes.CDLL(MODULE)
runtime.cairn_test_allocate.restype = ctypes.c_void_p
runtime.cairn_test_copy.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t]


class DeviceArray:
    """A copy in CUDA memory, described as CuPy, Numba and PyTorch describe theirs."""

    def __init__(self, array: np.ndarray[Any, Any]) -> None:
        self.host = np.array(array, order="C")
        self.pointer = runtime.cairn_test_allocate(max(1, self.host.nbytes))
        assert self.pointer
        self.copy(self.pointer, self.host.ctypes.data)
        self.strides: tuple[int, ...] | None = None
        self.stream: int | None = None
        self.read_only = False

    def copy(self, to: int, source: int) -> None:
        assert runtime.cairn_test_copy(to, source, self.host.nbytes) == 0

    def get(self) -> np.ndarray[Any, Any]:
        self.copy(self.host.ctypes.data, self.pointer)
        return self.host.copy()

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return {
            "shape": self.host.shape,
            "typestr": self.host.dtype.str,
            "data": (self.pointer, self.read_only),
            "strides": self.strides,
            "stream": self.stream,
            "version": 3,
        }


class Tensor(ctypes.Structure):
    """DLPack's DLManagedTensor."""

    _fields_ = (
        ("data", ctypes.c_void_p),
        ("device_type", ctypes.c_int32),
        ("device_id", ctypes.c_int32),
        ("dimensions", ctypes.c_int32),
        ("code", ctypes.c_uint8),
        ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
        ("context", ctypes.c_void_p),
        ("deleter", ctypes.c_void_p),
    )


class DlpackArray:
    """The same memory through DLPack, as JAX has it."""

    deleted = 0
    streams: tuple[int, ...] = ()

    def __init__(self, array: DeviceArray, device_type: int = 2) -> None:
        self.array, self.device_type = array, device_type
        self.kept: list[Any] = []  # one array may be exported twice, as an input and as a result

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.device_type, 0

    def __dlpack__(self, stream: int | None = None) -> Any:
        DlpackArray.streams += (stream or 0,)
        host = self.array.host
        tensor = Tensor(data=self.array.pointer, device_type=2, dimensions=host.ndim, lanes=1)
        tensor.code, tensor.bits = "iuf".index(host.dtype.kind), 8 * host.itemsize
        shape = (ctypes.c_int64 * host.ndim)(*host.shape)
        tensor.shape = ctypes.cast(shape, ctypes.POINTER(ctypes.c_int64))

        def delete(_: int) -> None:
            DlpackArray.deleted += 1

        deleter = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(delete)
        self.kept.append((tensor, shape, deleter))
        tensor.deleter = ctypes.cast(deleter, ctypes.c_void_p)
        new = ctypes.pythonapi.PyCapsule_New
        new.restype, new.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
        return new(ctypes.addressof(tensor), b"dltensor", None)


COUNT = 3


def bodies() -> dict[str, Any]:
    """Balls of 1 kg and radius 0.5 m, one on the other."""
    position = np.zeros((COUNT, 3), dtype=np.float32)
    position[:, 1] = 0.5 + np.arange(COUNT)
    return {
        "position": position,
        "orientation": np.tile(np.array([0, 0, 0, 1], dtype=np.float32), (COUNT, 1)),
        "linear_velocity": np.zeros((COUNT, 3), dtype=np.float32),
        "angular_velocity": np.zeros((COUNT, 3), dtype=np.float32),
        "inverse_mass": np.ones(COUNT, dtype=np.float32),
        "inverse_inertia": np.full((COUNT, 3), 10, dtype=np.float32),
    }


def contacts() -> dict[str, Any]:
    arm = np.tile(np.array([0, 0.5, 0], dtype=np.float32), (COUNT, 1))
    arm_a = arm.copy()
    arm_a[0] = 0
    return {
        "body_a": np.arange(COUNT, dtype=np.int32) - 1,
        "body_b": np.arange(COUNT, dtype=np.int32),
        "normal": np.tile(np.array([0, 1, 0], dtype=np.float32), (COUNT, 1)),
        "arm_a": arm_a,
        "arm_b": -arm,
        "separation": np.zeros(COUNT, dtype=np.float32),
        "key": np.arange(COUNT, dtype=np.uint64) + 1,
    }


def moved(table: dict[str, Any]) -> dict[str, Any]:
    return {name: DeviceArray(column) for name, column in table.items()}


def expected() -> dict[str, Any]:
    table = bodies()
    solver = cairn.Solver(backend="cpu")
    for _ in range(3):
        solver.step(0.01, table, contacts(), out=table)
    return table


@pytest.fixture
def gpu() -> cairn.Solver:
    return cairn.Solver(backend="cuda", executor="grid")


def test_device_arrays_have_the_bits_of_host_arrays(gpu: cairn.Solver) -> None:
    table, touching = moved(bodies()), moved(contacts())
    impulse = DeviceArray(np.zeros(COUNT))
    for _ in range(3):
        results = gpu.step(0.01, table, touching, out={**table, "contact_impulse": impulse})
    for name, column in expected().items():
        np.testing.assert_array_equal(table[name].get(), column, err_msg=name)
    assert gpu.statistics["backend"] == "cuda"
    assert gpu.statistics["executor"] == "grid"
    assert results.contact_impulse is impulse
    assert results.friction_impulse is None
    weight = 9.81 * 0.01 * (COUNT - np.arange(COUNT))
    np.testing.assert_allclose(impulse.get(), weight, rtol=0.05)


def test_dlpack(gpu: cairn.Solver) -> None:
    DlpackArray.deleted, DlpackArray.streams = 0, ()
    memory, touching = moved(bodies()), moved(contacts())
    touching["key"] = DeviceArray(contacts()["key"].astype(np.int64))  # who has no unsigned integers
    for _ in range(3):
        table = {name: DlpackArray(array) for name, array in memory.items()}
        gpu.step(0.01, table, {name: DlpackArray(array) for name, array in touching.items()}, out=table)
    for name, column in expected().items():
        np.testing.assert_array_equal(memory[name].get(), column, err_msg=name)
    exports = 3 * (2 * len(memory) - 2 + len(touching))  # in out, two columns are no results
    assert DlpackArray.deleted == exports
    assert DlpackArray.streams == (1,) * exports


def test_two_calls(gpu: cairn.Solver) -> None:
    table = bodies()
    assert gpu.wait() is None
    for _ in range(3):
        gpu.step_async(0.01, table, contacts(), out=table)
        with pytest.raises(cairn.Error, match="in flight"):
            gpu.step(0.01, table, contacts())
        with pytest.raises(cairn.Error, match="in flight"):
            gpu.step_async(0.01, bodies())
        results = gpu.wait()
        assert results is not None
        assert results.position is table["position"]
    for name, column in expected().items():
        np.testing.assert_array_equal(table[name], column, err_msg=name)


def test_arrays_in_flight_are_kept(gpu: cairn.Solver) -> None:
    gpu.step_async(0.01, bodies(), contacts())
    results = gpu.wait()
    assert results is not None
    np.testing.assert_array_equal(
        results.position, cairn.Solver(backend="cpu").step(0.01, bodies(), contacts()).position
    )
    gpu.step_async(0.01, bodies(), contacts())  # and one is destroyed in flight


def broken(change: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    table = moved(bodies())
    change(table)
    return table


def test_refusals(gpu: cairn.Solver) -> None:
    def bad(kind: type[Exception], text: str, change: Callable[[dict[str, Any]], None]) -> None:
        table = broken(change)
        with pytest.raises(kind, match=text):
            gpu.step(0.01, table, out=table)

    def put(name: str, array: Any) -> Callable[[dict[str, Any]], None]:
        return lambda table: table.update({name: array})

    def mark(name: str, **marks: Any) -> Callable[[dict[str, Any]], None]:
        return lambda table: vars(table[name]).update(marks)

    half = np.zeros((COUNT, 3), dtype=np.float16)
    bad(TypeError, r"bodies.position has elements of type float16", put("position", DeviceArray(half)))
    bad(TypeError, r"bodies.position has elements of type float16", put("position", DlpackArray(DeviceArray(half))))
    bad(
        TypeError,
        r"bodies.position is .*DLPack's kind 1;",
        put("position", DlpackArray(DeviceArray(half), device_type=1)),
    )
    bad(
        ValueError, r"bodies.position has shape \(3, 4\); pass \(n, 3\)", put("position", DeviceArray(np.zeros((3, 4))))
    )
    bad(ValueError, r"out.position is read-only", mark("position", read_only=True))
    bad(TypeError, r"bodies.position has a last axis that is not contiguous", mark("position", strides=(4, 12)))
    bad(ValueError, r"ready in the order of stream 7, .* stream=7", mark("position", stream=7))
    mass = DeviceArray(np.array([1, -2, 1], dtype=np.float32))
    bad(cairn.Error, r"bodies.inverse_mass\[1\] is -2: must be >= 0", put("inverse_mass", mass))
    table = moved(bodies())
    with pytest.raises(cairn.Error, match="this solver runs on the CPU"):
        cairn.Solver(backend="cpu").step(0.01, table, out=table)
    with pytest.raises(ValueError, match="backend 'opencl' is unknown; there are auto, cpu, cuda"):
        cairn.Solver(backend="opencl")


def test_the_legacy_streams_number_is_no_other_stream(gpu: cairn.Solver) -> None:
    table = moved(bodies())
    table["position"].stream = 1
    gpu.step(0.01, table, out=table)
