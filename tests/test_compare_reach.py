"""`compare` tells the change of the tool point where it was measured, not where drives could bring it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.campaigns import shipped
from tests.command import MACHINES, run
from tests.truth import generate

TWO_LEGS = "triglide-nonredundant"
PLAIN = str(MACHINES / f"{TWO_LEGS}.yaml")
MM, UM = 1e-3, 1e-6


def test_the_tool_point_changes_where_it_was_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without `workspace`, and none of the poses stretched: a leg 60 um longer moves the tool by what the independent
    simulator says of the rows. With drives at the ends of their travel it was 19.9 mm, at a pose that no row is near.
    """
    monkeypatch.chdir(tmp_path)
    simulator, plan = generate.campaigns()[TWO_LEGS].machine, shipped(TWO_LEGS)
    files, poses = [], plan.positions
    low = poses[simulator.forward(poses, simulator.nominal).tcp[:, 1] < 375 * MM]
    for name, longer in (("a", 0.0), ("b", 0.06 * MM)):
        values = {**simulator.nominal, "l1": simulator.nominal["l1"] + longer}
        rows = np.hstack([low, simulator.forward(low, values).tcp[:, :2]])
        noise = 5e-6 * np.random.default_rng(3).normal(size=(len(rows), 2))
        lines = [",".join(f"{v / MM:.7f}" for v in row) for row in rows + np.hstack([0 * low, noise])]
        Path(f"{name}.csv").write_text("\n".join(["q1 [mm],q2 [mm],x [mm],y [mm]", *lines, ""]))
        done = run("calibrate", PLAIN, f"{name}.csv", "-o", f"{name}.yaml", "-q", "--holdout", "none")
        assert done.code == 0, done.err
        files.append(f"{name}.yaml")
    moved = simulator.forward(low, values).tcp - simulator.forward(low, simulator.nominal).tcp
    size = np.linalg.norm(moved, axis=1)
    tool = run("compare", *files, "--json").json["tool_point"]
    assert tool["over"] == "measured travel" and tool["unit"] == "um" and tool["at"]["y"] <= 375.1
    assert tool["max"] == pytest.approx(size.max() / UM, rel=0.1)
    assert tool["rms"] == pytest.approx(np.sqrt((size**2).mean()) / UM, rel=0.15)
