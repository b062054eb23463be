"""`python -m tests.first_campaign`: the files of docs/first-campaign.md.

The machine file and the plan come from `pkmcal`. The measurements come from the closed forms of
`tests/truth/templates_true.py`, which share no code with it: a delta with wrong dimensions, and a backlash that its
machine file does not declare.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from tests.command import ROOT, run
from tests.csv_tables import read_table
from tests.truth.templates_true import Array, delta_pose

FOLDER = ROOT / "docs" / "first-campaign"
BACKLASH = 0.03
"""Of q2, mm."""
NAMES = ("delta.yaml", "plan.csv", "measured.csv", "after.csv")
SIGMA = 0.004
"""Of the tracker, mm; as the machine file states it for this span."""
NOMINAL = {"R": 280.0, "turn": 0.0, "tilt": 0.0, "lean": 0.0, "stop": 0.0, "rod": 560.0}
RANGE = {"R": 0.08, "turn": 0.02, "tilt": 2e-4, "lean": 2e-4, "stop": 0.08, "rod": 0.08}
GRID = "x=-140:140:5,y=-140:140:5,z=-580:-460:3"
TARGETS = "x=-120:120:4,y=-120:120:4,z=-560:-480:2"
FOUND = "extends: delta.yaml\neffects: {backlash@q2: {b: {identify: true}}}\n"


def machine() -> dict[str, float]:
    """The dimensions of the machine as it was built: errors of half the ranges, one standard deviation."""
    rng = np.random.default_rng(11)
    off = {f"{n}{i}": v + 0.5 * RANGE[n] * float(rng.normal()) for n, v in NOMINAL.items() for i in (1, 2, 3)}
    return off | {"r": 40.0, "w": 32.0}


def positions(readings: Array, sides: Array) -> Array:
    """Where the tracker sees the platform (N, 3), without noise, mm; sides: of approach (N, 3)."""
    true, p = readings.copy(), machine()
    true[:, 1] -= 0.5 * BACKLASH * sides[:, 1]
    return np.array([delta_pose(row, p) for row in true])


def _sides(table: Path) -> Array:
    """From which side set values are reached (N, 3); those that come from no side from below."""
    plan = read_table(table)
    sides = np.transpose([plan.numbers[f"dir.q{i}"] for i in (1, 2, 3)])
    return np.where(sides == 0, 1.0, sides)


def _seen(table: Path, seed: int) -> list[str]:
    """What the tracker reads at the rows of a table of set values: three cells a row."""
    drives = [read_table(table).numbers[f"q{i}"] for i in (1, 2, 3)]
    seen = positions(np.transpose(drives), _sides(table))
    seen = seen + SIGMA * np.random.default_rng(seed).normal(size=seen.shape)
    return [",".join(f"{v:.4f}" for v in at) for at in seen]


def measured(plan: Path) -> str:
    """The plan as it comes back from the machine: the cells of the readings are filled."""
    lines = plan.read_text(encoding="utf-8").splitlines()
    rows = [line.rstrip(",") + "," + at for line, at in zip(lines[1:], _seen(plan, 21), strict=True)]
    return "\n".join([lines[0], *rows, ""])


def after(commands: Path) -> str:
    """What is measured at corrected set values."""
    table, names = read_table(commands), [f"dir.q{i}" for i in (1, 2, 3)] + [f"q{i}" for i in (1, 2, 3)]
    numbers = np.hstack([_sides(commands), np.transpose([table.numbers[name] for name in names[3:]])])
    rows = [
        f"{k},{','.join(f'{v:g}' for v in row[:3])},{','.join(f'{v:.4f}' for v in row[3:])},{at}"
        for k, (row, at) in enumerate(zip(numbers, _seen(commands, 22), strict=True), 1)
    ]
    head = ",".join(["id", *names[:3], *(f"{name} [mm]" for name in (*names[3:], "x", "y", "z"))])
    return "\n".join([head, *rows, ""])


def files() -> dict[str, str]:
    """The files of the page, by name."""
    old = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            _command("new", "delta", "--span", "400 mm", "-o", "delta.yaml")
            _command("plan", "delta.yaml", "--grid", GRID, "-q", "-o", "plan.csv")
            Path("measured.csv").write_text(measured(Path("plan.csv")), encoding="utf-8")
            Path("found.yaml").write_text(FOUND, encoding="utf-8")
            _command("calibrate", "found.yaml", "measured.csv", "-q", "-o", "p.yaml")
            _command("correct", "found.yaml", "--grid", TARGETS, "-p", "p.yaml", "-q", "-o", "commands.csv")
            Path("after.csv").write_text(after(Path("commands.csv")), encoding="utf-8")
            return {name: Path(name).read_text(encoding="utf-8") for name in NAMES}
        finally:
            os.chdir(old)


def _command(*words: str) -> None:
    done = run(*words)
    assert done.code == 0, done.err


def main() -> None:
    """Write them."""
    FOLDER.mkdir(exist_ok=True)
    for name, text in files().items():
        (FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
