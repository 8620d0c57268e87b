"""Charts, verdicts, replays and the report, on recordings made up here whose contents are known."""

from __future__ import annotations

import base64
import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec  # viser's, as zstandard is
import numpy as np
import pytest
import zstandard

from cairn import charts, demo, replay, scenes, workers
from cairn.charts import claims, error_time, report, scaling, verdict
from cairn.charts.frames import buckets
from cairn.charts.result import METHODS, NAMES, PRESETS, Comparison, Request, Result
from cairn.recording import SERIES, Recording
from cairn.summary import KEYS

FRAMES = 200
EVERY = 20


def recording(request: Request, **summary: Any) -> Recording:
    """A run whose bodies stay where they start; summary overrides its figures."""
    scene = scenes.build(request.scene)
    start = np.hstack([scene.start_positions, scene.start_orientations])
    figures = dict.fromkeys(KEYS, 0.01) | {
        "scene": request.scene, "method": request.method, "preset": request.preset, "iterations": request.iterations,
        "substeps": request.substeps, "frames": FRAMES, "dt": scene.dt, "finite": True, "collapsed_at_frame": None,
        "state_hash": "0", "build": "a compiler", "solver_ms_median": 0.01 * request.iterations,
    }  # fmt: skip
    sweeps = request.iterations // request.substeps
    return Recording(
        summary=figures | summary,
        frames={name: np.full(FRAMES, 0.01) for name in SERIES},
        stage_ms={"pack": 0.1, "build": 0.2, "sweep": 3.0, "position": 0.0, "integrate": 0.1, "finish": 0.1},
        residual_trace=np.tile(np.geomspace(1.0, 1e-3, sweeps), request.substeps),
        poses=np.tile(start, (FRAMES // EVERY + 1, 1, 1)),
        pose_frames=np.arange(0.0, FRAMES + 1, EVERY),
        scene=scene,
    )


def comparison(scene: str, **by_method: dict[str, Any]) -> Comparison:
    """All runs of the demo; by_method overrides summaries of the paper preset's runs."""
    results = []
    for request in demo.requests(scene):
        figures = by_method.get(request.method, {}) if request.preset == "paper" else {}
        results.append(Result(request, recording(request, **figures)))
    return Comparison(scene, results, FRAMES)


def texts(svg: str) -> list[str]:
    """What is written in a chart; that it parses is the check that it is a valid file."""
    root = ElementTree.fromstring(svg)
    assert root.tag.endswith("svg")
    return ["".join(node.itertext()) for node in root.iter() if node.tag.endswith("}text")]


def colours_drawn(svg: str) -> set[str]:
    return {found.lower() for found in re.findall(r"#[0-9a-fA-F]{6}", svg)}


@pytest.mark.parametrize(
    ("chart", "scene"),
    [("energy", "stack"), ("error", "chain"), ("residual", "overlap"), ("time", "stack")],
)
def test_a_chart_draws_every_method_in_its_colour(chart: str, scene: str) -> None:
    runs = comparison(scene)
    svg = {
        "energy": lambda: charts.energy_change(runs),
        "error": lambda: charts.constraint_error(runs, charts.JOINT_ERROR),
        "residual": lambda: charts.residual_trace(runs, 1),
        "time": lambda: charts.error_against_time(runs, verdict.DRIFT),
    }[chart]()
    wanted = {charts.style.COLOURS[method].lower() for method in METHODS}
    assert wanted <= colours_drawn(svg)
    for method in METHODS:
        assert any(NAMES[method] in text for text in texts(svg)), method


def test_curves_are_named_once_in_each_panel() -> None:
    svg = charts.constraint_error(comparison("chain"), charts.JOINT_ERROR, "the footnote")
    written = texts(svg)
    for method in METHODS:
        assert written.count(NAMES[method]) == len(PRESETS)
    assert written.count(NAMES["stock"]) == len(PRESETS)
    assert "the footnote" in written
    assert any("[m]" in text for text in written)  # the unit on the axis


def test_charts_take_the_pages_colours() -> None:
    svg = charts.energy_change(comparison("stack"))
    assert "currentColor" in svg
    assert charts.style.INK not in svg
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", svg)


def test_the_time_split_names_stages_and_totals() -> None:
    written = texts(charts.time_split([comparison("stack"), comparison("overlap")]))
    assert {"pack", "build", "sweep", "position", "integrate", "finish"} <= set(written)
    assert sum("3.5 ms" in text for text in written) == 2 * len(METHODS) * len(PRESETS)


def test_buckets_keep_the_extremes_and_leave_out_what_is_not_finite() -> None:
    values = np.zeros(5000)
    values[1234], values[4321], values[17] = 7.0, -3.0, np.nan
    frame, low, high = buckets(values)
    assert len(frame) < 1000
    assert (np.nanmax(high), np.nanmin(low)) == (7.0, -3.0)
    assert abs(frame[np.nanargmax(high)] - 1235) < 5000 / len(frame)


def test_failed_runs_stand_apart_and_off_the_pareto_front() -> None:
    runs = comparison("stack", pj={"collapsed_at_frame": 70}, tj={"finite": False})
    found = error_time.points(runs, verdict.DRIFT)
    failed = {p.result.request.label for p in found if p.error is None}
    assert failed == {"PJ 300, paper", "TJ 10×30, paper"}
    assert not failed & {p.result.request.label for p in charts.pareto(found)}
    assert "failed" in texts(charts.error_against_time(runs, verdict.DRIFT))


def test_the_pareto_front_is_what_none_beats() -> None:
    request = Request("stack", "pj", 300, "default")

    def point(milliseconds: float, error: float | None) -> error_time.Point:
        return error_time.Point(Result(request), milliseconds, error)

    found = [point(3, 1), point(1, 5), point(2, 6), point(4, 1), point(2, 3), point(0.5, None)]
    assert [(p.milliseconds, p.error) for p in charts.pareto(found)] == [(1, 5), (2, 3), (3, 1)]


def test_the_timing_table_has_the_papers_figures_beside_ours() -> None:
    rows = {row.method: row for row in charts.timing_table([comparison("chain", pj={"solver_ms_median": 1.5})])}
    assert list(rows) == list(METHODS)
    assert (rows["pj"].by_preset["paper"], rows["pj"].published) == (1.5, 7.2128)
    missing = Comparison("chain", [Result(Request("chain", "pj", 300, "paper"), error="gone")])
    assert np.isnan(charts.timing_table([missing])[0].by_preset["paper"])


def test_times_of_runs_that_flew_apart_are_marked_and_settle_nothing() -> None:
    runs = comparison("stack", tj={"rows": 0.001})
    assert [row.scattered for row in charts.timing_table([runs]) if row.method == "tj"] == [("paper",)]
    assert any("†" in text for text in texts(charts.time_split([runs])))
    (answer,) = [answer for claim, answer in answers(runs).items() if "quickest" in claim]
    assert answer == claims.UNKNOWN


@pytest.mark.parametrize(
    ("scene", "figures", "good", "word"),
    [
        ("stack", {}, True, "stands"),
        ("stack", {"collapsed_at_frame": 2100}, False, "falls, frame 2100"),
        ("chain", {"max_joint_error_m": 0.049}, True, "holds"),
        ("chain", {"max_joint_error_m": 0.051}, False, "comes apart"),
        ("chain", {"finite": False, "frames": 9}, False, "numbers blow up at frame 9"),
        ("overlap", {"max_separation_speed_m_s": 2.9}, True, "parts gently"),
        ("overlap", {"max_separation_speed_m_s": 3.2}, False, "flies apart"),
    ],
)
def test_verdicts_follow_their_rule(scene: str, figures: dict[str, Any], good: bool, word: str) -> None:
    request = Request(scene, "pj", 300, "paper")
    judged = verdict.judge(scenes.build(scene), Result(request, recording(request, **figures)))
    assert (judged.good, judged.text) == (good, word)


def test_a_run_without_a_recording_says_why() -> None:
    judged = verdict.judge(scenes.build("stack"), Result(Request("stack", "pj", 300), error="its process ended"))
    assert (judged.good, judged.text) == (False, "did not run: its process ended")


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0123, "m", "12.3 mm"),
        (-4.5e-6, "J", "−4.5 µJ"),
        (2500, "J", "2.5 kJ"),
        (2.5, "m/s", "2.5 m/s"),
        (np.nan, "m", "–"),
    ],
)
def test_numbers_keep_short(value: float, unit: str, text: str) -> None:
    assert verdict.number(value, unit) == text


