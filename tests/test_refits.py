"""Fits within a diagnosis: what counts as a fit, what is refused and tried again, what is never called clean."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.calibration import predictable, step
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.patience import COMPARED, Patience
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.diagnosis import refits, search
from pkmcal_cli.diagnosis.run_diagnosis import diagnose
from pkmcal_cli.diagnosis.scoring import Search
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import read_measurements
from tests.benchmark.setting import ALPHA, diagnosed, ready
from tests.command import MACHINES, clean, run
from tests.hangprinter_cases import measured
from tests.truth.campaigns import campaign, unit

pytestmark = pytest.mark.usefixtures("unsized")


def test_a_fit_settles_before_it_has_converged() -> None:
    """The hangprinter takes eight steps; after six chi-square stands still, after one it falls by far."""
    problem, _ = measured("2021-12-16")
    selected = select(problem.model, "auto")
    fits = {steps: identify(problem, selected, iterations=steps) for steps in (1, 6, 60)}
    assert [f.status for f in fits.values()] == ["not_converged", "not_converged", "converged"]
    assert [f.usable for f in fits.values()] == [False, True, True]
    assert fits[6].chi2 == pytest.approx(fits[60].chi2, rel=1e-3) and fits[1].chi2 > 1.01 * fits[60].chi2
    once = identify(problem, selected, fits[6].values, 1, shift=fits[6].shift)
    assert (once.status, once.usable) == ("not_converged", False), "two values alike are no standstill"


def test_a_fit_that_is_compared_ends_where_no_evidence_shows_what_is_left() -> None:
    """One variance of the noise is half a unit of log evidence, and one standard uncertainty of one parameter."""
    problem, _ = measured("2021-12-16")
    selected = select(problem.model, "auto")
    end, compared = identify(problem, selected), identify(problem, selected, patience=COMPARED)
    assert (end.stopped, compared.stopped, compared.status) == ("gradient", "enough", "converged")
    assert compared.iterations < end.iterations
    variance = end.chi2 / problem.count
    assert -1e-9 * variance < compared.chi2 - end.chi2 < 1e-3 * variance
    index = [problem.model.names.index(n) for n in selected]
    moved = linearise(problem, end.last).jacobian @ (compared.values - end.values)[index] / np.sqrt(variance)
    assert np.linalg.norm(moved) < 0.03, "in standard uncertainties, all directions together"


def test_a_fit_that_is_compared_and_begins_near_an_earlier_one_needs_no_lead(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors of the drives at the measured poses are looked for in others; the end is the same."""
    problem, _ = measured("2021-12-16")
    selected, led = select(problem.model, "auto"), list[int]()
    plain = predictable.errors_at_poses
    monkeypatch.setattr(predictable, "errors_at_poses", lambda *given: (led.append(0), plain(*given))[1])
    first = identify(problem, selected)
    assert led
    led.clear()
    again = identify(problem, selected, states=first.before.start, patience=COMPARED)
    assert not led
    assert again.chi2 == pytest.approx(first.chi2, abs=1e-3 * first.chi2 / problem.count)
    identify(problem, selected, states=first.before.start)
    assert led


def test_where_a_fit_ended_is_predicted_as_the_drives_read() -> None:
    """Spools have errors, which the fit estimates; what is told of the rows is without them."""
    problem, _ = measured("2021-12-16")
    fit = identify(problem, select(problem.model, "auto"))
    assert fit.last.shift.any() and not fit.after.shift.any()
    plain = evaluate(problem, fit.values)
    assert fit.after.residual == pytest.approx(plain.residual, abs=1e-9, nan_ok=True)
    assert np.nanmax(np.abs(fit.last.residual - plain.residual)) > 1e-3


