"""Line that builds up on spools, against its differential equation: the radius changes with the line that is wound.

A wound line takes up room: with a spool of radius R0 at reading 0 and s the line unwound since, R(s)^2 = R0^2 + K s
(K < 0 where unwinding uncovers lower turns), and ds/dphi = R(s). That is how the Hangprinter's controller has it.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Rows, drive_travels
from tests.support import at, model
from tests.test_winding import balanced, machine

R0, K = 0.03, -2.4e-5  # m, m
B = K / (2 * R0)  # change of the radius per line unwound, at reading 0
ANGLES = np.deg2rad([-2500.0, -700.0, 0.0, 400.0, 1900.0])
SPOOL = "zero: 1100, radius: 30, unit: deg, sigma: 1 mm"


def line(angle: float) -> float:
    """Line unwound when the spool has turned by an angle (rad), m; by integration."""
    turned = solve_ivp(lambda _, s: np.sqrt(R0**2 + K * s), (0.0, angle), [0.0], rtol=1e-12, atol=1e-15)
    return float(turned.y[0, -1])


def wound(folds: str, at_place: str = "q4") -> str:
    """A point on three legs and a rope on a spool whose line builds up."""
    return machine(SPOOL + folds) + f"    effects: {{buildup@{at_place}: {{b: {B * 1e6} um/m}}}}\n"


def travels(text: str, angles: Array) -> Array:
    """Travel (N,) of the rope at angles of its spool."""
    built = model(text)
    readings = np.column_stack([np.full((len(angles), 3), 0.95), angles])
    return drive_travels(built, built.nominal, readings, Rows.at(readings))[:, 3]


@pytest.mark.parametrize("folds", [1.0, 2.0, 4.0, 2.5])
def test_the_same_spool_winds_the_same_line_whatever_the_reeving(folds: float) -> None:
    found = travels(wound(f", folds: {folds}"), ANGLES)
    expected = np.array([line(angle) for angle in ANGLES]) / folds
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-14)


def test_without_folds_there_is_one() -> None:
    np.testing.assert_array_equal(travels(wound(""), ANGLES), travels(wound(", folds: 1"), ANGLES))


def test_folds_divide_the_travel_also_where_nothing_builds_up() -> None:
    """Also of a drive whose reading is a length."""
    plain = travels(machine(SPOOL + ", folds: 4"), ANGLES)
    np.testing.assert_allclose(plain, R0 * ANGLES / 4, rtol=1e-14)
    found = at(model(machine("zero: 900, folds: 2")), np.array([[0.95, 0.93, 0.94, 0.4]]))
    assert np.abs(found.values[0] - balanced(np.array([0.95, 0.93, 0.94]), 1.1)).max() < 1e-10


def test_the_point_hangs_where_forces_balance() -> None:
    """Through the whole machine: the rope's natural length is that of the line, half of it on each strand."""
    built, turned = model(wound(", folds: 2")), np.deg2rad(170.0)
    found = at(built, np.array([[0.95, 0.93, 0.94, turned]]))
    assert np.abs(found.values[0] - balanced(np.array([0.95, 0.93, 0.94]), 1.1 + line(turned) / 2)).max() < 1e-10


def test_its_derivative_is_that_of_the_law() -> None:
    """By the parameter and by the reading, away from reading 0."""
    built = model(wound(", folds: 2"))
    readings = np.array([[0.95, 0.93, 0.94, np.deg2rad(170.0)]])
    ends = []
    for step in (-1e-5, 1e-5):
        values = built.nominal
        values[built.names.index("buildup@q4.b")] += step
        ends.append(drive_travels(built, values, readings, Rows.at(readings))[0, 3])
    slope = (ends[1] - ends[0]) / 2e-5
    assert slope == pytest.approx((R0 * np.deg2rad(170.0)) ** 2 / (2 * R0) / 2, rel=1e-9)


def test_one_value_serves_spools_of_different_reeving() -> None:
    """Two spools of one kind, one of a simple line, one of a tackle: their lines build up alike."""
    text = machine(SPOOL).replace(
        "      q4: {",
        "      q5: {winds: rope5, redundant: true, zero: 1100, radius: 30, unit: deg, folds: 4}\n      q4: {",
    )
    text = text.replace("ropes: {", "ropes: {rope5: {between: [tcp, top], EA: EArope}, ")
    both = model(text + f"    effects: {{buildup@all: {{b: {B * 1e6} um/m}}}}\n")
    drives = [a.name for a in both.actuators]
    readings = np.full((1, 5), 0.95)
    readings[0, [drives.index("q4"), drives.index("q5")]] = 40.0
    found = drive_travels(both, both.nominal, readings, Rows.at(readings))[0]
    assert found[drives.index("q4")] == pytest.approx(line(40.0), rel=1e-11)
    assert found[drives.index("q5")] == pytest.approx(line(40.0) / 4, rel=1e-11)
