"""`simulate --uncertainty` knows the same set values as well as `correct` and `check -p` do, whatever is unsure."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tests.command import MACHINES, SCISSORS, SHOPFLOOR, column, run

GRID = "x=-100:100:3,y=-100:100:3"
SHAPE = f"""extends: {MACHINES / "scissors.yaml"}
effects:
  unexplained@q2: {{knots: [-1000, -950, -900, -850], values: [0.01, -0.005, 0.02, 0.001], spread: 0.02, width: 60}}
  unexplained@q3: {{knots: [-1000, -950, -900, -850], values: [0.01, -0.005, 0.02, 0.001], spread: 0.02, width: 60}}
"""


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def both(machine: str, *more: str) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    """Uncertainties (N, 2), um, of corrected set values: by `correct`, and by `simulate` of its table."""
    asked = ("correct", machine, "--grid", GRID, "-p", "p.yaml", "-o", "c.csv", "--redundant", "nominal", *more)
    assert run(*asked, "-q", "--force").code == 0
    done = run("simulate", machine, "c.csv", "-p", "p.yaml", "--uncertainty", "-o", "s.csv", "-q", "--force")
    assert done.code == 0, done.err
    corrected, mapped = (np.stack([column(f, f"u.{x}") for x in "xy"], axis=1) for f in ("c.csv", "s.csv"))
    return corrected, mapped


def test_what_a_calibration_left_is_in_the_map() -> None:
    """A table with effects that the model lacks: their size, of each coordinate, is part of what is not known."""
    run("calibrate", SCISSORS, SHOPFLOOR, "-o", "p.yaml", "--holdout", "none", "-q")
    text = Path("p.yaml").read_text()
    left = float(re.search(r"^unexplained:(?:.*\n)*?  position: \{std: ([\d.]+)", text, re.MULTILINE)[1])  # type: ignore[index]
    assert left > 5
    corrected, mapped = both(SCISSORS)
    assert mapped == pytest.approx(corrected, rel=1e-6)
    Path("p.yaml").write_text(text.replace(f"std: {left}", "std: 0.0"))
    assert mapped**2 - both(SCISSORS)[1] ** 2 == pytest.approx(np.full(mapped.shape, left**2), rel=1e-6)


def test_a_side_that_nobody_knows_is_in_the_map() -> None:
    """The first row comes from no side: half a reversal of its drive there, by differences of set values."""
    effect = "backlash@q1: {b: {value: 30 um, identify: false}}"
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects:\n  {effect}\n")
    table = str(MACHINES / "scissors.csv")
    assert run("calibrate", "m.yaml", table, "-o", "p.yaml", "--holdout", "none", "-q", "--accept").code in (0, 1)
    corrected, mapped = both("m.yaml")
    assert mapped == pytest.approx(corrected, rel=1e-6)
    moved = []
    lines = Path("c.csv").read_text().splitlines()
    head = lines[0].split(",")
    place, side = (next(k for k, c in enumerate(head) if c.startswith(n)) for n in ("q1", "dir.q1"))
    for way in ("-1", "1"):
        cells = lines[1].split(",")
        assert float(cells[side]) == 0
        cells[side] = way
        Path("one.csv").write_text(f"{lines[0]}\n{','.join(cells)}\n")
        run("simulate", "m.yaml", "one.csv", "-p", "p.yaml", "--uncertainty", "-o", "o.csv", "-q", "--force")
        moved.append([column("o.csv", x)[0] * 1e3 for x in "xy"])
        known = np.array([column("o.csv", f"u.{x}")[0] for x in "xy"])
    half = 0.5 * np.abs(np.subtract(*moved))
    assert half.max() > 3 and place >= 0
    assert mapped[0] ** 2 - known**2 == pytest.approx(half**2, rel=0.01, abs=0.05)


def test_what_shapes_do_not_know_is_in_all() -> None:
    """Beyond its knots a shape is as unsure as its spread and its line: set values there are, and predictions."""
    Path("m.yaml").write_text(SHAPE)
    table = str(MACHINES / "scissors.csv")
    assert run("calibrate", "m.yaml", table, "-o", "p.yaml", "--holdout", "none", "-q", "--accept").code in (0, 1)
    corrected, mapped = both("m.yaml")
    assert mapped.max() > 10, "most targets lie beyond the knots"
    assert mapped == pytest.approx(corrected, rel=1e-6)
    done = run("check", "m.yaml", table, "-p", "p.yaml", "--json", "-q")
    by_check = {c["name"]: c["u_predicted"] for c in json.loads(done.out)["verification"]["channels"]}
    run("simulate", "m.yaml", table, "-p", "p.yaml", "--uncertainty", "-o", "s.csv", "-q", "--force")
    for x in "xy":
        expanded = 2e-3 * np.sqrt(np.mean(column("s.csv", f"u.{x}") ** 2))
        assert by_check[x] == pytest.approx(expanded, rel=1e-3)
