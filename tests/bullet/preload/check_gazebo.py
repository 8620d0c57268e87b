"""Gazebo's Bullet engine, as Debian packages it, under cairn-run: arm and piles hold, as stock's do not."""

import re
import subprocess
import sys

SKIPPED = 77

if len(sys.argv) != 4:
    print("#### NOT TESTED: Gazebo's Bullet engine under cairn-run. It needs libignition-physics-dev and")
    print("#### libignition-physics5-bullet-plugin5 (apt-get install --no-install-recommends), then configure again.")
    sys.exit(SKIPPED)
cairn_run, program, world = sys.argv[1:]


def run(*command: str) -> "tuple[float, float, str]":
    """The widest gap of a hinge and how far the piles crept, in mm, and what was said on stderr."""
    done = subprocess.run([*command, program, world], capture_output=True, text=True, timeout=300, check=True)
    print(done.stdout, done.stderr, sep="", flush=True)
    figures = re.search(r"moved one by ([\d.]+) mm.*gap ([\d.]+) mm", done.stdout, re.DOTALL)
    assert figures, done.stdout
    return float(figures[2]), float(figures[1]), done.stderr


stock_gap, stock_crept, _ = run()
measured_gap, measured_crept, _ = run(cairn_run, "--late", "--method", "stock", "--stats")
assert (measured_gap, measured_crept) == (stock_gap, stock_crept), "measuring stock changes nothing"
gap, crept, told = run(cairn_run, "--late", "--threads", "1", "--stats")
assert gap < stock_gap / 10, (gap, stock_gap)
assert crept < stock_crept / 10, (crept, stock_crept)
assert "tjsoft" in told and "600 steps" in told and "left" not in told, told
