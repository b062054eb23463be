"""Tables whose columns are exchanged, reversed or in a wrong unit: put right, and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.gross_errors.hints import suspicions
from pkmcal_cli.gross_errors.plausibility import Hint, MovedReadings, Right
from pkmcal_cli.gross_errors.put_right import put_right
from pkmcal_cli.gross_errors.row_shift import apply_shifts, find_row_shifts
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.campaign_tables import true_values, write_table
from tests.command import MACHINES, Done, clean, run
from tests.in_ci import in_ci

TRIGLIDE = str(MACHINES / "triglide.yaml")
Table = dict[str, np.ndarray]


def spoilt(file: Path, spoil: Callable[[Table], Table], rows: int = 40) -> str:
    """The Triglide as the independent simulator measures it, with columns changed, in mm."""
    lines = Path(write_table(file, "triglide", true_values("triglide", 3), 3, rows)).read_text().splitlines()
    names = [header.split()[0] for header in lines[0].split(",")]
    columns = dict(zip(names, np.array([line.split(",") for line in lines[1:]], dtype=float).T, strict=True))
    columns = spoil(columns)
    cells = np.stack([columns[n] for n in names], axis=1)
    file.write_text("\n".join([lines[0], *(",".join(f"{v:.7f}" for v in row) for row in cells), ""]))
    return str(file)


MISTAKES: dict[str, tuple[Callable[[Table], Table], str]] = {
    "swapped drives": (lambda t: t | {"q1": t["q2"], "q2": t["q1"]}, "`q1` and `q2` look swapped"),
    "reversed drive": (lambda t: t | {"q3": -t["q3"]}, "`q3` looks reversed in sign"),
    "swapped readings": (lambda t: t | {"x": t["y"], "y": t["x"]}, "`x` and `y` look swapped"),
    "reversed reading": (lambda t: t | {"x": -t["x"]}, "`x` looks reversed in sign"),
    "from the other end": (lambda t: t | {"y": 500 - t["y"]}, "`y` looks reversed in sign, from another origin"),
    "inches": (lambda t: t | {"x": t["x"] / 25.4, "y": t["y"] / 25.4}, "`x` and `y` look 25.4 times too small"),
}


def diagnosed(table: str) -> Done:
    return clean(run("diagnose", TRIGLIDE, table, "--json"))


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What `diagnose --json` has of the table without a mistake."""
    return diagnosed(spoilt(tmp_path_factory.mktemp("honest") / "honest.csv", lambda t: t)).json


@pytest.mark.parametrize("mistake", in_ci(["reversed drive", "swapped readings"], MISTAKES))
def test_a_mistake_is_the_verdict_and_the_rest_is_searched(mistake: str, honest: Any, tmp_path: Path) -> None:
    """As the honest table is: the same residuals but for rounding, and nothing else is named."""
    spoil, text = MISTAKES[mistake]
    done = diagnosed(spoilt(tmp_path / "spoilt.csv", spoil))
    assert done.code == 1 and done.json["verdict"] == "measurement_fault" and done.json["effects"] == []
    (told,) = done.json["mistakes"]
    assert told.startswith(text) and f"diagnosis: the measurement is at fault: {text}" in done.err
    assert done.json["chi2_per_dof_before"] == pytest.approx(honest["chi2_per_dof_before"], rel=0.01)
    assert "searched with the table put right; correct it, or the machine file" in done.err
    assert honest["mistakes"] == [] and honest["verdict"] == "clean"


@pytest.mark.parametrize(("first", "where"), [(0, ":"), (15, " from ")])
def test_readings_in_wrong_rows_are_put_back(first: int, where: str, honest: Any, tmp_path: Path) -> None:
    """From a row on, each has what was read in the next: they are those of the honest table, but for what was lost."""

    def late(column: np.ndarray) -> np.ndarray:
        return np.concatenate([column[:first], column[first + 1 :], column[-1:]])

    file = spoilt(tmp_path / "late.csv", lambda t: t | {"x": late(t["x"]), "y": late(t["y"])})
    done = diagnosed(file)
    assert done.code == 1 and done.json["verdict"] == "measurement_fault" and done.json["effects"] == []
    (told,) = done.json["mistakes"]
    assert told.startswith(f"the readings look shifted by one row{where}")
    assert f"the measurement is at fault: {told.partition(': ')[0]}\n" in done.err, "whole, though places have colons"
    assert done.json["chi2_per_dof_before"] == pytest.approx(honest["chi2_per_dof_before"], rel=0.1)  # without a row
    machine = load_machine(TRIGLIDE)
    right, wrong = (load_measurements(machine, [f]) for f in (spoilt(tmp_path / "h.csv", lambda t: t), file))
    problem = problem_of(machine.model, wrong)
    back = put_right(wrong, suspicions(machine, problem, problem.model.nominal, wrong))
    assert back is not None and int(np.isnan(back.readings).all(axis=1).sum()) == 1, "the reading that was left out"
    known = np.isfinite(back.readings)
    np.testing.assert_array_equal(back.readings[known], right.readings[known])
    np.testing.assert_array_equal(back.actuators, right.actuators)


