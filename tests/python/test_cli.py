"""The command line, as a user meets it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from cairn.cli import main
from cairn.run import METHODS
from cairn.scenes import SCENES
from cairn.summary import KEYS

pytest.importorskip("cairn._bullet", reason="cairn was built without Bullet")


def cairn(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "cairn.cli", *arguments], capture_output=True, text=True, timeout=120)


def test_lists() -> None:
    listed = cairn("scenes")
    assert listed.returncode == 0
    assert all(f"\n{name} " in "\n" + listed.stdout for name in SCENES)
    listed = cairn("methods")
    assert all(f"\n{name} " in listed.stdout for name in METHODS)
    told = cairn("info").stdout
    assert "commit" in told
    assert "\ncuda " in told
    assert cairn("--version").stdout.startswith("cairn 0.")


@pytest.mark.parametrize("command", [[], ["scenes"], ["methods"], ["info"], ["run"], ["compare"]])
def test_help_has_examples(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*command, "--help"])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert "example" in shown
    if command == ["run"]:
        assert all(f"  {key} " in shown for key in KEYS)


def test_run_writes_json_to_standard_output() -> None:
    done = cairn(
        *("run", "chain", "--method", "tj", "--frames", "3", "--set", "links=3", "--set", "splitting=point"),
        *("--iterations", "12", "--substeps", "3", "--dt", "0.01", "--threads", "1", "--json", "-"),
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # no progress bar: it was quick, and this is no terminal
    summary = json.loads(done.stdout)
    assert list(summary) == list(KEYS)
    assert (summary["iterations"], summary["substeps"], summary["frames"], summary["dt"]) == (12, 3, 3, 0.01)


def test_run_prints_and_writes_files(tmp_path: Path) -> None:
    target = tmp_path / "one.json"
    done = cairn("run", "overlap", "--method", "stock", "--frames", "3", "--json", str(target))
    assert done.returncode == 0, done.stderr
    assert "max_separation_speed_m_s" in done.stdout
    assert json.loads(target.read_text())["iterations"] == 10
    assert cairn("run", "overlap", "--method", "stock", "--frames", "2", "--json", str(tmp_path)).returncode == 1


def test_compare_aligns_methods() -> None:
    done = cairn(
        *("compare", "chain", "--methods", "pj,pjnj,tjsoft,stock,stock-substeps", "--frames", "2", "--set", "links=3"),
        *("--iterations", "20", "--substeps", "5", "--position-iterations", "4", "--preset", "paper"),
    )
    assert done.returncode == 0, done.stderr
    title, *lines = done.stdout.splitlines()
    assert title == "chain (links=3), 2 frames of 0.016 s"
    rows = [line.split() for line in lines if line.split()[0] in METHODS]
    assert [row[:3] for row in rows] == [
        ["pj", "paper", "20"],
        ["pjnj", "paper", "20"],
        ["tjsoft", "paper", "5x4"],
        ["stock", "-", "20"],
        ["stock-substeps", "-", "5x4"],
    ]
    assert len({len(line) for line in lines if line.startswith(("pj ", "stock "))}) == 1
    listed = cairn("compare", "chain", "--methods", "pj,stock", "--frames", "1", "--set", "links=2", "--json", "-")
    assert [one["method"] for one in json.loads(listed.stdout)] == ["pj", "stock"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["run", "stak", "--method", "tj"], "no scene is called 'stak'; there are stack, stack-1m, chain"),
        (
            ["run", "stack", "--method", "sor"],
            "no method is called 'sor'; there are pj, pjnj, pjsoft, tj, tjsoft, auto, stock",
        ),
        (["compare", "stack", "--methods", "tj,sor"], "no method is called 'sor'"),
        (["compare", "stack", "--methods", ","], "--methods names none"),
        (["run", "stack", "--method", "tj", "--set", "layer=3"], "sizes of the scene: columns, layers"),
        (["run", "stack", "--method", "tj", "--set", "layer=3"], "parameters of tj: method, iterations"),
        (["run", "stack", "--method", "tj", "--set", "layers"], "'layers' is not of the form name=value"),
        (["run", "stack", "--method", "tj", "--set", "layers=2.5"], "must be a whole number"),
        (["run", "stack", "--method", "tj", "--set", "layers=many"], "layers = 'many' is not a number"),
        (["run", "stack", "--method", "tj", "--frames", "0"], "'0' is not a whole number of at least 1"),
        (["run", "stack", "--method", "tj", "--dt", "-1"], "'-1' is not a positive number of seconds"),
        (["run", "stack", "--method", "tj", "--preset", "best"], "invalid choice: 'best'"),
        (["run", "stack", "--method", "stock", "--preset", "paper"], "it has no presets"),
        (["run", "stack", "--method", "tj", "--iterations", "3", "--substeps", "4"], "substeps"),
        (["run", "stack", "--method", "tj", "--set", "contact_hertz=-1"], "contact_hertz"),
        (["run", "stack"], "--method"),
        ([], "COMMAND"),
    ],
)
def test_what_is_refused(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        status: object = main(arguments)
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    shown = capsys.readouterr()
    assert text in shown.err
    assert shown.out == ""


def test_refusal_is_the_exit_status() -> None:
    done = cairn("run", "stak", "--method", "tj")
    assert done.returncode == 2
    assert done.stderr.startswith("cairn: no scene is called 'stak'")
    assert done.stdout == ""
