"""The report's beside-bullet.csv as the table of learned.md.

usage: beside_bullet_table.py out/report/beside-bullet.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

COLUMNS = ("scene", "error ≤", "Cairn's quickest", "ms", "Bullet's quickest", "ms", "Cairn ÷ Bullet")
HEADING = "| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS)


def cells(row: dict[str, str], name: str) -> tuple[str, str]:
    time = row["ms" if name == "ours" else f"{name}_ms"]
    return (row[name], f"{float(time):.2g}") if row[name] else ("–", "")


def ratio(row: dict[str, str]) -> str:
    words = {"": "neither", "0": "only Cairn", "inf": "**only Bullet**"}
    if row["ratio"] in words:
        return words[row["ratio"]]
    value = float(row["ratio"])
    return f"**{value:.2g}**" if value > 1 else f"{value:.2g}"


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    print(HEADING)
    with Path(sys.argv[1]).open(encoding="utf-8", newline="") as file:
        rows = sorted(csv.DictReader(file), key=lambda row: row["scene"])
    for row in rows:
        found = (*cells(row, "ours"), *cells(row, "bullets"), ratio(row))
        print(f"| {row['scene']} | {row['tolerance']} | " + " | ".join(found) + " |")


if __name__ == "__main__":
    main()
