"""FCLIB files as raw rows: a problem of our own in that format, and the recorded ones that CAIRN_FCLIB_DIR shows."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from cairn.cli import main

fclib = pytest.importorskip("cairn.fclib", reason="cairn was built without Eigen", exc_type=ImportError)

RECORDED = sorted(Path(os.environ.get("CAIRN_FCLIB_DIR", "/nonexistent")).glob("*.hdf5"))


def write_matrix(group: h5py.Group, matrix: np.ndarray, form: str) -> None:
    """As triplets, compressed columns or compressed rows."""
    rows, columns = np.nonzero(matrix)
    if form == "columns":
        columns, rows = np.nonzero(matrix.T)
    values = matrix[rows, columns]
    group["m"], group["n"] = np.array([matrix.shape[0]]), np.array([matrix.shape[1]])
    group["nz"] = np.array([{"triplets": len(values), "columns": -1, "rows": -2}[form]])
    group["x"] = values
    ends = {"columns": (rows, columns, matrix.shape[1]), "rows": (columns, rows, matrix.shape[0])}
    if form == "triplets":
        group["i"], group["p"] = rows, columns
    else:
        index, major, count = ends[form]
        group["i"], group["p"] = index, np.concatenate([[0], np.cumsum(np.bincount(major, minlength=count))])


def write_tower(path: Path, form: str = "triplets", local: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Two bodies of 2 kg and 1 kg, one on the other on the ground, the upper one pushed; returns W and q."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]  # inertia about axes that are not the world's
    mass = np.zeros((12, 12))
    for body, m in enumerate((2.0, 1.0)):
        mass[6 * body : 6 * body + 3, 6 * body : 6 * body + 3] = m * np.eye(3)
        mass[6 * body + 3 : 6 * body + 6, 6 * body + 3 : 6 * body + 6] = turn @ np.diag([0.1, 0.2, 0.25]) @ turn.T
    frame = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1]], dtype=float)
    h = np.zeros((12, 24))
    for contact in range(8):
        lower, upper = contact // 4 - 1, contact // 4
        for body, sign, y in ((lower, -1, 0.5), (upper, 1, -0.5)):
            arm = np.array([(-1) ** contact * 0.5, y, (-1) ** (contact // 2) * 0.5])
            if body >= 0:
                part = sign * np.hstack([frame, np.cross(arm, frame)])
                h[6 * body : 6 * body + 6, 3 * contact : 3 * contact + 3] = part.T
    f = np.array([0, -2, 0, 0, 0, 0, 0.8, -1, 0.1, 0, 0, 0.05])
    w = np.zeros(24)
    W, q = h.T @ np.linalg.solve(mass, h), h.T @ np.linalg.solve(mass, f) + w
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_local" if local else "fclib_global")
        group["spacedim"] = np.array([3])
        group["info/title"] = np.bytes_("tower")
        group["vectors/mu"] = np.full(8, 0.4)
        if local:
            write_matrix(group.create_group("W"), W, form)
            group["vectors/q"] = q
        else:
            write_matrix(group.create_group("M"), mass, form)
            write_matrix(group.create_group("H"), h, form)
            group["vectors/f"], group["vectors/w"] = f, w
    return W, q


@pytest.mark.parametrize("form", ["triplets", "columns", "rows"])
@pytest.mark.parametrize("local", [False, True])
def test_every_form_is_read(tmp_path: Path, form: str, local: bool) -> None:
    W, q = write_tower(tmp_path / "tower.hdf5", form, local)
    problem = fclib.read(tmp_path / "tower.hdf5")
    np.testing.assert_allclose(problem.W, W, atol=1e-12)
    np.testing.assert_allclose(problem.q, q, atol=1e-12)
    assert (problem.name, problem.title, len(problem), problem.coupled) == (
        "tower",
        "tower",
        8,
        None if local else True,
    )
    assert (problem.bodies is None) == local


@pytest.mark.parametrize("method", ["pj", "tjsoft"])
def test_sweeps_go_to_the_reference(tmp_path: Path, method: str) -> None:
    write_tower(tmp_path / "tower.hdf5")
    problem = fclib.read(tmp_path / "tower.hdf5")
    assert problem.solution.residual.relative < 1e-12
    sweeps = fclib.Sweeps(problem, method, precision=64)
    impulse = sweeps.impulse(3000)
    assert problem.residual(impulse).relative < 1e-9
    first, second = sweeps.reach([1e-2, 1e-4])
    assert sweeps.residual(first.iterations) <= 1e-2 < sweeps.residual(max(1, first.iterations * 7 // 8))
    assert second.iterations > first.iterations


def test_no_more_sweeps_than_allowed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_tower(tmp_path / "tower.hdf5")
    sweeps = fclib.Sweeps(fclib.read(tmp_path / "tower.hdf5"), "pj")
    tried: list[int] = []

    def residual(iterations: int) -> float:
        tried.append(iterations)
        return 1 / iterations

    monkeypatch.setattr(sweeps, "residual", residual)
    monkeypatch.setattr(sweeps, "seconds", lambda iterations: 0.0)
    reached = list(sweeps.reach([0.5, 0.11, 0.1, 1e-3], most=10))
    assert [one.iterations for one in reached] == [2, 10, 10, None]
    assert max(tried) == 10


def test_refusals(tmp_path: Path) -> None:
    path = tmp_path / "bad.hdf5"
    with pytest.raises(OSError, match=r"bad\.hdf5"):
        fclib.read(path)
    with h5py.File(path, "w") as file:
        file["something"] = 1
    with pytest.raises(ValueError, match=r"neither /fclib_global nor /fclib_local: it holds something"):
        fclib.read(path)
    write_tower(path, local=True)
    with pytest.raises(ValueError, match="does not say which bodies"):
        fclib.rows_of(fclib.read(path))
    write_tower(path)
    with h5py.File(path, "r+") as file:
        file["fclib_global/M/x"][0] = 3
    with pytest.raises(ValueError, match="block of body 0 is not that of a rigid body"):
        fclib.rows_of(fclib.read(path))


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_tower(tmp_path / "tower.hdf5")
    assert main(["fclib", str(tmp_path / "tower.hdf5"), "--tolerances", "1e-1,1e-2"]) == 0
    shown = capsys.readouterr().out
    assert "tower: 8 contacts, global, coupled" in shown
    assert "paper" in shown
    assert "1e-02" in shown
    (tmp_path / "not.hdf5").write_text("no")
    assert main(["fclib", str(tmp_path / "not.hdf5")]) == 1


@pytest.mark.skipif(not RECORDED, reason="CAIRN_FCLIB_DIR shows no *.hdf5")
@pytest.mark.parametrize("path", RECORDED, ids=lambda path: path.stem)
def test_recorded_problems(path: Path) -> None:
    problem = fclib.read(path)
    assert problem.solution.residual.relative < 1e-8
    assert problem.solution.residual.natural_map < 1e-8
    if problem.bodies is not None:
        residuals = [fclib.Sweeps(problem, "tjsoft").residual(n) for n in (1, 30, 300)]
        assert residuals[0] > residuals[1] > residuals[2]
        assert residuals[2] < 1e-2
