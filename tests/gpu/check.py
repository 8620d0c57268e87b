"""Checks the CUDA backend on this machine's GPU, in under ten minutes and without a network: ./dev gpu-check runs this.

It builds for this GPU alone, then runs on it: the laws against the CPU's bits, the laws of tests/unit, the conformance
suite, the tests behind Bullet and from Python, compute-sanitizer, the kernels' budget and the benchmark. A test that is
skipped for want of a device fails here. Each stage has a time limit, and the next goes on when one fails.

  DIR/gpu-check.txt    machine, versions, commit, and a line for each stage
  DIR/gpu-check.log    all that the stages printed
  DIR/gpu-bench.*      the benchmark's text and JSON

A machine without Debian's packages takes them from build/carry, which --prepare fills on a machine that has apt-get.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "gpu-check"
CARRY = ROOT / "build" / "carry"
SECONDS = 570  # for everything
CORES = len(os.sched_getaffinity(0))

# What the build needs of Debian, and where it is when it is installed.
PACKAGES = {
    "libgtest-dev": "/usr/include/gtest/gtest.h",
    "libeigen3-dev": "/usr/include/eigen3/Eigen/Dense",
    "libbullet-dev": "/usr/include/bullet/btBulletDynamicsCommon.h",
    "libbenchmark-dev": "/usr/include/benchmark/benchmark.h",
    "pkgconf": "pkg-config",
}
RUNTIMES = ("libbullet", "libbenchmark", "pkgconf", "libpkgconf")  # of the dependencies, those that come along

ON_DEVICE = {"CAIRN_BACKEND": "cuda"}
# Of tests/unit and tests/conformance, what is about the CPU backend alone: its tasks go to the caller's hook.
OF_THE_CPU = "Hooks.ParallelFor*:Environment.TheCallersTaskSystem*"
CHAINS = "*Chain.*"  # of tests/unit, a hundred times as long as all the others
# Under compute-sanitizer, which slows a step down a hundredfold: every executor, twice over.
SANITIZED = "Gpu.RevisionsChangeNoBits:*OfEveryExecutorInEveryOrder/tjsoft:*OfEveryExecutorInEveryOrder/pjnj"


def fail(text: str) -> NoReturn:
    raise SystemExit(f"gpu-check: {text}")


# ---- What a machine without packages and network needs ---------------------------------------------------------------


def prepare() -> None:
    """Fills build/carry from the packages' archives; nothing is installed."""
    for tool in ("apt-get", "apt-cache", "dpkg-deb"):
        if not shutil.which(tool):
            fail(f"--prepare needs {tool}: run it on Debian or Ubuntu")
    names, found = list(PACKAGES), set(PACKAGES)
    for name in names:
        listing = subprocess.run(["apt-cache", "depends", "--important", name], capture_output=True, text=True).stdout
        for other in re.findall(r"Depends: (\S+)", listing):
            if other.startswith(RUNTIMES) and other not in found:
                found.add(other)
                names.append(other)
    shutil.rmtree(CARRY, ignore_errors=True)
    CARRY.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(["apt-get", "download", *names], cwd=folder, capture_output=True, text=True)
        if done.returncode != 0:
            fail(f"apt-get download failed (apt-get update may help):\n{done.stderr}")
        for archive in sorted(Path(folder).glob("*.deb")):
            subprocess.run(["dpkg-deb", "-x", str(archive), str(CARRY)], check=True)
    for pattern in ("usr/share/doc", "usr/share/man", "usr/share/lintian", "usr/include/bullet/Bullet3*"):
        for path in CARRY.glob(pattern):
            shutil.rmtree(path)
    for path in CARRY.glob("usr/lib/*/libBullet3*"):
        path.unlink()
    (CARRY / "commit").write_text(commit())
    size = sum(path.lstat().st_size for path in CARRY.rglob("*") if path.is_file())
    print(f"gpu-check: {CARRY.relative_to(ROOT)} holds {', '.join(sorted(names))}: {size / 2**20:.0f} MiB")


def commit() -> str:
    command = ["git", "describe", "--always", "--dirty=+dirty", "--abbrev=8", "--match=", "--exclude=*"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True) if shutil.which("git") else None
    if done is not None and done.returncode == 0:
        return done.stdout.strip()
    noted = CARRY / "commit"
    return f"{noted.read_text()} when build/carry was made" if noted.exists() else "unknown"


