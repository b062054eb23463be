"""What `import pkmcal` takes: tables and parameters in all their forms, errors in the words of the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pkmcal
import pytest

from tests.command import GRID, MACHINES, TRIGLIDE, TRIGLIDE_DATA


@pytest.fixture(scope="module")
def found() -> pkmcal.Calibration:
    return pkmcal.calibrate("triglide", TRIGLIDE_DATA)


@pytest.fixture(scope="module")
def machine() -> pkmcal.Machine:
    return pkmcal.load(TRIGLIDE)


def test_every_form_of_a_table_is_the_same_table(found: pkmcal.Calibration, machine: pkmcal.Machine) -> None:
    """A path, a DataFrame in other units, arrays with units: the same estimates to rounding."""
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    names = {label.partition(" [")[0]: label for label in raw.columns}
    metres = pd.DataFrame({f"{n} [m]": raw[names[n]] * 1e-3 for n in ("q1", "q2", "q3", "x", "y")})
    arrays = {n: (raw[names[n]].to_numpy() * 1e3, "um") for n in ("q1", "q2", "q3", "x", "y")}
    bare = {n: raw[names[n]].tolist() for n in ("q1", "q2", "q3", "x", "y")}
    for table in (Path(TRIGLIDE_DATA), raw, raw.set_index("id"), metres, arrays, bare, found.table):
        again = pkmcal.calibrate(machine, table, holdout="none")
        assert again.parameters.value.to_numpy() == pytest.approx(found.parameters.value.to_numpy(), abs=1e-6)
        assert len(again.table) == len(again.residuals) == len(raw)


def test_tables_in_a_list_are_sessions(machine: pkmcal.Machine) -> None:
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    both = pkmcal.calibrate(machine, [raw.iloc[:120], raw.iloc[120:]], holdout="session")
    assert both.table["session"].unique().tolist() == ["table1", "table2"] and "2" in both.held_out
    apart = pkmcal.calibrate(machine, raw.iloc[:150], holdout=raw.iloc[150:])
    assert apart.held_out == "rows of holdout"
    assert np.isfinite(apart.errors.rms_held_out).all()


def test_an_earlier_calibration_is_a_prior(found: pkmcal.Calibration, tmp_path: Path) -> None:
    """In memory as from its file: a few rows and what was known give more than the rows."""
    found.write(tmp_path / "old.params.yaml")
    few = found.table.iloc[::40]
    by_result, by_file = (
        pkmcal.calibrate("triglide", few, prior=prior, holdout="none").parameters
        for prior in (found, str(tmp_path / "old.params.yaml"))
    )
    assert by_result.equals(by_file)
    alone = pkmcal.calibrate("triglide", few, holdout="none").parameters["std"].fillna(np.inf)
    known = by_result["std"].loc[alone.index]
    assert (known <= alone * 1.001).all() and (known < 0.7 * alone).any()


def test_values_by_name_are_parameters(machine: pkmcal.Machine) -> None:
    """A strut 0.1 mm longer; numbers are in the parameter's unit."""
    one, other = (
        pkmcal.simulate(machine, grid=GRID, parameters={"l1": value}).table["x [mm]"] for value in ("0.3001 m", 300.1)
    )
    assert one.to_numpy() == pytest.approx(other.to_numpy(), abs=1e-12)
    assert np.abs(one - pkmcal.simulate(machine, grid=GRID).table["x [mm]"]).max() > 0.01
    with pytest.raises(pkmcal.BadInput, match="no parameter `l9`"):
        pkmcal.simulate(machine, grid=GRID, parameters={"l9": 1.0})


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (lambda: pkmcal.load("no-machine.yaml"), "No such file"),
        (lambda: pkmcal.load("triglid"), "did you mean `triglide`"),
        (lambda: pkmcal.load("-"), "stdin"),
        (lambda: pkmcal.calibrate("triglide", "-"), "stdin"),
        (lambda: pkmcal.calibrate("triglide", []), "no table"),
        (lambda: pkmcal.calibrate("triglide", 3), "no table"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", {}), "no table"),
        (lambda: pkmcal.calibrate("triglide", pd.DataFrame()), "no table"),
        (lambda: pkmcal.calibrate("triglide", {"q1": ([1.0], "mm"), "x": ([1.0, 2.0], "mm")}), "differ in length"),
        (lambda: pkmcal.calibrate("triglide", {"q1": (1.0, "mm")}), "no list of values"),
        (lambda: pkmcal.load(None), "no file: NoneType"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, starts=-1), "--starts: -1"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, seed=1.5), "--seed: 1.5"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, holdout=True), "--holdout: True"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, select=3), "--select"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, parameters={"l1": None}), "`l1`"),  # type: ignore[dict-item]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, parameters={"l1": "3 kg"}), "give `l1` in mm"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, select="l9"), "--select"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, method="exakt"), "did you mean `exact`"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, parameters=3), "no parameters"),  # type: ignore[arg-type]
        (lambda: pkmcal.simulate("triglide"), "either a table of poses or --grid"),
        (lambda: pkmcal.simulate("triglide", grid=GRID, seed=-1), "--seed: -1"),
        (lambda: pkmcal.correct("triglide", grid=GRID, redundant="none"), "--redundant"),
        (lambda: pkmcal.diagnose("triglide", TRIGLIDE_DATA, alpha=2.0), "alpha"),
        (lambda: pkmcal.shipped("nothing.csv"), "no shipped file"),
    ],
)
def test_what_is_wrong_is_told(wrong: Callable[[], object], text: str) -> None:
    with pytest.raises(pkmcal.PkmcalError) as caught:
        wrong()
    assert text in caught.value.text()


