"""A reading that is grossly wrong costs its own row, not its neighbours that failed on the way."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.bound import problem_of
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.residual import evaluate, reasons
from pkmcal_cli.loading import load_machine, load_measurements
from tests.command import MACHINES, clean, run
from tests.test_spoilt_tables import out_of_reach, spoilt

TABLE = MACHINES / "five-bar.csv"
WRONG = 20  # the row whose drive is 192 degrees off
ASTRAY = (-62, 94, -77, 87, 111, 116, 11, -98, 44, -80, -72)
"""In ranges: where a fit of all rows goes for the sake of the wrong one; three good ones are out of reach there."""


def test_rows_that_failed_on_the_way_are_fitted(tmp_path: Path) -> None:
    machine, table = spoilt(TABLE, out_of_reach, tmp_path)
    loaded = load_machine(machine)
    problem = problem_of(loaded.model, load_measurements(loaded, (table,)))
    selected = tuple(p.name for p in loaded.model.parameters if "@" not in p.name)
    start = loaded.model.nominal
    for name, way in zip(selected, ASTRAY, strict=True):
        k = loaded.model.names.index(name)
        start[k] += way * loaded.model.ranges[k]
    lost = reasons(problem, evaluate(problem, start, selected))
    assert len(lost) > 1 and WRONG in lost
    fit = identify(problem, selected, start, 20)
    truth = identify(problem.without((WRONG,)), selected)
    assert fit.failed.keys() == {WRONG} and fit.status == truth.status == "converged"
    # two fits of the same rows: as near as steps end
    index = [loaded.model.names.index(n) for n in selected]
    np.testing.assert_allclose((fit.values - truth.values)[index] / truth.std, 0.0, atol=1e-4)


@pytest.mark.slow
def test_the_diagnosis_of_the_others_is_what_it_would_be(tmp_path: Path) -> None:
    done = clean(run("diagnose", *spoilt(TABLE, out_of_reach, tmp_path), "--json"))
    found = json.loads(done.out)
    assert (found["verdict"], found["n_failed"]) == ("clean", 1)
