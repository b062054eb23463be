"""`check --tolerance` of tables with distances only: each is a length, judged by ISO 14253-1 like a position."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import Done, run

SLIDE = """
units: {length: mm, angle: deg}
space: planar
ranges: {length: 1}
parameters: {bx: 600, by: -200}
ground: {ball: [bx, by]}
guides: {long: {along: x}, short: {body: cross, along: y}}
bodies: {cross: {guide: long, at: 0}, ram: {guide: short, at: 0, points: {tip: [0, 0]}}}
actuators: {X: {moves: cross}, Y: {moves: ram}}
sensors: {bar: {kind: distance, at: tip, to: ball, sigma: 1 um}}
tool_point: tip
"""
KNOWN = """
parameters: {bx: {value: 600.1, std: 0.001, unit: mm}, by: {value: -200.3, std: 0.001, unit: mm}}
correlations: {names: [bx, by], std: [0.001, 0.001], matrix: [[1, 0], [0, 1]]}
"""
X, Y = np.array([0.0, 100, 200, -300]), np.array([0.0, 50, -80, 40])


def checked(folder: Path, off: list[float], tolerance: str) -> Done:
    """A table of distances that are off by so many micrometres; U is 2 um."""
    bar = np.hypot(X - 600.1, Y + 200.3) + 1e-3 * np.array(off)
    (folder / "m.yaml").write_text(SLIDE)
    (folder / "p.yaml").write_text(KNOWN)
    lines = [f"{x},{y},{d!r}\n" for x, y, d in zip(X.tolist(), Y.tolist(), bar.tolist(), strict=True)]
    (folder / "t.csv").write_text("X,Y,bar\n" + "".join(lines))
    files = (folder / "m.yaml", folder / "t.csv", "-p", folder / "p.yaml")
    return run("check", *files, "--tolerance", tolerance, "--json")


@pytest.mark.parametrize(
    ("off", "verdict", "counts"),
    [
        ([7.5, -7.4, 0.0, 1.0], "pass", (4, 0, 0)),  # |e| + 2 um within 10 um
        ([7.5, -8.5, 0.0, 1.0], "undecided", (3, 0, 1)),
        ([7.5, -11.5, 12.5, 1.0], "fail", (2, 1, 1)),  # |e| - 2 um beyond
    ],
)
def test_each_distance_is_judged(tmp_path: Path, off: list[float], verdict: str, counts: tuple[int, ...]) -> None:
    done = checked(tmp_path, off, "10 um")
    assert done.code == (0 if verdict == "pass" else 1), done.err
    told = done.json["verification"]["tolerance"]
    assert told["verdict"] == verdict
    assert (told["n_pass"], told["n_fail"], told["n_undecided"]) == counts
    worst = int(np.argmax(np.abs(off)))
    assert told["largest"]["line"] == worst + 2 and told["largest"]["expanded_uncertainty"] == pytest.approx(2.0)
    assert told["largest"]["error"] == pytest.approx(abs(off[worst]), abs=1e-6)
    assert f"{verdict.upper()} (ISO 14253-1, tolerance 10 um): 4 lengths" in done.err
    assert "How far the tool point is off across it, it does not show." in done.err
