"""How well further rows will let a fit know a parameter, before they are measured."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import Rows, predict
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


def test_what_held_parameters_add_is_what_they_move_in_a_fit() -> None:
    """Each held length of the Scissors half a range off, and calibrated: they move l3 by as much, in quadrature."""
    machine, rows = model("scissors"), Rows.at(shipped("scissors").positions)
    readings = predict(machine, machine.nominal, rows).values
    sigma = np.full(readings.shape, 1e-6)
    problem = Problem(
        model=machine,
        rows=rows,
        readings=readings,
        sigma=sigma,
        drive_sigma=0 * rows.readings,
        measured=sigma > 0,
    )
    selected, held = ("l3", "xa1", "xb1"), ("l1", "l2", "ya2")
    moved = []
    for name in held:
        off, k = machine.nominal, machine.names.index(name)
        off[k] += 0.05 * machine.ranges[k]
        moved.append(10 * (identify(problem, selected, off).values - machine.nominal)[machine.names.index("l3")])
    found = held_std(problem, machine.nominal, selected, held, "l3")
    assert found == pytest.approx(np.linalg.norm(moved), rel=0.01) and found > 1e-6
