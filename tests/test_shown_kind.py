"""Of two kinds of readings, errors are told of that which noise does not explain: in words, tables, pictures, JSON."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.benchmark.setting import FOLDER
from tests.command import Done, clean, run
from tests.truth.campaigns import Planted, campaign

pytestmark = pytest.mark.usefixtures("unsized")

MACHINE = "triglide-nonredundant"
BALL = np.array([520.0, -40.0])
BAR = f"""
parameters: {{ballx: {{nominal: {BALL[0]}, range: 0.1}}, bally: {{nominal: {BALL[1]}, range: 0.1}}}}
ground: {{ball: [ballx, bally]}}
sensors: {{bar: {{kind: distance, at: tcp, to: ball, sigma: 2 um}}}}
"""


def measured(folder: Path, constant: float) -> tuple[Path, Path]:
    """A machine with a tracker and a bar, and a campaign in which the bar reads `constant`, mm, too much."""
    machine, table = folder / "m.yaml", folder / f"{constant}.csv"
    machine.write_text(f"extends: {FOLDER / MACHINE}.yaml{BAR}", encoding="utf-8")
    made, rng = campaign(MACHINE, [], 3, rows=60), np.random.default_rng(1)
    read = np.hypot(*(1e3 * made.true_readings - BALL).T) + constant + 2e-3 * rng.normal(size=60)
    head, *lines = made.csv_text().replace(",x [mm],y [mm]", ",tracker.x [mm],tracker.y [mm]").splitlines()
    rows = [f"{line},{length:.5f}" for line, length in zip(lines, read, strict=True)]
    table.write_text("\n".join([f"{head},bar [mm]", *rows, ""]), encoding="utf-8")
    return machine, table


def diagnosed(folder: Path, constant: float) -> Done:
    return clean(run("diagnose", *measured(folder, constant), "--json", "--plots", folder / "pictures"))


def test_errors_are_told_of_the_kind_that_stands_out(tmp_path: Path) -> None:
    """The constant of a bar: positions agree with their noise, and say nothing of it."""
    done = diagnosed(tmp_path, 0.04)
    (effect,) = done.json["effects"]
    assert (effect["effect"], effect["at"], done.json["kind"]) == ("meas_zero", "bar", "distance")
    assert effect["heldout_rms_without"] > 3 * effect["heldout_rms"] and effect["heldout_rms"] < 4e-3, effect["unit"]
    told = re.search(r": ([\d.]+) um rms of distance \(sigma 2 um", done.err)
    assert told is not None and float(told[1]) > 6.0
    assert "held-out rms, distance" in done.err
    assert "residual of distance [" in (tmp_path / "pictures" / "residuals.svg").read_text(encoding="utf-8")


def test_where_all_is_noise_positions_are_told_of(tmp_path: Path) -> None:
    done = diagnosed(tmp_path, 0.0)
    assert (done.json["verdict"], done.json["kind"]) == ("clean", "position")
    assert "um rms of position (sigma 10 um" in done.err
    assert not (tmp_path / "pictures" / "residuals.svg").exists()


def test_rows_that_report_without_that_kind_tell_of_theirs(tmp_path: Path) -> None:
    """The bar was put away before the rows for validation were measured."""
    machine, table = measured(tmp_path, 0.04)
    head, *rows = [line for line in table.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    use, apart = tmp_path / "use.csv", tmp_path / "apart.csv"
    use.write_text("\n".join([head, *rows[::2], ""]), encoding="utf-8")
    without = [line.rpartition(",")[0] for line in (head, *rows[1::2])]
    apart.write_text("\n".join([*without, ""]), encoding="utf-8")
    done = clean(run("improve", machine, use, "--validation", apart, "--only", "meas_zero@bar", "--json"))
    assert done.json["improvement"]["kind"] == "position" and set(done.json["before"]) == {"position"}
    told = re.search(r"position rms (falls|rises) by [\d.]+ um, 95 % interval: -?[\d.]+ um to [\d.]+ um", done.err)
    assert told is not None and "Steps (position)" in done.err


def test_errors_held_out_are_those_of_points(tmp_path: Path) -> None:
    """What noise is in the readings, by distance, and a few percent more: 14 parameters are fitted to 384 readings."""
    table, made = tmp_path / "m.csv", campaign("triglide", [Planted("backlash", "q1", {"b": 30e-6})], 2)
    table.write_text(made.csv_text(), encoding="utf-8")
    noise = pd.read_csv(table)[["x [mm]", "y [mm]"]].to_numpy() - 1e3 * made.true_readings
    done = clean(run("diagnose", FOLDER / "triglide.yaml", table, "--json"))
    (effect,) = done.json["effects"]
    assert (effect["effect"], effect["at"], done.json["kind"]) == ("backlash", "q1", "position")
    assert 1.0 < effect["heldout_rms"] / np.sqrt((noise**2).sum(axis=1).mean()) < 1.06, effect["unit"]
