"""A cause of plausible size where a calibration runs away: accepted, and judged, where that with it ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.patience import EXACT
from pkmcal_cli.diagnosis import far_causes, far_starts
from pkmcal_cli.diagnosis.first_fit import calibrated
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.near_causes import with_near_cause
from pkmcal_cli.diagnosis.scoring import Search, score_all, score_without
from pkmcal_cli.diagnosis.search_options import SearchOptions
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import CaseRequest, prepare
from tests import four_rails

BAR, TIMES = 0.05, 5.0  # mm by which the ball bar is too long; ranges, and true errors, over those of the file


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> Search:
    """A plate that hardly turns, so that a calibration without the bar's constant puts the rails many ranges off."""
    folder, rng = tmp_path_factory.mktemp("rails"), np.random.default_rng(3)
    text, machine = four_rails.MACHINE, folder / "m.yaml"
    for before, after in (("length: 0.1}", "length: 0.5}"), ("0, range: 0.5", "0, range: 2.5"), ("1 um", "2 um")):
        text = text.replace(before, after)
    machine.write_text(text.replace("range: 0.1}", "range: 0.5}"), encoding="utf-8")
    files = four_rails.measure(four_rails.drawn(rng, TIMES), rng, folder, bar=BAR, sigma=2e-3, turn=6.0)
    case = prepare(CaseRequest(machine=str(machine), measurements=tuple(files)), Reporter(quiet=True))
    candidates, fit = calibrated(case.candidates, case.problem, case.selected, SearchOptions(alpha=0.005, seed=0))
    return Search(candidates=candidates, problem=case.problem, declared=case.selected, fit=fit)


@pytest.fixture(scope="module")
def free(search: Search) -> tuple[Search, Fit]:
    """The search from nominal values, and the fit with the constant of any size, as far causes are fitted."""
    begun, constant = far_causes._from_nominal(search), named(search, "meas_zero@ballbar")
    ((start,),) = (s.values for s in far_starts.far_starts(begun, [constant], False))
    fit = far_causes._fit(begun, constant, start, 30, EXACT)
    assert fit is not None
    return begun, fit


@pytest.fixture(scope="module")
def accepted(search: Search, free: tuple[Search, Fit]) -> Search:
    """The constant accepted as a cause of plausible size."""
    begun, fit = free
    after = with_near_cause(begun, named(search, "meas_zero@ballbar"), fit)
    assert after is not None
    return after


def named(search: Search, name: str) -> Hypothesis:
    return next(h for h in search.open if h.name == name)


def test_the_fit_with_it_is_that_of_its_usual_range(search: Search, accepted: Search) -> None:
    """Where fits begin at nominal, what is held turns on the way, and they end at twice the noise or more."""
    (constant,), fit = accepted.near, accepted.fit
    assert search.fit.chi2_per_dof > 25 and fit.chi2_per_dof < 1.4
    k = fit.selected.index(constant.parameters[0])
    value = fit.values[accepted.problem.model.names.index(constant.parameters[0])]
    assert abs(value + 1e-3 * BAR) < 4 * fit.std[k] < 10e-6
    assert not accepted.far_off and accepted.p_values["meas_zero@ballbar"] < 1e-9


def test_a_cause_that_explains_less_within_its_range_is_left_to_linear_tests(
    search: Search, free: tuple[Search, Fit]
) -> None:
    begun, fit = free
    assert with_near_cause(begun, named(search, "meas_zero@ballbar"), replace(fit, chi2=0.7 * fit.chi2)) is None


def test_rivals_are_judged_where_the_calibration_with_it_ends(search: Search, accepted: Search) -> None:
    """At the calibration without it linear scores put it far behind scales of its own at each drive."""
    there = score_all(search, search.open)
    ranks = dict(zip([h.name for h in there.hypotheses], there.log_bayes, strict=True))
    assert ranks["meas_zero@ballbar"] < max(ranks["scale@each"], ranks["pitch_curve@each"]) - 20
    (constant,) = accepted.accepted
    near = score_without(accepted, [constant], (constant, *accepted.open))
    ranks = dict(zip([h.name for h in near.hypotheses], near.log_bayes, strict=True))
    best = max(ranks.values())
    assert ranks["meas_zero@ballbar"] > best - 1.0 > ranks["scale@each"]
