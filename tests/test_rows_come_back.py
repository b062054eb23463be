"""Rows that cannot be predicted: out of every step, with all that joins others to them, and these others are not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.deletion import deletion_residuals
from pkmcal_cli.calibration.holdout import cross_validate, validate
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import (
    Evaluation,
    evaluate,
    linearise,
    reasons,
    whitened_residual,
)
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.command import MACHINES, clean, run
from tests.support import overlay
from tests.test_identify import noisy
from tests.test_spoilt_tables import Csv, out_of_reach, spoilt

pytestmark = pytest.mark.usefixtures("unsized")

TABLE = MACHINES / "five-bar.csv"
WRONG = 20  # the row whose drive is 192 degrees off
ASTRAY = (-62, 94, -77, 87, 111, 116, 11, -98, 44, -80, -72)
"""In ranges: where a fit of all rows goes for the sake of the wrong one; three good ones are out of reach there."""


def astray(folder: Path) -> tuple[Problem, tuple[str, ...], Array, set[int]]:
    """The table with a wrong drive, what is identified, values (P,) to begin with, and rows out of reach there."""
    machine, table = spoilt(TABLE, out_of_reach, folder)
    loaded = load_machine(machine)
    problem = problem_of(loaded.model, load_measurements(loaded, (table,)))
    selected = tuple(p.name for p in loaded.model.parameters if "@" not in p.name)
    start = loaded.model.nominal
    for name, way in zip(selected, ASTRAY, strict=True):
        k = loaded.model.names.index(name)
        start[k] += way * loaded.model.ranges[k]
    lost = set(reasons(problem, evaluate(problem, start, selected)))
    assert len(lost) > 1 and WRONG in lost
    return problem, selected, start, lost


def test_rows_that_failed_on_the_way_are_fitted(tmp_path: Path) -> None:
    problem, selected, start, _ = astray(tmp_path)
    fit = identify(problem, selected, start, 20)
    truth = identify(problem.without((WRONG,)), selected)
    assert fit.failed.keys() == {WRONG} and fit.status == truth.status == "converged"
    # two fits of the same rows: as near as steps end
    index = [problem.model.names.index(n) for n in selected]
    np.testing.assert_allclose((fit.values - truth.values)[index] / truth.std, 0.0, atol=1e-4)


@pytest.mark.slow
def test_rows_that_would_spoil_the_fit_do_not_come_back(tmp_path: Path) -> None:
    """Readings of one that failed are 90 standard uncertainties off: it is near, but explained by nothing."""
    problem, selected, start, lost = astray(tmp_path)
    readings = problem.readings.copy()
    readings[max(lost)] += 90 * problem.sigma[max(lost)]
    fit = identify(replace(problem, readings=readings), selected, start, 20)
    assert fit.failed.keys() == lost and fit.status == "converged" and fit.chi2_per_dof < 2


def test_a_pose_at_the_other_end_of_a_distance_that_cannot_be_predicted() -> None:
    """Nothing was read there but the distance: it is named, the distance is not used, and its first end stays."""
    loaded = load_machine(str(MACHINES / "belt-router.yaml"))
    table = load_measurements(loaded, (str(MACHINES / "belt-router.csv"),))
    problem = problem_of(loaded.model, table)
    assert problem.rows.partner is not None
    near = int(np.nonzero(problem.measured[:, problem.joining].any(axis=1))[0][0])
    far = int(problem.rows.partner[near])
    readings, measured = problem.rows.readings.copy(), problem.measured.copy()
    readings[far] *= 0.01
    measured[far] = False
    problem = replace(problem, rows=replace(problem.rows, readings=readings), measured=measured)
    selected = select(loaded.model, "auto")
    fit, alone = identify(problem, selected), identify(problem.without([far]), selected)
    assert list(fit.failed) == [far] and alone.status == "converged" and not alone.failed
    assert not problem.without([far]).measured[near, problem.joining].any()
    assert problem.without([far]).measured[near].any()
    assert (fit.status, fit.dof) == ("converged", alone.dof) and fit.values == pytest.approx(alone.values, rel=1e-12)


def test_what_is_not_predicted_is_left_out_of_every_linear_step() -> None:
    """As if nothing had been measured there, and never a nan."""
    plan, problem, _ = noisy()
    positions = plan.positions.copy()
    positions[17, 0] -= 1.0
    problem = plan.problem(problem.readings, positions)
    without = problem.without([17])
    there, rest = (evaluate(p, p.model.nominal, plan.selected) for p in (problem, without))
    assert np.isnan(there.residual[17]).all() and rest.solved
    for one, other in zip(_linear(problem, there), _linear(without, rest), strict=True):
        assert np.isfinite(one).all()
        np.testing.assert_array_equal(one, other)


def _linear(problem: Problem, there: Evaluation) -> list[Array]:
    near = linearise(problem, there)
    white = whitened_residual(problem, there)
    return [near.residual, near.jacobian, np.array(near.chi2), white, *deletion_residuals(problem, there)]


def test_a_start_at_which_most_rows_are_out_of_reach() -> None:
    """Rods 100 mm short close at 66 of 231 poses; fits of those rows that close lead to where all do."""
    _, problem, _ = noisy()
    rods, start = ("l1", "l2"), problem.model.nominal
    start[[problem.model.names.index(n) for n in rods]] -= 0.1
    assert evaluate(problem, start, rods).prediction.solved.sum() == 66 and len(problem) == 231
    far, near = identify(problem, rods, start), identify(problem, rods)
    assert not far.failed and far.chi2 == pytest.approx(near.chi2, rel=1e-9)
    assert np.abs(far.values - near.values).max() < 1e-6 * near.std.min()


def test_rows_that_leave_fewer_values_than_parameters_are_no_table() -> None:
    """Three rows of two coordinates for six parameters, one row out of reach: four values cannot tell them."""
    plan, problem, _ = noisy()
    positions, rows = plan.positions.copy(), np.arange(3)
    whole = identify(problem.take(rows), plan.selected)
    assert whole.status == "converged" and len(plan.selected) == 6 and whole.dof >= 0
    positions[2, 0] -= 1.0
    with pytest.raises(RowsFailed):
        identify(plan.problem(problem.readings, positions).take(rows), plan.selected)


def test_what_was_measured_once_counts_though_the_first_row_has_no_prediction(tmp_path: Path) -> None:
    """A rod on a bench, told to 0.1 um: the fit is that of the other rows and the bench."""
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    bench = "sensors: {bench: {kind: bench, of: l1, reading: 300.01, sigma: 0.1 um}}"
    machine.write_text(overlay("triglide-nonredundant", bench), encoding="utf-8")
    text = (MACHINES / "triglide-nonredundant.csv").read_text(encoding="utf-8")
    table.write_text(text, encoding="utf-8")
    loaded = load_machine(str(machine))
    problem = problem_of(loaded.model, load_measurements(loaded, (str(table),)))
    readings = problem.rows.readings.copy()
    readings[0, 0] -= 1.0
    problem = replace(problem, rows=replace(problem.rows, readings=readings))
    selected = select(loaded.model, "auto")
    fit, rest = identify(problem, selected), identify(problem.take(np.arange(1, len(problem))), selected)
    assert list(fit.failed) == [0] and fit.dof == rest.dof
    assert fit.values == pytest.approx(rest.values, rel=1e-12)
    assert fit.values[loaded.model.names.index("l1")] == pytest.approx(0.30001, abs=3e-7)


@pytest.mark.slow
def test_held_out_rows_that_cannot_be_predicted_have_no_error() -> None:
    """Neither before nor after; how many they are is told."""
    plan, problem, _ = noisy()
    positions = plan.positions.copy()
    positions[17, 0] -= 1.0
    fit = identify(problem.take(np.arange(100, len(problem))), plan.selected)
    other = plan.problem(problem.readings, positions).take(np.arange(100))
    found = validate(other, problem.model, fit, "another file")
    rest = validate(other.take(np.delete(np.arange(100), 17)), problem.model, fit, "another file")
    assert (found.before, found.after) == (rest.before, rest.after)
    assert (found.scheme, rest.scheme) == ("another file; 1 of 100 rows could not be predicted", "another file")
    fit, labels = identify(other, plan.selected), np.arange(100) % 4
    found, rest = (cross_validate(p, fit, labels, "4 folds") for p in (other, other.without([17])))
    for one, same in ((found.before, rest.before), (found.after, rest.after)):
        assert one["position"].rms == pytest.approx(same["position"].rms, rel=1e-9)
    assert (found.scheme, rest.scheme) == ("4 folds; 1 of 100 rows could not be predicted", "4 folds")


@pytest.mark.slow
def test_the_diagnosis_of_the_others_is_what_it_would_be(tmp_path: Path) -> None:
    done = clean(run("diagnose", *spoilt(TABLE, out_of_reach, tmp_path), "--json"))
    found = json.loads(done.out)
    assert (found["verdict"], found["effects"]) == ("measurement_fault", [])
    assert [row["id"] for row in found["outliers"]] == ["21"], "the row out of reach is at fault, and nothing besides"


def test_a_row_that_nothing_brings_back_is_compared_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Comparing its drives with all poses costs as much as a hundred good rows."""
    from pkmcal_cli.prediction import solving

    asked: list[int] = []
    compared = solving.common_pose
    monkeypatch.setattr(solving, "common_pose", lambda model, some: asked.append(len(some)) or compared(model, some))

    def ten_times(csv: Csv) -> Csv:
        short, drive = csv.of_rows(csv.rows[:12]), csv.drives[1]
        return short.with_cell(5, drive, repr(10 * float(short.rows[5][drive])))

    machine, table = spoilt(MACHINES / "hexapod7.csv", ten_times, tmp_path)
    loaded = load_machine(machine)
    problem = problem_of(loaded.model, load_measurements(loaded, (table,)))
    fit = identify(problem, select(loaded.model, "auto"))
    assert fit.status == "converged" and len(fit.failed) == 1
    assert sum(asked) == 1
