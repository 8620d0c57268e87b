"""The report of speed against accuracy: its rules on made-up data, and small reports that are cut off and resumed."""

from __future__ import annotations

import csv
import io
import math
import re
import subprocess
import sys
import time
import warnings
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cairn import (
    cli,
    cluster,
    demo,
    report,
    report_cache,
    report_failures,
    report_outcome,
    report_plan,
    scenes,
    workers,
)  # fmt: skip
from cairn.charts import ablation, atlas, auto, beside_bullet, claims, error_time, paper, profiles, work_precision
from cairn.charts.result import Comparison, Measured, Request, Result
from cairn.recording import SERIES, Recording
from cairn.report_outcome import COLLAPSED, DEGRADED, EXPLODED, FAILED, NAN, SURVIVED, UNKNOWN
from cairn.summary import KEYS
from cairn.workers import Task

FRAMES = 100
ERROR = Measured("error", "error", "m")
TINY = replace(report.QUICK, frames=61, atlas_seconds=0.1, iterations=(10,), substeps=((20, 2),))


def recording(scene: str, series: dict[str, Any] | None = None, **summary: Any) -> Recording:
    """A quiet run, some of whose figures and series are given."""
    built = scenes.build(scene)
    figures = dict.fromkeys(KEYS, 0.0) | {"frames": FRAMES, "finite": True, "collapsed_at_frame": None}
    frames = {name: np.zeros(FRAMES) for name in (*SERIES, *built.quantities, *built.motions)} | (series or {})
    return Recording(figures | summary, frames, {}, np.zeros(0), np.zeros((0, 1, 7)), np.zeros(0), built)


def result(method: str, milliseconds: float, error: float | None, preset: str | None = None, scene: str = "stack",
           **summary: Any) -> Result:  # fmt: skip
    figures = {"error": error, "solver_ms_median": milliseconds, **summary}
    return Result(Request(scene, method, 10, preset), recording(scene, **figures))


# ---- Work and precision ------------------------------------------------------------------------------------------


def comparison() -> Comparison:
    return Comparison(
        "stack",
        [
            result("pj", 1.0, 1e-2, "default"),
            result("pj", 4.0, 1e-4, "default"),
            result("pj", 3.0, 1e-1, "paper"),
            result("tj", 1.0, 1.0, "paper", finite=False),
            result("stock", 2.0, 1e-3),
            result("dantzig", 9.0, 1e-3),
            Result(Request("stack", "nncg", 10), error="given up after 1 s", stopped=True),
        ],
        FRAMES,
    )


def test_the_front_is_what_nothing_beats_and_losers_are_named() -> None:
    found = error_time.points(comparison(), ERROR)
    front = error_time.pareto(found)
    assert [(p.milliseconds, p.error) for p in front] == [(1.0, 1e-2), (2.0, 1e-3), (4.0, 1e-4)]
    sentences = work_precision.standing(found)
    assert sentences == [
        "On the Pareto front: PJ, default; stock PGS.",
        "Lose to one of Bullet's own at every setting: PJ, paper.",
        "Fail at every setting: TJ, paper.",
    ]
    stock = [p for p in found if p.result.request.method == "stock"]
    losers = [p for p in found if p.result.request.preset == "paper"]
    assert "Bullet's own are ahead throughout." in work_precision.standing(stock + losers)


def test_beating_needs_to_be_better_in_one_and_worse_in_none() -> None:
    points = [error_time.Point(result("pj", 1.0, 1.0), ms, error) for ms, error in ((1.0, 1.0), (1.0, 2.0), (2.0, 0.5))]
    first, worse, other = points
    assert work_precision.beats(first, worse) and not work_precision.beats(worse, first)
    assert not work_precision.beats(first, first)
    assert not work_precision.beats(first, other) and not work_precision.beats(other, first)
    fallen = error_time.Point(result("pj", 1.0, 1.0), 1.0, None)
    assert work_precision.beats(first, fallen) and not work_precision.beats(fallen, worse)


