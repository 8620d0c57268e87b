"""Whole runs: what is recorded, how substeps of Bullet's own solver are counted, how a run ends that blows up."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from cairn import scenes
from cairn.bullet import BulletWorld
from cairn.recording import SERIES, Judge, Times
from cairn.run import STAGES, run
from cairn.scenes.model import Array, Body, Box, Scene, Sphere
from cairn.summary import KEYS

pytest.importorskip("cairn._bullet", reason="cairn was built without Bullet")

SMALL = {"columns": 2, "layers": 2, "rows": 1}


def test_keys_are_those_of_the_project_in_order() -> None:
    text = """scene method preset iterations position_iterations substeps frames dt contacts rows solver_ms_median
    step_ms_median max_penetration_m max_drift_m settling_m max_joint_error_m max_joint_error_rad max_speed_m_s
    max_separation_speed_m_s energy_change_J kinetic_energy_change_max_J collapsed_at_frame finite state_hash build"""
    assert list(KEYS) == text.split()
    assert list(run("stack", "tj", frames=2, settings=SMALL).summary) == text.split()


def test_auto_says_what_it_did() -> None:
    recording = run("stack", "auto", frames=2, settings=SMALL)
    assert recording.choices is not None and "contacts between bodies of like mass" in recording.choices
    assert "tolerance met by" in recording.choices
    chained = run("chain", "auto", frames=2, settings={"links": 10, "tolerance": 1e-1})
    assert chained.choices is not None and "tjsoft, substeps 10" in chained.choices
    assert run("stack", "tj", frames=2, settings=SMALL).choices is None


def test_summary_of_a_small_stack() -> None:
    recording = run(
        "stack",
        "tjsoft",
        preset="paper",
        iterations=20,
        substeps=4,
        frames=80,
        settings={**SMALL, "friction_model": "pyramid"},
        keep_poses_every=30,
        trace_frame=5,
    )
    summary = recording.summary
    assert (summary["scene"], summary["method"], summary["preset"]) == ("stack", "tjsoft", "paper")
    assert (summary["iterations"], summary["substeps"], summary["frames"], summary["dt"]) == (20, 4, 80, 0.016)
    assert summary["contacts"] > 0
    assert summary["rows"] >= summary["contacts"]
    assert summary["settling_m"] == pytest.approx(0.002, abs=0.002)  # two gaps of 1 mm
    assert summary["max_drift_m"] < 0.01
    assert summary["collapsed_at_frame"] is None
    assert summary["max_joint_error_m"] is None
    assert summary["max_separation_speed_m_s"] is None
    assert summary["finite"] is True
    json.dumps(summary, allow_nan=False)
    assert set(recording.frames) == set(SERIES)
    assert {len(series) for series in recording.frames.values()} == {80}
    assert recording.frames["potential_energy_J"][-1] < recording.frames["potential_energy_J"][0]
    assert set(recording.stage_ms) == set(STAGES)
    assert len(recording.residual_trace) == 20
    np.testing.assert_array_equal(recording.pose_frames, [0, 30, 60])
    assert recording.poses.shape == (3, 5, 7)
    np.testing.assert_allclose(recording.poses[0, :, :3], recording.scene.start_positions, atol=1e-6)


def test_tracing_and_watching_change_nothing() -> None:
    first = run("chain", "tj", frames=5, settings={"links": 4})
    second = run("chain", "tj", frames=5, settings={"links": 4}, trace_frame=None, keep_poses_every=1, threads=1)
    assert first.summary["state_hash"] == second.summary["state_hash"]
    assert len(first.residual_trace) > 0
    assert len(second.residual_trace) == 0


@pytest.mark.parametrize("method", ["pj", "stock"])
def test_free_fall_energy(method: str) -> None:
    """Nothing to solve: the solve changes no kinetic energy, and Euler's step loses m g h v / 2 of the whole."""
    ball = Body(Sphere(0.5), 2.0)
    scene = Scene("fall", "", "", [ball], gravity=(0, -10, 0), dt=0.01, frames=50)
    summary = run(scene, method).summary
    assert summary["kinetic_energy_change_max_J"] == pytest.approx(0, abs=1e-4)
    assert summary["max_speed_m_s"] == pytest.approx(5, rel=1e-5)
    assert summary["energy_change_J"] == pytest.approx(-2 * 10 * 0.01 * 5 / 2, rel=1e-2)
    assert summary["contacts"] == 0
    assert summary["max_drift_m"] is None


