"""Orientations read by an instrument that stands anywhere: their signs and units, by rotations of another library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.gross_errors.frame_turns import lever
from pkmcal_cli.gross_errors.mirror import brought_back, explain_frame
from tests.command import run

NAMES, UNITS = ["x", "y", "z", "rx", "ry", "rz"], ["mm", "mm", "mm", "deg", "deg", "deg"]
POINTS, TURNS = [[0, 1, 2]], [[3, 4, 5]]
STAGE = """
units: {length: mm, angle: deg}
space: planar
ranges: {length: 0.2, angle: 0.1}
datum: [z]
parameters: {z: 0, e: 50}
ground: {O: [0, 0]}
frames: {arm_axes: {body: arm}}
guides: {rail: {frame: arm_axes, along: x}}
bodies: {arm: {at: [0, 0]}, slide: {guide: rail, at: 300, points: {mark: [0, e]}}}
joints: {hub: {between: [O, arm], type: revolute}}
actuators: {a: {turns: arm, zero: z}, q: {moves: slide}}
sensors: {tracker: {at: mark, reads: [x, y, rz], sigma: {position: 5 um, orientation: 20 urad}, frame: fitted}}
"""
"""A slide on an arm that turns."""


def seen() -> tuple[Array, Array]:
    """Readings (20, 6) of an instrument that is turned by 2 rad, one orientation missing; and predictions, SI."""
    rng = np.random.default_rng(4)
    body, place = Rotation.from_rotvec(rng.normal(0, 0.3, (20, 3))), rng.uniform(-0.2, 0.2, (20, 3))
    frame = Rotation.from_rotvec([1.2, -1.4, 0.8])
    there = np.hstack([place, body.as_rotvec()])
    here = np.hstack([frame.apply(place) + np.array([2.0, -1.0, 0.5]), (frame * body).as_rotvec()])
    here[:, :3] += rng.normal(0, 1e-5, (20, 3))
    here[7, 4] = np.nan
    return here, there


def test_rotation_vectors_are_brought_back_with_their_points() -> None:
    here, there = seen()
    back = brought_back(here, there, POINTS, TURNS)
    known = np.arange(20) != 7
    np.testing.assert_allclose(back[known], there[known], atol=2e-4)
    assert np.isnan(back[7, 3:]).all() and np.isfinite(back[7, :3]).all()


@pytest.mark.parametrize(
    ("slip", "words"),
    [
        ([-1, -1, -1], "`rx`, `ry`, `rz` look reversed in sign"),
        ([1, -1, 1], "`ry` looks reversed in sign"),
        ([np.pi / 180] * 3, "`rx`, `ry`, `rz` look 57.3 times too small (is it in `rad`, not `deg`?)"),
    ],
)
def test_signs_and_units_of_rotation_vectors(slip: list[float], words: str) -> None:
    here, there = seen()
    wrong = here * np.array([1, 1, 1, *slip])
    hints, right = explain_frame(wrong, there, POINTS, NAMES, UNITS, TURNS)
    assert [h.message.partition(": ")[0] for h in hints] == [words]
    np.testing.assert_allclose(right, here, atol=1e-12)
    assert explain_frame(here, there, POINTS, NAMES, UNITS, TURNS)[0] == ()


@pytest.mark.parametrize(
    ("kept", "words"),
    [
        ("own", "`rx`, `ry`, `rz` look counted from another orientation, as from the reference pose"),
        ("base", "`rx`, `ry`, `rz` look given in other axes"),
    ],
)
def test_orientations_against_the_reference_pose_are_told(kept: str, words: str) -> None:
    """R B R^-1 in the axes of the instrument, or B in those of the base, where R B is what it reads."""
    here, there = seen()
    frame = Rotation.from_rotvec([1.2, -1.4, 0.8])
    body = Rotation.from_rotvec(there[:, 3:])
    wrong = here.copy()
    wrong[:, 3:] = (frame * body * frame.inv() if kept == "own" else body).as_rotvec()
    wrong[7, 4] = np.nan
    (hint,), _ = explain_frame(wrong, there, POINTS, NAMES, UNITS, TURNS)
    assert hint.message.partition(": ")[0] == words and not hint.mends
    assert "when turned by 115 deg in all rows" in hint.message and hint.after < 1e-3


def test_what_points_on_a_line_show_of_a_turn_about_it() -> None:
    line = np.linspace(-1, 1, 5)[:, None] * np.array([1.0, 1.0, 0.0])
    assert lever(line) < 1e-12, "nothing about the line"
    assert lever(line[:, :2]) == pytest.approx(1.0), "in the plane all of it"
    square = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0.0]])
    assert lever(square) == pytest.approx(1.0), "about an axis in its plane"


def table(slip: float) -> str:
    """Poses of the stage in closed form, as an instrument reads them that is turned by 150 deg."""
    a, q = (np.random.default_rng(1).uniform(*ends, 30) for ends in ((-60, 60), (200, 400)))
    turn, frame = np.radians(a), np.radians(150)
    place = (q + 50j) * np.exp(1j * turn) * np.exp(1j * frame) + (3000 - 1000j)
    rows = zip(a, q, place.real, place.imag, slip * (a + 150), strict=True)
    return "a [deg],q [mm],x [mm],y [mm],rz [deg]\n" + "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in rows)


@pytest.mark.parametrize(
    ("slip", "words"), [(-1.0, "`rz` looks reversed in sign"), (np.pi / 180, "`rz` looks 57.3 times too small")]
)
def test_check_compares_orientations_in_a_frame_that_is_fitted(slip: float, words: str, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(STAGE)
    (tmp_path / "right.csv").write_text(table(1.0))
    (tmp_path / "wrong.csv").write_text(table(slip))
    good, bad = (run("check", tmp_path / "m.yaml", tmp_path / f"{t}.csv") for t in ("right", "wrong"))
    assert good.code == 0 and "\nrz " in good.err and "not compared" not in good.err, good.err
    assert bad.code == 1 and f"error[plausibility]: {words}" in bad.err, bad.err
