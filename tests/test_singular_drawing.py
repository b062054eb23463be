"""Drawn in or next to a singular pose: `check` tells so, as rows about it may be solved in either assembly."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import Done, run

FLAT = """units: {{length: mm, angle: deg, force: N}}
space: planar
ranges: {{length: 0.1}}
parameters: {{l1: 400, l2: 400}}
guides: {{rail: {{along: x}}}}
bodies:
  c1: {{guide: rail, at: {left}, points: {{B1: [0, 0]}}}}
  c2: {{guide: rail, at: {right}, points: {{B2: [0, 0]}}}}
nodes: {{tcp: [0, {height}]}}
bars: {{rod1: {{between: [B1, tcp], length: l1}}, rod2: {{between: [B2, tcp], length: l2}}}}
actuators: {{q1: {{moves: c1}}, q2: {{moves: c2}}}}
sensors: {{tracker: {{at: tcp, reads: [x, y], sigma: 5 um, frame: machine}}}}
"""


def checked(height: float, tmp_path: Path) -> Done:
    """Two rods on one rail meet `height` above it: dq/dy = height / reach, which vanishes where they lie flat."""
    reach = (400**2 - height**2) ** 0.5
    (tmp_path / "m.yaml").write_text(FLAT.format(left=-reach, right=reach, height=height), encoding="utf-8")
    return run("check", tmp_path / "m.yaml", "--json")


@pytest.mark.parametrize("height", [1.0, 2.5])
def test_a_drawing_next_to_a_singular_pose_is_told(height: float, tmp_path: Path) -> None:
    done = checked(height, tmp_path)
    (told,) = done.json["warnings"]
    assert (done.code, told["code"], told["line"]) == (0, "singular", 11)
    assert "hardly hold the platform in y" in told["message"]


@pytest.mark.parametrize("height", [60.0, 250.0])
def test_a_drawing_away_from_singular_poses_is_not(height: float, tmp_path: Path) -> None:
    assert not checked(height, tmp_path).json["warnings"]