def test_errors_below_the_floor_are_alike_and_bodies_that_flew_stand_apart() -> None:
    flown = replace(result("tj", 0.5, 1e15, "paper"), exploded=True)
    runs = [result("pj", 1.0, 1e-8, "default"), result("stock", 2.0, 1e-9), flown]
    drawn = work_precision.work_precision(Comparison("hub", runs, FRAMES), ERROR, {})
    rows = list(csv.DictReader(io.StringIO(drawn.csv)))
    assert [row["pareto"] for row in rows] == ["1", "0", "0"]
    assert [row["failed"] for row in rows] == ["0", "0", "1"]
    assert "Fail at every setting: TJ, paper." in drawn.notes
    assert any("count as alike" in note for note in drawn.notes)


def test_a_chart_names_its_front_its_frames_and_what_is_missing() -> None:
    drawn = work_precision.work_precision(comparison(), ERROR, {"layers": 5}, "a machine")
    written = " ".join(text.strip() for text in ElementTree.fromstring(drawn.svg).itertext() if text.strip())
    for words in (
        "100 frames",
        "layers 5",
        "PJ 10",
        "Lose to one of Bullet's own",
        "Out of time",
        "NNCG 10",
        "a machine",
    ):
        assert words in written
    assert drawn.png.startswith(b"\x89PNG")
    rows = list(csv.DictReader(io.StringIO(drawn.csv)))
    assert len(rows) == len(comparison().results)
    assert [row["pareto"] for row in rows] == ["1", "1", "0", "0", "1", "0", "0"]
    assert [row["failed"] for row in rows] == ["0", "0", "0", "1", "0", "0", "1"]


# ---- Performance profiles ----------------------------------------------------------------------------------------


def test_profiles_of_three_solvers_on_four_problems() -> None:
    inf = math.inf
    costs = {"a": [1.0, 2.0, inf, inf], "b": [2.0, 1.0, 8.0, inf], "c": [inf, inf, 4.0, inf]}
    assert profiles.ratios(costs) == {"a": [1, 2, inf, inf], "b": [2, 1, 2, inf], "c": [inf, inf, 1, inf]}
    # The last problem, which none solves, counts: no profile comes to more than three quarters.
    assert profiles.profile(costs) == {
        "a": [(1.0, 0.25), (2.0, 0.5)],
        "b": [(1.0, 0.25), (2.0, 0.75)],
        "c": [(1.0, 0.25)],
    }
    assert profiles.profile({"a": [inf]}) == {"a": []}


def test_a_profile_takes_the_quickest_setting_that_meets_the_tolerance() -> None:
    runs = Comparison(
        "stack",
        [
            result("pj", 1.0, 0.5, "default"),
            result("pj", 3.0, 0.01, "default"),
            result("pj", 5.0, 0.001, "default"),
            result("stock", 1.0, 0.001, collapsed_at_frame=70),
        ],
    )
    assert profiles.costs([runs], {"stack": 0.2}, 0.1) == {"PJ, default": [3.0], "stock PGS": [math.inf]}
    drawn = profiles.profiles([runs], {"stack": (0.2, "size of a body")}, "Frames: stack 100.")
    assert any("stack" in note and "met by none" in note for note in drawn.notes)
    assert "Frames: stack 100." in drawn.svg


# ---- Auto --------------------------------------------------------------------------------------------------------


def chosen(milliseconds: float, error: float | None, tolerance: float, **summary: Any) -> Result:
    run = result("auto", milliseconds, error, "default", **summary)
    return replace(run, request=replace(run.request, changes=(("tolerance", tolerance),)))


def test_auto_stands_beside_the_quickest_setting_with_no_more_error() -> None:
    runs = [
        result("pj", 1.0, 1e-2, "default"),
        result("tj", 2.0, 1e-3, "paper"),
        result("tj", 0.1, 1e-9, "paper", collapsed_at_frame=70),
        result("stock", 0.1, 1e-9),
        chosen(3.0, 5e-4, 1e-4),
        chosen(3.0, 5e-3, 1e-3),
        chosen(1.2, 1e-2, 1e-2),
        chosen(0.5, None, 1e-1, finite=False),
    ]
    found = auto.beside(Comparison("stack", runs, FRAMES))
    assert [one.tolerance for one in found] == [1e-1, 1e-2, 1e-3, 1e-4]
    assert [one.ratio for one in found] == [math.inf, pytest.approx(1.2), pytest.approx(1.5), 0.0]
    assert [one.best for one in found] == [None, runs[0], runs[1], None]
    assert auto.typical(found) == pytest.approx(1.35)


