"""What residuals larger than noise mean where poses were repeated: an effect that the model lacks, or a wrong sigma."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.command import run
from tests.support import model, overlay

MACHINE = model(overlay("triglide"))
STATED = "readings of the same poses scatter as stated"


def written(path: Path, repeats: int, noise: float, wave: float, poses: int = 20) -> Path:
    """A table of the Triglide, 20 random poses: x with a wave over the travel that no rod makes, m."""
    rng = np.random.default_rng(6)
    at = np.tile(MACHINE.tool.reference, (poses, 1))
    at[:, :2] = rng.uniform([0.25, 0.2], [0.65, 0.34], size=(poses, 2))
    drives = np.repeat(drive_positions(MACHINE, at).readings, repeats, axis=0)
    seen = predict(MACHINE, MACHINE.nominal, Rows.at(drives)).values
    seen[:, 0] += wave * np.sin(drives[:, 0] / 4e-3)
    seen += noise * rng.normal(size=seen.shape)
    lines = [",".join(f"{1e3 * v!r}" for v in [*q, *z]) for q, z in zip(drives.tolist(), seen.tolist(), strict=True)]
    path.write_text("\n".join(["q1 [mm],q2 [mm],q3 [mm],x [mm],y [mm]", *lines]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("repeats", "noise", "wave", "confirmed"),
    [
        (4, 10e-6, 60e-6, True),
        (4, 40e-6, 0.0, False),
        (1, 10e-6, 60e-6, False),
        (4, 12e-6, 4e-6, False),
        (4, 30e-6, 300e-6, False),
    ],
    ids=["an effect", "a wrong sigma", "no repeats", "hardly more than noise", "both"],
)
def test_repeats_tell_noise_from_an_effect(
    repeats: int, noise: float, wave: float, confirmed: bool, tmp_path: Path
) -> None:
    """The tracker states 10 um. 60 degrees of freedom tell it to a fifth; residuals 1.2 times as large are no case."""
    done = run("calibrate", "triglide", written(tmp_path / "t.csv", repeats, noise, wave), "--holdout", "none")
    assert "larger than the stated noise" in done.err
    assert (STATED in done.err) == confirmed and ("or sigma is too small" in done.err) == (not confirmed)
    assert "The model lacks an effect" in done.err


def test_repeats_of_one_channel_alone_confirm_nothing(tmp_path: Path) -> None:
    """y was read once a pose: whether its sigma is right nobody knows."""
    table = written(tmp_path / "t.csv", 4, 10e-6, 60e-6)
    lines = table.read_text(encoding="utf-8").splitlines()
    kept = [line if k % 4 == 0 else line.rpartition(",")[0] + "," for k, line in enumerate(lines[1:])]
    table.write_text("\n".join([lines[0], *kept]) + "\n", encoding="utf-8")
    done = run("calibrate", "triglide", table, "--holdout", "none")
    assert "or sigma is too small" in done.err and STATED not in done.err
