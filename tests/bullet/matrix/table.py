"""Writes the conformance matrix of the Bullet adapter as Markdown, from its tests' results; or checks it.

The tests leave one CSV file a precision (conformance.h). A deviation is shown rounded up to 1, 2 or 5 times a power of
ten, the worse of the two precisions. `--check` compares every row, column, tolerance, reference and reason; a deviation
may be one such step off, since Bullet's own build decides its last digits, and anything below.
"""

from __future__ import annotations

import argparse
import csv
import math
import re
import sys
from pathlib import Path

HEAD = """# Conformance: Cairn beside Bullet

Written by `tests/bullet/matrix/table.py` from the runs of `cairn_matrix_bullet` and `cairn_matrix_bullet-float64`,
which `./dev test ctest` makes and compares with this page. Do not edit it.

A cell is the deviation from its reference, in single and double precision, the worse of both rounded up to 1, 2 or 5
times a power of ten, at least 1e-06, and in brackets what the tests allow; in m or rad, or in the unit that stands
there. References: **S** stock Bullet in a thirtieth of the step, 100 iterations; **s** stock Bullet in the same
steps, where its behaviour depends on their size; **F** a closed formula; **D** a deliberate difference from stock,
whose deviation is from what is meant instead.
"""
FIRST = -18  # 1e-6
LETTERS = {"stock": "S", "stock step": "s", "formula": "F", "deliberate": "D"}


def rung(value: float) -> int:
    """The number of the step of ..., 1, 2, 5, 10, ... that is not below the value; a millionth is the first."""
    if value <= 1e-6:
        return FIRST
    decade = math.floor(math.log10(value) + 1e-9)
    scaled = value / 10.0**decade
    return 3 * decade + (0 if scaled <= 1 else 1 if scaled <= 2 else 2 if scaled <= 5 else 3)


def shown(step: int) -> str:
    return f"{(1, 2, 5)[step % 3] * 10.0 ** (step // 3):g}"


def read(paths: list[Path]) -> dict[str, dict[str, dict[str, list[dict[str, str]]]]]:
    """Reports by section, row and column, in the order in which they came."""
    sections: dict[str, dict[str, dict[str, list[dict[str, str]]]]] = {}
    for path in paths:
        with path.open(newline="") as file:
            for line in csv.DictReader(file, delimiter=";"):
                row = sections.setdefault(line["section"], {}).setdefault(line["row"], {})
                row.setdefault(line["column"], []).append(line)
    return sections


def cell_text(reports: list[dict[str, str]], notes: list[str]) -> str:
    def note(text: str) -> str:
        if text not in notes:
            notes.append(text)
        return f"<sup>{notes.index(text) + 1}</sup>"

    first = reports[0]
    if first["reference"] == "absent":
        return f"–{note(first['why'])}"
    worst = max(float(report["measured"]) for report in reports)
    unit = "" if first["unit"] == "m or rad" else f" {first['unit']}"
    text = f"{shown(rung(worst))} ({float(first['tolerance']):g}{unit}) {LETTERS[first['reference']]}"
    return text + (note(first["why"]) if first["why"] else "")


def markdown(paths: list[Path]) -> str:
    parts = [HEAD]
    for section, rows in read(paths).items():
        columns = list(dict.fromkeys(column for row in rows.values() for column in row))
        notes: list[str] = []
        parts.append(f"\n## {section}\n\n| | {' | '.join(columns)} |\n|---|{'---|' * len(columns)}\n")
        for name, row in rows.items():
            cells = [cell_text(row[column], notes) if column in row else "" for column in columns]
            parts.append(f"| {name} | {' | '.join(cells)} |\n")
        parts.append("\n" + "".join(f"{i}. {note}\n" for i, note in enumerate(notes, 1)))
    return "".join(parts)


def differences(committed: str, fresh: str) -> list[str]:
    """Lines that differ in more than a step of their deviations."""
    deviation = re.compile(r"(?<=\| )[0-9.e+-]+(?= \()")
    old, new = committed.splitlines(), fresh.splitlines()
    problems = [f"{len(old)} lines are committed, {len(new)} fresh"] if len(old) != len(new) else []
    for before, after in zip(old, new):
        olds, news = ([rung(float(x)) for x in deviation.findall(line)] for line in (before, after))
        if deviation.sub("", before) != deviation.sub("", after) or any(b - a > 1 for a, b in zip(olds, news)):
            problems.append(f"- {before}\n+ {after}")
    return problems


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", type=Path, help="CSV files of the tests")
    parser.add_argument("--page", type=Path, required=True, help="the Markdown file")
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    arguments = parser.parse_args()
    text = markdown(arguments.results)
    if not arguments.check:
        arguments.page.write_text(text)
        return
    problems = differences(arguments.page.read_text(), text)
    if problems:
        print("\n".join(problems))
        command = f"python3 {sys.argv[0]} {' '.join(map(str, arguments.results))} --page {arguments.page}"
        sys.exit(f"{arguments.page} is not what the tests show; write it with\n  {command}")


if __name__ == "__main__":
    main()
