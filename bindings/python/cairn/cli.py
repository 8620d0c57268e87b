"""The command line `cairn`: run scenes and compare methods."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Callable

from tabulate import tabulate
from tqdm import tqdm

from . import __version__, scenes
from . import summary as summaries
from .run import METHODS, STOCK, Recording, build_text, check_method, run, split_settings
from .solver import PRESETS, Error, ParamValue, info, preset, presets_of

ABOUT = {
    "pj": "projected Jacobi, Baumgarte bias",
    "pjnj": "projected Jacobi without bias, then nonlinear Jacobi on positions",
    "pjsoft": "projected Jacobi, soft constraints",
    "tj": "substeps of pj",
    "tjsoft": "substeps of pjsoft",
    "auto": "pjsoft or tjsoft for each island, stopping at params.tolerance (m/s)",
    "stock": "Bullet's own projected Gauss-Seidel",
    "stock-substeps": "the same through stepSimulation(dt, n, dt / n)",
    "nncg": "Bullet's own nonlinear conjugate gradients over its projected Gauss-Seidel",
    "dantzig": "Bullet's own direct solver (Dantzig's)",
}
_REPLAY_SAMPLES = 600  # poses of a replay: enough for ten seconds at sixty a second


class UsageError(Exception):
    """What was asked for cannot be: exit status 2."""


def _setting(text: str) -> tuple[str, ParamValue]:
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form name=value")
    try:
        return name, int(value)
    except ValueError:
        pass
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _positive(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least 1")
    return value


def _count(text: str) -> int:
    return 0 if text == "0" else _positive(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a positive number of seconds")
    return value


def _share(text: str) -> float:
    value = _seconds(text)
    if value > 1:
        raise argparse.ArgumentTypeError(f"'{text}' is more than all, 1")
    return value


def _tolerances(text: str) -> list[float]:
    values = [float(part) for part in text.split(",")]
    if not all(0 < value < 1 for value in values):
        raise argparse.ArgumentTypeError(f"'{text}' is not a list of numbers between 0 and 1")
    return values


def _checked_scene(name: str) -> str:
    if name not in scenes.SCENES:
        raise UsageError(f"no scene is called '{name}'; there are {', '.join(scenes.SCENES)}")
    return name


def _split(arguments: argparse.Namespace, method: str) -> dict[str, ParamValue]:
    settings = dict(arguments.set)
    try:
        check_method(method)
        split_settings(arguments.scene, method, settings)
    except ValueError as error:
        raise UsageError(str(error)) from error
    return settings


def _record(arguments: argparse.Namespace, method: str, **options: Any) -> Recording:
    """Runs with a progress bar, on a terminal and if it takes longer than two seconds."""
    settings = _split(arguments, method)
    frames = arguments.frames or scenes.SCENES[arguments.scene]().frames
    label = f"{arguments.scene} {method}"
    with tqdm(total=frames, desc=label, unit="frame", delay=2, disable=None, leave=False) as bar:

        def progress(done: int) -> None:
            bar.update(done - bar.n)

        try:
            return run(
                arguments.scene,
                method,
                iterations=arguments.iterations,
                frames=frames,
                dt=arguments.dt,
                threads=arguments.threads,
                settings=settings,
                progress=progress,
                **options,
            )
        except ValueError as error:
            raise UsageError(str(error)) from error


def _write_json(value: object, target: str) -> None:
    text = json.dumps(value, indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
    else:
        Path(target).write_text(text, encoding="utf-8")


def _command_scenes(_: argparse.Namespace) -> None:
    rows = []
    for name in scenes.SCENES:
        scene = scenes.build(name)
        sizes = ", ".join(f"{key}={value:g}" for key, value in scene.settings.items())
        rows.append([name, f"{scene.why}\nfailure shows as {scene.failure}; --set {sizes}"])
    print(tabulate(rows, tablefmt="plain", maxcolwidths=[None, 96]))


def _command_methods(_: argparse.Namespace) -> None:
    rows = []
    for method in METHODS:
        plans = []
        for name in presets_of(method):
            values = preset(method, name)
            plan = f"{values['iterations']} iterations"
            if int(values["substeps"]) > 1:
                plan += f" in {values['substeps']} substeps"
            if values["position_iterations"]:
                plan += f" and {values['position_iterations']} of positions"
            plans.append(plan)
        rows.append([method, ABOUT[method], *plans, *("-" for _ in PRESETS[len(plans) :])])
    print(tabulate(rows, headers=["method", "what it is", *(f"preset {name}" for name in PRESETS)], tablefmt="simple"))


def _command_info(_: argparse.Namespace) -> None:
    facts = {**info(), "build": build_text()}
    print(tabulate(facts.items(), tablefmt="plain", disable_numparse=True))


def _command_run(arguments: argparse.Namespace) -> None:
    _checked_scene(arguments.scene)
    frames = arguments.frames or scenes.SCENES[arguments.scene]().frames
    every = max(1, frames // _REPLAY_SAMPLES) if arguments.replay else 0
    recording = _record(
        arguments,
        arguments.method,
        preset=arguments.preset,
        position_iterations=arguments.position_iterations,
        substeps=arguments.substeps,
        keep_poses_every=every,
    )
    if arguments.replay:
        from . import replay  # only here: the viewer takes a while to load

        replay.save(arguments.replay, [replay.Take(arguments.method, recording.scene, recording)])
    if arguments.json:
        _write_json(recording.summary, arguments.json)
    if arguments.json != "-":
        print(tabulate([[key, _shown(value)] for key, value in recording.summary.items()], tablefmt="plain"))
        if recording.choices is not None:
            print("auto, in the last step:")
            for clause in recording.choices.split("; "):
                print(f"  {clause}")


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value is None else str(value)


# Columns of `compare`: heading, key, factor.
_COLUMNS = [
    ("solver\nms", "solver_ms_median", 1.0),
    ("step\nms", "step_ms_median", 1.0),
    ("penetration\nmm", "max_penetration_m", 1e3),
    ("drift\nmm", "max_drift_m", 1e3),
    ("joint error\nmm", "max_joint_error_m", 1e3),
    ("separation\nm/s", "max_separation_speed_m_s", 1.0),
    ("energy\nJ", "energy_change_J", 1.0),
    ("fell at\nframe", "collapsed_at_frame", 1.0),
]


def _command_compare(arguments: argparse.Namespace) -> None:
    _checked_scene(arguments.scene)
    methods = [name.strip() for name in arguments.methods.split(",") if name.strip()]
    if not methods:
        raise UsageError(f"--methods names none; there are {', '.join(METHODS)}")
    settings = dict(arguments.set)
    for method in methods:  # all are checked before the first, which may take minutes, is run
        _split(arguments, method)
    found = []
    for method in methods:
        ours = method not in STOCK
        recording = _record(
            arguments,
            method,
            preset=arguments.preset if ours else None,
            position_iterations=arguments.position_iterations if method == "pjnj" else None,
            substeps=arguments.substeps if method in ("tj", "tjsoft", "stock-substeps") else None,
            trace_frame=None,
        )
        found.append(recording.summary)
    if arguments.json:
        _write_json(found, arguments.json)
    if arguments.json == "-":
        return
    columns = [column for column in _COLUMNS if any(one[column[1]] is not None for one in found)]
    rows = []
    for one in found:
        plan = f"{one['substeps']}x{one['iterations'] // one['substeps']}" if one["substeps"] > 1 else one["iterations"]
        values = ["-" if one[key] is None else f"{one[key] * factor:.3g}" for _, key, factor in columns]
        state = "yes" if one["finite"] else f"no, since\nframe {one['frames'] + 1}"
        rows.append([one["method"], one["preset"] or "-", plan, *values, state])
    headers = ["method", "preset", "iterations", *(column[0] for column in columns), "finite"]
    size = ", ".join(f"{name}={value}" for name, value in settings.items())
    print(f"{arguments.scene}{f' ({size})' if size else ''}, {found[0]['frames']} frames of {found[0]['dt']} s")
    alignment = ["left", "left", *["right"] * (len(headers) - 2)]
    print(tabulate(rows, headers=headers, tablefmt="simple", colalign=alignment, disable_numparse=True))


def _command_fclib(arguments: argparse.Namespace) -> None:
    from . import fclib

    problems = []
    for path in arguments.files:
        try:
            problems.append(fclib.read(path))
        except ValueError as error:
            raise UsageError(str(error)) from None
    tolerances = sorted(arguments.tolerances, reverse=True)
    found = []
    for problem in problems:
        one = fclib.compare(problem, tolerances, arguments.most, arguments.precision)
        found.append(one)
        if arguments.json != "-":
            _print_fclib(one)
    if arguments.json:
        _write_json(found, arguments.json)


def _command_report(arguments: argparse.Namespace) -> None:
    from . import report  # only here: matplotlib takes a while to load

    plan = report.QUICK if arguments.quick else report.FULL
    chosen = (
        None if arguments.scenes is None else [name.strip() for name in arguments.scenes.split(",") if name.strip()]
    )
    for name in chosen or ():
        _checked_scene(name)
    if chosen == []:
        raise UsageError(f"--scenes names none; there are {', '.join(scenes.SCENES)}")
    if arguments.frames is not None:
        try:
            plan = replace(plan, frames=arguments.frames)
        except ValueError as error:
            raise UsageError(f"--frames: {error}") from error
    out = Path(arguments.out)
    given = ["--quick"] if arguments.quick else []
    given += [] if chosen is None else ["--scenes", ",".join(chosen)]
    given += [] if arguments.frames is None else ["--frames", str(arguments.frames)]
    command = shlex.join(["./dev", "report", str(out), *given])
    if arguments.scheduler and arguments.jobs:
        raise UsageError("--jobs is for this machine's cores: a --scheduler has its workers' threads")
    try:
        page = report.report(out, plan, chosen, arguments.jobs, arguments.resume, command, arguments.scheduler)
    except ValueError as error:
        raise UsageError(str(error)) from error
    print(f"Look at  {page.resolve().as_uri()}")


def _print_fclib(one: dict[str, Any]) -> None:
    kinds = {True: ", coupled", False: ", uncoupled: no contact joins two bodies that move", None: ""}
    print(f"{one['name']}: {one['contacts']} contacts, {one['form']}{kinds[one['coupled']]}")
    exact = one["reference"]
    print(f"reference: relative residual {exact['relative']:.1e} in {exact['seconds']:.2g} s\n")
    rows: dict[tuple[str, ...], list[str]] = {}
    for sweep in one["sweeps"]:
        cells = [
            "-" if r["iterations"] is None else f"{r['iterations']}\n{1e3 * r['seconds']:.2g} ms"
            for r in sweep["reached"]
        ]
        counts = tuple(str(r["iterations"]) for r in sweep["reached"])
        rows.setdefault((sweep["preset"], *counts), [sweep["method"], sweep["preset"], *cells])
        if rows[(sweep["preset"], *counts)][0] != sweep["method"]:
            rows[(sweep["preset"], *counts)][0] += ", " + sweep["method"]
    if not rows:
        print("no sweeps: a local problem does not say which bodies its contacts join\n")
        return
    headers = ["method", "preset", *(f"{r['tolerance']:.0e}" for r in one["sweeps"][0]["reached"])]
    alignment = ["left", "left", *["right"] * (len(headers) - 2)]
    print(
        tabulate(list(rows.values()), headers=headers, tablefmt="simple", colalign=alignment, disable_numparse=True),
        end="\n\n",
    )


def _command_simbenchmark(arguments: argparse.Namespace) -> None:
    from . import simbenchmark

    found = []
    for request in simbenchmark.SOLVERS:
        found.append(
            simbenchmark.figures(
                request, arguments.steps, arguments.share, lambda text: print(text, file=sys.stderr, flush=True)
            )
        )
    print(simbenchmark.table(found))


def _command_features(arguments: argparse.Namespace) -> None:
    from . import features

    times, machine = None, ""
    if arguments.times:
        try:
            machine, times = features.load_times(Path(arguments.times))
        except ValueError as error:
            raise UsageError(str(error)) from None
    found = features.measure()
    if arguments.measure:
        features.save_times(found, Path(arguments.measure))
    print(features.table(found, times))
    if machine:
        print(f"\nTimes: {machine}.")


def _add_options(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("scene", metavar="SCENE", help="a name that `cairn scenes` lists")
    add("--preset", choices=PRESETS, help="parameters to start from, Cairn's methods only (default: default)")
    add(
        "--iterations",
        type=_positive,
        metavar="N",
        help="velocity iterations of a step in all (the preset's; stock: 10)",
    )
    add("--position-iterations", type=_count, metavar="N", help="pjnj: position iterations of a step (the preset's)")
    add("--substeps", type=_positive, metavar="N", help="tj, tjsoft, stock-substeps: substeps of a step")
    add("--frames", type=_positive, metavar="N", help="steps to make (the scene's: 3000)")
    add("--dt", type=_seconds, metavar="S", help="seconds of a step (the scene's: 0.016)")
    add("--threads", type=_count, metavar="N", help="threads of Cairn's methods; 0, the default: all that there are")
    add(
        "--set",
        type=_setting,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a size of the scene or a parameter of the method, such as layers=8 or splitting=point; may be repeated",
    )
    add("--json", metavar="FILE", help="write the results as JSON to FILE; - for standard output instead of the table")


def parser() -> argparse.ArgumentParser:
    plain = argparse.RawDescriptionHelpFormatter
    top = argparse.ArgumentParser(
        prog="cairn",
        description="Cairn, a rigid-body constraint solver: runs scenes in Bullet under its methods and Bullet's own.",
        epilog="examples:\n  cairn scenes\n  cairn run stack --method tjsoft --frames 300\n"
        "  cairn compare chain-1m --methods tj,tjsoft,stock,stock-substeps --frames 500",
        formatter_class=plain,
    )
    top.add_argument("--version", action="version", version=f"cairn {__version__}")
    commands = top.add_subparsers(metavar="COMMAND", required=True)

    def add(
        name: str, about: str, epilog: str, action: Callable[[argparse.Namespace], None]
    ) -> argparse.ArgumentParser:
        command = commands.add_parser(
            name, help=about, description=about[0].upper() + about[1:] + ".", epilog=epilog, formatter_class=plain
        )
        command.set_defaults(action=action)
        return command

    add("scenes", "list the scenes, why each exists and its sizes", "example:\n  cairn scenes", _command_scenes)
    add("methods", "list the methods and their presets", "example:\n  cairn methods", _command_methods)
    add("info", "say what was built and what the machine offers", "example:\n  cairn info", _command_info)

    examples = (
        "examples:\n"
        "  cairn run stack --method tjsoft\n"
        "  cairn run chain-1m --method tj --preset paper --iterations 300 --substeps 10 --json chain.json\n"
        "  cairn run stack --method pj --set layers=10 --set splitting=point --replay stack.html\n"
        "  cairn run overlap --method stock --iterations 50 --frames 300 --json - | python3 -m json.tool\n\n"
        f"keys of the JSON, in order (penetration, drift and settling count from frame 60):\n{summaries.help_text()}"
    )
    one = add("run", "run a scene under one method and judge it", examples, _command_run)
    one.add_argument("--method", required=True, metavar="M", help=", ".join(METHODS))
    _add_options(one)
    one.add_argument("--replay", metavar="FILE", help="write an animated 3D replay as one HTML page")

    examples = (
        "examples:\n"
        "  cairn compare stack --methods pj,pjnj,pjsoft,tj,tjsoft --frames 600\n"
        "  cairn compare chain-1m --methods tj,tjsoft,stock-substeps --iterations 300 --substeps 10 --json -\n\n"
        "--preset, --position-iterations and --substeps go to those methods that have them. The JSON is a list of\n"
        "what `cairn run` writes; `cairn run --help` explains its keys."
    )
    many = add("compare", "run a scene under several methods and set them side by side", examples, _command_compare)
    many.add_argument("--methods", required=True, metavar="A,B,C", help=f"of {', '.join(METHODS)}")
    _add_options(many)

    examples = (
        "examples:\n"
        "  cairn fclib problem.hdf5\n"
        "  cairn fclib *.hdf5 --tolerances 1e-2,1e-4 --json fclib.json\n\n"
        "The table has, for each tolerance, the sweeps from zero after which the relative residual is below it, and\n"
        "their time on one thread (medians). Methods that take the same sweeps stand together."
    )
    problems = add(
        "fclib", "solve recorded contact problems (FCLIB), beside the exact solution", examples, _command_fclib
    )
    problems.add_argument("files", metavar="FILE", nargs="+", help="HDF5 files in FCLIB's format")
    problems.add_argument(
        "--tolerances",
        type=_tolerances,
        default=[1e-2, 1e-3, 1e-4, 1e-5, 1e-6],
        metavar="A,B",
        help="of the relative residual (1e-2,...,1e-6)",
    )
    problems.add_argument("--most", type=_positive, default=1 << 14, metavar="N", help="sweeps to try at most (16384)")
    problems.add_argument("--precision", type=int, choices=(32, 64), default=32, help="of the sweeps (32)")
    problems.add_argument(
        "--json", metavar="FILE", help="write the results as JSON to FILE; - for standard output instead of the table"
    )

    about = "run kapla, 666 and rolling as SimBenchmark does, beside its published figures"
    epilog = "example:\n  cairn simbenchmark --steps 6000\n\nAll of it takes an hour or two."
    outside = add("simbenchmark", about, epilog, _command_simbenchmark)
    outside.add_argument("--steps", type=_positive, default=60_000, metavar="N", help="of kapla, at most (60000)")
    outside.add_argument(
        "--share", type=_share, default=1.0, metavar="X", help="of the durations of 666 and rolling (1)"
    )

    about = "count what each feature of the model costs, with it and without"
    epilog = (
        "examples:\n  cairn features\n"
        "  cairn features --measure features.json   (on a quiet machine)\n"
        "  cairn features --times features.json\n\n"
        "Prints Markdown. Of two figures the first is with the feature. Rows, bytes and sweeps are the same on every\n"
        "machine; TJSoft, default preset, 40 sweeps in 4 substeps, one thread."
    )
    parts = add("features", about, epilog, _command_features)
    parts.add_argument("--measure", metavar="FILE", help="write the times of this run to FILE")
    parts.add_argument("--times", metavar="FILE", help="show the times that FILE has in a column")

    examples = (
        "examples:\n"
        "  cairn report --quick\n"
        "  cairn report out/report --scenes stack,chain --jobs 2\n\n"
        "Each run is kept in OUT/cache, by scene, sizes, method, parameters, libcairn's build and the machine: an\n"
        "interrupted report goes on where it stopped. --quick takes minutes, with few frames and small sizes; without\n"
        "it, about an hour. The scenes heavy-pendulum, column, stack-1m and overlap have maps of their own."
    )
    study = add("report", "chart speed against accuracy, and where methods fail", examples, _command_report)
    study.add_argument("out", nargs="?", default="out/report", metavar="OUT", help="folder to write to (%(default)s)")
    study.add_argument("--quick", action="store_true", help="few frames and small sizes: minutes")
    study.add_argument("--jobs", type=_positive, metavar="N", help="runs at a time, each on its own core (all cores)")
    study.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on the workers of this Dask scheduler, as tcp://host:8786 (needs distributed)",
    )
    study.add_argument("--scenes", metavar="A,B", help="only these (all)")
    study.add_argument("--frames", type=_positive, metavar="N", help="of every run but the maps' (the scene's, or few)")
    study.add_argument(
        "--resume",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="take what is kept from before, or run all anew",
    )
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0 done, 1 failed, 2 asked for what cannot be, 130 interrupted."""
    given = parser().parse_args(arguments)
    try:
        given.action(given)
    except UsageError as error:
        print(f"cairn: {error}", file=sys.stderr)
        return 2
    except (Error, OSError, ImportError) as error:
        print(f"cairn: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("cairn: interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