def test_stock_substeps_are_those_of_step_simulation() -> None:
    recording = run("chain", "stock-substeps", iterations=40, substeps=4, frames=20, settings={"links": 5})
    scene = scenes.build("chain", links=5)
    world = BulletWorld(scene, "stock-substeps", iterations=40, substeps=4)
    for _ in range(20):
        world.step()
    end = run(replace(scene, frames=20), "stock-substeps", iterations=40, substeps=4, keep_poses_every=20).poses[-1]
    np.testing.assert_array_equal(end, world.poses)
    assert recording.summary["iterations"] == 40
    assert recording.summary["substeps"] == 4
    assert recording.summary["preset"] is None
    assert recording.summary["rows"] is None
    assert recording.stage_ms == {}


@pytest.mark.parametrize("method", ["stock", "stock-substeps"])
def test_kinetic_energy_change_of_stock_counts_what_contacts_take(method: str) -> None:
    """A ball that lands: the solve takes the kinetic energy that it had."""
    floor = scenes.build("stack").bodies[0]
    ball = Body(Sphere(0.5), 2.0, position=(0, 0.5, 0), linear_velocity=(0, -3, 0))
    scene = Scene("land", "", "", [floor, ball], gravity=(0, 0, 0), dt=0.01, frames=1)
    assert run(scene, method).summary["kinetic_energy_change_max_J"] == pytest.approx(-9, rel=1e-3)


def test_joint_scenes_measure_their_joints() -> None:
    recording = run("joints", "tj", frames=30)
    assert 0 < recording.summary["max_joint_error_m"] < 1e-2
    assert recording.summary["max_joint_error_rad"] < 1e-2
    assert recording.summary["max_penetration_m"] is None  # too short
    crank = run("crank", "tjsoft", frames=30)
    assert crank.frames["piston_error_m"].max() < 1e-2
    assert crank.summary["max_speed_m_s"] > 0.5  # the motor drives it


def test_overlap_separates() -> None:
    summary = run("overlap", "pj", frames=20, iterations=50, settings={"boxes": 2}).summary
    assert 0.1 < summary["max_separation_speed_m_s"] < 3.5


# ---- The judge, on states made by hand ----------------------------------------------------------------------------


def state(*rows: tuple[float, ...]) -> Array:
    """Positions [bodies, 3], standing upright, at rest."""
    return np.array([[*row, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0] for row in rows], dtype=np.float64)


def judge_of(frames: int) -> Judge:
    box = Body(Box((0.5, 0.5, 0.5)), 2.0, position=(0, 1, 0))
    return Judge(Scene("hand", "", "", [box], gravity=(0, -10, 0), rests=True), frames)


REQUEST = dict.fromkeys(("scene", "method", "preset", "iterations", "position_iterations", "substeps", "dt"))


