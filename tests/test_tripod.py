"""What commands say of a tripod on rails with drives in counts, whose legs lag behind the temperature."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.loading.load_machine import load_machine, load_parameters
from tests.command import clean, column, run
from tests.tripod import AT_ONCE, LATE, TRIPOD


def test_a_plan_has_whole_counts(tmp_path: Path) -> None:
    """A control that counts takes no fractions, neither where it goes nor where it comes from."""
    target = tmp_path / "plan.csv"
    clean(run("plan", TRIPOD, "-o", target))
    for drive in ("q1", "q2"):
        counts = column(target, drive), column(target, f"approach.{drive}")
        assert all(np.array_equal(c, np.round(c)) for c in counts) and np.abs(counts[0]).max() > 1e5
    assert not np.array_equal(column(target, "q3"), np.round(column(target, "q3")))
    more = clean(run("plan", TRIPOD, "--grid", "12", "--aim", "uncertainty", "--points", "3", "--json")).json["points"]
    assert more and all(point[drive] == round(point[drive]) for point in more for drive in ("q1", "q2"))


def test_rows_without_a_temperature_that_an_effect_needs_are_named(tmp_path: Path) -> None:
    """With table, first row, how many, and what can be done; not the machine file, which is right."""
    table, lines = tmp_path / "t.csv", LATE.read_text(encoding="utf-8").splitlines()
    lines[11:13] = [line.rpartition(";")[0] + ";" for line in lines[11:13]]
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    for command in ("calibrate", "diagnose", "check"):
        done = run(command, TRIPOD, table)
        assert done.code == 3
        assert f"{table}:12: error[csv-empty-cell]: `T` is empty in 2 of 46 rows" in done.err
        assert "needed by thermal_strut@all" in done.err and "leave these rows out" in done.err


def test_a_machine_whose_drives_bear_nothing_has_no_table_of_forces() -> None:
    done = clean(run("correct", TRIPOD, "--grid", "6"))
    assert "rms after" in done.err
    assert "Largest forces" not in done.err and "strain energy" not in done.err


def test_compared_values_have_uncertainties_and_units(tmp_path: Path) -> None:
    files = tmp_path / "late.params.yaml", tmp_path / "at-once.params.yaml"
    for table, file in zip((LATE, AT_ONCE), files, strict=True):
        clean(run("calibrate", TRIPOD, table, "--holdout", "none", "-o", file))
    row = next(line for line in run("compare", *files).err.splitlines() if line.startswith("L3 "))
    assert re.match(r"L3 +700\.\d+\(\d+\) mm +(699|700)\.\d+\(\d+\) mm +-?[\d.]+\(\d+\) mm ", row), row


def test_where_drives_in_counts_were_measured_is_known_to_a_correction(tmp_path: Path) -> None:
    """A count is 0.5 um: the range of `q1` in the file is that of the table."""
    file = tmp_path / "late.params.yaml"
    clean(run("calibrate", TRIPOD, LATE, "--holdout", "none", "-o", file))
    evidence = load_parameters(load_machine(str(TRIPOD)).model, str(file)).evidence
    counts = [int(line.split(";")[2]) for line in LATE.read_text(encoding="utf-8").splitlines()[1:]]
    assert evidence is not None
    assert evidence.measured["q1"] == pytest.approx((0.5e-6 * min(counts), 0.5e-6 * max(counts)))
