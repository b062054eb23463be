"""Rows that are wrong on their own: taken out before a search, put back where effects explain them after all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem, usable
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.gross_rows import Rows, gross_rows
from pkmcal_cli.diagnosis.outlying_rows import row_scores
from pkmcal_cli.diagnosis.refits import recalibrated
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all

_KINSHIP = 0.9  # share of what rows are off by that an effect explains if it is the cause
_SUSPECT = 0.05  # chance that any row is as far off, at which one is told
_ORDINARY = 0.01  # p value above which a row that was taken out is put back


def without_gross_rows(search: Search, parts: Alpha, seed: int) -> Search:
    """The search without rows that are beyond all noise, unless one effect explains nearly all that several are off by.

    One row proves no effect: a misread drive moves along what every effect of this drive does.
    """
    begin, states = search.start, search.fit.before.start
    rows, fit = gross_rows(search.problem, search.declared, parts.rows, seed, start=begin, states=states)
    if fit is None:
        return search
    if len(rows) > 1 and _of_one_cause(search, rows, fit):
        return search
    failed = {**search.failed, **fit.failed}
    return replace(search, problem=search.problem.without((*rows, *fit.failed)), fit=fit, bad_rows=rows, failed=failed)


def _of_one_cause(search: Search, rows: Rows, others: Fit) -> bool:
    """Whether one effect explains nearly all that rows are off by the fit of the others."""
    whole = score_all(replace(search, fit=others), search.candidates.hypotheses)
    off = whole.linear.chi2 - others.chi2
    values = int(search.problem.measured[list(rows)].sum())
    few = [s.statistic for s in whole.scores if 2 * s.count <= values]  # as many numbers explain any rows
    return max(few, default=0.0) > _KINSHIP * off


def restored(search: Search) -> Search:
    """The search with rows put back that the accepted effects explain after all, each judged by the good ones."""
    if not search.bad_rows:
        return search
    scale = score_all(search, ()).scale
    good = []
    for row in search.bad_rows:
        again = score_all(replace(search, problem=with_rows(search.problem, [row])), ())
        scores = row_scores(again.linear, again.linear.on, scale)
        if scores.count[row] and scores.p_value[row] > _ORDINARY:  # what the good ones cannot judge stays out
            good.append(row)
    if not good:
        return search
    whole = with_rows(search.problem, list(search.bad_rows))
    kept = tuple(r for r in search.bad_rows if r not in good)
    return recalibrated(replace(search, problem=whole.without(kept), bad_rows=kept))


def suspected_rows(last: Scored) -> dict[int, float]:
    """Rows that may be wrong, the worst first; `last`: scored with all that was found."""
    chance = np.minimum(last.rows.p_value * len(last.rows.p_value), 1.0)
    return {int(k): float(chance[k]) for k in np.argsort(chance, kind="stable") if chance[k] < _SUSPECT}


def with_rows(problem: Problem, rows: list[int]) -> Problem:
    """The problem with rows that were taken out."""
    measured = problem.measured.copy()
    measured[rows] = ~np.isnan(problem.readings[rows]) & ~np.isnan(problem.sigma[rows])
    return usable(replace(problem, measured=measured))
