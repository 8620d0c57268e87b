"""Fails if the library holds an instruction whose result differs from a rounded +, -, *, / or square root.

Fused multiply-adds and approximate reciprocals would make results depend on the instruction set.
"""

import argparse
import re
import subprocess

FORBIDDEN = re.compile(r"\t(vfn?m(?:add|sub)\w*|v?r(?:cp|sqrt)\w+)\s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objdump", default="objdump")
    parser.add_argument("library")
    arguments = parser.parse_args()

    command = [arguments.objdump, "-d", "-C", "--no-show-raw-insn", arguments.library]
    listing = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    function, found, vectors = "", set(), 0
    for line in listing.splitlines():
        if line.endswith(">:"):
            function = line.split("<", 1)[1][:-2]
        vectors += "mulps" in line
        hit = FORBIDDEN.search(line)
        if hit:
            found.add(f"{hit.group(1)} in {function}")
    if not vectors:
        raise SystemExit(f"no vector multiplication found in {arguments.library}: is this the right file?")
    if found:
        raise SystemExit("\n".join(sorted(found)))
    print(f"{vectors} vector multiplications, none fused or approximate")


if __name__ == "__main__":
    main()
