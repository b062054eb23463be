"""Slips by hand: one fault tells the cause, with the place and the remedy, and no others follow from it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput, Fault
from pkmcal_cli.loading.load_machine import load_machine
from tests.command import MACHINES, TRIGLIDE, run
from tests.csv_tables import read_table

FAR = """
units: {length: mm}
space: planar
guides: {rail: {along: x}}
bodies:
  left: {guide: rail, at: 0, points: {p: [0, 0]}}
  right: {guide: rail, at: 400, points: {q: [0, 0]}}
nodes: {top: [200, 600]}
bars:
  rod1: {between: [p, top], length: LENGTH}
  rod2: {between: [q, top], length: 632}
actuators: {q1: {moves: left}, q2: {moves: right}}
sensors: {probe: {at: top, reads: [x, y], sigma: 1 um, frame: machine}}
"""


def told(folder: Path, text: str) -> list[Fault]:
    """Faults of a machine file, or its warnings."""
    file = folder / "m.yaml"
    file.write_text(text, encoding="utf-8")
    try:
        return list(load_machine(str(file)).warnings)
    except BadInput as error:
        return list(error.faults)


def changed(name: str, old: str, new: str) -> str:
    """A shipped machine with a slip."""
    text = (MACHINES / f"{name}.yaml").read_text(encoding="utf-8")
    assert old in text
    return text.replace(old, new, 1)


def test_one_digit_too_many_in_a_length_closes_far_from_the_drawing(tmp_path: Path) -> None:
    """Carriages stand where a rod of 3160 mm reaches: sqrt(3160^2 - 600^2) from the node, 2902.5 mm from 0 and back."""
    assert told(tmp_path, FAR.replace("LENGTH", "632")) == []
    (fault,) = told(tmp_path, FAR.replace("LENGTH", "3160"))
    assert fault.code == "drawing" and fault.severity == "warning" and fault.where is not None
    assert fault.where.line == 6 and "`left` is 2902.52 mm from where the file draws it" in fault.what


def test_names_that_an_entry_without_each_would_have_made_are_no_faults(tmp_path: Path) -> None:
    faults = told(tmp_path, changed("delta4", '"R{i}": {each: {i: [1, 2, 3, 4]}, ', '"R{i}": {'))
    assert [f.code for f in faults] == ["name"] and faults[0].hint is not None and "each" in faults[0].hint


def test_lengths_of_a_file_without_units_are_one_warning(tmp_path: Path) -> None:
    faults = [f for f in told(tmp_path, changed("triglide", "units: {length: mm, ", "units: {")) if "length" in f.what]
    (fault,) = faults
    assert fault.what == "l1 = 300 m and 10 other lengths: did you mean mm?"
    assert fault.hint is not None and "add `units: {length: mm}`" in fault.hint


@pytest.mark.parametrize(
    ("name", "old", "new", "hint"),
    [
        ("triglide", "{nominal: 50000, range: 5000", "{nominal: 50000, range: [-5000, 5000]", "`bounds: [min, max]`"),
        ("triglide", "reads: [x, y], sigma: 10 um", "reads: [x, y], sigma: [10 um, 10 um]", "`sigma: {x: 10 um}`"),
        ("triglide", "l2: 300", "l2: 3OO", "write digits, not letters: `300`"),
        ("gantry", "pieces: 2", "pieces: 101", "use fewer pieces"),
    ],
)
def test_the_remedy_is_told(tmp_path: Path, name: str, old: str, new: str, hint: str) -> None:
    fault = told(tmp_path, changed(name, old, new))[0]
    assert fault.severity == "error" and fault.hint is not None and hint in fault.hint


def test_a_pipe_is_no_machine_to_extend(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    (fault,) = told(tmp_path, "extends: pipe.yaml\n")
    assert fault.what == "`pipe.yaml` is not a regular file" and fault.hint == "give the path of a machine file"


@pytest.mark.parametrize(("force", "severity"), [("-60", "error"), ("0", "warning")])
def test_ropes_do_not_push(tmp_path: Path, force: str, severity: str) -> None:
    (fault,) = told(tmp_path, changed("belt-router", "force: 60", f"force: {force}"))  # of both members of an `each`
    assert (fault.severity, fault.where and fault.where.line) == (severity, 38)
    assert "`BL`" in fault.what and fault.what.endswith("(also `BR`)")


def test_an_unknown_key_of_sigma_is_the_only_fault(tmp_path: Path) -> None:
    (fault,) = told(tmp_path, changed("hexapod7", "sigma: {position: 5 um", "sigma: {pos: 5 um"))
    assert fault.code == "unknown-key" and fault.hint is not None and "`position`" in fault.hint


def test_a_product_without_its_sign_names_the_parameter(tmp_path: Path) -> None:
    (fault,) = told(tmp_path, changed("triglide", "[xb1r, yb1r]", "[2 xb1r, yb1r]"))
    assert fault.code == "unit" and fault.hint == "write a product with `*`: `2*xb1r`"


@pytest.mark.parametrize(("value", "what", "hint"), [
    ("yes", "must be a number, found `yes`", "300 mm"),
    ("l2", "not an expression of `l2`", "where the parameter is used"),
    ("2*l2", "not an expression of `l2`", "where the parameter is used"),
])  # fmt: skip
def test_the_value_of_a_parameter_is_a_number(value: str, what: str, hint: str, tmp_path: Path) -> None:
    fault = told(tmp_path, changed("triglide", "  l1: 300", f"  l1: {value}"))[0]
    assert fault.code == "parameter" and what in fault.what and fault.hint is not None and hint in fault.hint


def test_seconds_of_arc_are_meant_only_behind_a_number(tmp_path: Path) -> None:
    (fault,) = told(tmp_path, changed("triglide", "sigma: 10 um", "sigma: 5 ''"))
    assert fault.code == "expression" and fault.hint is not None and "arcsec" in fault.hint
    fault = told(tmp_path, changed("triglide", "sigma: 10 um", "sigma: a'b"))[0]
    assert fault.hint is not None and "arcsec" not in fault.hint


def cell_fault(folder: Path, text: str) -> Fault:
    """The only fault of a table."""
    file = folder / "t.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        read_table(file, ())
    (fault,) = caught.value.faults
    return fault


@pytest.mark.parametrize(("cell", "what"), [
    ("noon", "neither a number of seconds nor a time in ISO 8601"),
    ("2021-02-30", "there is no such date or time"),
    ("2021-12-16T25:30:00", "there is no such date or time"),
    ("2021-12-16T10:30", "is a date, the first row has a number"),
])  # fmt: skip
def test_a_time_that_is_none_among_seconds(cell: str, what: str, tmp_path: Path) -> None:
    fault = cell_fault(tmp_path, f"time,x\n0.5,1.0\n{cell},2.0\n")
    assert (
        fault.code == "csv-time" and what in fault.what and fault.hint is not None and "2021-12-16T10:30" in fault.hint
    )


@pytest.mark.parametrize(("row", "hint"), [
    ("1.5,-5,96°", "write decimal points: `-5.96°` instead of `-5,96°`"),
    ("1.5,2,3456", "write decimal points: `2.3456` instead of `2,3456`"),
    ("1.5,1,234", "remove the cell after `y`"),  # or is it one thousand?
    ("1.5,2.5,96", "remove the cell after `y`"),
])  # fmt: skip
def test_a_decimal_comma_in_one_cell(row: str, hint: str, tmp_path: Path) -> None:
    fault = cell_fault(tmp_path, f"x,y\n1.5,2.5\n0.5,1.5\n{row}\n")
    assert fault.code == "csv-width" and fault.hint is not None and fault.hint.startswith(hint)


def test_letters_for_digits_in_a_parameter_file(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("parameters: {l1: {value: 3OO, unit: mm}}\n")
    done = run("simulate", TRIGLIDE, "--grid", "x=400:500:2,y=250:260:2", "-p", file, "-o", tmp_path / "o.csv")
    assert done.code == 3 and "help: write digits, not letters: `300`" in done.err
