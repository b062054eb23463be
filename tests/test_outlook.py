"""How well further rows will let a fit know a parameter, before they are measured."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.workflow.next_points import _Campaign
from pkmcal_cli.workflow.outlook import Outlook, held_std
from tests.campaigns import shipped
from tests.next_campaigns import LIMIT
from tests.support import model


@pytest.mark.parametrize(("std", "planned", "noise"), [(48e-6, 33e-6, 1.0), (11e-6, 33e-6, 1.0), (25e-6, 15e-6, 1.1)])
def test_what_is_promised_and_what_is_known(std: float, planned: float, noise: float) -> None:
    """Information adds: of rows by their noise, of ranges as it is; a design that would do and does not, too."""
    limit = LIMIT if std > LIMIT else std / 2
    outlook = Outlook.of(noise, planned, std, limit, 0.0)
    assert outlook.std(outlook.promised(limit)) == pytest.approx(limit, rel=1e-12)
    rows = (noise * planned) ** -2
    assert outlook.std(planned) == pytest.approx(std if std**-2 > rows or noise * planned <= limit else rows**-0.5)


def test_what_held_parameters_add_stays_however_many_rows_follow() -> None:
    """Rows know 15 of the 25 um, held parameters add 20; 22 um ask 9.2 of rows, 20 um cannot be."""
    outlook = Outlook.of(1.0, 15e-6, 25e-6, 22e-6, 20e-6)
    assert outlook.std(15e-6) == pytest.approx(25e-6, rel=1e-12)
    assert outlook.promised(22e-6) == pytest.approx(np.sqrt(22.0**2 - 20.0**2) * 1e-6, rel=1e-12)
    assert outlook.promised(20e-6) == 0.0 and outlook.std(1e-12) == pytest.approx(20e-6, rel=1e-9)
    excess = Outlook.of(1.0, 8e-6, 25e-6, 22e-6, 20e-6)  # rows would know 8 um, and their fit knows 15
    assert excess.std(8e-6) == pytest.approx(25e-6) and excess.std(excess.promised(22e-6)) == pytest.approx(22e-6)


SELECTED, HELD = ("l3", "xa1", "xb1"), ("l1", "l2", "ya2")


def without_noise(positions: Array) -> Problem:
    """The nominal Scissors, read without noise."""
    machine, rows = model("scissors"), Rows.at(positions)
    readings = predict(machine, machine.nominal, rows).values
    sigma = np.full(readings.shape, 1e-6)
    return Problem(
        model=machine,
        rows=rows,
        readings=readings,
        sigma=sigma,
        drive_sigma=0 * rows.readings,
        measured=sigma > 0,
    )


def moved(problem: Problem) -> float:
    """By how much l3 moves in fits where held lengths are half a range off, each alone, in quadrature, m."""
    machine, off = problem.model, []
    for name in HELD:
        values, k = machine.nominal, machine.names.index(name)
        values[k] += 0.05 * machine.ranges[k]
        off.append(10 * (identify(problem, SELECTED, values).values - machine.nominal)[machine.names.index("l3")])
    return float(np.linalg.norm(off))


def test_what_held_parameters_add_is_what_they_move_in_a_fit() -> None:
    problem = without_noise(shipped("scissors").positions)
    found = held_std(problem, problem.model.nominal, SELECTED, HELD, "l3")
    assert found == pytest.approx(moved(problem), rel=0.01) and found > 1e-6


def test_of_a_direction_that_ranges_hold_they_add_what_the_calibration_states() -> None:
    """Of fourteen rows, which barely show one direction; the calibration weighs the ranges by what it has seen."""
    problem = without_noise(shipped("scissors").positions[:14])
    model, session = problem.model, np.zeros(14, dtype=int)
    done = calibrated(problem, select(model, "auto"), model.nominal, FitOptions(), session)
    fit, budget = done.robust.fit, done.budget
    assert fit.directions.weak.any()
    found = [held_std(problem, fit.values, fit.selected, budget.held, name) for name in fit.selected]
    assert found == pytest.approx(np.linalg.norm(budget.by_held, axis=1), rel=0.15)


def test_what_they_add_after_further_rows_is_foreseen() -> None:
    """In proportion to what they move in fits of the rows that are there, and of all."""
    positions = shipped("scissors").positions
    some, others, every = (without_noise(p) for p in (positions[:12], positions[12:], positions))
    campaign = _Campaign(
        problem=some,
        lost=np.zeros((0, 4)),
        values=some.model.nominal,
        selected=SELECTED,
        std=np.full(3, 50e-6),
        by_held=np.array([40e-6, 0.0, 0.0]),
        held=HELD,
        noise=1.0,
        advice="",
    )
    share = moved(every) / moved(some)
    assert campaign.held_after(others, "l3") == pytest.approx(40e-6 * share, rel=0.02)
    assert abs(share - 1) > 0.05