def test_the_chart_of_auto_counts_scenes_and_runs() -> None:
    near = [result("pj", 1.0, 1e-2, "default"), chosen(1.2, 1e-2, 1e-2), chosen(1.8, 1e-2, 1e-3)]
    far = [result("pj", 1.0, 1e-2, "default"), chosen(1.4, 1e-2, 1e-2), chosen(4.0, 1e-2, 1e-3)]
    lost = [result("pj", 1.0, 1e-2, "default"), chosen(1.4, 1e-2, 1e-2), chosen(4.0, None, 1e-3, finite=False)]
    shown = [Comparison(scene, runs, FRAMES) for scene, runs in (("hub", far), ("pile", lost), ("stack", near))]
    drawn = auto.auto([*shown, Comparison("column", near[:1], FRAMES)])
    assert "1 of 3 scenes by the median over the tolerances, 3 of 6 runs" in drawn.notes[0]
    assert drawn.notes[1:3] == ["Farther: hub (×2.7).", "Fails at half of the tolerances or more: pile."]
    rows = list(csv.DictReader(io.StringIO(drawn.csv)))
    assert [row["scene"] for row in rows] == ["stack"] * 2 + ["hub"] * 2 + ["pile"] * 2
    assert [row["ratio"] for row in rows] == ["1.2", "1.8", "1.4", "4", "1.4", "inf"]


def test_cairn_and_bullet_each_take_their_quickest_setting_that_meets_a_tolerance() -> None:
    runs = [
        result("pj", 1.0, 1e-2, "default"),
        result("tj", 4.0, 1e-4, "default"),
        result("tj", 0.1, 1e-9, "paper", collapsed_at_frame=70),
        result("stock", 2.0, 1e-3),
        result("dantzig", 8.0, 1e-5),
    ]
    found = beside_bullet.pairs(Comparison("stack", runs, FRAMES), 0.1)
    assert [(p.ours, p.bullets, p.ratio) for p in found] == [
        (runs[0], runs[3], 0.5),
        (runs[1], runs[3], 2.0),
        (runs[1], runs[4], 0.5),
    ]
    nobody, ours, bullets = (
        beside_bullet.pairs(Comparison(scene, some, FRAMES), 0.1)
        for scene, some in (("pile", []), ("column", runs[:3]), ("hub", runs[3:]))
    )
    assert math.isnan(nobody[0].ratio) and ours[0].ratio == 0.0 and bullets[0].ratio == math.inf


def test_the_chart_beside_bullet_says_where_cairn_loses() -> None:
    scenes_and_runs = {
        "stack": [result("pj", 1.0, 1e-9, "default"), result("stock", 2.0, 1e-9)],
        "hub": [result("pj", 3.0, 1e-9, "default"), result("stock", 1.0, 1e-9)],
        "pile": [result("stock", 1.0, 1e-9)],
        "column": [result("pj", 3.0, None, "default", finite=False)],
    }
    shown = [Comparison(scene, runs, FRAMES) for scene, runs in scenes_and_runs.items()]
    drawn = beside_bullet.beside_bullet(shown, dict.fromkeys(scenes_and_runs, (0.1, "size")))
    assert drawn.notes[0] == (
        "At 0.1 of the scale: Cairn quicker in 1, alone in 0, Bullet quicker in 1 (hub ×3), alone in 1 (pile), "
        "neither in 1 (column)."
    )
    rows = list(csv.DictReader(io.StringIO(drawn.csv)))
    assert [row["scene"] for row in rows[::3]] == ["stack", "column", "hub", "pile"]


# ---- Outcomes and the atlas --------------------------------------------------------------------------------------


def rising(value: float, from_frame: int) -> np.ndarray[Any, Any]:
    series = np.zeros(FRAMES)
    series[from_frame - 1 :] = value
    return series


