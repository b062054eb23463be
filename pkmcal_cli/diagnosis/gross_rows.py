"""Rows that are wrong by far, found before anything is estimated from the others: in small tables they spoil it.

Least trimmed squares by rows on the linearised problem (Rousseeuw and Van Driessen 2006), with the ranges as prior so
that few rows are enough. What it leaves out is judged by what the other rows predict, and taken out if it is beyond any
noise, tails included, and if no effect of the catalogue explains it.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from pkmcal_cli.base.lean import parts_of
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import evaluate_in_parts
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.patience import SHORT
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, linearise
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.outlying_rows import Tails
from pkmcal_cli.diagnosis.rows_by_session import Index, RowsBySession, Steps
from pkmcal_cli.prediction import WarmStart

_TRIMMED = 0.25  # share of rows that the first fit leaves out
_ALWAYS, _MOST = 3, 0.1  # rows that may be taken out of any table, share of a larger one; more are an effect
_FEWEST = 6  # rows
_STARTS, _STEPS, _BEST = 300, 2, 10
_SAMPLE = 2000  # rows of a long table on which starts are tried
_MOST_STEPS = 30  # steps until a trimmed fit stands still, at most
_ROUNDS = 4
_ORDINARY = 0.01  # chance of normal noise above which a row is like the others
_FEW = 40  # values that do not tell gross rows from tails
_WIDER, _SHARE = 100.0, 0.1  # ranges so much wider, and the share of its squares that they may leave of a row
_WORSE = 2.0  # times chi-square per degree of freedom without some rows, by which they may make a fit worse

Rows = tuple[int, ...]


def gross_rows(
    problem: Problem,
    selected: tuple[str, ...],
    alpha: float,
    seed: int,
    least: float = 6.0,
    *,
    start: Array | None = None,
    states: WarmStart | None = None,
    known: KnownResults | None = None,
) -> tuple[Rows, Fit | None]:
    """Rows that are beyond all noise, at a chance of alpha for the whole table, and the fit of the others, no bench.

    least: standard deviations, as the others scatter, that they are off at least. start (P,): values, SI, that fits
    begin with and that held parameters have; default: nominal. states: of the rows there. known: what was found before.
    """
    begin = problem.model.nominal if start is None else start
    find = partial(_gross_rows, problem, selected, alpha, seed, least, begin=begin, states=states)
    key = ("gross rows", selected, alpha, seed, least, begin.tobytes())
    return find() if known is None else known.once((problem,), key, find)


def _gross_rows(
    problem: Problem,
    selected: tuple[str, ...],
    alpha: float,
    seed: int,
    least: float,
    *,
    begin: Array,
    states: WarmStart | None,
) -> tuple[Rows, Fit | None]:
    """As `gross_rows`."""
    problem = problem.leaving_out(problem.once)
    values, fit = begin, None
    gross: Rows = ()
    for _ in range(_ROUNDS):
        by_row = _by_row(problem, values, selected, states if fit is None else None)
        if len(by_row.rows) < _FEWEST:
            return (), None
        judged = _judged(by_row, _trimmed(by_row, seed), alpha, least)
        if len(judged) > _most(len(by_row.rows)):
            return (), None
        if judged == gross:
            break
        gross = judged
        try:
            fit = identify(problem.without(gross), selected, begin, states=states, patience=SHORT)
        except RowsFailed:
            return (), None
        if not fit.usable:
            return (), None
        values = fit.values
    if not gross or fit is None or _by_parameters(problem, by_row, gross, fit):
        return (), None
    return gross, fit


def _by_parameters(problem: Problem, by_row: RowsBySession, rows: Rows, fit: Fit) -> bool:
    """Whether parameters beyond their ranges explain some rows, which the others hardly tell: a zero of a session."""
    some = np.isin(np.arange(len(by_row.on)), rows)
    good = by_row.on.any(axis=1) & ~some
    alone, both = (by_row.squares(by_row.fit(chosen[None], _WIDER))[0] for chosen in (good, good | some))
    ours = by_row.squares(by_row.fit(good[None]))[0]
    if both[some].sum() > _SHARE * ours[some].sum() or both[good].sum() > _WORSE * max(alone[good].sum(), good.sum()):
        return False
    try:
        whole = identify(problem, fit.selected, fit.values)
    except RowsFailed:
        return False
    better = whole.chi2_per_dof <= _WORSE * max(fit.chi2_per_dof, 1.0)
    return whole.usable and better and not set(whole.failed) & set(rows)


def _most(rows: int) -> int:
    """How many rows of a table may be gross; more are an effect."""
    return min(max(_ALWAYS, int(_MOST * rows)), int(_TRIMMED * rows))


def _by_row(problem: Problem, values: Array, selected: tuple[str, ...], states: WarmStart | None) -> RowsBySession:
    index = [problem.model.names.index(n) for n in selected]
    half = 0.5 * problem.model.ranges[index]
    residual, on = np.zeros(problem.readings.shape), np.zeros(problem.readings.shape, dtype=bool)
    jacobian = np.zeros((*residual.shape, len(selected)))

    def visit(rows: slice, part: Problem, evaluation: Evaluation) -> None:
        white, slopes = linearise(part, evaluation).values
        seen = on[rows] = part.measured & np.isfinite(evaluation.residual)
        residual[rows] = np.where(seen, white.reshape(seen.shape), 0.0)
        jacobian[rows] = np.where(seen[..., None], (slopes * half).reshape(*seen.shape, -1), 0.0)

    evaluate_in_parts(problem, values, selected, states, visit)
    offsets = (values - problem.model.nominal)[index] / half
    return RowsBySession.of(residual, jacobian, on, problem.rows.session, offsets)


def _trimmed(by_row: RowsBySession, seed: int) -> NDArray[np.bool_]:
    """The rows (N,), all but a share, that a fit explains best.

    Many starts take steps on a sample of a long table, the best go on with all rows (Rousseeuw and van Driessen 2006).
    """
    rng, rows = np.random.default_rng([seed, 7]), by_row.rows
    channels = by_row.on[rows].sum() / len(rows)
    sample = rows if len(rows) <= _SAMPLE else np.sort(rng.choice(rows, _SAMPLE, replace=False))
    few = int(min(_kept(sample), max(3, np.ceil(by_row.parameters / channels))))
    order = rng.random((_STARTS, len(sample))).argsort(axis=1)[:, :few]
    chosen = np.zeros((_STARTS, len(sample)), dtype=bool)
    np.put_along_axis(chosen, order, True, axis=1)
    part = by_row.take(sample)
    chosen, cost = _concentrated(part, chosen, _STEPS)
    best = chosen[np.argsort(cost, kind="stable")[:_BEST]]
    if len(sample) < len(rows):
        converged, cost = _concentrated(part, best, _MOST_STEPS)
        best = converged[[int(np.argmin(cost))]]
    every = np.zeros((len(best), len(by_row.on)), dtype=bool)
    every[:, sample] = best
    chosen, cost = _concentrated(by_row, every, _MOST_STEPS)
    return np.asarray(chosen[int(np.argmin(cost))])


def _kept(rows: Index) -> int:
    """How many of some rows a trimmed fit explains."""
    return len(rows) - int(_TRIMMED * len(rows))


def _concentrated(by_row: RowsBySession, chosen: NDArray[np.bool_], steps: int) -> tuple[NDArray[np.bool_], Array]:
    """Chosen rows (S, N) after some steps, each to those that the fit of the last explains best; their cost (S,)."""
    rows, cost = by_row.rows, np.zeros(len(chosen))
    for _ in range(steps):
        squares = by_row.squares(by_row.fit(chosen))[:, rows]
        order = np.argsort(squares, axis=1, kind="stable")[:, : _kept(rows)]
        fresh = np.zeros_like(chosen)
        np.put_along_axis(fresh, rows[order], True, axis=1)
        cost = np.take_along_axis(squares, order, axis=1).sum(axis=1)
        if (fresh == chosen).all():
            break
        chosen = fresh
    return chosen, cost


def _judged(by_row: RowsBySession, good: NDArray[np.bool_], alpha: float, least: float) -> Rows:
    """Rows that the good ones do not explain; these take in what they explain well, and nothing in doubt.

    Else one bad row among them widens their scatter, by which the next comes in.
    """
    every = by_row.on.any(axis=1)
    for _ in range(_MOST_STEPS):
        deviation, ordinary, p = _deviations(by_row, good, good)
        more = good | (every & (ordinary > _ORDINARY))
        if (more == good).all():
            break
        good = more
    chance, doubted = alpha / len(by_row.rows), every & ~good & (deviation > least)
    far = doubted & (p < chance)
    if far.any() and by_row.on[every & ~far].sum() < _FEW:  # where there is one, others are as likely as tails
        return tuple(int(r) for r in np.nonzero(doubted & (ordinary < chance))[0])
    if far.any():  # rows in doubt are the tails of the noise
        far &= _deviations(by_row, good, every & ~far)[2] < chance
    return tuple(int(r) for r in np.nonzero(far)[0])


def _deviations(by_row: RowsBySession, good: NDArray[np.bool_], noisy: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """How far rows (N,) are off what the good ones (N,) tell without them, in their scatter, and p values.

    First of normal noise, then of noise with the tails of some rows (N,), `noisy`.
    """
    steps = by_row.fit(good[None])
    parts = [_off(by_row.take(rows), good[rows], steps) for rows in parts_of(len(by_row.on))]
    left, expected, statistic = (np.concatenate(part) for part in zip(*parts, strict=True))
    count = by_row.on.sum(axis=1)
    freedom = max(float(count[good].sum()) - steps.determined(), 1.0)
    variance = max(float((left[good] ** 2).sum()) / freedom, 1.0)
    relative = statistic / np.maximum(count, 1) / variance
    normal_p = fdtrc(np.maximum(count, 1), freedom, relative)
    typical = np.abs(left / np.sqrt(variance * np.maximum(expected, 1e-9)))
    tails = Tails.of(typical[noisy][by_row.on[noisy]])
    p = tails.p_value(normal_p, statistic / variance, count)
    measured = count > 0
    return np.sqrt(relative * count), np.where(measured, normal_p, 1.0), np.where(measured, p, 1.0)


def _off(by_row: RowsBySession, good: NDArray[np.bool_], steps: Steps) -> tuple[Array, Array, Array]:
    """What steps leave of rows (N, C), its variances (N, C), its squares (N,) in standard uncertainties."""
    left, leverage = by_row.left(steps), by_row.leverage(steps)
    unit = np.eye(leverage.shape[1])
    share = unit + np.where(good[:, None, None], -leverage, leverage)
    share = share + 1e-9 * unit
    squares = np.einsum("nc,nc->n", left, np.linalg.solve(share, left[..., None])[..., 0])
    return left, np.einsum("ncc->nc", share).copy(), np.maximum(squares, 0.0)
