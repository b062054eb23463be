"""The closed loop: fit, diagnose, add, fit again; accepted by points that neither fitted nor chose.

The table is cut into blocks. In each rotation one block only reports: the rest fits the parameters and chooses the
effects (by its own cross-validation); an effect changes the errors on a rotation's report rows only if that rotation's
other rows chose it. Over all rotations every row reports once. With a validation table there is one rotation, and
that table reports.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.calibration.errors_before_after import ErrorFigures, channel_figures, error_figures, pooled
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise_at
from pkmcal_cli.diagnosis.confirm import cells, shown_channels
from pkmcal_cli.diagnosis.diagnose import Diagnosis, diagnose
from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis
from pkmcal_cli.prediction import frozen
from pkmcal_cli.rotation import Array

ROTATIONS = 5
_DRAWS = 4000
_FEWEST_BLOCKS = 5
_SINGLE = 1_000_000  # cells, each a block of its own


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Errors:
    """Figures by kind on the rows that fitted, that chose (held out by cells of them) and that only reported."""

    fit: dict[str, ErrorFigures]
    choose: dict[str, ErrorFigures]
    report: dict[str, ErrorFigures]
    channels: dict[str, ErrorFigures]  # by channel, on the report rows
    chi2: float  # mean square whitened residual on the report rows


@dataclass(frozen=True)
class Step:
    """One effect that was tried: errors with it, gain on the report rows (mean square, whitened), how often chosen."""

    hypothesis: Hypothesis
    errors: Errors
    gain: Interval
    chosen: int
    accepted: bool


@dataclass(frozen=True)
class Improvement:
    """The loop's result; `gain`: of the mean square whitened, `rms_gain` (SI) of positions; `fit`: on all rows."""

    whole: Diagnosis
    rotations: int
    steps: tuple[Step, ...]
    accepted: tuple[Hypothesis, ...]
    before: Errors
    after: Errors
    gain: Interval
    rms_gain: Interval
    fit: Fit
    problem: Problem
    alpha: float  # false-alarm rate of the diagnosis

    @property
    def confirmed(self) -> bool:
        """Whether the error on the report rows falls, by the lower end of the interval."""
        return bool(self.accepted) and self.gain.low > 0


@dataclass(frozen=True)
class _Rotation:
    """Rows that fit and choose, rows that report, what the former find; their effects and fit so far."""

    train: Problem
    report: Problem
    found: Diagnosis
    fit: Fit
    accepted: tuple[Hypothesis, ...] = ()

    def chose(self, hypothesis: Hypothesis) -> bool:
        """Whether these rows name the effect too, or cannot tell theirs from it, and their own blocks confirm it."""
        return any(
            f.held_out.confirmed and hypothesis in [f.hypothesis, *(r.hypothesis for r in f.rivals)]
            for f in self.found.findings
        )


def improve(
    found: Candidates, problem: Problem, selected: tuple[str, ...], validation: Problem | None, alpha: float, seed: int
) -> Improvement:
    """Run the loop; `problem` belongs to the candidates' model. Raises RowsFailed."""
    whole = diagnose(found, problem, selected, alpha, seed)
    clean = whole.problem  # without its bad rows
    model = frozen(clean.model, clean.rows)  # shapes are spread over the whole table, whatever part of it is fitted
    clean, found = replace(clean, model=model), replace(found, model=model)
    validation = None if validation is None else replace(validation, model=model)
    turns = [_rotation(found, train, report, selected, alpha, seed) for train, report in _parts(clean, validation)]
    first = turns
    before = _errors(turns)
    now, accepted, steps = before, list[Hypothesis](), list[Step]()
    for hypothesis in _majority(whole, turns):
        chosen = sum(t.chose(hypothesis) for t in turns)
        trial = [_with(t, hypothesis, whole) if t.chose(hypothesis) else t for t in turns]
        gain = _gain(turns, trial, seed)
        good = 2 * chosen > len(turns) and gain.low > 0 and all(t.fit.status == "converged" for t in trial)
        errors = _errors(trial)
        steps.append(Step(hypothesis, errors, gain, chosen, good))
        if good:
            turns, now = trial, errors
            accepted.append(hypothesis)
    last = _fit_with(clean, accepted, whole)
    gains = _gain(first, turns, seed), _rms_gain(first, turns, seed)
    return Improvement(whole, len(turns), tuple(steps), tuple(accepted), before, now, *gains, last, clean, alpha)


def _majority(whole: Diagnosis, turns: Sequence[_Rotation]) -> list[Hypothesis]:
    """Effects to try: those that all rows name, and those that most rotations name though all rows do not.

    Parameters of the machine file first: what they explain needs no effect.
    """
    named = list(whole.search.accepted)
    for hypothesis in (f.hypothesis for t in turns for f in t.found.findings):
        if hypothesis not in named and 2 * sum(t.chose(hypothesis) for t in turns) > len(turns):
            named += [hypothesis] if not any(_alike(hypothesis, f) for f in whole.findings) else []
    return sorted(named, key=lambda h: h.effect != RELEASE)


def _alike(hypothesis: Hypothesis, finding: Finding) -> bool:
    """Whether an effect is in the set of one that is named already."""
    return hypothesis in [r.hypothesis for r in finding.rivals]


