"""Runs cairn_bullet_bench, small, and checks what it prints and writes.

check_program.py cairn_bullet_bench
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

program = sys.argv[1]


def ran(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([program, *arguments], capture_output=True, text=True)


with tempfile.TemporaryDirectory() as folder:
    written, page = Path(folder) / "bullet.json", Path(folder) / "bullet.md"
    done = ran("--sizes", "30,300", "--settle", "20", "--steps", "3", "--threads", "3", "--json", str(written))
    assert done.returncode == 0, done.stderr
    assert done.stderr == "", f"a progress bar without a terminal: {done.stderr}"
    speed = json.loads(written.read_text())
    small = ["--sizes", "30", "--settle", "10", "--steps", "20", "--iterations", "10,50", "--threads", "1"]
    done = ran("--quality", *small, "--json", str(written), "--markdown", str(page))
    assert done.returncode == 0, done.stderr
    quality, table = json.loads(written.read_text()), page.read_text()
    assert {path.name for path in Path(folder).iterdir()} == {written.name, page.name}

assert speed["complete"] and speed["build"] and speed["cpu"] and not speed["quality"]
rows = {(row["scene"], row["bodies"], row["solver"], row["threads"]) for row in speed["speed"]}
solvers = {("stock", 1), ("cairn", 1), ("cairn", 3)}
assert rows == {(scene, n, *solver) for scene in ("wall", "pile") for n in (30, 300) for solver in solvers}, rows
for row in speed["speed"]:
    assert 0 < row["gather_ms"] + row["scatter_ms"] + row["sweeps_ms"] <= row["solver_ms"] <= row["step_ms"], row
    assert row["points"] > 0 and 0 < row["share"] < 1, row

assert quality["complete"] and not quality["speed"] and "Not complete" not in table
pairs = list(zip(quality["quality"][::2], quality["quality"][1::2], strict=True))
found = {(stock["scene"], stock["iterations"]) for stock, _ in pairs}
assert found == {(scene, n) for scene in ("wall", "pile") for n in (10, 50)}, found
for stock, cairn in pairs:
    assert (stock["solver"], cairn["solver"]) == ("stock", "cairn") and cairn["iterations"] >= cairn["substeps"] >= 1
    for row in (stock, cairn):
        assert 0 <= row["mean_penetration_m"] <= row["worst_penetration_m"] < 0.5, row
        assert 0 <= row["drift_m"] < 10 and 0 <= row["rms_speed_m_s"] < 20, row
assert table.count("\n| wall |") == 4 and table.count("\n| pile |") == 4, table

wrong = ran("--steps", "many")
assert wrong.returncode == 2 and '"many"' in wrong.stderr, wrong
wrong = ran("--scenes", "heap")
assert wrong.returncode == 2 and '"heap"' in wrong.stderr, wrong
unwritable = ran("--sizes", "10", "--json", "/nowhere/bullet.json")
assert unwritable.returncode == 1 and "/nowhere/bullet.json" in unwritable.stderr, unwritable