def take_packages() -> None:
    """Puts build/carry into the environment if a package is missing."""
    missing = [
        name
        for name, probe in PACKAGES.items()
        if not (Path(probe).exists() if probe[0] == "/" else shutil.which(probe))
    ]
    if not missing:
        return
    libraries = next(CARRY.glob("usr/lib/*/pkgconfig"), None)
    if libraries is None:
        fail(f"{', '.join(missing)} are missing: install them, or bring {CARRY} from ./dev gpu-check --prepare")
    os.environ["PATH"] += f":{CARRY}/usr/bin"
    os.environ["CMAKE_PREFIX_PATH"] = f"{CARRY}/usr"
    os.environ["PKG_CONFIG_LIBDIR"] = str(libraries)
    os.environ["PKG_CONFIG_SYSROOT_DIR"] = str(CARRY)
    os.environ["PKG_CONFIG_ALLOW_SYSTEM_CFLAGS"] = os.environ["PKG_CONFIG_ALLOW_SYSTEM_LIBS"] = "1"
    older = os.environ.get("LD_LIBRARY_PATH")
    os.environ["LD_LIBRARY_PATH"] = f"{libraries.parent}:{older}" if older else str(libraries.parent)


# ---- The machine -----------------------------------------------------------------------------------------------------


@dataclass
class Device:
    name: str
    compute: tuple[int, int]
    driver: str


def find_device() -> Device:
    """The first one, as the driver tells; ends with what is missing if there is none."""
    try:
        cuda = ctypes.CDLL("libcuda.so.1")
    except OSError:
        fail("there is no GPU to check on: NVIDIA's driver (libcuda.so.1) was not found")
    count, version, device = ctypes.c_int(), ctypes.c_int(), ctypes.c_int()
    major, minor = ctypes.c_int(), ctypes.c_int()
    status = cuda.cuInit(0)
    if status != 0 or cuda.cuDeviceGetCount(ctypes.byref(count)) != 0 or count.value == 0:
        fail(f"there is no GPU to check on: NVIDIA's driver offers none (cuInit gives {status}; see nvidia-smi)")
    name = ctypes.create_string_buffer(256)
    cuda.cuDeviceGet(ctypes.byref(device), 0)
    cuda.cuDeviceGetName(name, len(name), device)
    cuda.cuDeviceGetAttribute(ctypes.byref(major), 75, device)  # CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR
    cuda.cuDeviceGetAttribute(ctypes.byref(minor), 76, device)
    cuda.cuDriverGetVersion(ctypes.byref(version))
    driver = f"driver for CUDA {version.value // 1000}.{version.value % 1000 // 10}"
    number = told("nvidia-smi", "--query-gpu=driver_version", "--format=csv,noheader")
    if number:
        driver = f"driver {number.splitlines()[0]}, for CUDA {version.value // 1000}.{version.value % 1000 // 10}"
    return Device(name.value.decode(), (major.value, minor.value), driver)


