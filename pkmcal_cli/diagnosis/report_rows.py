"""Rows that only report: errors on them, and what effects gain there, with intervals by resampling blocks of rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import ErrorFigures, channel_figures, error_figures, pooled
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.patience import COMPARED
from pkmcal_cli.calibration.point_errors import PointErrors, joined, point_errors
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate, lost_rows, predicted_part, weighted_residual
from pkmcal_cli.diagnosis.confirm import cells
from pkmcal_cli.diagnosis.hypotheses import Hypothesis

_DRAWS = 4000
_FEWEST_BLOCKS = 5
_SINGLE = 1_000_000  # cells, each a block of its own


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Figures by kind on the rows that fitted, that chose (held out by cells of them) and that only reported.

    Of rows that are predicted; `failed` of those that report are not.
    """

    folds: tuple[OuterFold, ...] = field(compare=False, repr=False)
    fit: dict[str, ErrorFigures]
    report: dict[str, ErrorFigures]
    channels: dict[str, ErrorFigures]  # by channel, on the report rows
    chi2: float  # mean square whitened residual on the report rows
    points: PointErrors = field(compare=False)  # of positions on the report rows
    failed: int = 0

    @cached_property
    def choose(self) -> dict[str, ErrorFigures]:
        """On the rows that chose: only shown, so that they are fitted when they are."""
        return pooled([figures for t in self.folds for figures in t.held_out])


@dataclass(frozen=True, kw_only=True)
class OuterFold:
    """Rows that fit and choose, rows that report and their numbers in the table (n,), what the former name (`sets`);
    their effects and fit so far.
    """

    train: Problem
    report: Problem
    rows: NDArray[np.intp]
    sets: tuple[tuple[Hypothesis, ...], ...]
    fit: Fit
    start: Array  # (P,), where its fits begin
    accepted: tuple[Hypothesis, ...] = ()

    @cached_property
    def reported(self) -> Evaluation:
        """The rows that report, at the fit."""
        return evaluate(self.report, self.fit.values, ())

    @cached_property
    def held_out(self) -> tuple[dict[str, ErrorFigures], ...]:
        """Figures of each group of cells of the rows that choose, by a fit of the others; without those that fail."""
        return tuple(error_figures(*_predicted(problem, there)) for problem, there in _inner(self))

    def chose(self, alike: Sequence[Hypothesis]) -> bool:
        """Whether these rows name the first of effects that all rows cannot separate, or one of the others.

        A set of these rows that holds the first counts too, and the same effect spread otherwise over places.
        """
        named, *_ = alike
        if any(names[0] in alike or named in names for names in self.sets):
            return True
        return named.spread([names[0] for names in self.sets])


def errors_of(folds: Sequence[OuterFold]) -> Errors:
    """Figures over all rotations."""
    fit = [error_figures(*_predicted(t.train, t.fit.after)) for t in folds]
    report, channels, points, squares, values, failed = [], [], [], 0.0, 0, 0
    for t in folds:
        there = t.reported
        failed += len(lost_rows(t.report, there))
        part, there = _predicted(t.report, there)
        report.append(error_figures(part, there))
        channels.append(channel_figures(part, there))
        errors = point_errors(part, there.residual, part.measured)
        points.append(replace(errors, rows=t.rows[errors.rows]))
        squares += float((weighted_residual(part, there) ** 2).sum())
        values += part.count
    return Errors(
        folds=tuple(folds),
        fit=pooled(fit),
        report=pooled(report),
        channels=pooled(channels),
        chi2=squares / max(values, 1),
        points=joined(points),
        failed=failed,
    )


def _predicted(problem: Problem, evaluation: Evaluation) -> tuple[Problem, Evaluation]:
    """Both without rows that are not predicted."""
    return predicted_part(problem.without(lost_rows(problem, evaluation)), evaluation)