def test_what_rows_state_of_their_readings_moves_with_these(tmp_path: Path) -> None:
    machine = load_machine(TRIGLIDE)
    honest = load_measurements(machine, [spoilt(tmp_path / "h.csv", lambda t: t)])
    stated = np.arange(1.0, len(honest) + 1)[:, None] * np.array([1e-6, 1e-5])  # (N, C), m
    moved = MovedReadings(("x", "y"), shift=-1, first=0, unsure=1)
    hint = Hint(kind="rows", names=("x",), message="", before=1.0, after=0.0, moved=(moved,))
    back = put_right(replace(honest, sigma=stated), [hint])
    assert back is not None
    np.testing.assert_array_equal(back.sigma[1:], stated[:-1])
    np.testing.assert_array_equal(back.readings[1:], honest.readings[:-1])


def test_rows_that_nobody_looked_at_are_not_put_back() -> None:
    """Of a long table every third row is looked at; from row 40 on each has the reading of the next one."""
    true = np.random.default_rng(1).normal(size=(90, 1))
    readings = np.concatenate([true[:40], true[41:], true[-1:]])
    rows, session = np.arange(0, 90, 3), np.zeros(90, dtype=int)
    (shift,) = find_row_shifts(readings, true[rows], rows, session, lambda measured, _: measured)
    back = apply_shifts(readings, session, [(shift.shift, shift.first, shift.unsure)])
    known = np.isfinite(back)
    np.testing.assert_array_equal(back[known], true[known])
    assert known.sum() >= 90 - 2 * 3


def test_a_column_that_stays_is_exchanged_back(tmp_path: Path) -> None:
    """The height of the carriage hardly varies, so that only the other column shows that they are exchanged."""
    text = (MACHINES / "gantry.csv").read_text()
    (tmp_path / "t.csv").write_text(text.replace("x [mm],y [mm],z [mm]", "x [mm],z [mm],y [mm]"))
    done = clean(run("diagnose", MACHINES / "gantry.yaml", tmp_path / "t.csv", "--json"))
    assert done.code == 1 and done.json["verdict"] == "measurement_fault" and done.json["effects"] == []
    assert done.json["mistakes"][0].startswith("`y` and `z` look swapped")


@pytest.mark.parametrize(
    ("mistake", "rows"), [("swapped readings", 30), pytest.param("swapped drives", 80, marks=pytest.mark.slow)]
)
def test_an_effect_is_found_beside_a_mistake(mistake: str, rows: int, tmp_path: Path) -> None:
    """The scale of q1 is off by 2 per mille, too: named with its size, and the columns besides."""
    swapped, text = MISTAKES[mistake]
    done = diagnosed(spoilt(tmp_path / "t.csv", lambda t: swapped(t | {"q1": t["q1"] / 1.002}), rows))
    (effect,) = done.json["effects"]
    assert (effect["effect"], effect["at"]) == ("scale", "q1") and len(done.json["mistakes"]) == 1
    (size,) = effect["parameters"]
    assert abs(size["value"] - 2000) < 4 * size["std"] < 800, "um/m"
    assert f"; besides, {text}" in done.err


@pytest.mark.slow
def test_improve_keeps_its_reservation(tmp_path: Path) -> None:
    """Nothing is improved by a table that is wrong; the file says so."""
    table = spoilt(tmp_path / "t.csv", MISTAKES["swapped drives"][0])
    done = clean(run("improve", TRIGLIDE, table, "-o", tmp_path / "out.yaml", "--json"))
    assert done.code == 1 and "implausible" in done.json["failures"]
    assert done.json["implausible"][0].startswith("`q1` and `q2` look swapped")


def test_columns_are_those_of_the_honest_table(tmp_path: Path) -> None:
    """Values and their uncertainties; what hints do not say stays."""
    machine = load_machine(TRIGLIDE)
    honest = load_measurements(machine, [spoilt(tmp_path / "honest.csv", lambda t: t)])
    wrong = load_measurements(
        machine,
        [spoilt(tmp_path / "w.csv", lambda t: t | {"q1": -t["q2"], "q2": t["q1"], "y": 100 - t["y"] / 1000})],
    )
    columns = (Right("q1", "q2", 1.0), Right("q2", "q1", -1.0), Right("y", "y", -1e3, 1e2))
    hint = Hint(kind="swapped", names=("q1", "q2"), message="", before=1.0, after=0.0, columns=columns)
    right = put_right(wrong, [hint])
    assert right is not None
    np.testing.assert_allclose(right.actuators, honest.actuators, atol=1e-9)
    np.testing.assert_allclose(right.readings, honest.readings, atol=1e-6)  # seven decimals of m were written
    assert put_right(wrong, [Hint(kind="offset", names=("y",), message="", before=1.0, after=0.0)]) is None
