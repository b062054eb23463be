"""Small tables: effects against noise that only the table itself tells, and rows that spoil a fit."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import fdtrc

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis import first_fit
from pkmcal_cli.diagnosis.run_diagnosis import diagnose
from pkmcal_cli.diagnosis.score import p_of_part
from pkmcal_cli.diagnosis.search_options import SearchOptions
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import CaseRequest, prepare
from tests.benchmark.setting import ready
from tests.command import MACHINES
from tests.lookalikes.judge import written
from tests.truth.campaigns import campaign
from tests.truth.look_alikes.head import head


def test_the_part_of_a_sum_of_squares_has_an_exact_level() -> None:
    """F of what a part leaves; of normal values of any size it is as rare as it says (within four standard errors)."""
    squares = 9.0 * np.random.default_rng(3).normal(size=(20_000, 24)) ** 2
    for count in (1, 3, 10):
        part, whole = squares[:, :count].sum(axis=1), squares.sum(axis=1)
        p = p_of_part(part, np.full(len(part), count), whole / 24, 24.0)
        assert p == pytest.approx(fdtrc(count, 24 - count, part / count / ((whole - part) / (24 - count))), rel=1e-9)
        assert np.mean(p < 0.01) == pytest.approx(0.01, abs=4 * np.sqrt(0.01 / 20_000))
    assert p_of_part(np.array([5.0]), np.array([24]), 1.0, 24.0) == [1.0], "as many numbers as values"


def test_an_effect_of_a_small_table_is_told_from_noise_that_is_larger_than_stated() -> None:
    """Ten poses of a tripod head, a screw with a wrong pitch: 18 standard uncertainties, by what it leaves.

    Not by the whole residual, in which it is the most: no effect could be more than so many times that. Its size is
    not one that being found has made larger.
    """
    campaign_ = head(0)
    with tempfile.TemporaryDirectory() as folder:
        machine, _ = written(Path(folder), campaign_)
        request = CaseRequest(machine=str(machine), measurements=(str(machine.with_name("table.csv")),))
        case = prepare(request, Reporter(quiet=True))
        found = diagnose(case.candidates, case.problem, case.selected, 0.005, 0)
    (finding,) = found.findings
    assert finding.hypothesis.name == "scale@q1" and found.scale.variance < 2
    assert finding.estimate[0] == pytest.approx(campaign_.values["scale@q1.s"], abs=3 * finding.std[0])
    assert finding.estimate[0] > 15 * finding.std[0] and finding.selected is None


def test_rows_that_spoil_the_fit_are_left_out_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where all rows together do not converge, the good ones are fitted, instead of all from other starts."""
    there = ready(campaign("triglide-nonredundant", [], 5, 40))
    readings = there.problem.readings.copy()
    readings[7] += 1e5 * there.problem.sigma[7]
    spoilt = replace(there.problem, readings=readings)

    def diverged(problem: Problem, *_: object, **__: object) -> Fit:
        return replace(identify(problem, there.selected), status="not_converged")

    monkeypatch.setattr(first_fit, "identify", diverged)
    monkeypatch.setattr(first_fit, "best_of_starts", None)
    found = diagnose(there.candidates, spoilt, there.selected, 0.005, 0)
    assert found.bad_rows == (7,) and found.verdict == "measurement_fault"
    good = identify(there.problem.without((7,)), there.selected)
    assert found.before.values == pytest.approx(good.values, rel=1e-6, abs=1e-9)


def test_later_fits_begin_where_further_starts_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """From where the first fit failed they would fail too, or end in another minimum than the calibration."""
    there = ready(campaign("triglide-nonredundant", [], 5, 40))
    good = identify(there.problem, there.selected)

    def diverged(problem: Problem, *_: object, **__: object) -> Fit:
        return replace(good, status="not_converged")

    monkeypatch.setattr(first_fit, "identify", diverged)
    monkeypatch.setattr(first_fit, "gross_rows", lambda *_, **__: ((), None))
    monkeypatch.setattr(first_fit, "best_of_starts", lambda *_, **__: (good, None))
    options = SearchOptions(alpha=0.005, seed=0)
    candidates, fit = first_fit.calibrated(there.candidates, there.problem, there.selected, options)
    assert candidates.begin() == pytest.approx(good.values) and fit.chi2 == good.chi2
    assert fit.before.values == pytest.approx(good.values), "folds begin there too"


def test_rows_that_a_fit_has_lost_stay_lost_where_ranges_are_widened(tmp_path: Path) -> None:
    """A drive's readings stand one row too late: parameters run away after them, and a few poses cannot be assembled.

    Such rows have no derivatives to weigh ranges by ("the computation fails with these numbers").
    """
    lines = [line for line in (MACHINES / "biglide.csv").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    head_, *rows = (line.split(",") for line in lines)
    k = head_.index("q3 [mm]")
    late = [[*row[:k], before[k], *row[k + 1 :]] for row, before in zip(rows, [rows[-1], *rows[:-1]], strict=True)]
    table = tmp_path / "late.csv"
    table.write_text("\n".join(",".join(row) for row in [head_, *late]) + "\n", encoding="utf-8")
    request = CaseRequest(machine=str(MACHINES / "biglide.yaml"), measurements=(str(table),))
    case = prepare(request, Reporter(quiet=True))
    options = SearchOptions(alpha=0.005, seed=0)
    _, fit = first_fit.calibrated(case.candidates, case.problem, case.selected, options)
    assert set(fit.failed) == set(np.nonzero(~fit.last.prediction.solved)[0].tolist())
    assert set(fit.failed)