@pytest.mark.parametrize(
    ("run", "state", "kind", "frame"),
    [
        (recording("column"), SURVIVED, "", None),
        (recording("column", max_drift_m=0.2), DEGRADED, "", None),
        (recording("column", settling_m=0.2), DEGRADED, "", None),
        (recording("column", max_drift_m=2.0, collapsed_at_frame=80), FAILED, COLLAPSED, 80),
        (recording("column", settling_m=0.6), FAILED, COLLAPSED, 60),
        (recording("column", max_drift_m=None, settling_m=None), UNKNOWN, "", None),
        (recording("column", finite=False, frames=41), FAILED, NAN, 42),
        (recording("column", {"max_speed_m_s": rising(500.0, 30)}, collapsed_at_frame=80), FAILED, EXPLODED, 30),
        (recording("heavy-pendulum", max_joint_error_m=0.3), DEGRADED, "", None),
        (recording("heavy-pendulum", {"max_speed_m_s": rising(500.0, 30)}, energy_change_J=9.0), FAILED, EXPLODED, 30),
        (recording("heavy-pendulum", {"max_speed_m_s": rising(500.0, 30)}, energy_change_J=-9.0), SURVIVED, "", None),
        (
            recording("heavy-pendulum", {"max_joint_error_m": rising(0.6, 12)}, max_joint_error_m=0.6),
            FAILED, COLLAPSED, 12,
        ),
        (recording("overlap", max_separation_speed_m_s=3.0), SURVIVED, "", None),
        (recording("rolling", {"velocity_error_m_s": rising(0.02, 5)}), SURVIVED, "", None),
        (recording("rolling", {"velocity_error_m_s": rising(0.2, 5)}), DEGRADED, "", None),
        (recording("rolling", {"velocity_error_m_s": rising(0.4, 5)}), FAILED, COLLAPSED, 5),
        (recording("card-house", {"top_sinks_m": rising(0.06, 40)}), FAILED, COLLAPSED, 40),
        (
            recording("overlap", {"separation_speed_m_s": rising(7.0, 3)}, max_separation_speed_m_s=7.0),
            FAILED, EXPLODED, 3,
        ),
    ],
)  # fmt: skip
def test_the_first_failure_decides(run: Recording, state: str, kind: str, frame: int | None) -> None:
    assert report_outcome.outcome(run) == report_outcome.Outcome(state, kind, frame)


@pytest.mark.parametrize("scene", list(scenes.SCENES))
def test_what_no_scene_can_make_has_exploded(scene: str) -> None:
    """The speeds that a scene starts with, and those of a fall through it, are none of it."""
    built = scenes.build(scene)
    given = max(float(np.linalg.norm(body.linear_velocity)) for body in built.bodies)
    assert not report_outcome.exploded(recording(scene, max_speed_m_s=given))
    assert report_outcome.exploded(recording(scene, max_speed_m_s=1e3))
    whipped = recording(scene, max_speed_m_s=1e3, energy_change_J=-1.0)  # the free end of a chain may be that fast
    assert report_outcome.exploded(whipped) == (not built.joints)


def test_errors_are_the_scenes_own_quantity() -> None:
    assert report_outcome.error_of(recording("stack", max_drift_m=0.25)) == 0.25
    assert report_outcome.error_of(recording("tumble", energy_change_J=-3.0)) == 3.0
    assert report_outcome.error_of(recording("mass-ratio", {"sinking_m": rising(0.5, 20)})) == 0.5
    assert math.isnan(report_outcome.error_of(recording("stack", max_drift_m=None)))
    for name in scenes.SCENES:
        built = scenes.build(name, **report.QUICK.sizes.get(name, {}))
        value, _ = report_outcome.scale(built)
        assert value > 0 and report_outcome.measured(built).unit != "1", name


def test_a_map_shows_every_cell_with_its_failure() -> None:
    cells = {(0, 0): atlas.Cell(SURVIVED), (0, 1): atlas.Cell(FAILED, NAN, 7), (1, 0): atlas.Cell(DEGRADED)}
    shown = atlas.Map(
        "column", "a map", "boxes", "sweeps", ["5", "9"], ["10", "20"], {"PJ": cells, "TJ": cells}, ["why"]
    )
    drawn = atlas.atlas(shown)
    assert drawn.svg.count(">NaN<") == 2 and drawn.svg.count(">7<") == 2
    assert "PJ 1 of 3" in drawn.svg and "why" in drawn.svg
    rows = list(csv.DictReader(io.StringIO(drawn.csv)))
    assert len(rows) == 6
    assert rows[1] == {"panel": "PJ", "sweeps": "10", "boxes": "9", "state": FAILED, "kind": NAN, "frame": "7"}


# ---- The paper ---------------------------------------------------------------------------------------------------