@pytest.mark.parametrize(("hopeless", "given_up"), [(np.inf, False), (1e30, False), (1.0, True)])
def test_a_fit_that_is_far_off_and_finds_no_easy_step_is_given_up(
    hopeless: float, given_up: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no step leads to a solved prediction, only a fit above `hopeless` ends after the first four dampings."""
    problem, _ = measured("2021-12-16")
    tried: list[float] = []
    plain = step._moved

    def lost(*given: Any) -> Any:
        tried.append(0.0)
        end = plain(*given)
        return replace(end, residual=np.full_like(end.residual, np.nan))

    monkeypatch.setattr(step, "_moved", lost)
    fit = identify(problem, select(problem.model, "auto"), patience=Patience(hopeless))
    assert (fit.status, fit.stopped) == ("not_converged", "no_descent")
    assert (len(tried) == 4) == given_up and len(tried) >= 4


@pytest.mark.parametrize(
    ("chi2", "ended"),
    [
        ([1e6, 1176.0, 1171.0, 1167.0, 1163.0], True),
        ([1e6, 1176.0, 1171.0, 1167.0], False),
        ([1e6, 1200.0, 1180.0, 1170.0, 1160.0], False),
        ([1e6, 599.0, 598.0, 597.0, 596.0], False),
    ],
)
def test_a_fit_that_creeps_above_what_is_hoped_for_is_given_up(chi2: list[float], ended: bool) -> None:
    """By less than 2 % in three steps, above 600; where nothing is hoped for, never."""
    assert Patience(hoped=600.0).ends(chi2) == ended and not COMPARED.ends(chi2)


def test_a_contender_is_hoped_to_do_as_its_score_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """From where all fits begin; near the fit before, the last way there is, nothing is hoped for."""
    hoped: list[float] = []
    plain = refits.identify

    def noting(*given: Any, **options: Any) -> Fit:
        hoped.append(options["patience"].hoped if "patience" in options else np.nan)
        return plain(*given, **options)

    monkeypatch.setattr(refits, "identify", noting)
    d = diagnosed(campaign("scissors", [unit("scissors", "backlash", "q3", 4).scaled(0.6)], 4), 4)
    assert [f.hypothesis.name for f in d.findings] == ["backlash@q3"]
    assert 0.0 < min(hoped) < 3.0 * d.search.problem.count, "about 1.5 variances a reading"


def test_one_of_several_fits_is_none_where_it_tears_the_machine(tmp_path: Path) -> None:
    """A joint of the redundant delta is 3 mm off in the file: steps lead where drives disagree far too much.

    The only fit there is looks for others, with each step compared; of several one less is no loss.
    """
    file = tmp_path / "m.yaml"
    text = (MACHINES / "delta4.yaml").read_text(encoding="utf-8")
    file.write_text(text.replace("P1a: [r1, 40, 0]", "P1a: [r1, 43, 0]"), encoding="utf-8")
    machine = read_machine(file)
    model = compile_machine(machine).model
    table = read_measurements([MACHINES / "delta4.csv"], machine)
    problem, selected = problem_of(model, table).take(np.arange(0, 80, 8)), select(model, "auto")
    with pytest.raises(RowsFailed):
        identify(problem, selected, patience=Patience(1e9))
    assert identify(problem, selected).usable


@pytest.mark.parametrize(
    ("flat", "found"), [(True, ["backlash@q3"]), pytest.param(False, [], marks=pytest.mark.slow)]
)
def test_a_refit_that_has_settled_counts(flat: bool, found: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Parameters that hardly matter may wander for more steps than a refit has."""
    plain = refits.identify

    def wandering(problem: Problem, selected: tuple[str, ...], *more: Any, **options: Any) -> Fit:
        fit = plain(problem, selected, *more, **options)
        return replace(fit, status="not_converged", flat=flat) if any("@" in n for n in selected) else fit

    monkeypatch.setattr(refits, "identify", wandering)
    d = diagnosed(campaign("scissors", [unit("scissors", "backlash", "q3", 4).scaled(0.6)], 4), 4)
    assert [f.hypothesis.name for f in d.findings] == found
    assert d.verdict == ("found" if flat else "unknown") and (flat or d.unknown)


def test_a_refit_that_leaves_rows_out_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its chi-square is that of other rows."""
    plain = refits.identify

    def leaving(problem: Problem, selected: tuple[str, ...], *more: Any, **options: Any) -> Fit:
        fit = plain(problem, selected, *more, **options)
        return replace(fit, failed={3: "out of reach"}) if any("@" in n for n in selected) else fit

    monkeypatch.setattr(refits, "identify", leaving)
    case = ready(campaign("scissors", [unit("scissors", "backlash", "q3", 4).scaled(0.6)], 4))
    few = replace(case.candidates, hypotheses=tuple(h for h in case.candidates.hypotheses if h.effect == "backlash"))
    d = diagnose(few, case.problem, case.selected, ALPHA, 4)
    assert d.findings == () and d.verdict == "unknown"


def test_an_effect_by_which_rows_are_lost_begins_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    """Up to a play of 1 mm rows are predicted here; a linear estimate of 12 mm is halved until they are."""
    there = ready(campaign("scissors", [unit("scissors", "backlash", "q3", 4)], 4))
    now = Search(
        candidates=there.candidates,
        problem=there.problem,
        declared=there.selected,
        fit=identify(there.problem, there.selected),
    )
    play = next(h for h in now.open if h.name == "backlash@q3")
    k = now.problem.model.names.index(play.parameters[0])
    plain_evaluate, plain_identify, begun = refits.evaluate, refits.identify, list[float]()

    def limited(problem: Problem, values: Any, *more: Any) -> Any:
        end = plain_evaluate(problem, values, *more)
        return end if values[k] <= 1e-3 else replace(end, residual=np.full_like(end.residual, np.nan))

    def watched(problem: Problem, selected: tuple[str, ...], start: Any, *more: Any, **options: Any) -> Fit:
        begun.append(float(start[k]))
        return plain_identify(problem, selected, start, *more, **options)

    monkeypatch.setattr(refits, "evaluate", limited)
    monkeypatch.setattr(refits, "identify", watched)
    fit = refits.refit(replace(now, accepted=(play,)), {play: np.array([12e-3])})
    assert begun == [12e-3 / 16] and fit is not None and fit.usable
    assert abs(fit.values[k] - 20e-6) < 1e-6


@pytest.mark.parametrize("sizes", [(0.4, 1.0), pytest.param((2.0, 0.5), marks=pytest.mark.slow)])
def test_what_was_refused_is_tried_again_beside_what_was_accepted(
    sizes: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Backlash of q3 has no fit as long as the other effect is not in the model, be it the smaller or the larger."""
    plain = search.refit

    def one_after_the_other(now: search.Search, starts: Any, *more: float) -> Fit | None:
        names = {h.name for h in now.accepted}
        return None if names == {"backlash@q3"} else plain(now, starts)

    monkeypatch.setattr(search, "refit", one_after_the_other)
    effects = unit("scissors", "backlash", "q3", 4), unit("scissors", "pitch_curve", "q2", 4)
    planted = [effect.scaled(size) for effect, size in zip(effects, sizes, strict=True)]
    case = ready(campaign("scissors", planted, 4))
    few = tuple(h for h in case.candidates.hypotheses if h.effect in ("backlash", "pitch_curve"))
    d = diagnose(replace(case.candidates, hypotheses=few), case.problem, case.selected, ALPHA, 4)
    assert {f.hypothesis.name for f in d.findings} == {"backlash@q3", "pitch_curve@q2"}


@pytest.mark.parametrize("command", ["diagnose", pytest.param("improve", marks=pytest.mark.slow)])
def test_more_than_the_stated_sigma_leaves_is_never_clean(command: str, tmp_path: Path) -> None:
    """The noise of the Scissors' table, of which every second row does, is twice what this machine file states."""
    machine, table = tmp_path / "half.yaml", tmp_path / "t.csv"
    rows = [line for line in (MACHINES / "scissors.csv").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    table.write_text("\n".join([rows[0], *rows[1::2], ""]), encoding="utf-8")
    machine.write_text(f"extends: {MACHINES}/scissors.yaml\nsensors: {{grid: {{sigma: 0.25 um}}}}\n", encoding="utf-8")
    done = clean(run(command, machine, table, "--json"))
    assert (done.code, done.json["verdict"]) == (1, "sigma_too_small")
    assert "sigma is too small" in done.err
    assert not done.json.get("effects") and not done.json.get("steps")
    honest = clean(run(command, MACHINES / "scissors.yaml", table, "--json"))
    assert (honest.code, honest.json["verdict"]) == (0, "clean")
