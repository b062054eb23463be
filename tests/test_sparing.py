"""Attempts of a fit are of no use once a row is lost in which something was measured: the others are given up then."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration import step
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.patience import SHORT
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.equilibrium import newton
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.prediction import Request, RowLost, Rows, predict
from tests.command import MACHINES
from tests.test_far_scales import scaled

SPARING = Request(compare=False, sparing=True)


def rows(measured: Array) -> Rows:
    """Five rows of the Triglide, one of which no pose has; measured (5, C)."""
    readings = np.tile([-0.293938769, 0.293938769, 0.599916661], (5, 1))
    readings[2, 0] = -9.0
    return replace(Rows.at(readings), measured=measured)


def test_a_row_that_is_lost_ends_a_prediction_if_something_was_measured_in_it() -> None:
    machine = load_machine(str(MACHINES / "triglide.yaml")).model
    measured = np.zeros((5, len(machine.channels)))
    plain = predict(machine, machine.nominal, rows(measured), Request(compare=False))
    assert plain.solved.tolist() == [True, True, False, True, True]
    with pytest.raises(RowLost):
        predict(machine, machine.nominal, rows(measured), SPARING)
    measured[2] = np.nan
    others = predict(machine, machine.nominal, rows(measured), SPARING)
    assert np.array_equal(others.values, plain.values, equal_nan=True), "nothing is given up for it"
    measured[2, 0] = 0.0
    with pytest.raises(RowLost):
        predict(machine, machine.nominal, rows(measured), SPARING)


@pytest.fixture
def strides(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many rows were on their way in each stride."""
    made: list[int] = []
    plain = newton._Path.stride_on
    monkeypatch.setattr(newton._Path, "stride_on", lambda path, *a: made.append(len(path.todo)) or plain(path, *a))
    return made


def test_a_fit_is_the_same_and_takes_fewer_steps(
    tmp_path: Path, strides: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A leg of seven that is 2 % off: the first step takes attempts that lose half of the rows."""
    loaded = load_machine(str(MACHINES / "hexapod7.yaml"))
    table = scaled(tmp_path, "hexapod7", "q1", 1.02, every=5)
    problem = problem_of(loaded.model, load_measurements(loaded, (str(table),)))

    def fitted() -> Fit:
        strides.clear()
        return identify(problem, select(loaded.model, "auto"), iterations=1, patience=SHORT)

    sparing, few = fitted(), len(strides)
    plain = step.evaluate_condensed
    monkeypatch.setattr(step, "evaluate_condensed", lambda *a, sparing: plain(*a))
    thorough, many = fitted(), len(strides)
    assert np.array_equal(sparing.values, thorough.values) and sparing.chi2 == thorough.chi2
    assert sparing.iterations == thorough.iterations == 1
    assert few < 0.7 * many