def test_the_paper_is_set_beside_our_runs() -> None:
    """Made-up runs in which soft is gentler and PJNJ the slowest, as the paper has it; the bridge as it has it not."""
    times = {"pj": 1.0, "pjsoft": 1.1, "tj": 2.0, "tjsoft": 2.1, "pjnj": 9.0}
    comparisons: dict[str, Comparison] = {}
    built: dict[str, scenes.Scene] = {}
    stood: dict[str, dict[str, bool]] = {}
    for scene in ("stack", "chain", "overlap", "jeep-bridge"):
        gaps = {"pj": 0.1, "pjnj": 0.05, "pjsoft": 0.02, "tj": 0.02, "tjsoft": 0.01}
        runs = [
            result(m, times[m], 0.1, "paper", scene, max_joint_error_m=gaps[m], energy_roughness_J=gaps[m])
            for m in ("pj", "pjnj", "pjsoft", "tj", "tjsoft")
        ]
        if scene in ("stack", "jeep-bridge"):
            comparisons[scene], built[scene] = Comparison(scene, runs, FRAMES), scenes.build(scene)
        stood[scene] = {m: m not in ("pj", "pjnj") for m in times}
    rows = paper.rows(comparisons, built, stood)
    assert [row.item for row in rows] == ["Figure 5"] * 4 + ["Figure 10"] * 2 + ["Table 1", "Table 2"]
    by_claim = {row.theirs: row for row in rows}
    assert by_claim["PJNJ hardly holds the bridge's joints"].answer == "no"
    assert by_claim["PJNJ hardly holds the bridge's joints"].why
    better = by_claim["soft constraints and substeps each hold the joints better than PJ"]
    assert better.answer == "yes" and better.why == "" and "TJSoft 10 mm" in better.ours
    stars, table = rows[-2:]
    assert stars.answer == "yes" and "of 4 scenes stand: TJSoft 4" in stars.ours and "TJSoft ★★★★★" in stars.theirs
    assert table.answer == "yes" and "PJNJ 54.8 ms (×7.73)" in table.theirs and "PJNJ 9 ms (×9.00)" in table.ours
    stands = [row for row in rows if "fall afterwards" in row.theirs]
    assert [row.answer for row in stands] == ["cannot tell"]  # too few frames
    assert "cannot be told" in paper.summary(rows)
    lines = list(csv.DictReader(io.StringIO(paper.as_csv(rows))))
    assert len(lines) == len(rows) and lines[0]["item"] == "Figure 5"


def test_what_claims_need_is_kept_without_the_series(tmp_path: Path) -> None:
    """Of a real run: the same answers from what the cache keeps as from the recording."""
    task = Task(Request("tumble", "tj", 20, "paper", 4), 80)
    (real,) = [workers.perform(task)]
    assert real.recording is not None
    kept = report_cache.entry(task, real, "")
    report_cache.save(tmp_path, kept)
    back = report_cache.load(tmp_path, task)
    assert back is not None
    derived = claims.derived(real.recording)
    assert derived["energy_roughness_J"] == claims._roughness(real) == claims._roughness(back.result)
    assert {key: back.result.number(key) for key in derived} == derived


# ---- Ablations ---------------------------------------------------------------------------------------------------


def test_an_effect_is_a_ratio_unless_a_run_fails() -> None:
    base, worse = result("tjsoft", 2.0, 1e-3, "default"), result("tjsoft", 1.0, 1e-1, "default")
    fallen = result("tjsoft", 1.0, 1.0, "default", collapsed_at_frame=70)
    found = ablation.effect(base, worse)
    assert found.error == pytest.approx(100) and (found.time, found.text) == (0.5, "×100\nt 0.5")
    assert ablation.effect(worse, base).colour != found.colour != ablation.effect(base, base).colour
    assert ablation.effect(base, fallen).text == "fails" and ablation.effect(fallen, fallen).text == "both fail"
    assert ablation.effect(fallen, base).text == "holds\nt 2"
    exact = result("tjsoft", 2.0, 0.0, "default"), result("tjsoft", 2.0, 1e-9, "default")
    assert ablation.effect(*exact).error == 1.0  # both below the floor