def answers(runs: Comparison, fall: int = FRAMES) -> dict[str, str]:
    found = claims.claims({runs.scene: replace(runs, frames=fall)}, {runs.scene: scenes.build(runs.scene)})
    return {claim.claim: claim.answer for claim in found}


def test_claims_about_the_stack_follow_the_data() -> None:
    late, early = {"collapsed_at_frame": 2345}, {"collapsed_at_frame": 345}
    (fall,) = [c for c in answers(comparison("stack")) if "fall afterwards" in c]
    assert answers(comparison("stack", pj=late, tj=late), 3000)[fall] == claims.YES
    assert answers(comparison("stack", pj=late, tj={}), 3000)[fall] == claims.NO
    assert answers(comparison("stack"), 1500)[fall] == claims.UNKNOWN  # too few frames to know
    assert answers(comparison("stack", pj=early), 1500)[fall] == claims.NO  # but an early fall settles it


def test_claims_about_the_chain_follow_the_data() -> None:
    apart, whole = {"max_joint_error_m": 2.0}, {"max_joint_error_m": 0.01}
    failing = dict.fromkeys(("pj", "pjnj", "pjsoft"), apart)
    found = list(answers(comparison("chain", **failing, tj=whole, tjsoft=whole)).values())
    assert found[:2] == [claims.YES, claims.YES]
    found = list(answers(comparison("chain", **(failing | {"pj": whole}), tj=apart, tjsoft=whole)).values())
    assert found[:2] == [claims.NO, claims.NO]


