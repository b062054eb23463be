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
    poses, lines = folder / "p.csv", (MACHINES / "hexapod7.csv").read_text(encoding="utf-8").splitlines()
    poses.write_text("\n".join([lines[0], *lines[1::2], ""]), encoding="utf-8")
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


LONG = dict.fromkeys(("two drives", "two reflectors", "one coordinate of two points"), pytest.mark.slow)
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


FOUR_LEGS = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.5 mm}
parameters:
  a2x: 1200
  a3x: 1150
  "o{i}": {each: {i: [1, 2, 3, 4]}, nominal: 400, range: 0.3}
ground: {A1: [0, 0], A2: [a2x, 0], A3: [a3x, 900], A4: [50, 950]}
bodies: {plate: {at: [600, 450], points: {P1: [-120, -80], P2: [120, -80], P3: [120, 80], P4: [-120, 80]}}}
bars: {"leg{i}": {each: {i: [1, 2, 3, 4]}, between: ["A{i}", "P{i}"], k: 8 N/um}}
actuators:
  "q{i}": {each: {i: [1, 2, 3]}, drives: "leg{i}", offset: "o{i}"}
  q4: {drives: leg4, offset: o4, redundant: true}
sensors: {tracker: {at: plate, reads: [x, y, rz], sigma: {position: 6 um, orientation: 25 urad}, frame: fitted}}
tool_point: plate
"""


@pytest.mark.slow
def test_inches_of_a_leg_are_named_where_most_rows_are_out_of_reach(tmp_path: Path) -> None:
    """A tracker that stands anywhere has nothing to say of it: that is no explanation."""
    machine, poses, table = (tmp_path / n for n in ("m.yaml", "p.csv", "t.csv"))
    machine.write_text(FOUR_LEGS, encoding="utf-8")
    grid = [f"{x},{y},{rz}" for x in (460, 600, 740) for y in (340, 450, 560) for rz in (-8, 7)]
    poses.write_text("\n".join(["x [mm],y [mm],rz [deg]", *grid]), encoding="utf-8")
    assert run("simulate", machine, poses, "--noise", "declared", "-o", table, "-q").code == 0
    lines = [line for line in table.read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    header, *rows = csv.reader(lines)
    changed = {"q2 [mm]": (1 / 25.4, 0.0), "x [mm]": (1.0, 212.3), "y [mm]": (1.0, -87.1)}
    for name, (factor, shift) in changed.items():
        place = header.index(name)
        for row in rows:
            row[place] = repr(factor * float(row[place]) + shift)
    table.write_text("\n".join(",".join(r) for r in [header, *rows]), encoding="utf-8")
    done = run("check", machine, table)
    assert done.code == 1 and "`q2` looks 25.4 times too small (is it in `in`, not `mm`?)" in done.err