def test_an_ablation_says_what_is_lost() -> None:
    base = {"stack": result("tjsoft", 2.0, 1e-3, "default")}
    changed = {
        "cold": {"stack": result("tjsoft", 2.0, 1.0, "default", collapsed_at_frame=70)},
        "points": {"stack": result("tjsoft", 1.0, 5e-3, "default")},
        "pyramid": {"stack": result("tjsoft", 2.0, 1e-3, "default")},
    }
    drawn = ablation.ablation(ablation.Ablation("ablation", "title", ["stack"], base, changed, ["a note"]), "machine")
    assert drawn.notes == [
        "Makes a scene fail that stands: cold.",
        "Worst growth of an error by 2 or more: points (×5).",
        "No error grows by a tenth: pyramid.",
        "a note",
    ]
    rows = list(csv.DictReader(io.StringIO(drawn.csv)))
    assert [row["option"] for row in rows] == ["cold", "points", "pyramid"]
    assert [row["fails"] for row in rows] == ["1", "0", "0"] and rows[1]["error_ratio"] == "5"
    assert "both fail" not in drawn.svg and ">fails<" in drawn.svg


def test_ablations_change_one_thing_each() -> None:
    assert report_plan.ablations(TINY, ["tumble"]) == []
    for plan in report_plan.ablations(TINY, ["stack", "overlap"]):
        assert list(plan.base) == ["stack", "overlap"]
        base = plan.base["stack"]
        for option, tasks in plan.changed.items():
            request, task = tasks["stack"].request, base.request
            options = [name for name, _ in request.changes[len(task.changes) :]]
            moved = (request.method != task.method, request.preset != task.preset, request.substeps != task.substeps)
            assert request.iterations == task.iterations
            assert len(options) == 2 if "damping" in option else len(options) + max(sum(moved), 0) in (1, 2), option
            assert report_cache.path_of(Path(), tasks["stack"]) != report_cache.path_of(Path(), base), option


# ---- The cache ---------------------------------------------------------------------------------------------------

TASK = Task(Request("tumble", "pj", 10, "default"), FRAMES)


def test_a_kept_run_comes_back_as_it_was(tmp_path: Path) -> None:
    entry = report_cache.entry(TASK, Result(TASK.request, recording("tumble", energy_change_J=-2.0)), "alone")
    report_cache.save(tmp_path, entry)
    back = report_cache.load(tmp_path, TASK)
    assert back is not None and back.outcome == entry.outcome and back.conditions == "alone"
    assert back.result.summary == entry.result.summary and back.result.number("error") == 2.0
    assert [path.suffix for path in tmp_path.iterdir()] == [".json"]
    for other in (
        replace(TASK, frames=FRAMES + 1),
        replace(TASK, request=replace(TASK.request, iterations=11)),
        replace(TASK, request=replace(TASK.request, changes=(("speed", 4.0),))),
        replace(TASK, request=replace(TASK.request, changes=(("splitting", "point"),))),
        replace(TASK, request=replace(TASK.request, dt=0.01)),
    ):
        assert report_cache.load(tmp_path, other) is None


def test_what_a_scene_does_not_tolerate_has_failed_for_the_charts_too(tmp_path: Path) -> None:
    task = Task(Request("arch", "pj", 10, "default"), FRAMES)
    for moved, failed in ((0.2, False), (0.4, True)):
        entry = report_cache.entry(
            task, Result(task.request, recording("arch", {"key_stone_moves_m": rising(moved, 9)})), ""
        )
        report_cache.save(tmp_path, entry)
        back = report_cache.load(tmp_path, task)
        assert back is not None and entry.result.failed == back.result.failed == failed


def test_another_build_is_another_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    report_cache.save(tmp_path, report_cache.entry(TASK, Result(TASK.request, recording("tumble")), ""))
    monkeypatch.setattr(report_cache, "build_text", lambda: "commit 2")
    assert report_cache.load(tmp_path, TASK) is None


def test_broken_files_and_runs_without_result_are_run_again(tmp_path: Path) -> None:
    report_cache.save(tmp_path, report_cache.entry(TASK, Result(TASK.request, error="SIGKILL"), ""))
    assert list(tmp_path.iterdir()) == []
    report_cache.save(tmp_path, report_cache.entry(TASK, Result(TASK.request, error="late", stopped=True), ""))
    (kept,) = tmp_path.iterdir()
    back = report_cache.load(tmp_path, TASK)
    assert back is not None and back.result.stopped and back.result.error == "late"
    kept.write_text(kept.read_text()[:40])
    assert report_cache.load(tmp_path, TASK) is None


