"""Columns that are read, but about which something is to be said."""

from __future__ import annotations

from pathlib import Path

from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.tables.measurements import read_measurements
from tests.command import TRIGLIDE

HEAD = "q1,q2,q3,x,time"
ROW = "366.025,500,633.975,450"


def found(tmp_path: Path, *lines: str) -> Measurements:
    file = tmp_path / "t.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_measurements([str(file)], read_machine(TRIGLIDE))


def test_days_of_a_spreadsheet_are_no_seconds(tmp_path: Path) -> None:
    """44546.4375 is 2021-12-16 10:30; poses every ten minutes are 0.007 apart, as in no campaign in seconds."""
    days = found(tmp_path, HEAD, *(f"{ROW},{44546.4375 + k / 144:.6f}" for k in range(5)))
    (told,) = days.warnings
    assert (told.code, told.severity) == ("csv-time", "warning")
    assert "looks like a spreadsheet's day (2021-12-16)" in told.what
    assert not found(tmp_path, HEAD, *(f"{ROW},{44546 + 600 * k}" for k in range(5))).warnings


def test_of_many_unused_columns_the_first_twenty_are_told(tmp_path: Path) -> None:
    foreign = ",".join(f"foreign{k}" for k in range(25))
    notes = found(tmp_path, f"q1,q2,q3,x,{foreign}", f"{ROW}{',9' * 25}").notes
    (note,) = (n for n in notes if "columns not used" in n)
    assert "foreign19" in note and "foreign20" not in note and "and 5 more" in note