def test_a_claim_without_its_runs_is_unknown() -> None:
    runs = comparison("overlap")
    kept = [r for r in runs.results if r.request.method != "pj"]
    found = answers(Comparison("overlap", kept, FRAMES))
    assert found["PJ overshoots, PJSoft parts the boxes more slowly"] == claims.UNKNOWN


def test_the_residual_claims_count_jumps() -> None:
    found = answers(comparison("overlap"))
    assert found["with substeps the residual jumps up where a substep begins"] == claims.YES
    assert claims._jumps(np.geomspace(1, 1e-3, 300), 10) == (0, 9)


@pytest.fixture(scope="module")
def study() -> report.Study:
    names = ("stack", "chain", "overlap")
    runs = {name: comparison(name) for name in names}
    broken = Result(runs["stack"].results[0].request, error="its process ended with signal SIGSEGV")
    runs["stack"] = replace(runs["stack"], results=[broken, *runs["stack"].results[1:]])
    facts = report.Facts("a machine", "a compiler", "medians", "2026-01-01", "./dev demo")
    windows = {name: report.Window(None, EVERY, 1.0) for name in names}
    return report.Study(runs, {name: scenes.build(name) for name in names}, windows, facts)


@pytest.fixture(scope="module")
def page(study: report.Study) -> str:
    return report.html(study)


def test_the_page_loads_nothing(page: str) -> None:
    loaded = re.findall(r'\b(?:src|href|srcset|data|action|poster)\s*=\s*["\']?([^"\'\s>]+)', page)
    assert [target for target in loaded if not target.startswith("#")] == []
    assert not re.search(r"@import|url\((?!#)|\bfetch\(|XMLHttpRequest|\bimport\(", page)


def test_the_page_has_every_chart_claim_and_failure(page: str) -> None:
    assert page.count("<svg") == 3 * 3 + 1 + 1
    assert "its process ended with signal SIGSEGV" in page
    assert "1 of 75 runs did not finish" in page
    for scene in ("stack", "chain", "overlap"):
        assert f'id="{scene}-replay"' in page
    targets = set(re.findall(r'href="#([\w-]+)"', re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL)))
    assert targets <= set(re.findall(r'id="([\w-]+)"', page))


def test_the_page_holds_one_viewer_for_all_replays(page: str) -> None:
    viewer = re.findall(r'<script type="text/plain" id="viewer">([^<]*)</script>', page)
    assert len(viewer) == 1
    html = base64.b64decode(viewer[0]).decode()
    assert html.count("@DATA@") == 1
    assert "darkMode:false" in html  # what the page's script replaces
    assert len(re.findall(r'<script type="text/plain" id="replay-', page)) == 3 * len(PRESETS)


def test_results_hold_every_run_with_its_summary(study: report.Study) -> None:
    found = json.loads(json.dumps(report.results(study)))
    assert set(found) == {
        "format", "machine", "build", "conditions", "when", "command", "frames", "claims", "runs",
    }  # fmt: skip
    assert found["frames"] == {"stack": FRAMES, "chain": FRAMES, "overlap": FRAMES}
    assert len(found["runs"]) == sum(len(runs.results) for runs in study.comparisons.values())
    for run in found["runs"]:
        assert set(run) == {"label", "request", "error", "verdict", "summary", "stage_ms"}
        assert (run["summary"] is None) == (run["error"] is not None)
        if run["summary"] is not None:
            assert list(run["summary"]) == list(KEYS)


