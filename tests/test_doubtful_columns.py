"""Columns that are read, but about which something is to be said."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.tables.measurements import read_measurements
from tests.command import MACHINES, TRIGLIDE

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


@pytest.mark.parametrize("first", ["1710239455900", "1710239455900000000", "20240312103055"])
def test_milliseconds_and_digits_of_dates_are_no_seconds(first: str, tmp_path: Path) -> None:
    """2024-03-12 10:30:55.9 since 1970 in ms and ns, and as digits; in s it is a time like others."""
    (told,) = found(tmp_path, HEAD, *(f"{ROW},{int(first) + 1000 * k}" for k in range(5))).warnings
    assert (told.code, told.severity) == ("csv-time", "warning")
    assert first in told.what and "milliseconds since 1970" in told.what
    assert not found(tmp_path, HEAD, *(f"{ROW},{1710239455.9 + 600 * k}" for k in range(5))).warnings


def test_of_many_unused_columns_the_first_twenty_are_told(tmp_path: Path) -> None:
    foreign = ",".join(f"foreign{k}" for k in range(25))
    notes = found(tmp_path, f"q1,q2,q3,x,{foreign}", f"{ROW}{',9' * 25}").notes
    (note,) = (n for n in notes if "columns not used" in n)
    assert "foreign19" in note and "foreign20" not in note and "and 5 more" in note


@pytest.mark.parametrize(("header", "cells", "meant"), [
    ("T [degC]", "292.95", "K"), ("T", "292.95", "K"), ("T [K]", "19.8", "degC"),
])  # fmt: skip
def test_temperatures_of_another_unit(header: str, cells: str, meant: str, tmp_path: Path) -> None:
    (doubt,) = found(tmp_path, f"{HEAD.rpartition(',')[0]},{header}", f"{ROW},{cells}").warnings
    assert (doubt.code, doubt.severity) == ("csv-unit", "warning") and doubt.where is not None and doubt.where.line == 1
    assert f"looks like {meant}" in doubt.what and doubt.hint == f"write `T [{meant}]` in the header"


def test_air_as_warm_as_no_workshop_is_in_fahrenheit(tmp_path: Path) -> None:
    """68 degF are 20 degC; a part may be as warm as 68 degC, and so may an oven."""
    head = HEAD.rpartition(",")[0]
    (doubt,) = found(tmp_path, f"{head},T [degC]", f"{ROW},68.1", f"{ROW},74").warnings
    assert doubt.code == "csv-unit" and "68.1 to 74 looks like degrees Fahrenheit" in doubt.what
    assert doubt.hint == "convert it: (F - 32)/1.8"
    for name, cells in (("T.platform [degC]", "68.1"), ("T [degC]", "49"), ("T [degC]", "111")):
        assert not found(tmp_path, f"{head},{name}", f"{ROW},{cells}").warnings


@pytest.mark.parametrize(("header", "cells"), [
    ("T [degC]", "-20"), ("T [degC]", "120"), ("T [K]", "292.95"), ("T [K]", "77"), ("T [degC]", ""),
])  # fmt: skip
def test_temperatures_of_a_workshop(header: str, cells: str, tmp_path: Path) -> None:
    assert found(tmp_path, f"{HEAD.rpartition(',')[0]},{header}", f"{ROW},{cells}").warnings == ()


def test_a_logger_that_failed_reads_zero(tmp_path: Path) -> None:
    """Two of four rows; one column of a part that is right; in a cold hall 0 degC is a temperature like others."""
    head = HEAD.rpartition(",")[0]
    rows = [f"{ROW},{air},{part}" for air, part in ((21.5, 22), (0, 23), (0.0, 23), (22, 24))]
    (doubt,) = found(tmp_path, f"{head},T [degC],T.platform [degC]", *rows).warnings
    assert (doubt.code, doubt.severity) == ("csv-value", "warning") and doubt.hint is not None and "empty" in doubt.hint
    assert "`T` is exactly 0 degC in 2 rows, and 21.5 degC or more in the others" in doubt.what
    for cells in (("4.9", "0"), ("0", "0"), ("0.1", "22")):
        assert not found(tmp_path, f"{head},T [degC]", *(f"{ROW},{cell}" for cell in cells)).warnings


@pytest.mark.parametrize(
    ("header", "cell", "said"),
    [
        ("payload [kg]", "5000", "read in kg, up to 5000"), ("payload", "1000", "read in kg, up to 1000"),
        ("payload [kg]", "-2.5", "below zero: -2.5 kg"), ("payload [g]", "-500", "below zero: -0.5 kg"),
        ("payload [kg]", "999", ""), ("payload [g]", "5000000", ""), ("payload [kg]", "0", ""), ("payload", "", ""),
    ],
)  # fmt: skip
def test_payloads_in_grams_or_with_a_sign(header: str, cell: str, said: str, tmp_path: Path) -> None:
    told = found(tmp_path, f"{HEAD.rpartition(',')[0]},{header}", f"{ROW},0", f"{ROW},{cell}").warnings
    assert [(t.code, t.severity) for t in told] == [("csv-value", "warning")] * bool(said)
    assert all(said in t.what and "`payload`" in t.what for t in told)


@pytest.mark.parametrize("unit", ["degF", "\u00b0F"])
def test_degrees_fahrenheit_are_to_be_converted(unit: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        found(tmp_path, f"{HEAD.rpartition(',')[0]},T [{unit}]", f"{ROW},68")
    (fault,) = caught.value.faults
    assert fault.hint is not None and "(F - 32)/1.8" in fault.hint


@pytest.mark.parametrize("unit", ["Grad", "grad", "gon"])
def test_gon_and_german_degrees_are_no_radians(unit: str, tmp_path: Path) -> None:
    """`Grad` are degrees in German, and grad 0.9 degrees in surveying."""
    (tmp_path / "m.csv").write_text(f"q1 [{unit}],q2 [deg],ballbar [mm]\n105,38,99\n", encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        read_measurements([str(tmp_path / "m.csv")], read_machine(str(MACHINES / "five-bar.yaml")))
    hint = str(caught.value.faults[0].hint)
    assert "did you mean `deg`?" in hint and "1 gon is 0.9 deg" in hint


def test_columns_of_an_only_sensor_need_not_its_name(tmp_path: Path) -> None:
    """With one sensor the column is `x`, with several `tracker.x`: who writes that of an only one is told its name."""
    with pytest.raises(BadInput) as refused:
        found(tmp_path, "q1,q2,q3,tracker.x,tracker.y", "366.025,500,633.975,450,250")
    assert (refused.value.faults[0].hint or "").startswith("did you mean `tracker.x`? Rename it, or name it")
