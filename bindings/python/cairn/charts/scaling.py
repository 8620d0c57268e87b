"""How a step's time grows with the scene on the GPU, the CPU and in stock Bullet: what `cairn_gpu_bench` wrote, drawn.

python -m cairn.charts.scaling gpu.json gpu.png
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from . import style

# group of the results: title of its panel
PANELS = {"stack": "one stack", "pile": "one pile", "worlds": "worlds of 20 bodies"}
# solver: name, colour, marker, line. The GPU is what is judged, the rest is beside it.
SOLVERS: dict[str, tuple[str, str, str, str]] = {
    "gpu": ("Cairn, GPU", "#D55E00", "o", "-"),
    "cpu": ("Cairn, CPU", "#0072B2", "s", "-"),
    "stock": ("stock Bullet", "#8a8a8a", "P", "--"),
}


@dataclass(frozen=True)
class Curve:
    """Median milliseconds of a step by bodies, smallest scene first."""

    solver: str
    bodies: list[int]
    milliseconds: list[float]


def curves(results: Mapping[str, Any], group: str) -> list[Curve]:
    """The solvers with a measurement in `group` (stack, pile, worlds); of the GPU the executor that it chose itself."""
    found = []
    for solver in SOLVERS:
        times = sorted(
            (case["bodies"], cell["ms"])
            for case in results["measured"]
            if case["group"] == group
            for cell in case["solvers"]
            if cell["solver"] == solver
            and cell.get("executor_asked_for", "auto") == "auto"
            and cell["not_measured"] is None
        )
        if times:
            found.append(Curve(solver, [bodies for bodies, _ in times], [ms for _, ms in times]))
    return found


def verdict(results: Mapping[str, Any], group: str, other: str) -> str:
    """Where the GPU starts to win against `other` (cpu, stock), in words."""
    crossing = results["crossings"][group][other]
    name = {"cpu": "the CPU", "stock": "stock Bullet"}[other]
    if not crossing["measured"]:
        return f"GPU against {name}: not measured"
    if crossing["from_bodies"] is None:
        return f"GPU never ahead of {name}"
    bodies = f"{crossing['from_bodies']:,.0f}".replace(",", "\N{THIN SPACE}")
    return f"GPU ahead of {name} from {bodies} bodies" + (" or fewer" if crossing["everywhere"] else "")


def reason(results: Mapping[str, Any]) -> str:
    """Why no GPU was measured; empty if one was."""
    cells = [cell for case in results["measured"] for cell in case["solvers"] if cell["solver"] == "gpu"]
    if not cells or any(cell["not_measured"] is None for cell in cells):
        return ""
    return str(cells[0]["not_measured"])


def scaling(results: Mapping[str, Any], target: Path) -> None:
    """Write the chart to `target` as PNG: a panel a group that has measurements, log-log, the crossings marked.

    results: what `cairn_gpu_bench --json` wrote. Raises ValueError if it holds no measurement of a scene that grows.
    """
    groups = [group for group in PANELS if curves(results, group)]
    if not groups:
        raise ValueError("nothing to draw: no scene of stack, pile or worlds was measured")
    with style.figure(4.9, width=4.6 * len(groups)) as drawing:
        panels = drawing.subplots(1, len(groups), sharey=True, squeeze=False)[0]
        for panel, group in zip(panels, groups):
            _draw(panel, results, group)
        panels[0].set_ylabel("time of a step, median [ms]")
        drawn = {curve.solver for group in groups for curve in curves(results, group)}
        handles = [panels[0].plot([], [], color=colour, marker=marker, ls=line, label=_name(results, solver))[0]
                   for solver, (_, colour, marker, line) in SOLVERS.items() if solver in drawn]  # fmt: skip
        drawing.legend(handles=handles, loc="outside upper left", ncols=len(handles), fontsize=9)
        style.png(drawing, target, _footnote(results))


def _draw(panel: Axes, results: Mapping[str, Any], group: str) -> None:
    panel.set_xscale("log")
    panel.set_yscale("log")
    for curve in reversed(curves(results, group)):  # the GPU on top
        _, colour, marker, line = SOLVERS[curve.solver]
        panel.plot(curve.bodies, curve.milliseconds, color=colour, marker=marker, ls=line, ms=5, lw=1.6)
    for other in ("cpu", "stock"):
        crossing = results["crossings"][group][other]
        if crossing["from_bodies"] is not None and not crossing["everywhere"]:
            panel.axvline(crossing["from_bodies"], color=SOLVERS[other][1], ls=":", lw=1.2)
    panel.set_title(PANELS[group])
    panel.set_xlabel("bodies\n" + "\n".join(verdict(results, group, other) for other in ("cpu", "stock")))


def _name(results: Mapping[str, Any], solver: str) -> str:
    """As the legend has it; the CPU with its threads."""
    threads = [cell["threads"] for case in results["measured"] for cell in case["solvers"]
               if cell["solver"] == solver and cell["not_measured"] is None and case["group"] in PANELS]  # fmt: skip
    return SOLVERS[solver][0] + (f", {max(threads)} threads" if solver == "cpu" and max(threads) > 1 else "")


def _footnote(results: Mapping[str, Any]) -> str:
    why = reason(results)
    gpu = f"GPU not measured: {why}" if why else str(results["cuda"]).removeprefix("present: ")
    grown = next(case for case in results["measured"] if case["group"] in PANELS)
    lines = [
        f"{results['cpu']}, {results['cores']} cores; {gpu}",
        f"{results['build']}; Bullet {results['bullet'] or 'not built in'}; {grown['method']}, {grown['iterations']} "
        f"iterations; {results['when']}",
    ]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0 drawn, 1 the results cannot be read or hold nothing to draw, 2 wrong arguments."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if len(given) != 2:
        print("usage: python -m cairn.charts.scaling RESULTS.json CHART.png", file=sys.stderr)
        return 2
    try:
        scaling(json.loads(Path(given[0]).read_text()), Path(given[1]))
    except (OSError, ValueError) as error:
        print(f"scaling: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