def _parts(problem: Problem, validation: Problem | None) -> list[tuple[Problem, Problem]]:
    """Rows that fit and choose, and rows that report, by rotation."""
    if validation is not None:
        return [(problem, validation)]
    labels = cells(problem, ROTATIONS)
    pairs = [(np.nonzero(labels != k)[0], np.nonzero(labels == k)[0]) for k in range(ROTATIONS)]
    return [(problem.take(train), problem.take(report)) for train, report in pairs if len(report)]


def _rotation(
    found: Candidates, train: Problem, report: Problem, selected: tuple[str, ...], alpha: float, seed: int
) -> _Rotation:
    diagnosis = diagnose(found, train, selected, alpha, seed)
    return _Rotation(train, report, diagnosis, identify(train, selected))


def _with(turn: _Rotation, hypothesis: Hypothesis, whole: Diagnosis) -> _Rotation:
    accepted = (*turn.accepted, hypothesis)
    return replace(turn, fit=_fit_with(turn.train, accepted, whole), accepted=accepted)


def _fit_with(problem: Problem, accepted: Sequence[Hypothesis], whole: Diagnosis) -> Fit:
    """A calibration with effects, from nominal values."""
    chosen = set(whole.search.declared) | {n for h in accepted for n in h.parameters}
    return identify(problem, tuple(n for n in problem.model.names if n in chosen))


def _errors(turns: Sequence[_Rotation]) -> Errors:
    """Figures over all rotations."""
    fit = [error_figures(t.train, t.fit.after) for t in turns]
    choose, report, channels, squares, count = [], [], [], 0.0, 0
    for t in turns:
        choose += [error_figures(p, evaluate(p, fold.values)) for p, fold in _inner(t)]
        there = evaluate(t.report, t.fit.values)
        report.append(error_figures(t.report, there))
        channels.append(channel_figures(t.report, there))
        squares += float(whitened_rows(t.report, t.fit.values).sum())
        count += t.report.count
    return Errors(pooled(fit), pooled(choose), pooled(report), pooled(channels), squares / count)


def _inner(turn: _Rotation, folds: int = 3) -> list[tuple[Problem, Fit]]:
    """Fits without each of a few groups of cells of the training rows, and the rows left out."""
    labels = cells(turn.train, folds)
    out = []
    for k in np.unique(labels):
        rest, rows = np.nonzero(labels != k)[0], np.nonzero(labels == k)[0]
        out.append((turn.train.take(rows), identify(turn.train.take(rest), turn.fit.selected)))
    return out


def whitened_rows(problem: Problem, values: Array) -> Array:
    """Sum of squares of each row's whitened residual (N,)."""
    near = linearise_at(problem, values, (), None)
    return np.asarray((near.residual.reshape(problem.readings.shape) ** 2).sum(axis=1))


def _gain(before: Sequence[_Rotation], after: Sequence[_Rotation], seed: int) -> Interval:
    """Fall of the mean square whitened residual on the report rows, by resampling blocks of rows together."""
    sums = []
    for old, new in zip(before, after, strict=True):
        change = whitened_rows(old.report, old.fit.values) - whitened_rows(new.report, new.fit.values)
        sums.append(_block_sums(old.report, np.stack([change, old.report.measured.sum(axis=1)], axis=1)))
    total, drawn = _resampled(np.vstack(sums), seed)
    return _interval(float(total[0] / total[1]), drawn[0] / drawn[1])


def _rms_gain(before: Sequence[_Rotation], after: Sequence[_Rotation], seed: int) -> Interval:
    """Fall of the root mean square error of positions (of all channels without any), SI."""
    positions = shown_channels(before[0].report)
    sums = []
    for old, new in zip(before, after, strict=True):
        residuals = [evaluate(t.report, t.fit.values).residual[:, positions] for t in (old, new)]
        squares = [(r**2).sum(axis=1) for r in residuals]
        used = old.report.measured[:, positions].any(axis=1)
        sums.append(_block_sums(old.report, np.stack([*squares, used], axis=1)))
    total, drawn = _resampled(np.vstack(sums), seed)
    value = np.sqrt(total[0] / total[2]) - np.sqrt(total[1] / total[2])
    return _interval(float(value), np.sqrt(drawn[0] / drawn[2]) - np.sqrt(drawn[1] / drawn[2]))


def _block_sums(problem: Problem, columns: Array) -> Array:
    """Sums (B, k) of columns (N, k) over cells of the workspace, or single rows where there are few cells."""
    labels: NDArray[np.intp] = cells(problem, _SINGLE)
    if len(np.unique(labels)) < _FEWEST_BLOCKS:
        labels = np.arange(len(problem))
    _, index = np.unique(labels, return_inverse=True)
    out = np.zeros((int(index.max()) + 1, columns.shape[1]))
    np.add.at(out, index, columns)
    return out


def _resampled(sums: Array, seed: int) -> tuple[Array, Array]:
    """Totals (k,), and totals (k, draws) over blocks drawn with replacement."""
    rng = np.random.default_rng(seed)
    counts = rng.multinomial(len(sums), np.full(len(sums), 1 / len(sums)), size=_DRAWS)
    return sums.sum(axis=0), np.asarray((counts @ sums).T)


def _interval(value: float, drawn: Array) -> Interval:
    low, high = np.quantile(drawn[np.isfinite(drawn)], [0.025, 0.975])
    return Interval(value, float(low), float(high))
