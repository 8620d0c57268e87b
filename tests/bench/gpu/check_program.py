"""Runs cairn_gpu_bench, small and with every GPU hidden, and checks what it prints and writes.

check_program.py cairn_gpu_bench
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

program = sys.argv[1]
with tempfile.TemporaryDirectory() as folder:
    written = Path(folder) / "gpu.json"
    size = ["--quick", "--runs", "1", "--iterations", "10", "--most-bodies", "20", "--most-worlds", "1"]
    hidden = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}
    done = subprocess.run([program, *size, "--json", str(written)], env=hidden, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == "", f"a progress bar without a terminal: {done.stderr}"
    assert [path.name for path in Path(folder).iterdir()] == [written.name]
    results = json.loads(written.read_text())

assert results["complete"] and results["build"] and results["cpu"]
assert f"GPU: not measured: {results['cuda']}" in done.stdout
seen = {(case["group"], case["scene"], case["bodies"], case["method"]) for case in results["measured"]}
methods = {"pj", "pjnj", "pjsoft", "tj", "tjsoft"}
scenes = {("chain", 51), ("stack", 125), ("overlap", 10)}
assert seen == {("scenes", *scene, method) for scene in scenes for method in methods} | {
    (name, name, bodies, "pj") for name in ("stack", "pile") for bodies in (10, 20)
} | {("worlds", "worlds", 20, "pj")}, seen
for case in results["measured"]:
    for cell in case["solvers"]:
        if cell["solver"] == "gpu":
            assert cell["not_measured"] == results["cuda"] and "ms" not in cell, cell
        elif cell["solver"] == "stock" and results["bullet"] is None:
            assert cell["not_measured"] == "built without Bullet", cell
        else:
            assert cell["not_measured"] is None and cell["ms"] > 0 and cell["runs"] == 1, cell
            assert cell["rows"] > 0 and cell["friction"], cell
assert not any(one["measured"] for group in results["crossings"].values() for one in group.values())

wrong = subprocess.run([program, "--runs", "many"], capture_output=True, text=True)
assert wrong.returncode == 2 and '"many"' in wrong.stderr, wrong
unwritable = subprocess.run([program, "--json", "/nowhere/gpu.json"], capture_output=True, text=True)
assert unwritable.returncode == 1 and "/nowhere/gpu.json" in unwritable.stderr, unwritable