# ---- Runs --------------------------------------------------------------------------------------------------------


def test_a_run_whose_time_is_up_says_so() -> None:
    slow = Task(Request("tumble", "pj", 10, "default"), 1_000_000, limit_s=0.2)
    with workers.Pool(1) as pool:
        (given_up,) = pool.run([slow], lambda request, frames: None)
    assert given_up.stopped and "of 1000000" in given_up.error


def test_every_scene_runs_in_another_process() -> None:
    tasks = [replace(report_plan.work_precision(TINY, scene)[0], frames=2) for scene in scenes.SCENES]
    with workers.Pool(1) as pool:
        results = pool.run(tasks, lambda request, frames: None)
    assert [r.error for r in results] == [""] * len(scenes.SCENES)
    assert all(r.recording is not None and r.recording.scene.name == r.request.scene for r in results)


def test_one_run_serves_all_who_ask_for_it_in_other_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    same = replace(TASK, request=replace(TASK.request, dt=0.016, changes=(("speed", 5.0),)))
    other = replace(TASK, request=replace(TASK.request, iterations=11))
    found = report.run([TASK, same, other], tmp_path, jobs=1)
    assert "2 runs" in capsys.readouterr().out
    assert len(list(tmp_path.iterdir())) == 2
    assert [found[task].result.request for task in (TASK, same, other)] == [TASK.request, same.request, other.request]
    assert found[TASK].result.summary == found[same].result.summary


