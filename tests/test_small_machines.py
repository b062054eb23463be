"""Machines that travel by micrometres: what is a little way elsewhere is beyond their travel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import column, run

STAGE = """\
units: {length: mm, angle: mrad, force: N}
space: planar
ranges: {length: 0.01, scale: 0.05}
parameters: {sx: 1, sy: 1, h: 20}
guides: {low: {along: x}, high: {body: slide, along: y}}
bodies: {slide: {guide: low, at: 0}, table: {guide: high, at: 0, points: {mirror: [3, h]}}}
actuators: {u: {moves: slide, unit: um, scale: sx, LIMITS}, v: {moves: table, unit: um, scale: sy, LIMITS}}
sensors: {interferometer: {at: mirror, reads: [x, y], sigma: 5 nm, frame: machine}}
"""


def stage(tmp_path: Path, limits: str) -> Path:
    """Two slides that piezos drive."""
    file = tmp_path / "stage.yaml"
    file.write_text(STAGE.replace(", LIMITS", limits))
    return file


@pytest.mark.parametrize("limits", [", limits: [0, 15]", ""])
def test_a_stage_of_some_micrometres_can_be_planned(limits: str, tmp_path: Path) -> None:
    """Approaches begin within travel, by which limits or the poses tell what is far: 1.5 um; they were 1 mm long."""
    file = stage(tmp_path, limits)
    poses = ["--grid", "x=3.002:3.013:4,y=20.002:20.013:4"]
    done = run("plan", file, *poses, "-o", tmp_path / "plan.csv")
    assert done.code == 0, done.err
    plan = tmp_path / "plan.csv"
    there, before = (np.stack([column(plan, f"{of}{drive}") for drive in "uv"]) for of in ("", "approach."))
    least = np.abs(there - before).min(axis=0)
    assert (least > 1e-3).all() and (least < 1.5).all()
    assert not limits or ((before > 0) & (before < 15)).all()


def test_the_direction_of_a_slide_that_is_drawn_at_its_zero_is_felt(tmp_path: Path) -> None:
    """Where it stands the direction moves nothing, elsewhere it does: `check` said that it has none."""
    file = tmp_path / "square.yaml"
    text = STAGE.replace("along: y", "along: [sq, 1]").replace("sy: 1, h", "sy: 1, sq: {nominal: 0, range: 0.01}, h")
    file.write_text(text.replace(", LIMITS", ""))
    done = run("check", file)
    assert done.code == 0 and "no faults" in done.err, done.err
    (tmp_path / "true.yaml").write_text("parameters: {sq: 0.004}\n")
    poses = tmp_path / "poses.csv"
    poses.write_text("u [um],v [um]\n0,0\n0,10\n5,10\n")
    done = run("simulate", file, poses, "-p", tmp_path / "true.yaml", "-o", tmp_path / "seen.csv")
    x = column(tmp_path / "seen.csv", "x") - 3
    assert done.code == 0 and x == pytest.approx(np.array([0, 0.01 * 0.004, 0.005 + 0.01 * 0.004]), abs=1e-9)
