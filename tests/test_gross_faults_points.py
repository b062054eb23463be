"""Gross mistakes among several reflectors of a tracker that stands anywhere, and beside motor currents."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from tests.command import MACHINES, run

TRACKER = f"""
extends: {MACHINES / "hexapod7.yaml"}
datum: [b6z, b5z, b2z, b6x, b5x, b2y]
sensors:
  tracker: {{at: [P1, P3, P5], reads: [x, y, z], sigma: 10 um, frame: fitted}}
  current: {{kind: force, drive: q7, unit: "1", scale: 50 N, sigma: 0.01}}
"""


def spoilt(folder: Path, change: dict[str, str], times: dict[str, float]) -> tuple[Path, Path]:
    """Simulated readings in which columns are taken from others, or are so many times too large."""
    machine, table = folder / "m.yaml", folder / "t.csv"
    machine.write_text(TRACKER, encoding="utf-8")
    values = folder / "v.yaml"
    values.write_text("parameters: {a7: 200.05, a2: 199.96}\n", encoding="utf-8")  # the redundant leg pulls
    poses = MACHINES / "hexapod7.csv"
    done = run("simulate", machine, poses, "-p", values, "--noise", "declared", "-o", table, "-q")
    assert done.code == 0, done.err
    lines = [line for line in table.read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    rows = list(csv.reader(lines))
    place = {h.split(" ")[0]: k for k, h in enumerate(rows[0])}
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(rows[0])
        for row in rows[1:]:
            new = row.copy()
            for name, source in change.items():
                new[place[name]] = row[place[source]]
            for name, factor in times.items():
                new[place[name]] = repr(factor * float(row[place[name]]))
            writer.writerow(new)
    return machine, table


def exchanged(*pairs: tuple[str, str]) -> dict[str, str]:
    return {a: b for pair in pairs for a, b in (pair, pair[::-1])}


LONG = {"two drives": pytest.mark.slow}
CASES = {
    "one coordinate of two points": (
        exchanged(("tracker.P1.x", "tracker.P3.x")), {}, "`tracker.P1.x` and `tracker.P3.x` look swapped",
    ),
    "two reflectors": (
        exchanged(*((f"tracker.P1.{c}", f"tracker.P5.{c}") for c in "xyz")), {},
        "`tracker.P1.x`, `tracker.P1.y`, `tracker.P1.z` and `tracker.P5.x`, `tracker.P5.y`",
    ),
    "unit of one reflector": (
        {}, {f"tracker.P3.{c}": 0.1 for c in "xyz"},
        "`tracker.P3.x`, `tracker.P3.y`, `tracker.P3.z` look 10 times too small (is it in `cm`, not `mm`?)",
    ),
    "two drives": (exchanged(("q2", "q3")), {}, "`q2` and `q3` look swapped"),
    "nothing": ({}, {}, ""),
}  # fmt: skip


@pytest.mark.parametrize("case", [pytest.param(c, marks=LONG.get(c, ())) for c in CASES])
def test_what_is_wrong_is_named(case: str, tmp_path: Path) -> None:
    change, times, words = CASES[case]
    done = run("check", *spoilt(tmp_path, change, times))
    hints = [line for line in done.err.splitlines() if "plausibility" in line]
    assert (len(hints) == 1 and words in hints[0]) if words else (not hints and done.code == 0), done.err


def test_rows_of_one_drive_that_is_only_read_are_shifted(tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    lines = (MACHINES / "belt-router.csv").read_text(encoding="utf-8").splitlines()
    rows = [row for row in csv.reader(lines) if row[0][:1] != "#"]
    place = rows[0].index("BR [rev]")
    late = ["", *(row[place] for row in rows[1:-1])]
    moved = [[*row[:place], cell, *row[place + 1 :]] for row, cell in zip(rows[1:], late, strict=True)]
    table.write_text("\n".join(",".join(row) for row in [rows[0], *moved]), encoding="utf-8")
    done = run("check", MACHINES / "belt-router.yaml", table)
    assert done.code == 1 and "the readings of `BR` look shifted by one row" in done.err