def test_a_scheduler_runs_what_this_machine_would(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    tasks = [
        replace(TASK, frames=20),
        replace(TASK, frames=20, request=replace(TASK.request, method="stock", preset=None)),
    ]
    slow = Task(Request("tumble", "pj", 10, "default"), 1_000_000, limit_s=0.2)
    broken = Task(Request("tumble", "pj", 10, "nowhere"), 20)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of libraries below
        with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as local:
            address = local.scheduler_address
            found = report.run(tasks, tmp_path / "cluster", jobs=1, scheduler=address)
            with cluster.Cluster(address) as pool:
                told: list[int] = []
                late, wrong = pool.run([slow, broken], lambda request, frames: told.append(frames))
            monkeypatch.setattr(cluster, "info", lambda: {"build": "another"})
            with pytest.raises(ValueError, match="runs another build of cairn"):
                cluster.Cluster(address)
            monkeypatch.undo()
    here = report.run(tasks, tmp_path / "here", jobs=1)
    for task in tasks:
        assert found[task].result.summary["state_hash"] == here[task].result.summary["state_hash"]
        assert "a Dask cluster of 1 threads" in found[task].conditions
    assert late.stopped and "of 1000000" in late.error and "nowhere" in wrong.error and sorted(told) == [20, 1_000_000]


def test_without_distributed_a_scheduler_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    arguments = ["report", str(tmp_path), "--quick", "--scenes", "tumble", "--scheduler", "tcp://127.0.0.1:1"]
    assert cli.main(arguments) == 1
    assert "--scheduler needs dask.distributed" in capsys.readouterr().err
    assert cli.main([*arguments, "--jobs", "2"]) == 2


SCRIPT = """
import sys
from dataclasses import replace
from pathlib import Path
from cairn import report
if __name__ == "__main__":
    plan = replace(report.QUICK, frames=61, atlas_seconds=0.1, iterations=(10,), substeps=((20, 2),))
    report.report(Path(sys.argv[1]), plan, ["tumble", "mass-ratio"], jobs=1)
"""


def test_a_report_that_is_killed_goes_on_where_it_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    out = tmp_path / "out"
    with subprocess.Popen([sys.executable, str(script), str(out)], stdout=subprocess.DEVNULL) as program:
        for _ in range(1000):
            if len(list((out / "cache").glob("*.json"))) >= 3:
                break
            time.sleep(0.03)
        program.kill()
    kept = {path: path.stat().st_mtime_ns for path in (out / "cache").glob("*.json")}
    total = 2 * len(report_plan.work_precision(TINY, "tumble"))
    assert len(kept) >= 3 and not (out / "index.html").exists()

    page = report.report(out, TINY, ["tumble", "mass-ratio"], jobs=1)
    assert f"{total} runs, {len(kept)} of them kept" in capsys.readouterr().out
    assert all(path.stat().st_mtime_ns == then for path, then in kept.items())
    assert len(list((out / "cache").glob("*.json"))) == total
    report.report(out, TINY, ["tumble", "mass-ratio"], jobs=1)
    assert f"{total} runs, {total} of them kept" in capsys.readouterr().out

    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == 5 and "61 frames of each scene" in text
    loaded = re.findall(r'\b(?:src|href|srcset|data|action|poster)\s*=\s*["\']?([^"\'\s>]+)', text)
    beside = {target for target in loaded if not target.startswith("#")}
    assert beside == {path.name for path in out.glob("failures-*.html")}
    assert not re.search(r"@import|url\((?!#)|\bfetch\(|XMLHttpRequest|\bimport\(", text)
    names = {path.name for path in out.iterdir()}
    for chart in ("work-precision-tumble", "work-precision-mass-ratio", "profiles", "beside-bullet", "auto"):
        assert {f"{chart}.png", f"{chart}.csv"} <= names and f'id="{chart}"' in text


def test_a_report_has_the_maps_of_its_scenes(tmp_path: Path) -> None:
    page = report.report(tmp_path, TINY, ["overlap"], jobs=2).read_text(encoding="utf-8")
    assert 'id="atlas-overlap"' in page and 'id="atlas-column"' not in page
    rows = list(csv.DictReader(io.StringIO((tmp_path / "atlas-overlap.csv").read_text())))
    assert len(rows) == 15 * 5 and {row["state"] for row in rows} <= {SURVIVED, DEGRADED, FAILED}
    assert "61 frames" in page and "NaN: a number not finite" in page


def failed(method: str, iterations: int, preset: str | None, frame: int, scene: str = "tumble") -> report_cache.Entry:
    task = Task(Request(scene, method, iterations, preset), FRAMES)
    outcome = report_outcome.Outcome(FAILED, EXPLODED, frame)
    return report_cache.Entry(task, Result(task.request, recording(scene)), outcome, "")


def test_of_what_failed_each_family_shows_its_best_run() -> None:
    sound = replace(failed("tj", 300, "default", 3), outcome=report_outcome.Outcome(SURVIVED))
    late = failed("pjnj", 10, "default", report_failures.LONGEST + 1)
    entries = [failed("pj", 10, "paper", 9), failed("pj", 40, "paper", 20), sound, late, failed("stock", 10, None, 5)]
    found = [(e.task.request.method, e.task.request.iterations) for e in report_failures.chosen(entries)]
    assert found == [("stock", 10), ("pj", 40)]


def test_failures_are_replayed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    groups = [[failed("pj", 10, "paper", 9), failed("tj", 10, "paper", 2)], []]
    (shown,) = report_failures.write(tmp_path, groups, 1)
    assert (shown.scene, shown.file, len(shown.takes)) == ("tumble", "failures-tumble.html", 2)
    page = (tmp_path / shown.file).read_text(encoding="utf-8")
    assert "__VISER_EMBED_DATA__" in page
    monkeypatch.setattr(demo, "run_with_bar", None)  # or it would be called
    assert report_failures.write(tmp_path, groups, 1) == [shown]


def test_frames_are_told_once_where_they_are_the_same() -> None:
    assert report._frames({"a": 5, "b": 5}) == "5 frames of each scene."
    assert report._frames({"a": 5, "b": 3, "c": 4}) == "5 frames of each scene, but of b 3, c 4."


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--scenes", "nowhere"], "no scene is called 'nowhere'"),
        (["--scenes", ","], "--scenes names none"),
        (["--frames", "60"], "60 frames are too few"),
    ],
)
def test_the_command_refuses_what_cannot_be(
    arguments: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["report", str(tmp_path / "out"), "--quick", *arguments]) == 2
    assert text in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_plan_has_the_scenes_frames_unless_they_are_too_many() -> None:
    assert [report.FULL.frames_of(scene) for scene in ("stack", "jeep-bridge", "kapla")] == [1500, 600, 1500]
    assert report.QUICK.frames_of("kapla") == 200


def test_too_few_frames_are_refused() -> None:
    with pytest.raises(ValueError, match="60 frames are too few"):
        replace(report.QUICK, frames=60)
    with pytest.raises(ValueError, match="no scene is called 'nowhere'"):
        report.report(Path("nowhere"), TINY, ["nowhere"])
