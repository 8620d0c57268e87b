"""Fails if an object compiled for one instruction set defines an inline function that another might be linked with.

The linker keeps one copy of a weak symbol. Were it the one with AVX-512 instructions, the library would crash on a
processor without them. A weak symbol is safe if its mangled name mentions one of the instruction set's namespaces (as a
scope or in a template argument), or a vector of std::experimental that only this instruction set has.
"""

import argparse
import re
import subprocess

# The vectors that only this instruction set has, in bytes, as they appear in mangled names: simd_abi::_VecBuiltin<32>.
OWN_VECTORS = {"avx2": 32, "avx512": 64}


def is_safe(symbol: str, isa: str) -> bool:
    if any(re.search(rf"(?<!\d){len(name)}{name}", symbol) for name in (isa, f"kernels_{isa}")):
        return True
    width = OWN_VECTORS.get(isa)
    return width is not None and re.search(rf"_Vec(Builtin|BltnBtmsk)ILi{width}E", symbol) is not None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nm", default="nm")
    parser.add_argument("isa")
    parser.add_argument("objects", nargs="+")
    arguments = parser.parse_args()

    listing = subprocess.run(
        [arguments.nm, "--defined-only", *arguments.objects], check=True, capture_output=True, text=True
    ).stdout
    fields = [line.split() for line in listing.splitlines()]
    symbols = [(field[1], field[2]) for field in fields if len(field) == 3]
    symbols = [
        (kind, name) for kind, name in symbols if not name.startswith("DW.ref.")
    ]  # a pointer, the same everywhere
    own = [name for _, name in symbols if is_safe(name, arguments.isa)]
    if not own:
        raise SystemExit(f"no symbol of namespace {arguments.isa} in {arguments.objects}: is this the right object?")
    bad = [name for kind, name in symbols if kind in "WVu" and not is_safe(name, arguments.isa)]
    if bad:
        names = subprocess.run(["c++filt"], input="\n".join(bad), capture_output=True, text=True, check=True).stdout
        raise SystemExit(
            f"{len(bad)} weak symbols outside namespace {arguments.isa}; make their callers inline them, or move the "
            f"code that needs them out of core/cpu/kernels.cpp:\n{names}"
        )
    print(f"{len(own)} symbols, all of namespace {arguments.isa}")


if __name__ == "__main__":
    main()
