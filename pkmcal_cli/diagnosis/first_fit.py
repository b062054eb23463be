"""The fit that is diagnosed, and where fits begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.error_budget import error_budget, held_parameters
from pkmcal_cli.calibration.estimated_ranges import centred, with_estimated_ranges
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import WEAK
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.patience import SHORT
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.starts import best_of_starts
from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.diagnosis.hypotheses import Candidates
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.search_options import SearchOptions

OUT = 3.0
"""Ranges off nominal, beyond which a declared parameter has run away."""
_BETTER = 9.0  # fall of chi-square, in variances of the noise, that is more than chance
_LEFT = 0.1  # of what is beyond the noise, that parameters far off leave: where more is left, they imitate a cause
_DRIFTED = 0.1  # half ranges by which what is held has left nominal: it turns on a long way, as of a ball far off
_SOON = 15  # steps in which fits converge, unless something is wrong


def calibrated(
    candidates: Candidates, problem: Problem, selected: tuple[str, ...], options: SearchOptions
) -> tuple[Candidates, Fit]:
    """The fit that is diagnosed, and where fits begin; from further starts, if it does not converge."""
    known = KnownResults()
    candidates, fit = calibrated_from_nominal(candidates, problem, selected, options, known)
    if fit.status == "not_converged":
        return calibrated_from_starts(candidates, problem, fit, options, known)
    return candidates, fit


def calibrated_from_nominal(
    candidates: Candidates, problem: Problem, selected: tuple[str, ...], options: SearchOptions, known: KnownResults
) -> tuple[Candidates, Fit]:
    """The fit that is diagnosed, and where fits begin.

    That is as given, but at nominal values in directions that the data hardly see: the ranges hold them there, also
    where these turned on a long way. Where the fit does not soon converge, it is that of the other rows, if some are
    gross where it begins; it may not converge at all.
    """
    start = replace(candidates, model=problem.model).begin()
    fit = identify(problem, selected, start, iterations=_SOON, patience=SHORT)
    if fit.status == "not_converged":
        states = fit.before.start
        chance, seed = options.parts.rows, options.seed
        _, others = gross_rows(problem, selected, chance, seed, start=start, states=states, known=known)
        if others is not None:
            return candidates, others
        fit = identify(problem, selected, start, states=states)
    if fit.status == "not_converged":
        return candidates, fit
    if candidates.start is not None and fit.directions.weak.any():
        start = centred(problem, start, start, fit.directions)
        candidates, fit = replace(candidates, start=start), identify(problem, selected, start, states=fit.before.start)
    return _from_its_end(candidates, problem, fit, options, known)


def calibrated_from_starts(
    candidates: Candidates, problem: Problem, fit: Fit, options: SearchOptions, known: KnownResults
) -> tuple[Candidates, Fit]:
    """The best fit from further starts, where one from nominal did not converge; all begin where it ends."""
    start, selected = replace(candidates, model=problem.model).begin(), fit.selected
    best, _ = best_of_starts(problem, selected, start, fit, 0, seed=options.seed, observe=options.observe)
    if best is None or best.status != "converged":
        return candidates, best or fit
    candidates, best = replace(candidates, start=best.values), replace(best, before=best.after)
    return _from_its_end(candidates, problem, best, options, known)


def _from_its_end(
    candidates: Candidates, problem: Problem, fit: Fit, options: SearchOptions, known: KnownResults
) -> tuple[Candidates, Fit]:
    """A fit that has converged, from where it ends, as long as that changes what ranges hold."""
    start, selected = replace(candidates, model=problem.model).begin(), fit.selected
    if fit.status == "converged" and not _ran_away(problem, fit) and _drift(problem, fit) > _DRIFTED:
        start = centred(problem, fit.values, start, fit.directions)
        candidates, fit = replace(candidates, start=start), identify(problem, selected, start, states=fit.after.start)
    return _by_wider_ranges(candidates, problem, fit, options, known)


def _drift(problem: Problem, fit: Fit) -> float:
    """By how much what the data hardly see has left nominal, in half ranges."""
    spectrum, nominal = fit.directions, problem.nominal_at(fit.values)
    index = [problem.model.names.index(n) for n in fit.selected]
    parts = WEAK * spectrum.duals @ ((fit.values - nominal)[index] / spectrum.ranges)
    return float(np.abs(parts[spectrum.weak]).max(initial=0.0))


def _by_wider_ranges(
    candidates: Candidates, problem: Problem, fit: Fit, options: SearchOptions, known: KnownResults
) -> tuple[Candidates, Fit]:
    """The fit from where one with ranges as they turn out to be ends, and that fits begin there; if it is better.

    How they turn out is asked of the rows that do not contradict the others: one wrong cell drives parameters as far.
    """
    if fit.status != "converged" or not _ran_away(problem, fit):
        return candidates, fit
    start, states = replace(candidates, model=problem.model).begin(), fit.before.start
    chance, seed = options.parts.rows, options.seed
    rows, others = gross_rows(problem, fit.selected, chance, seed, start=start, states=states, known=known)
    if others is None:
        wider = _wider(problem, fit, start)
        return (candidates, fit) if wider is None else (replace(candidates, start=wider.values), wider)
    wider = _wider(problem.without(rows), others, start) if _ran_away(problem, others) else None
    if wider is None:
        return candidates, fit
    return replace(candidates, start=wider.values), identify(problem, fit.selected, wider.values)


def _ran_away(problem: Problem, fit: Fit) -> bool:
    """Whether a parameter is so far off that it turns the directions that the data hardly see.

    Held near nominal, they would keep it away from where it is.
    """
    model = problem.model
    index = [model.names.index(n) for n in fit.selected]
    off = np.abs(fit.values[index] - model.nominal[index]) / model.ranges[index]
    return bool(fit.directions.held.any() and (off > OUT).any())


def _wider(problem: Problem, fit: Fit, start: Array) -> Fit | None:
    """The fit from where one with ranges as they turned out to be ends, without the rows that failed before; None where
    it does not explain what is left."""
    problem = problem.without(fit.failed)
    budget = error_budget(problem, fit, held_parameters(problem, fit.selected, ()))
    patience = replace(SHORT, hoped=_LEFT * fit.chi2)
    _, again = with_estimated_ranges(problem, fit, start, budget.factors, patience)
    if again is fit:
        return None
    wider = identify(problem, fit.selected, again.values, states=again.after.start)
    better = wider.chi2 < fit.chi2 - _BETTER * max(wider.chi2_per_dof, 1.0)
    explains = wider.excess - 1.0 <= _LEFT * (fit.excess - 1.0)
    good = wider.status == "converged" and better and explains and not wider.failed
    return replace(wider, failed=fit.failed) if good else None
