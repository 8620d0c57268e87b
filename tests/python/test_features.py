"""What each feature costs, and SimBenchmark's figures: the counts, by hand where they can be, and the tables."""

from __future__ import annotations

from pathlib import Path

import pytest

from cairn import cli, features, simbenchmark
from cairn.charts.result import Request
from cairn.features import Case, Cost


def found(name: str) -> tuple[Cost, Cost]:
    (case,) = [case for case in features.CASES if case.name == name]
    return case.with_it(), case.without()


def test_what_is_not_used_has_no_rows() -> None:
    rubbing, smooth = found("friction")
    # Slab 0 has no friction in both; without it the others have a row a point, not three.
    assert rubbing.rows > 3 * 10 * 3 and rubbing.rows % 3 == 1 and smooth.rows < 11 * 4
    assert smooth.sweep_bytes < rubbing.sweep_bytes and rubbing.error < 0.01 < smooth.error
    rolling, plain = found("rolling and spinning friction")
    assert (rolling.rows, plain.rows) == (6 * 64, 3 * 64)
    assert plain.sweep_bytes < rolling.sweep_bytes and rolling.error < plain.error == pytest.approx(1, abs=0.01)
    with_post, without = found("pairs that cannot move")
    assert (with_post.rows, with_post.sweep_bytes) == (without.rows, without.sweep_bytes) == (192, without.sweep_bytes)
    bouncing, dull = found("restitution")
    assert bouncing.sweeps > dull.sweeps == 40 and bouncing.error < 0.05 < dull.error


def test_sweep_bytes_by_hand() -> None:
    """64 balls on the floor, a manifold of one point each, default preset: manifold blocks, Nesterov."""
    _, plain = found("pairs that cannot move")
    point = 4 * (23 + 6 + 6)  # 23 fields, lambda, and what reducing reads
    lane = 4 * 4 + 2 * 32 + 4 + 16
    side = 2 * 32 + 2 * 32
    body = 4 * 32 + 4 + 2 * 32 + 4
    assert plain.sweep_bytes == 64 * (point + lane + side + body)


def test_what_is_still_paid_is_said() -> None:
    for name, ratio in (("duplicate points", 2.0), ("locked rotations of joints", 2.0)):
        with_it, without = found(name)
        assert with_it.rows == ratio * without.rows
    fixed, ball = found("locked rotations of joints")
    assert fixed.sweep_bytes == ball.sweep_bytes
    for case in features.CASES:
        paid = case.name in ("duplicate points", "locked rotations of joints", "angular part of frictionless spheres")
        assert case.note.startswith("**") == paid


def test_the_table_and_its_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cost = Cost(3, 2048.0, 40, 0.5, 0.25)
    case = Case("friction", "a scene", "creep [m]", "nothing", lambda: cost, lambda: Cost(1, 1024.0, 40, 2.0, 0.125))
    both = [(case, case.with_it(), case.without())]
    assert (
        features.table(both).splitlines()[-1]
        == "| friction | a scene | 3 / 1 | 2 / 1 | 40 | creep [m]: 0.5 / 2 | nothing |"
    )
    path = tmp_path / "times.json"
    features.save_times(both, path)
    machine, times = features.load_times(path)
    assert "cores" in machine and times == {"friction": [0.25, 0.125]}
    assert "| 0.25 / 0.12 | creep" in features.table(both, times)
    path.write_text('{"format": 0}')
    assert cli.main(["features", "--times", str(path)]) == 2
    assert "is no file of `cairn features --measure`: format 0, not 1" in capsys.readouterr().err


def test_simbenchmarks_collapse_is_a_step_and_the_table_has_what_was_published() -> None:
    fell = simbenchmark.collapse(Request("", "stock", 10), 500)
    assert fell is not None and 100 < fell < 500
    assert simbenchmark.collapse(Request("", "pjsoft", 20, "default"), 20) is None
    short = simbenchmark.figures(Request("", "pj", 10, "default"), steps=2, share=0.001)
    text = simbenchmark.table([short])
    assert "| PJ 10 | stands, 2 |" in text and "1.35e-4" in text and "52 to 55 058" in text
    assert len({line.count("|") for line in text.splitlines()}) == 1
