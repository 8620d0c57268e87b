"""Fails if the shared library exports anything but the header's functions, or needs anything but the C library."""

import argparse
import re
import subprocess
from pathlib import Path

ALLOWED = re.compile(r"^(libc|libm|libpthread|libdl|librt|ld-linux[a-z0-9-]*)\.so")


def run(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nm", default="nm")
    parser.add_argument("--readelf", default="readelf")
    parser.add_argument("header", type=Path)
    parser.add_argument("library")
    arguments = parser.parse_args()

    declared = set(re.findall(r"^CAIRN_API [^;]*?\b(cairn_\w+)\(", arguments.header.read_text(), re.MULTILINE))
    lines = run(arguments.nm, "-D", "--defined-only", arguments.library).splitlines()
    exported = {line.split()[-1].split("@")[0] for line in lines if line.split()[-2] != "A"}
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", run(arguments.readelf, "-d", arguments.library))

    problems = [f"declared in the header, not exported: {name}" for name in sorted(declared - exported)]
    problems += [f"exported, not in the header: {name}" for name in sorted(exported - declared)]
    problems += [f"needs {name}: link it statically" for name in needed if not ALLOWED.match(name)]
    if not declared:
        problems.append(f"no CAIRN_API function found in {arguments.header}")
    if problems:
        raise SystemExit("\n".join(problems))
    print(f"{len(exported)} functions, needs {', '.join(needed)}")


if __name__ == "__main__":
    main()