def unpacked(data: str) -> dict[str, Any]:
    """A recorded replay, as viser stores it: a length, then compressed with zstandard a length and msgpack."""
    raw = base64.b64decode(data)
    inner = zstandard.ZstdDecompressor().decompress(raw[8:], max_output_size=int.from_bytes(raw[:8], "little"))
    size = int.from_bytes(inner[:8], "little")
    content: dict[str, Any] = msgspec.msgpack.decode(inner[8 : 8 + size])
    return content


@pytest.mark.parametrize(("scene", "meshes"), [("stack", [125]), ("chain", [50, 1]), ("overlap", [10])])
def test_a_replay_shows_every_body_at_every_sample(scene: str, meshes: list[int]) -> None:
    made = recording(Request(scene, "pj", 300))
    for sample, pose in enumerate(made.poses):
        pose[:, 1] += 0.1 * sample
    made.poses[3:, 1] = np.nan  # a body that is lost stays where it was
    takes = [replay.Take(name, made.scene, made) for name in ("one", "two")]
    content = unpacked(replay.page(takes).data)
    messages = content["messages"]
    shown = [m["props"] for _, m in messages if m["type"] == "BatchedMeshesMessage"]
    sizes = [content["binaryBufferLengths"][props["batched_positions"]["__binary_index"]] for props in shown]
    assert [size / 12 for size in sizes] == 2 * meshes  # three floats a body
    assert [m["props"]["text"] for _, m in messages if m["type"] == "LabelMessage"] == ["one", "two"]
    moments = sorted({time for time, m in messages if m["type"] == "SceneNodeUpdateMessage"})
    np.testing.assert_allclose(moments, made.pose_frames[1:] * made.scene.dt)


def test_a_take_has_one_instance_a_body() -> None:
    scene = scenes.build("chain")
    groups = replay._by_shape(scene)
    assert sorted(index for bodies in groups.values() for index in bodies) == list(range(len(scene.bodies)))
    poses = np.hstack([scene.start_positions, scene.start_orientations])
    positions, turns = replay._instances(poses, groups[scene.bodies[0].shape], np.array([0.0, 0.0, 2.0]))
    assert positions.shape == (50, 3) and turns.shape == (50, 4)
    np.testing.assert_allclose(positions[:, 2], 2.0)
    np.testing.assert_array_equal(turns[0], (1, 0, 0, 0))  # w first, as viser has it


def test_takes_stand_side_by_side_without_touching() -> None:
    scene = scenes.build("overlap")
    takes = [replay.Take(str(i), scene, recording(Request("overlap", "pj", 300))) for i in range(3)]
    offsets, low, high = replay._places(takes)
    first, second = offsets[0], offsets[1]
    assert np.abs(second - first).max() > 0.65  # the width of a box; they run along z
    assert (high - low)[0] > 3 * 0.65


def test_a_replay_without_poses_says_what_to_do() -> None:
    made = replace(recording(Request("stack", "pj", 300)), poses=np.zeros((0, 126, 7)))
    with pytest.raises(ValueError, match="keep_poses_every"):
        replay.page([replay.Take("one", made.scene, made)])


def test_frames_fit_the_time_and_cheap_scenes_leave_theirs_over() -> None:
    costs = {"dear": 0.5, "cheap": 0.01, "middle": 0.05}
    fit = demo.frames_that_fit(costs, 600.0)
    assert fit["cheap"] == fit["middle"] == demo.FRAMES
    assert fit["dear"] == (600 - 3000 * 0.06) / 0.5 // 100 * 100
    assert demo.frames_that_fit({"dear": 10.0}, 1.0) == {"dear": demo.LEAST_FRAMES}


def test_labels_say_substeps_times_iterations() -> None:
    assert Request("stack", "tj", 300, "paper", 10).label == "TJ 10×30, paper"
    assert Request("stack", "stock-substeps", 100, None, 10).label == "stock + substeps 10×10"
    assert Request("stack", "stock", 50).label == "stock PGS 50"


def test_a_run_that_fails_says_so_and_the_others_go_on() -> None:
    tasks = [
        workers.Task(Request("overlap", "nonsense", 10), 3),
        workers.Task(Request("overlap", "pj", 10, "default"), 3, keep_poses_every=1),
    ]
    with workers.Pool(1) as pool:
        bad, good = pool.run(tasks, lambda request, frames: None)
    assert bad.recording is None and "nonsense" in bad.error
    assert good.recording is not None and good.recording.poses.shape == (4, 11, 7)


