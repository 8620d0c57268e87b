"""The keys of a run's summary, in order, with what each means and its unit: the JSON of `cairn run`."""

from __future__ import annotations

import textwrap
from typing import Any

Summary = dict[str, Any]

KEYS: dict[str, str] = {
    "scene": "name of the scene",
    "method": "pj, pjnj, pjsoft, tj, tjsoft, auto (Cairn); stock, stock-substeps (Bullet's own PGS), nncg, dantzig "
    "(its others)",
    "preset": "default or paper; null for Bullet's own",
    "iterations": "velocity iterations of a step in all, shared out over its substeps",
    "position_iterations": "nonlinear position iterations of a step; null for Bullet's own",
    "substeps": "substeps of a step",
    "frames": "steps that were made; fewer than asked for if the run did not stay finite",
    "dt": "s, of a step",
    "contacts": "contact points of a step, median",
    "rows": "scalar constraint rows of a step, median; null for Bullet's own",
    "solver_ms_median": "ms a step in the solver, with gathering from Bullet and writing back, median",
    "step_ms_median": "ms a step in all, collision detection included, median",
    "max_penetration_m": "m, deepest contact that Bullet finds after frame 60; null for a run of at most 60 frames",
    "max_drift_m": "m, longest horizontal distance of a body from its place at frame 60, over bodies and later frames; "
    "null if the scene is not one that rests, or the run too short",
    "settling_m": "m, longest vertical distance of a body from its start to its place at frame 60; null likewise",
    "max_joint_error_m": "m, widest gap of what a joint holds together, over joints and frames; null without joints",
    "max_joint_error_rad": "rad, widest angle of what a joint holds, over joints and frames; null without joints",
    "max_speed_m_s": "m/s, of the fastest centre of mass at the end of any step",
    "max_separation_speed_m_s": "m/s, fastest parting of two neighbours along the line of their centres; null if the "
    "scene has no neighbours",
    "energy_change_J": "J, kinetic and potential energy against the start, where it is largest in size, with its sign",
    "kinetic_energy_change_max_J": "J, kinetic energy after the solve less that before it (after external forces), "
    "summed over a step's substeps, of the step where it is largest in size, with its sign",
    "collapsed_at_frame": "first frame with a body's centre more than half its smallest size from its place at frame "
    "60; null if none, and where max_drift_m is",
    "finite": "false if a number became infinite or NaN: the run ends there, the other keys tell of the frames before",
    "state_hash": "SHA-256 of the last positions, orientations and velocities as 32-bit floats",
    "build": "compiler, flags and commit of libcairn, processor and cores of the machine",
}


def help_text() -> str:
    """Every key with its meaning, for people."""
    width = max(len(key) for key in KEYS)
    lines = []
    for key, meaning in KEYS.items():
        first, *rest = textwrap.wrap(meaning, 112 - width)
        lines += [f"  {key:<{width}}  {first}", *(" " * (width + 4) + line for line in rest)]
    return "\n".join(lines)