def _inner(fold: OuterFold, folds: int = 3) -> Iterator[tuple[Problem, Evaluation]]:
    """Each of a few groups of cells of the training rows, at a fit of the others; states begin at those of all.

    Values do not: what the others do not determine would stay where these rows put it.
    """
    labels = cells(fold.train, folds)
    before, after = fold.fit.before.start, fold.fit.after.start
    for k in np.unique(labels):
        others, rows = np.nonzero(labels != k)[0], np.nonzero(labels == k)[0]
        part = fold.train.take(rows)
        try:
            train, states = fold.train.take(others), before.take(others)
            fit = identify(train, fold.fit.selected, fold.start, states=states, patience=COMPARED)
            yield part, evaluate(part, fit.values, start=after.take(rows))
        except (RowsFailed, np.linalg.LinAlgError):
            continue


def _squares(fold: OuterFold) -> Array:
    """Sum of squares of each report row's whitened residual (N,), nan in rows that are not predicted."""
    out = np.asarray((weighted_residual(fold.report, fold.reported) ** 2).sum(axis=1))
    out[lost_rows(fold.report, fold.reported)] = np.nan
    return out


def gain_of(before: Sequence[OuterFold], after: Sequence[OuterFold], seed: int) -> Interval:
    """Fall of the mean square whitened residual on the report rows, by resampling blocks of rows together.

    Of rows that are predicted before and after.
    """
    sums = []
    for old, new in zip(before, after, strict=True):
        change = _squares(old) - _squares(new)
        sums.append(_block_sums(old.report, np.stack([change, old.report.measured.sum(axis=1)], axis=1)))
    total, drawn = _resampled(np.vstack(sums), seed)
    return _interval(total[0] / total[1], drawn[0] / drawn[1])


def rms_gain_of(
    before: Sequence[OuterFold], after: Sequence[OuterFold], channels: Sequence[int], seed: int
) -> Interval:
    """Fall of the root mean square error of some channels, of a point's where these are its coordinates, SI.

    Rows as in `gain_of`.
    """
    some = list(channels)
    sums = []
    for old, new in zip(before, after, strict=True):
        squares = [(t.reported.residual[:, some] ** 2).sum(axis=1) for t in (old, new)]
        used = old.report.measured[:, some].any(axis=1)
        sums.append(_block_sums(old.report, np.stack([*squares, used], axis=1)))
    total, drawn = _resampled(np.vstack(sums), seed)
    value = np.sqrt(total[0] / total[2]) - np.sqrt(total[1] / total[2])
    return _interval(value, np.sqrt(drawn[0] / drawn[2]) - np.sqrt(drawn[1] / drawn[2]))


def _block_sums(problem: Problem, columns: Array) -> Array:
    """Sums (B, k) of columns (N, k) over cells of the workspace, or single rows where there are few cells.

    Rows with a nan count nowhere.
    """
    labels: NDArray[np.intp] = cells(problem, _SINGLE)
    if len(np.unique(labels)) < _FEWEST_BLOCKS:
        labels = np.arange(len(problem))
    _, index = np.unique(labels, return_inverse=True)
    out = np.zeros((int(index.max()) + 1, columns.shape[1]))
    known = np.isfinite(columns).all(axis=1)
    np.add.at(out, index[known], columns[known])
    return out


def _resampled(sums: Array, seed: int) -> tuple[Array, Array]:
    """Totals (k,), and totals (k, draws) over blocks drawn with replacement."""
    rng = np.random.default_rng(seed)
    counts = rng.multinomial(len(sums), np.full(len(sums), 1 / len(sums)), size=_DRAWS)
    return sums.sum(axis=0), np.asarray((counts @ sums).T)


def _interval(value: float, drawn: Array) -> Interval:
    """A value and the middle 95 % of what was drawn; without bounds where nothing could be drawn."""
    known = drawn[np.isfinite(drawn)]
    if not len(known):
        return Interval(float("nan"), -np.inf, np.inf)
    low, high = np.quantile(known, [0.025, 0.975])
    return Interval(float(value), float(low), float(high))