def test_a_process_that_dies_is_replaced() -> None:
    with workers.Pool(1) as pool:
        worker = pool._free.get()
        worker._process.kill()
        worker._process.join()
        pool._free.put(worker)
        task = workers.Task(Request("overlap", "pj", 10, "default"), 3)
        died, lived = pool.run([task, task], lambda request, frames: None)
    assert "SIGKILL" in died.error
    assert lived.recording is not None


def test_the_demo_writes_a_page_and_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = demo.main(["--quick", "--frames", "3", "--out", str(tmp_path), "--jobs", "1"])
    assert status == 0
    assert "index.html" in capsys.readouterr().out
    found = json.loads((tmp_path / "results.json").read_text())
    assert found["frames"] == {"stack": 3, "chain": 3, "overlap": 3}
    assert all(run["error"] is None for run in found["runs"])
    assert (tmp_path / "index.html").stat().st_size < 8_000_000


def grown(group: str, times: dict[int, tuple[float | None, float | None, float | None]]) -> list[dict[str, Any]]:
    """Cases as cairn_gpu_bench writes them: milliseconds of GPU, CPU and stock Bullet by bodies, None: not measured."""
    return [
        {
            "group": group, "scene": group, "bodies": bodies, "method": "pj", "iterations": 30,
            "solvers": [
                {"solver": solver, "not_measured": "no driver" if ms is None else None, "ms": ms, "threads": 2}
                for solver, ms in zip(("gpu", "cpu", "stock"), milliseconds)
            ],
        }
        for bodies, milliseconds in times.items()
    ]  # fmt: skip


def benchmark(cases: list[dict[str, Any]], crossing: dict[str, Any]) -> dict[str, Any]:
    both = {"cpu": crossing, "stock": crossing}
    facts = {"cpu": "a CPU", "cores": 2, "cuda": "present: a GPU", "build": "a build", "bullet": None, "when": "today"}
    return {**facts, "crossings": dict.fromkeys(scaling.PANELS, both), "measured": cases}


def test_scaling_curves_are_sorted_and_leave_out_what_was_not_measured() -> None:
    cases = grown("pile", {100: (2.0, 3.0, None), 10: (1.0, None, 4.0)})
    forced = {"solver": "gpu", "executor_asked_for": "grid", "not_measured": None, "ms": 9.0}
    cases[0]["solvers"].append(forced)
    found = {curve.solver: (curve.bodies, curve.milliseconds) for curve in scaling.curves({"measured": cases}, "pile")}
    assert found == {"gpu": ([10, 100], [1.0, 2.0]), "cpu": ([100], [3.0]), "stock": ([10], [4.0])}
    assert scaling.curves({"measured": cases}, "stack") == []


@pytest.mark.parametrize(
    ("crossing", "text"),
    [
        ({"measured": False, "from_bodies": None, "everywhere": False}, "GPU against the CPU: not measured"),
        ({"measured": True, "from_bodies": None, "everywhere": False}, "GPU never ahead of the CPU"),
        ({"measured": True, "from_bodies": 2345.6, "everywhere": False}, "GPU ahead of the CPU from 2\u2009346 bodies"),
        ({"measured": True, "from_bodies": 10, "everywhere": True}, "GPU ahead of the CPU from 10 bodies or fewer"),
    ],
)
def test_scaling_says_where_the_gpu_wins(crossing: dict[str, Any], text: str) -> None:
    assert scaling.verdict(benchmark([], crossing), "stack", "cpu") == text


def test_scaling_draws_with_and_without_a_gpu(tmp_path: Path) -> None:
    crossing = {"measured": True, "from_bodies": 50.0, "everywhere": False}
    for gpu in (None, 0.5):
        cases = [case for group in scaling.PANELS for case in grown(group, {10: (gpu, 0.1, 0.2), 100: (gpu, 1.0, 2.0)})]
        results = benchmark(cases, crossing)
        assert scaling.reason(results) == ("no driver" if gpu is None else "")
        (tmp_path / "gpu.json").write_text(json.dumps(results))
        assert scaling.main([str(tmp_path / "gpu.json"), str(tmp_path / "gpu.png")]) == 0
        assert (tmp_path / "gpu.png").read_bytes().startswith(b"\x89PNG")


def test_scaling_refuses_what_it_cannot_draw(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "gpu.json").write_text(json.dumps(benchmark(grown("scenes", {10: (1.0, 1.0, 1.0)}), {})))
    assert scaling.main([str(tmp_path / "gpu.json"), str(tmp_path / "gpu.png")]) == 1
    assert "nothing to draw" in capsys.readouterr().err
    assert scaling.main([]) == 2
