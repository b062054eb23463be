"""A wrong reading of the bench is named by calibrate and diagnose; no row and no axis of an instrument is blamed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.bench_readings import bench_readings
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.campaign_tables import true_values, write_table
from tests.campaigns import shipped
from tests.command import MACHINES, run
from tests.computed_once import run_once

pytestmark = pytest.mark.usefixtures("unsized")

PLAIN = "triglide-nonredundant"
LINE = 4  # of the reading


def gauge(folder: Path, off: float, seed: int = 4, rows: int = 60) -> tuple[Path, Path, float]:
    """A machine whose gauge reads l1 `off` m too long, a table of it by an independent simulator, and true l1 in m."""
    values = true_values(PLAIN, seed)
    l1 = float(shipped(PLAIN).model.by_name(values)["l1"])
    machine = folder / "gauge.yaml"
    reading = f"    reading: {1e3 * (l1 + off):.6f}\n"
    head = f"extends: {MACHINES / PLAIN}.yaml\nsensors:\n  gauge: {{kind: bench, of: l1, sigma: 5 um,\n"
    machine.write_text(head + reading + "  }\n")
    return machine, Path(write_table(folder / "t.csv", PLAIN, values, seed, rows)), l1


def problem(folder: Path, off: float, rows: int = 60) -> tuple[Problem, tuple[str, ...]]:
    machine, table, _ = gauge(folder, off, rows=rows)
    loaded = load_machine(str(machine))
    made = problem_of(loaded.model, load_measurements(loaded, [str(table)]))
    return made, tuple(p.name for p in made.model.parameters if p.identify and not p.fixed)


@pytest.mark.parametrize("off", [0.2e-3, 2e-3])
def test_calibrate_names_a_wrong_reading_and_no_row(tmp_path: Path, off: float) -> None:
    machine, table, l1 = gauge(tmp_path, off)
    done = run("calibrate", machine, table, "--holdout", "none", "--json")
    result = done.json
    (named,) = result["bench"]
    assert named["name"] == "gauge" and (named["file"], named["line"]) == (str(machine), LINE)
    assert abs(named["predicted"] - 1e3 * l1) < 4 * named["std"] and abs(named["off"] - 1e3 * off) < 4 * named["std"]
    assert result["far_rows"] == [] and f"{machine}:{LINE}" in done.err and "far from what" not in done.err
    reasons = result["incomplete"] if off < 1e-3 else result["implausible"]
    assert done.code == int(off > 1e-3) and any("gauge" in reason for reason in reasons)
    robust = run("calibrate", machine, table, "--holdout", "none", "--loss", "tukey", "--json")
    value = next(p for p in robust.json["parameters"] if p["name"] == "l1")
    assert robust.code == 0 and abs(value["value"] - 1e3 * l1) < 4 * value["std"]


@pytest.mark.parametrize("off", [0.2e-3, 2e-3])
def test_diagnose_names_a_wrong_reading_and_nothing_else(tmp_path: Path, off: float) -> None:
    machine, table, _ = gauge(tmp_path, off)
    done = run_once("diagnose", machine, table, "--json")
    result = done.json
    assert [b["name"] for b in result["bench"]] == ["gauge"] and result["verdict"] == "measurement_fault"
    assert result["effects"] == [] and result["outliers"] == [] and result["unknown"] == []
    assert "bad reading: " in run_once("diagnose", machine, table).err


def test_a_doubtful_reading_is_used_and_named_alike_by_all(tmp_path: Path) -> None:
    """Off by three standard uncertainties: too little to find fault with the measurement, too much to say nothing."""
    made, selected = problem(tmp_path, 0.0, rows=30)
    (right,) = bench_readings(made, identify(made.leaving_out(made.once), selected))
    machine, table, _ = gauge(tmp_path, 3.0 * float(np.hypot(right.sigma, right.predicted_std)) - right.off, rows=30)
    calibrated = run("calibrate", machine, table, "--holdout", "none", "--json")
    (reason,) = [text for text in calibrated.json["incomplete"] if "gauge" in text]
    for command in ("diagnose", "improve"):
        done = run_once(command, machine, table, "--json")
        assert done.code == 0 and f"suspected reading: {reason}; still used: measure it again" in done.err
        (named,) = done.json["bench"]
        assert named["used"] and named["off"] == pytest.approx(calibrated.json["bench"][0]["off"], rel=1e-3)
    sheet = run_once("report", machine, table, "-o", tmp_path / "r.html")
    assert sheet.code == 0 and f"Provisional: {reason}." in sheet.err + sheet.out


def test_a_good_reading_is_used_and_has_no_word(tmp_path: Path) -> None:
    machine, table, l1 = gauge(tmp_path, 4e-6)
    found = run("calibrate", machine, table, "--holdout", "none", "--json").json
    assert found["status"] == "converged" and found["bench"] == []
    value = next(p for p in found["parameters"] if p["name"] == "l1")
    assert value["std"] < 6e-3 and abs(value["value"] - 1e3 * l1) < 4 * value["std"]
    diagnosis = run_once("diagnose", machine, table, "--json").json
    assert diagnosis["verdict"] == "clean" and diagnosis["bench"] == []


def test_a_bad_row_that_stands_with_the_reading_is_a_row(tmp_path: Path) -> None:
    """The first row holds the reading of the bench: which of both is wrong is told apart."""
    machine, table, _ = gauge(tmp_path, 2e-6)
    lines = table.read_text().splitlines()
    cells = lines[1].split(",")
    cells[-1] = str(float(cells[-1]) + 0.5)
    table.write_text("\n".join([lines[0], ",".join(cells), *lines[2:], ""]))
    done = run("calibrate", machine, table, "--holdout", "none", "--json").json
    assert [row["line"] for row in done["far_rows"]] == [2] and done["bench"] == []
    diagnosis = run_once("diagnose", machine, table, "--json").json
    assert [row["line"] for row in diagnosis["outliers"]] == [2] and diagnosis["bench"] == []


def test_what_the_rows_tell_has_the_uncertainty_of_their_own_fit(tmp_path: Path) -> None:
    """Prediction and uncertainty are those of l1 by the rows alone; the reading itself takes no part."""
    found = []
    for off in (0.0, 1e-3):
        made, selected = problem(tmp_path, off)
        alone = identify(made.leaving_out(made.once), selected)
        (reading,) = bench_readings(made, alone)
        k = alone.selected.index("l1")
        assert reading.predicted == pytest.approx(alone.values[made.model.names.index("l1")], abs=1e-9)
        assert reading.predicted_std == pytest.approx(alone.std[k] * np.sqrt(alone.excess), rel=1e-3)
        found.append(reading)
    assert found[0].predicted == pytest.approx(found[1].predicted, abs=1e-9)
    assert found[1].off - found[0].off == pytest.approx(1e-3, abs=2e-9)
    assert not found[0].contradicts(1) and found[1].contradicts(1)


def test_a_reading_of_what_rows_do_not_see_contradicts_nothing(tmp_path: Path) -> None:
    made, selected = problem(tmp_path, 0.3e-3)
    few = replace(made.take(np.arange(1)))
    alone = identify(few.leaving_out(few.once), selected)
    assert not any(r.contradicts(1) for r in bench_readings(few, alone))


def test_left_out_readings_come_back(tmp_path: Path) -> None:
    made, _ = problem(tmp_path, 0.0)
    bare = made.leaving_out(made.once)
    assert bare.once == [] and bare.count == made.count - 1 and bare.without([0, 1]).once == []
    again = bare.leaving_out(())
    assert again.once == made.once and again.count == made.count
    np.testing.assert_array_equal(again.readings, made.readings)
