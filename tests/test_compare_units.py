"""`compare` tells the change of the tool point in the units of the machine file, as its limits are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command import clean, run

MACHINE = """
units: {length: in, angle: deg, force: lbf}
space: planar
ranges: {length: 0.04}
parameters: {o1: 12, o2: 12}
ground: {A: [0, 0], B: [30, 0]}
nodes: {tip: [15, 20]}
bars:
  leg1: {between: [A, tip], length: 25}
  leg2: {between: [B, tip], length: 25}
actuators:
  q1: {drives: leg1, offset: o1}
  q2: {drives: leg2, offset: o2}
sensors: {tracker: {at: tip, reads: [x, y], sigma: 0.0004, frame: machine}}
workspace: {box: {x: [8, 22], y: [12, 28]}}
"""


def test_a_machine_in_inches_moves_by_inches(tmp_path: Path) -> None:
    """It was told in mm beside parameters in inches. Leg 2 longer by 0.03 in: right below B, the tip moves as much."""
    machine = tmp_path / "legs.yaml"
    machine.write_text(MACHINE, encoding="utf-8")
    for name, offset in (("old", 12.0), ("new", 12.03)):
        (tmp_path / "true.yaml").write_text(f"parameters: {{o2: {offset}}}\n", encoding="utf-8")
        table = tmp_path / f"{name}.csv"
        known = ("-p", tmp_path / "true.yaml", "--noise", "declared", "--seed", int(offset * 100))
        clean(run("simulate", machine, "--grid", "x=8:22:5,y=12:28:5", *map(str, known), "-o", table))
        clean(run("calibrate", machine, table, "--holdout", "none", "-o", tmp_path / f"{name}.p.yaml"))
    done = clean(run("compare", tmp_path / "old.p.yaml", tmp_path / "new.p.yaml"))
    line = next(text for text in done.err.splitlines() if text.startswith("change of the tool point"))
    found = re.search(r": (\S+) in rms \((\S+) in by chance alone\), largest (\S+) in .* x = (\S+) in", line)
    assert found is not None and "mm" not in line and " um" not in line
    rms, chance, largest, x = map(float, found.groups())
    assert 0.03 < rms < largest < 0.07 and chance < 0.002 and 8 <= x <= 22
    limit = run("compare", tmp_path / "old.p.yaml", tmp_path / "new.p.yaml", "--fail-above", "change 0.001 in", "-q")
    assert limit.code == 1 and f"{largest:.4g} in" in limit.err
    given = clean(run("compare", tmp_path / "old.p.yaml", tmp_path / "new.p.yaml", "--json")).json["tool_point"]
    assert given["unit"] == "um" and given["max"] == pytest.approx(25400 * largest, rel=1e-3)