def told(*command: str) -> str:
    """What a program prints; empty if it is not there or fails."""
    if not shutil.which(command[0]):
        return ""
    done = subprocess.run(command, capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else ""


def machine(device: Device) -> list[str]:
    cpu = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    release = re.search(r"release \S+, (\S+)", told("nvcc", "--version"))
    return [
        f"{device.name}, compute {device.compute[0]}.{device.compute[1]}, {device.driver}",
        f"{cpu[1] if cpu else platform.machine()}, {CORES} cores, {platform.system()} {platform.release()}",
        f"nvcc {release[1] if release else '?'}, {(told('c++', '--version') or '?').splitlines()[0]}, "
        f"Python {platform.python_version()}, commit {commit()}",
    ]


# ---- Stages ----------------------------------------------------------------------------------------------------------


@dataclass
class Check:
    """Runs stages, one after another, and keeps what became of them."""

    out: Path
    heading: list[str]
    began: float = field(default_factory=time.monotonic)
    rows: list[tuple[str, str, float, str]] = field(default_factory=list)  # name, result, seconds, remark

    def log(self, text: str) -> None:
        with (self.out / "gpu-check.log").open("a") as log:
            log.write(text)

    def note(self, name: str, result: str, seconds: float, remark: str) -> None:
        self.rows.append((name, result, seconds, remark))
        print(f"gpu-check: {name}: {result} in {seconds:.1f} s {remark and f'({remark})'}", flush=True)
        self.log(f"==== {name}: {result} in {seconds:.1f} s {remark}\n\n")
        self.write()  # now, so that a run that is cut off leaves what it had

    def skip(self, name: str, reason: str) -> None:
        self.note(name, "SKIPPED", 0, reason)

    def stage(
        self,
        name: str,
        limit: float,  # s
        command: Sequence[str | Path],
        env: dict[str, str] | None = None,  # more of it
        keep: str = "",  # also writes the output to this file
    ) -> None:
        """Its remark is the last line that counts tests, or what went wrong."""
        program = Path(command[0])
        if program.is_absolute() and not program.exists():
            self.note(name, "FAILED", 0, f"{program.name} was not built")
            return
        limit = min(limit, self.began + SECONDS - time.monotonic())
        if limit < 1:
            self.note(name, "FAILED", 0, f"no time was left of {SECONDS} s")
            return
        words = [str(word) for word in command]
        self.log(f"==== {name}: {' '.join([*(f'{k}={v}' for k, v in (env or {}).items()), *words])}\n")
        start = time.monotonic()
        status, output = run(words, limit, {**os.environ, **(env or {})})
        self.log(output)
        if keep:
            (self.out / keep).write_text(output)
        problem = judge(status, output, limit)
        if problem:
            lines = output.splitlines()
            told_of = [line for line in lines[:-20] if re.search(r"error|FAILED|Failure", line)]
            print("\n".join([*told_of[:20], *lines[-20:]]), flush=True)
        counted = re.findall(r"^\[  PASSED  \] .*|^.*\d passed.*|^=+ \w+ SUMMARY: .*|^\d+ kernels, .*", output, re.M)
        self.note(
            name,
            "SKIPPED" if status == 77 else "FAILED" if problem else "passed",
            time.monotonic() - start,
            problem or (counted[-1].strip("= ").replace("[  PASSED  ]", "passed:") if counted else ""),
        )

    def write(self) -> None:
        width = max(len(row[0]) for row in self.rows)
        table = [
            f"{name:{width}}  {result:7} {seconds:6.1f} s  {remark}".rstrip()
            for name, result, seconds, remark in self.rows
        ]
        total = f"{'total':{width}}          {time.monotonic() - self.began:6.1f} s"
        (self.out / "gpu-check.txt").write_text("\n".join([*self.heading, "", *table, total, ""]))


def run(command: Sequence[str], limit: float, env: dict[str, str]) -> tuple[int | None, str]:
    """Exit status, None if it was stopped at its limit in seconds, and what it printed."""
    process = subprocess.Popen(
        command, cwd=ROOT, env=env, text=True, errors="replace", start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        output = process.communicate(timeout=limit)[0]
        return process.returncode, output
    except BaseException as stopped:
        os.killpg(process.pid, signal.SIGKILL)  # what it started, too
        if not isinstance(stopped, subprocess.TimeoutExpired):
            raise
        return None, process.communicate()[0]


def judge(status: int | None, output: str, limit: float) -> str:
    """What is wrong with a stage; empty if nothing is."""
    if status == 77:  # how a script of ours says that it cannot run here
        return output.strip().splitlines()[-1]
    if status is None:
        return f"stopped at its limit of {limit:.0f} s"
    if status != 0:
        return f"exit status {status}"
    skipped = re.search(r"^\[  SKIPPED \] (\d+) tests?", output, re.M)
    if skipped:
        return f"{skipped[1]} tests were skipped"
    skipped = re.search(r"^(?:=+ )?\d+ passed.*?\b(\d+) skipped\b", output, re.M)  # pytest's
    if skipped:
        return f"{skipped[1]} tests were skipped"
    if "] Running 0 tests" in output:
        return "no test was run"
    found = re.findall(r"^=+ \w+ SUMMARY: (\d+) ", output, re.M)  # compute-sanitizer's: errors or hazards
    if "= COMPUTE-SANITIZER" in output and (not found or set(found) != {"0"}):
        return f"compute-sanitizer found {', '.join(found)}" if found else "compute-sanitizer gave no summary"
    return ""


def build(check: Check, device: Device) -> None:
    generator = "Ninja" if shutil.which("ninja") else "Unix Makefiles"
    without_python = python_problem()
    options = {
        "CMAKE_BUILD_TYPE": "Release",
        "CAIRN_TESTS": "ON",
        "CAIRN_BENCH": "ON",
        "CAIRN_CUDA": "ON",
        "CAIRN_CUDA_ARCHITECTURES": f"{device.compute[0]}{device.compute[1]}-real",
        "CAIRN_WERROR": "OFF",  # this machine's compiler may warn of more than ours
        "CAIRN_PYTHON": "OFF" if without_python else "ON",
        "Python_EXECUTABLE": sys.executable,
        "Python3_EXECUTABLE": sys.executable,
    }
    if not without_python:
        options["pybind11_DIR"] = told(sys.executable, "-m", "pybind11", "--cmakedir")
    definitions = [f"-D{name}={value}" for name, value in options.items()]
    check.stage("configure", 60, ["cmake", "-S", ROOT, "-B", BUILD, "-G", generator, *definitions])
    keep_going = ["-k", "0"] if generator == "Ninja" else ["-k"]
    check.stage("build", 300, ["cmake", "--build", BUILD, "--parallel", str(CORES), "--", *keep_going])


def python_problem() -> str:
    """Why the Python modules cannot be built here; empty if they can."""
    absent = [name for name in ("numpy", "pybind11", "pytest") if importlib.util.find_spec(name) is None]
    if absent:
        return f"{sys.executable} lacks {', '.join(absent)}"
    header = Path(sysconfig.get_path("include")) / "Python.h"
    return "" if header.exists() else f"{header} is missing"


def test(check: Check) -> None:
    tests = BUILD / "tests"
    check.stage("the CPU's bits", 90, [tests / "gpu" / "cairn_gpu_device_test"])
    without = f"--gtest_filter=-{OF_THE_CPU}"
    check.stage("unit", 90, [tests / "unit" / "cairn_unit", f"{without}:{CHAINS}"], ON_DEVICE)
    check.stage("conformance", 20, [tests / "conformance" / "cairn_conformance", without], ON_DEVICE)
    check.stage("conformance, C", 20, [tests / "conformance" / "cairn_conformance_drive"], ON_DEVICE)
    for precision in ("bullet", "bullet-float64"):
        check.stage(precision, 40, [tests / "bullet" / f"cairn_test_{precision}"], ON_DEVICE)
    problem = python_problem()
    if problem:
        check.skip("Python", problem)
        return
    site = BUILD / "site"
    shutil.copytree(ROOT / "bindings" / "python" / "cairn", site / "cairn", dirs_exist_ok=True)
    run(["cmake", "--install", str(BUILD), "--component", "python", "--prefix", str(site)], 30, dict(os.environ))
    files = [ROOT / "tests" / "python" / f"test_{name}.py" for name in ("solver", "ctypes", "bullet", "run")]
    command: list[str | Path] = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *files]
    check.stage("Python", 60, command, {**ON_DEVICE, "PYTHONPATH": str(site)})


def sanitize(check: Check) -> None:
    sanitizer = shutil.which("compute-sanitizer")
    for tool in ("memcheck", "racecheck", "synccheck"):
        if sanitizer is None:
            check.skip(tool, "compute-sanitizer was not found: it comes with CUDA's toolkit")
            continue
        program = BUILD / "tests" / "gpu" / "cairn_gpu_device_test"
        options = ["--tool", tool, "--error-exitcode", "9"]
        check.stage(tool, 60, [sanitizer, *options, program, f"--gtest_filter={SANITIZED}"])


def kernels(check: Check) -> None:
    script, library = ROOT / "tests" / "build" / "kernel_budget.py", BUILD / "capi" / "libcairn.so"
    check.stage("kernel budget", 30, [sys.executable, script, ROOT / "gpu" / "budget.txt", library])


def chains(check: Check) -> None:
    program = BUILD / "tests" / "unit" / "cairn_unit"
    check.stage("unit, chains", 120, [program, f"--gtest_filter={CHAINS}"], ON_DEVICE)


def bench(check: Check) -> None:
    """What ./dev bench --gpu --quick does, with what was built here."""
    program = BUILD / "tests" / "bench" / "gpu" / "cairn_gpu_bench"
    if not program.exists():
        check.skip("bench", f"{program.name} was not built")
        return
    check.stage("bench", 180, [program, "--quick", "--json", check.out / "gpu-bench.json"], keep="gpu-bench.txt")


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="./dev gpu-check", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--prepare", action="store_true", help="fill build/carry, and do nothing else")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", default=ROOT / "out" / "gpu-check", help="default: out/gpu-check"
    )
    arguments = parser.parse_args()
    if arguments.prepare:
        prepare()
        return

    device = find_device()
    os.environ["PATH"] += ":/usr/local/cuda/bin:/usr/local/cuda/compute-sanitizer"
    if not shutil.which("nvcc"):
        fail("nvcc was not found: ./dev setup --cuda gets it, where there is a network")
    take_packages()
    arguments.out.mkdir(parents=True, exist_ok=True)
    check = Check(arguments.out.resolve(), machine(device))
    print("\n".join(check.heading), flush=True)
    (check.out / "gpu-check.log").write_text("\n".join(check.heading) + "\n\n")
    build(check, device)
    test(check)
    sanitize(check)
    kernels(check)
    bench(check)
    chains(check)  # last: they take long and find little
    print((check.out / "gpu-check.txt").read_text())
    for result, text in (("SKIPPED", "NOT RUN HERE"), ("FAILED", "FAILED")):
        names = [row[0] for row in check.rows if row[1] == result]
        if names:
            print(f"######## {text}: {', '.join(names)} ########")
    if any(row[1] == "FAILED" for row in check.rows):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