def test_judge_measures_from_frame_60() -> None:
    judge = judge_of(100)
    for frame in range(1, 101):
        x = 5.0 if frame < 60 else 0.25 if frame == 61 else 0.0  # what happens before frame 60 does not count
        y = 0.75 if frame < 90 else 0.2
        depth = 0.4 if frame <= 60 else 0.03 if frame == 70 else 0.01
        judge.see(state((x, y, 0)), np.array([0.1, -depth]), 0.5 if frame == 9 else -0.1, Times(frame, 2))
    summary = judge.summary(REQUEST, [], "")
    assert summary["max_drift_m"] == pytest.approx(0.25)
    assert summary["settling_m"] == pytest.approx(0.25)
    assert summary["max_penetration_m"] == pytest.approx(0.03)
    assert summary["collapsed_at_frame"] == 90
    assert summary["energy_change_J"] == pytest.approx(-2 * 10 * 0.8)
    assert summary["kinetic_energy_change_max_J"] == 0.5
    assert summary["solver_ms_median"] == pytest.approx(50.5)
    assert summary["contacts"] == 2


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e200])
def test_judge_ends_a_run_that_is_not_finite(bad: float) -> None:
    judge = judge_of(10)
    assert judge.see(state((0, 1, 0)), np.zeros(0), 0.0, Times(1, 1))
    hash_before = judge.summary(REQUEST, [], "")["state_hash"]
    broken = state((0, 1, 0))
    broken[0, 7] = bad  # the energy of 1e200 m/s is infinite
    assert not judge.see(broken, np.zeros(0), 0.0, Times(1, 1))
    summary = judge.summary(REQUEST, [], "")
    assert summary["finite"] is False
    assert summary["frames"] == 1
    assert summary["state_hash"] == hash_before
    json.dumps(summary, allow_nan=False)


@pytest.mark.parametrize("method", ["pj", "tjsoft", "stock", "stock-substeps"])
def test_run_that_blows_up_ends_quietly(method: str) -> None:
    fast = Body(Sphere(0.5), 1.0, linear_velocity=(1e37, 0, 0))
    summary = run(Scene("fast", "", "", [fast], frames=200, dt=1.0), method).summary
    assert summary["finite"] is False
    assert summary["frames"] < 200
    json.dumps(summary, allow_nan=False)


# ---- What is refused ----------------------------------------------------------------------------------------------


def test_what_run_refuses() -> None:
    with pytest.raises(ValueError, match="no scene is called 'stak'; there are stack"):
        run("stak", "tj")
    with pytest.raises(ValueError, match="no method is called 'jacobi'; there are pj, pjnj"):
        run("stack", "jacobi")
    with pytest.raises(ValueError, match="nothing is called 'layer' here; sizes of the scene: columns, layers"):
        run("stack", "tj", settings={"layer": 3})
    with pytest.raises(ValueError, match="parameters of stock: none"):
        run("stack", "stock", settings={"contact_hertz": 3})
    with pytest.raises(ValueError, match="it has no presets"):
        run("stack", "stock", preset="paper")
    with pytest.raises(ValueError, match="stock-substeps"):
        run("stack", "stock", substeps=3)
    with pytest.raises(ValueError, match="frames = 0 must be at least 1"):
        run("stack", "tj", frames=0)
    with pytest.raises(ValueError, match="substeps"):
        run("stack", "pj", substeps=2)


def test_what_leaves_leaves_in_a_run_too() -> None:
    recording = run("warm-removal", "pj", iterations=10, frames=6, settings={"side": 2, "layers": 1, "leaves": 3},
                    keep_poses_every=1)  # fmt: skip
    plate = recording.poses[:, -1, 1]
    assert plate[3] < plate[0] and (plate[3:] == plate[3]).all()
    assert recording.frames["contacts"][-1] < recording.frames["contacts"][2]


def test_motions_are_series_of_their_own() -> None:
    """Once the floor touches in more than the one point that Bullet finds first, the error is small."""
    recording = run("rolling", "pj", iterations=300, frames=5, dt=0.001, settings={"contact_warm_start": 0.0})
    errors = recording.frames["velocity_error_m_s"]
    assert len(errors) == 5 and 0 < errors[-1] < 2e-3


def test_the_jeep_arrives_on_a_bridge_that_holds() -> None:
    recording = run("jeep-bridge", "tjsoft", frames=220, settings={"planks": 6})
    assert recording.frames["progress_m"][-1] > 6 * 0.911 + 4
    assert recording.summary["max_joint_error_m"] < 0.005
    assert 0 < recording.frames["planks_shake_m"].max() < 0.05
