"""Second derivatives in a fit: the secant update, and tables that hardly show a time constant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.second_order import SecondOrder
from tests.command import clean, run
from tests.tripod import AT_ONCE, LATE, TRIPOD

rng = np.random.default_rng(0)
SLOPES, BENT, READINGS = rng.normal(size=(9, 3)), rng.normal(size=(9, 3, 3)), 10 * rng.normal(size=9)
BENT = BENT + BENT.transpose(0, 2, 1)


def place(z: Array) -> tuple[Array, Array]:
    """Jacobian and residual of readings that are quadratic in z (3,): second derivatives `BENT`."""
    return SLOPES + BENT @ z, READINGS - SLOPES @ z - 0.5 * np.einsum("ipq,p,q->i", BENT, z, z)


def test_along_a_step_it_is_the_curvature_that_the_linear_problem_lacks() -> None:
    """Of quadratic readings, S times the last step is -sum r H times it exactly (NL2SOL's secant equation)."""
    here, step = np.array([0.3, -0.2, 0.1]), np.array([-0.1, 0.25, 0.2])
    before, after = place(here), place(here + step)
    gradient = before[0].T @ before[1] - after[0].T @ after[1]
    assert step @ gradient > 0
    bent = SecondOrder().after(step, *before, gained=0.1, linear=1.0).at(*after)
    assert bent.matrix is not None and bent.positive is not None
    np.testing.assert_allclose(bent.matrix @ step, -np.einsum("i,ipq->pq", after[1], BENT) @ step, rtol=1e-12)
    np.testing.assert_allclose(bent.matrix, bent.matrix.T)
    values = np.linalg.eigvalsh(bent.matrix)
    np.testing.assert_allclose(np.trace(bent.positive.T @ bent.positive), values[values > 0].sum())


def test_it_is_used_until_the_linear_problem_foretells_gains_clearly_better() -> None:
    step, rows = np.array([1.0, 0.0, 0.0]), np.array([[0.8, 0.0, 0.0]])
    bent = SecondOrder(np.diag([0.64, 0.0, 0.0]), rows)
    assert bent.added(step) == pytest.approx(0.64)
    assert bent.after(step, *place(step), gained=0.3, linear=1.0).rows is rows
    assert bent.after(step, *place(step), gained=0.66, linear=1.0).rows is rows, "hardly worse"
    linear = bent.after(step, *place(step), gained=0.95, linear=1.0)
    assert linear.rows is None and linear.added(step) == 0.0


@pytest.mark.parametrize("table", [LATE, AT_ONCE], ids=lambda path: path.stem)
def test_a_lag_that_a_table_hardly_shows_does_not_keep_a_fit_from_its_end(table: Path) -> None:
    """Linear steps went to and fro about the one lag without an end; of the other, what is held about nominal led to a
    lag below 0, where nothing is predicted, and ended at 1000 minutes."""
    fit = clean(run("calibrate", TRIPOD, table, "--holdout", "none", "--json")).json
    assert fit["status"] == "converged" and fit["iterations"] <= 30 and fit["starts"] is None
    assert fit["chi2_per_dof"] < 1.3
    by_name = {p["name"]: p for p in fit["parameters"]}
    growth, lag = by_name["thermal_strut@all.a"], by_name["thermal_strut@all.lag"]
    assert abs(growth["value"] - 11.5) < 3 * growth["std"]
    assert 0.0 <= lag["value"] < 10.0


def test_machines_that_lag_are_compared(tmp_path: Path) -> None:
    """At settled temperatures: no column `time` belongs to a pose."""
    late, at_once = tmp_path / "late.params.yaml", tmp_path / "at-once.params.yaml"
    for table, file in ((LATE, late), (AT_ONCE, at_once)):
        clean(run("calibrate", TRIPOD, table, "--holdout", "none", "-o", file))
    done = run("compare", late, at_once)
    assert done.code == 0 and "change of the tool point over the workspace" in done.err


@pytest.mark.parametrize("how", [("--starts", "6"), ("--method", "rigid", "--starts", "1")], ids=" ".join)
def test_a_lag_that_no_times_show_stays_at_nothing(how: tuple[str, ...], tmp_path: Path) -> None:
    """Exactly, whatever moves parameters: only at no lag at all can readings without times be predicted."""
    table = tmp_path / "timeless.csv"
    lines = [line.split(";") for line in AT_ONCE.read_text(encoding="utf-8").splitlines()]
    gone = lines[0].index("time")
    table.write_text("\n".join(";".join(c for k, c in enumerate(line) if k != gone) for line in lines) + "\n")
    fit = clean(run("calibrate", TRIPOD, table, "--holdout", "none", *how, "--json")).json
    by_name = {p["name"]: p for p in fit["parameters"]}
    growth, lag = by_name["thermal_strut@all.a"], by_name["thermal_strut@all.lag"]
    assert abs(growth["value"] - 11.5) < 3 * growth["std"]
    assert lag["value"] == 0.0 and lag["std"] is None
