"""Rows that are wrong on their own, and such readings of the bench: taken out before a search, put back where effects
explain them after all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.bench_readings import BenchReading, bench_readings
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.problem import Problem, usable
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.gross_rows import Rows, gross_rows
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.outlying_rows import row_scores
from pkmcal_cli.diagnosis.refits import recalibrated
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all

_KINSHIP = 0.9  # share of what rows are off by that an effect explains if it is the cause
_SUSPECT = 0.05  # chance that any row is as far off, at which one is told
_ORDINARY = 0.01  # p value above which a row that was taken out is put back


def without_gross_rows(search: Search, bare: Problem, parts: Alpha, seed: int) -> Search:
    """The search without rows that are beyond all noise, and without readings of the bench that the others contradict.

    Unless one effect explains nearly all that several are off by. One proves no effect: a misread drive moves along
    what every effect of this drive does. `bare`: the problem as it was fitted.
    """
    begin, states, once = search.start, search.fit.before.start, search.problem.once
    rows, fit = gross_rows(bare, search.declared, parts.rows, seed, start=begin, states=states, known=search.known)
    table = replace(search, problem=search.problem.leaving_out(once))
    if fit is not None and len(rows) > 1 and _of_one_cause(table, fit, rows):
        rows, fit = (), None
    if once:
        return _without_readings(search, recalibrated(table) if fit is None else _of_others(table, rows, fit), parts)
    return search if fit is None else _of_others(search, rows, fit)


def _of_others(search: Search, rows: Rows, fit: Fit) -> Search:
    """The search without some rows; fit: of the others."""
    failed = {**search.failed, **fit.failed}
    return replace(search, problem=search.problem.without((*rows, *fit.failed)), fit=fit, bad_rows=rows, failed=failed)


def _without_readings(search: Search, table: Search, parts: Alpha) -> Search:
    """The search without rows that are wrong in its table, and without readings of the bench that it contradicts.

    table: the search by rows alone, without any reading of the bench.
    """
    every = replace(table, problem=table.problem.leaving_out(search.problem.left_out))
    readings = bench_readings(every.problem, table.fit)
    bad = [r.channel for r in readings if r.p_value < parts.rows / len(readings)]
    pieces = [len(every.problem) + every.problem.once.index(channel) for channel in bad]
    if len(bad) > 1 and _of_one_cause(every, table.fit, pieces):
        bad = []
    if not bad and not table.bad_rows:
        return search
    return recalibrated(replace(every, problem=every.problem.leaving_out((*search.problem.left_out, *bad))))


def _of_one_cause(search: Search, others: Fit, pieces: Sequence[int]) -> bool:
    """Whether one effect explains nearly all that rows, or readings of the bench, are off by the fit of the others.

    That is of all these `pieces` together, and of each on average: one that is off by much more than the rest proves no
    effect.
    """
    whole = score_all(replace(search, fit=others), search.candidates.hypotheses)
    linear, some = whole.linear, list(pieces)
    values = int((np.isin(linear.pieces, some) & linear.on).sum())
    most = _KINSHIP * (linear.chi2 - others.chi2)
    squares = _squares(linear, linear.residual)[some]
    for hypothesis, score in zip(whole.hypotheses, whole.scores, strict=True):
        if score.statistic > most and 2 * score.count <= values:  # as many numbers explain any values
            left = linear.unexplained - linear.free(linear.tested(hypothesis) @ score.estimate)
            if np.mean(_squares(linear, left)[some] / squares) < 1.0 - _KINSHIP:
                return True
    return False


def _squares(linear: Linear, values: Array) -> Array:
    """Sums of squares of values (n,) by piece."""
    return np.bincount(linear.pieces.ravel(), values**2)


def restored(search: Search) -> Search:
    """The search with rows and readings of the bench put back that the accepted effects explain after all."""
    return _restored_rows(_restored_readings(search))


def left_out_readings(search: Search) -> tuple[BenchReading, ...]:
    """Readings of the bench that were taken out, against the fit."""
    used = search.problem.once
    return bench_readings(search.problem.leaving_out(used), search.fit)


def doubtful_readings(search: Search) -> tuple[BenchReading, ...]:
    """Readings of the bench that are used, but that the rows contradict all the same, with all that was accepted."""
    problem = search.problem
    if not problem.once:
        return ()
    try:
        table = recalibrated(replace(search, problem=problem.leaving_out((*problem.left_out, *problem.once))))
    except RowsFailed:
        return ()
    readings = bench_readings(problem, table.fit)
    return tuple(r for r in readings if r.contradicts(len(readings)))


def _restored_readings(search: Search) -> Search:
    bad = [r.channel for r in left_out_readings(search) if r.p_value <= _ORDINARY]
    if len(bad) == len(search.problem.left_out):
        return search
    return recalibrated(replace(search, problem=search.problem.leaving_out(bad)))


def cleared(every: Search, start: Search, search: Search) -> Search:
    """All rows but those that a search has taken out, without any effect; start: the search when it began."""
    if (start.bad_rows, start.problem.left_out) == (search.bad_rows, search.problem.left_out):
        return start
    problem = every.problem.without(search.bad_rows).leaving_out(search.problem.left_out)
    return recalibrated(replace(every, problem=problem, bad_rows=search.bad_rows))


def _restored_rows(search: Search) -> Search:
    """Rows are put back each as the good ones judge it."""
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