def test_faults_of_a_table_have_their_cells() -> None:
    """All of them at once, in the table's own lines: the header is the first."""
    table = pd.read_csv(TRIGLIDE_DATA, comment="#").astype(object)
    table.iloc[2, 1], table.iloc[5, 2] = "12,3 mm", float("inf")
    with pytest.raises(pkmcal.BadInput) as caught:
        pkmcal.calibrate("triglide", table)
    places = {(f.where.file, f.where.line) for f in caught.value.faults if f.where}
    assert places == {("table", 4), ("table", 7)}
    with pytest.raises(pkmcal.BadInput, match="duplicate column"):
        pkmcal.calibrate("triglide", pd.concat([table, table], axis=1))


def test_odd_tables_are_read_as_they_are_meant() -> None:
    """Lines in texts, numbers that may be absent, an index with the name of a column, names in a list."""
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    plain = pkmcal.calibrate("triglide", raw, select="l1,l2", holdout="none").parameters
    odd = (
        raw.assign(id=[f'p"{k}",\n{k}' for k in range(len(raw))]),
        raw.convert_dtypes(),
        raw.set_index("id", drop=False),
        raw.assign(time=pd.date_range("2026-05-04", periods=len(raw), freq="min", tz="Europe/Berlin")),
    )
    for table in odd:
        again = pkmcal.calibrate("triglide", table, select=["l1", "l2"], holdout="none").parameters
        assert again.value.equals(plain.value)


def test_a_force_controlled_drive_and_labels_come_through() -> None:
    """The hangprinter: motors in degrees, forces without unit, columns with names of their own."""
    found = pkmcal.calibrate("hangprinter", MACHINES / "hangprinter_2021-12-16.csv", holdout="none")
    again = pkmcal.calibrate("hangprinter", found.table, holdout="none")
    assert again.parameters.value.to_numpy() == pytest.approx(found.parameters.value.to_numpy(), rel=1e-7)


@pytest.mark.parametrize("function", [pkmcal.calibrate, pkmcal.diagnose, pkmcal.improve])
def test_a_row_out_of_reach_is_a_warning(function: Callable[..., pkmcal.Calibration], tmp_path: Path) -> None:
    """The closed loop of the Biglide: with both carriages at 1 mm and a leg of 301 mm its rods do not meet there."""
    table = MACHINES / "biglide.csv"
    (tmp_path / "t.csv").write_text(f"{table.read_text()}\nmean,1,1,1,1,1\n")
    row = function("biglide", tmp_path / "t.csv").warnings
    assert [w.endswith(": not used") and "(mean): out of reach" in w for w in row].count(True) == 1
    assert "1 of 61 rows is not used" in row
