"""Prints what each CUDA kernel of a library uses on each architecture; fails if that is more than its budget.

Registers decide how many warps run at a time, and what is spilled to local memory is traffic in every sweep. The budget
is a table: a pattern for the kernel's name (as the shell's), the most registers, the most bytes of local memory (the
stack, with what was spilled). The first line that fits counts.
"""

import argparse
import re
import shutil
import subprocess
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

SKIPPED = 77  # ctest's word for it stands in CMakeLists.txt


class Usage(NamedTuple):
    registers: int
    local: int
    shared: int


class Budget(NamedTuple):
    pattern: str
    registers: int
    local: int


def read_budget(path: Path) -> "list[Budget]":
    budgets = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        fields = line.partition("#")[0].split()
        if not fields:
            continue
        try:
            pattern, registers, local = fields
            budgets.append(Budget(pattern, int(registers), int(local)))
        except ValueError:
            raise SystemExit(f"{path}:{number}: '{line}' is not a pattern, registers and bytes") from None
    return budgets


def read_usage(listing: str) -> "dict[str, dict[str, Usage]]":
    """By kernel's mangled name and architecture, from cuobjdump --dump-resource-usage."""
    kernels: dict[str, dict[str, Usage]] = {}
    architecture, name = "", ""
    for line in listing.splitlines():
        if line.startswith("arch = "):
            architecture = line[len("arch = ") :]
        elif found := re.match(r" Function (\S+):$", line):
            name = found.group(1)
        elif name and "REG:" in line:
            used = {key: int(value) for key, value in re.findall(r"(\w+):(\d+)", line)}
            usage = Usage(used["REG"], used["STACK"] + used["LOCAL"], used["SHARED"])
            kernels.setdefault(name, {})[architecture] = usage
            name = ""
    return kernels


def readable(mangled: "list[str]") -> "list[str]":
    """Names without the scopes that all share, and without parameters: sweep<4, true>."""
    command = ["c++filt", "--no-params"]
    text = subprocess.run(command, input="\n".join(mangled), check=True, capture_output=True, text=True).stdout
    return [re.sub(r"\(anonymous namespace\)::|\bcairn::gpu::", "", line) for line in text.splitlines()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cuobjdump", default="cuobjdump")
    parser.add_argument("budget", type=Path)
    parser.add_argument("library")
    arguments = parser.parse_args()

    if not shutil.which(arguments.cuobjdump):
        print("skipped: cuobjdump was not found; pip install nvidia-cuda-cuobjdump has it, and ./dev setup does that")
        raise SystemExit(SKIPPED)
    command = [arguments.cuobjdump, "--dump-resource-usage", arguments.library]
    done = subprocess.run(command, capture_output=True, text=True)
    if "arch = " not in done.stdout:
        raise SystemExit(f"{arguments.library} holds no CUDA code: was it built with it?\n{done.stdout}{done.stderr}")
    kernels = read_usage(done.stdout)
    budgets = read_budget(arguments.budget)

    architectures = sorted({architecture for usages in kernels.values() for architecture in usages})
    names = dict(zip(kernels, readable(list(kernels))))
    width = max(map(len, [*names.values(), "kernel"]))
    print("registers + bytes of local memory (+ bytes of shared memory; sm_90 adds the 1024 that it keeps for itself)")
    print("  ".join([f"{'kernel':{width}}", *(f"{name:>16}" for name in architectures), "budget"]))
    problems = []
    for mangled, name in sorted(names.items(), key=lambda item: item[1]):
        budget = next((budget for budget in budgets if fnmatchcase(name, budget.pattern)), None)
        if budget is None:
            problems.append(f"{name} has no budget: give it a line in {arguments.budget}")
        cells = []
        for architecture in architectures:
            used = kernels[mangled].get(architecture)
            cells.append(f"{used.registers} + {used.local} + {used.shared}" if used else "-")
            if used and budget and (used.registers > budget.registers or used.local > budget.local):
                problems.append(
                    f"{name} takes {used.registers} registers and {used.local} bytes of local memory on "
                    f"{architecture}; its budget is {budget.registers} and {budget.local}"
                )
        limit = f"{budget.registers} + {budget.local}" if budget else "none"
        print("  ".join([f"{name:{width}}", *(f"{cell:>16}" for cell in cells), limit]))
    if problems:
        raise SystemExit("\n".join(problems))
    print(f"{len(kernels)} kernels, all within their budget")


if __name__ == "__main__":
    main()
