"""Gross mistakes are found with their evidence, and honest data raise no suspicion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pkmcal_cli.gross_errors.column_faults import explain_columns
from pkmcal_cli.gross_errors.plausibility import find_limit_faults

NAMES = ("x", "y", "rz")
UNITS = ("mm", "mm", "deg")


def campaign(seed: int = 0, rows: int = 40) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measured and predicted, SI: errors of 0.2 mm, a row without prediction, a cell without value."""
    rng = np.random.default_rng(seed)
    predicted = np.column_stack([rng.uniform(0.0, 0.95, rows), rng.uniform(0.16, 0.39, rows), rng.normal(0, 0.1, rows)])
    measured = predicted + rng.normal(0, 2e-4, predicted.shape)
    if rows > 3:
        predicted[rows // 2] = np.nan
        measured[1, 1] = np.nan
    return measured, predicted


@pytest.mark.parametrize("seed", range(20))
def test_honest_data_raise_no_suspicion(seed: int) -> None:
    for rows in (1, 2, 3, 40):
        assert explain_columns(*campaign(seed, rows), NAMES, UNITS).hints == ()


def test_swapped_columns() -> None:
    measured, predicted = campaign()
    (hint,) = explain_columns(measured[:, [1, 0, 2]], predicted, NAMES, UNITS).hints
    assert (hint.kind, hint.names) == ("swapped", ("x", "y"))
    assert hint.before > 0.2 and hint.after < 5e-4
    assert "`x` and `y` look swapped: residual rms" in hint.message
    assert hint.message.endswith("mm when swapped back")


def test_swapped_and_turned() -> None:
    measured, predicted = campaign()
    turned = np.column_stack([-measured[:, 1], measured[:, 0], measured[:, 2]])
    (hint,) = explain_columns(turned, predicted, NAMES, UNITS).hints
    assert hint.kind == "swapped" and "reversed in sign" in hint.message


def test_cyclic_exchange_is_one_hint() -> None:
    rng = np.random.default_rng(3)
    predicted = rng.normal(size=(30, 3))
    hints = explain_columns(predicted[:, [1, 2, 0]] + 1e-4, predicted, ("x", "y", "z")).hints
    assert [(h.kind, h.names) for h in hints] == [("rotated", ("x", "y", "z"))]
    assert "`x` has the readings of `y`, `y` those of `z`, `z` those of `x`" in hints[0].message


def test_small_moves_about_one_place() -> None:
    rng = np.random.default_rng(4)
    predicted = 1.0 + 0.005 * rng.normal(size=(20, 2))
    measured = predicted + 1e-5 * rng.normal(size=(20, 2))
    assert explain_columns(measured, predicted, "xy").hints == ()
    assert explain_columns(measured[:, ::-1], predicted, "xy").hints[0].kind == "swapped"


@pytest.mark.parametrize(
    ("factor", "column", "words"),
    [
        (1e-3, 0, "`x` looks 1000 times too small (is it in `m`, not `mm`, or in `mm`, not `um`?)"),
        (1e3, 1, "`y` looks 1000 times too large (is it in `um`, not `mm`, or in `mm`, not `m`?)"),
        (np.pi / 180, 2, "`rz` looks 57.3 times too small (is it in `rad`, not `deg`?)"),
        (1 / 25.4, 0, "`x` looks 25.4 times too small (is it in `in`, not `mm`?): residual rms"),
    ],
)
def test_wrong_units(factor: float, column: int, words: str) -> None:
    measured, predicted = campaign()
    measured[:, column] *= factor
    (hint,) = explain_columns(measured, predicted, NAMES, UNITS).hints
    assert hint.kind == "unit" and hint.names == (NAMES[column],)
    assert words in hint.message


@pytest.mark.parametrize("column", [0, 1, 2])
def test_turned_signs(column: int) -> None:
    measured, predicted = campaign()
    measured[:, column] *= -1
    (hint,) = explain_columns(measured, predicted, NAMES, UNITS).hints
    assert (hint.kind, hint.names) == ("sign", (NAMES[column],))


def test_origin_elsewhere() -> None:
    measured, predicted = campaign()
    measured[:, 1] += 0.5
    (hint,) = explain_columns(measured, predicted, NAMES, UNITS).hints
    assert hint.kind == "offset" and "`y` is off by 500 mm in all rows" in hint.message


def test_a_column_that_should_be_zero() -> None:
    rng = np.random.default_rng(0)
    assert explain_columns(1e-5 * rng.normal(size=(30, 1)), np.zeros((30, 1)), ["z"]).hints == ()


@settings(deadline=None)
@given(st.lists(st.floats(-1e3, 1e3) | st.just(np.nan), min_size=6, max_size=6))
def test_any_numbers_pass(values: list[float]) -> None:
    a = np.array(values).reshape(2, 3)
    explain_columns(a, a[::-1], NAMES, UNITS)
    find_limit_faults(a, np.array([[0.0, 1.0], [-np.inf, np.inf], [-1.0, 1.0]]), NAMES)


LIMITS = np.array([[0.0, 0.9], [-0.5, 0.5], [-np.inf, np.inf]])


def readings(rows: int = 30) -> NDArray[np.float64]:
    rng = np.random.default_rng(1)
    return np.column_stack([rng.uniform(0.55, 0.9, rows), rng.uniform(-0.5, 0, rows), rng.normal(0, 9, rows)])


def test_inside_limits() -> None:
    found = readings()
    found[3, 0] = np.nan
    found[4, 0] = 0.9 + 1e-13
    assert find_limit_faults(found, LIMITS, ("q1", "q2", "q3")) == ()


def test_one_row_outside() -> None:
    found = readings()
    found[7, 0] = 1.2
    (hint,) = find_limit_faults(found, LIMITS, ("q1", "q2", "q3"), ("mm", "mm", "deg"))
    assert hint.rows == (7,)
    expected = "`q1` is outside its limits (0 mm to 900 mm) in 1 of 30 rows, at worst 1200 mm"
    assert hint.message == expected


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: a * [-1, 1, 1], "all are inside with the opposite sign"),
        (
            lambda a: a * [1e3, 1, 1],
            "all are inside when multiplied by 0.001 (is it in `um`, not `mm`, or in `mm`, not `m`?)",
        ),
        (lambda a: a[:, [1, 0, 2]], "all are inside when swapped with `q2`"),
    ],
)
def test_what_would_bring_them_inside(change: object, words: str) -> None:
    assert callable(change)
    hints = find_limit_faults(change(readings()), LIMITS, ("q1", "q2", "q3"), ("mm", "mm", "deg"))
    assert words in hints[0].message


def test_the_sign_of_what_hardly_varies() -> None:
    """A motor that holds a weight reads 5 A and is known to 0.3 A, whatever the pose."""
    rng = np.random.default_rng(0)
    predicted = np.stack([5 + 0.05 * rng.normal(size=30), rng.normal(size=30)], axis=1)
    read = predicted * [-1, 1] + 0.2 * rng.normal(size=(30, 2)) * [1, 0.1]
    steady = explain_columns(read, predicted, ["current", "x"], prior_rms=np.array([0.3, 0.1]), steady=True)
    assert [(h.kind, h.names) for h in steady.hints] == [("sign", ("current",))]
    assert not explain_columns(read, predicted, ["current", "x"], prior_rms=np.array([0.3, 0.1])).hints
    unsure = explain_columns(read, predicted, ["current", "x"], prior_rms=np.array([3.0, 0.1]), steady=True)
    assert not unsure.hints, "a zero that may be anything"
