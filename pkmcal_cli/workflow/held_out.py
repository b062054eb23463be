"""Which rows of a calibration are held out, and the figures on them."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from functools import partial

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import AtHand, is_stream
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.stages import Observer
from pkmcal_cli.calibration.complete_fit import Calibration, FitOptions, refit
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import HeldOut, cross_validate, enough_values, fold_labels, validate
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.plausible import implausible_fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_check import range_check
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.arguments import by_method
from pkmcal_cli.workflow.unsolved_rows import unsolved

_FOLDS = "5"
_SCHEMES = ("session", "cells", "none")
_NUMBER = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?|")
_DIGITS = 9


def held_out(
    problem: Problem,
    measured: Measurements,
    calibration: Calibration,
    scheme: str | None,
    options: FitOptions,
    observe: Observer,
    *,
    useful: bool,
) -> HeldOut | str:
    """Figures on rows of the table itself, or why there are none. Raises UsageError.

    useful: whether they were asked for, or the fit can be believed; else each fold would search as long as it did.
    """
    fit = calibration.robust.fit
    if scheme == "none":
        return "not requested"
    if fit.status != "converged":
        return f"the fit did not succeed ({fit.status})"
    if scheme is not None and not 0 < len(scheme) <= _DIGITS:
        raise UsageError("--holdout: invalid number of folds", hint="give a number such as 5")
    if scheme is None and not enough_values(problem, fit.selected):
        values, parameters = count(problem.count, "measured value"), count(problem.unknowns(fit.selected), "parameter")
        return f"{values} for {parameters}: fewer than 3 values per parameter"
    if not useful:
        return f"the fit is implausible; `--holdout {_FOLDS}` computes it all the same"
    try:
        labels, words = fold_labels(scheme or _FOLDS, problem, measured)
    except ValueError as error:
        if scheme is None:
            return str(error)
        raise UsageError(f"--holdout {scheme}: {error}") from None
    again = partial(refit, options, factors=calibration.budget.factors)
    weight = None if options.loss == "squares" else calibration.robust.problem.weight
    return cross_validate(problem, fit, labels, words, again, observe=observe, weight=weight)


def implausible(problem: Problem, calibration: Calibration) -> bool:
    """Whether a calibration cannot be believed, by its values and by what it leaves."""
    robust = calibration.robust
    checked = range_check(problem, robust.fit, calibration.budget)
    return bool(implausible_fit(replace(problem, weight=robust.problem.weight), robust.fit, checked))


def validated(loaded: LoadedMachine, problem: Problem, fit: Fit, other: Measurements) -> HeldOut | str:
    """Figures on the rows of another file; problem: that was fitted. Raises BadInput."""
    apart = by_method(with_unknown_sides(problem_of(loaded.model, other), fit.selected), problem.method)
    if not apart.count:
        return f"no reading in {other.files[0]} has a sigma"
    if fit.status != "converged":
        return f"the fit did not succeed ({fit.status})"
    try:
        return validate(apart, problem.model, fit, f"rows of {other.files[0]}")
    except RowsFailed as failure:
        raise unsolved(other, failure.evaluation.prediction) from None


def holdout_file(scheme: str | None) -> str | None:
    """The file that --holdout names, None where it names none. Raises UsageError for a word that is nothing."""
    if isinstance(scheme, AtHand):
        return scheme
    if scheme is None or scheme in _SCHEMES or _NUMBER.fullmatch(scheme):
        return None
    if not is_stream(scheme) and not os.path.splitext(scheme)[1] and not os.path.exists(scheme):
        hint = did_you_mean(scheme, _SCHEMES, "give a number of folds, session, cells, FILE.csv or none")
        raise UsageError(f"--holdout: `{scheme}` is not a scheme", hint=hint)
    return scheme
