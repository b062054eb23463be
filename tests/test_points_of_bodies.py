"""References to points that are written with their body."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import run

MACHINE = """
units: {{length: mm, angle: deg}}
space: planar
ranges: {{length: 0.1}}
parameters: {{l: 300}}
ground: {{O: [0, 0]}}
guides: {{rail: {{along: x}}}}
bodies:
  car: {{guide: rail, at: 0, points: {{B1: [0, 0]}}}}
  platform: {{at: [0, 300], points: {{P1: [0, 0], tip: [50, 20]}}}}
joints: {{hub: {{between: [O, {hub}], type: fixed}}}}
bars: {{rod: {{between: [{rod}, B1], length: l, k: 10 kN/mm}}}}
actuators: {{q: {{moves: car}}}}
sensors: {{camera: {{at: {seen}, reads: [x, y], sigma: 1 um, frame: machine}}}}
tool_point: {tool}
"""
RIGHT = {"hub": "platform", "rod": "P1", "seen": "tip", "tool": "tip"}


@pytest.mark.parametrize(("where", "point"), [("rod", "P1"), ("seen", "tip"), ("tool", "tip")])
def test_the_hint_is_the_point_without_its_body(tmp_path: Path, where: str, point: str) -> None:
    """Names of points are unique in a machine: only the first part is too much, and nothing else is a fault."""
    file = tmp_path / "m.yaml"
    file.write_text(MACHINE.format(**RIGHT | {where: f"platform.{point}"}))
    done = run("check", file)
    assert done.code == 1 and f"unknown point `platform.{point}`" in done.err, done.err
    assert f"help: did you mean `{point}`?\n" in done.err and "1 fault\n" in done.err, done.err
    assert "is not used" not in done.err


def test_a_point_of_another_body_is_not_meant(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(MACHINE.format(**RIGHT | {"rod": "car.P1"}))
    assert "did you mean `P1`?" not in run("check", file).err
