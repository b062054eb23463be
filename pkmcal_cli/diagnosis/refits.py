"""Fits with what a search has accepted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.patience import COMPARED
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.scoring import Search
from pkmcal_cli.prediction import WarmStart

_STEPS = 20  # of a fit with effects; those that take more turn on the sign of forces
_HALVINGS = 6
_LOST = 1.5  # times the chi-square that is expected, at which a fit may have lost its way
_HOPELESS = 1e4  # times the chi-square before: a fit that begins so far off is not led back by damped steps


def recalibrated(search: Search) -> Search:
    """The same with a fit of its problem; rows that this does not predict are left out. Raises RowsFailed."""
    fit = identify(search.unheld, search.selected, search.start, states=search.fit.before.start)
    if search.accepted and fit.chi2 > _LOST * search.fit.chi2:  # with fewer rows
        fit = _better(fit, _converged_fit(search, _near(search), search.fit.after.start)) or fit
    return replace(search, problem=search.problem.without(fit.failed), fit=fit, failed={**search.failed, **fit.failed})


def refit(search: Search, starts: Mapping[Hypothesis, Array], expected: float = np.inf) -> Fit | None:
    """A calibration with the accepted effects; None where it does not settle, or does not predict all rows.

    It begins where all fits do, so that what the data do not determine stays there, but for effects with estimates
    (k,), SI. Where that is far from as good as `expected` (chi-square), it begins at the values of the fit before too.
    """
    near, start, null = _near(search), search.start, search.null
    for hypothesis, estimate in starts.items():
        for name, value in zip(hypothesis.parameters, estimate, strict=True):
            k = search.problem.model.names.index(name)
            if name in hypothesis.unknown:
                start[k] = near[k] = np.clip(null[k] + value, *search.problem.bounds[k])
    fit = _converged_fit(search, start, search.fit.before.start, _LOST * expected)
    if fit is not None and fit.chi2 < _LOST * expected:
        return fit
    return _better(fit, _converged_fit(search, near, search.fit.after.start))


def _near(search: Search) -> Array:
    """Values (P,) to begin with: those of the fit before, of what was fitted."""
    near = search.start
    index = [search.problem.model.names.index(n) for n in search.selected if n in search.fit.selected]
    near[index] = search.fit.values[index]
    return near


def _converged_fit(search: Search, start: Array, states: WarmStart, hoped: float = np.inf) -> Fit | None:
    """A fit from values (P,), and from states of rows near those there; not one that creeps above what is hoped for."""
    patience = replace(COMPARED, chi2=_HOPELESS * search.fit.chi2, hoped=hoped)
    start, states = _predicted(search, start, states)
    try:
        fit = identify(search.unheld, search.selected, start, _STEPS, states=states, patience=patience)
    except RowsFailed:
        return None
    return fit if fit.usable and not fit.failed else None


def _predicted(search: Search, start: Array, states: WarmStart) -> tuple[Array, WarmStart]:
    """Values (P,) and states at which all rows are predicted: effects half as large, again and again; else as given.

    Estimates are linear: an effect that they make so large that rows cannot be assembled is not as large as that.
    """
    names, values = search.problem.model.names, start.copy()
    index = [names.index(n) for h in search.accepted for n in h.unknown]
    for _ in range(_HALVINGS):
        there = evaluate(search.unheld, values, None, states)
        if there.solved:
            return values, there.start
        values[index] = 0.5 * (values[index] + search.null[index])
    return start, states


def _better(one: Fit | None, other: Fit | None) -> Fit | None:
    fits = [fit for fit in (one, other) if fit is not None]
    return min(fits, key=lambda fit: fit.chi2, default=None)
