"""A drum that is not round its axis: line comes and goes once per turn, which needs no entry in the machine file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import run
from tests.truth import dimensions as dim
from tests.truth.look_alikes.spools import FOLDS, GEAR, HIGH, LINES, LOW, MACHINE, RADIUS, TOP, natural_lengths

ECCENTRICITY, PHASE, ROWS = 4e-3, 0.7, 60
SIGMA, DEGREE = 0.1e-3, np.pi / 180


def motor_of_eccentric(out: Array) -> Array:
    """Motor angles (N,), rad, at which a drum with its axis off its centre has paid out line (N,), by Newton's method.

    The line runs off at a fixed side: the centre, and with it the line, comes and goes by e sin(angle + phase).
    """
    angle = out / RADIUS
    for _ in range(50):
        wound = RADIUS * angle + ECCENTRICITY * (np.sin(angle + PHASE) - np.sin(PHASE))
        angle = angle - (wound - out) / (RADIUS + ECCENTRICITY * np.cos(angle + PHASE))
    return np.asarray(angle / GEAR)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    rng = np.random.default_rng(3)
    places = rng.uniform(LOW, HIGH, size=(ROWS, 3))
    places[:, :2] *= 1 - places[:, 2:] / TOP
    anchors = np.array([[dim.HANGPRINTER[f"{line}{axis}"] for axis in "xyz"] for line in LINES])
    zeros = np.array([1.604, 1.797, 1.591, 2.355])
    out = (natural_lengths(places, anchors, dim.HANGPRINTER["EA"]) - zeros) * FOLDS
    angles = out / RADIUS / GEAR
    angles[:, 1] = motor_of_eccentric(out[:, 1])
    angles += 0.2e-3 * FOLDS / RADIUS / GEAR * rng.normal(size=angles.shape)
    read = places + SIGMA * rng.normal(size=places.shape)
    head = ",".join([*(f"{line} [deg]" for line in LINES), "x [mm]", "y [mm]", "z [mm]"])
    body = np.hstack([angles / DEGREE, read / dim.MM])
    file = tmp_path / "t.csv"
    np.savetxt(file, body, delimiter=",", header=head, comments="", fmt="%.6f")
    return file


def test_an_eccentric_drum_is_named_with_its_size(table: Path, tmp_path: Path) -> None:
    """Per travel of the tackle's rope it is half of the line that comes and goes."""
    machine = tmp_path / "m.yaml"
    machine.write_text(MACHINE.read_text(encoding="utf-8"), encoding="utf-8")
    (found,) = run("diagnose", machine, table, "--json").json["effects"]
    assert (found["effect"], found["at"], [s["at"] for s in found["credible_set"]]) == ("pitch", "B", ["B"])
    true = 1e6 * ECCENTRICITY / FOLDS[1] * np.array([np.sin(PHASE), np.cos(PHASE)])  # of cosine and sine, um
    for size, value in zip(found["parameters"], true, strict=True):
        assert size["unit"] == "um" and abs(size["value"] - value) < 3.5 * size["std"] < 0.15 * abs(value)
