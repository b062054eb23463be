"""The size of an effect that is detected in 80 % of campaigns: by the threshold over all hypotheses, without a veto.

A hypothesis is accepted where its p value is below the threshold, unless rows held out are predicted worse with it
(`confirm`). Both follow from the products of columns and noise in each fold, which are drawn: they are normal with the
folds' normal matrices as covariances, whatever the number of rows. Linear near null.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc, gammaincinv

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.confirm import blocks, value_folds
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.noise_tests import improbable
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.score import Score, log_evidence, minimal_detectable, p_of_part
from pkmcal_cli.diagnosis.selection_bias import Acceptance

_DETECTED = 0.8
_DRAWS = 500
_HALVINGS = 8  # of an interval of a factor of two: much finer than so many draws tell
_ROUNDING = 1e-12  # of the largest eigenvalue; and of a column in standard uncertainties, squared
_TRIED, _SHOWN = 24, 20.0  # sizes from which is learned how effects are accepted, up to so many standard uncertainties
_SMOOTH = 0.15  # standard uncertainties
_KNOWN = 1e8  # degrees of freedom, half
_LARGEST = 1e4  # standard deviations of a prior: as good as never
_SMALL = 1e-6  # prior of what is not held, as in the confirmation


@dataclass(frozen=True)
class Procedure:
    """What a hypothesis must pass: p value below `critical`, with noise of this scale."""

    critical: float
    scale: Scale


@dataclass(frozen=True)
class _Fold:
    """Products with the columns of one fold's rows, Q of them besides d declared directions, and D draws of noise.

    columns (Q, Q), noise (Q, D): what is left of columns in the fold once declared parameters are fitted to the others,
    times that of columns and noise; train (Q, Q), trained (Q, D): the same of the other rows. values: how many.
    """

    columns: Array
    noise: Array
    train: Array
    trained: Array
    values: int


class Detection:
    """Detectable sizes of hypotheses at a linearised problem."""

    def __init__(
        self, linear: Linear, problem: Problem, hypotheses: Sequence[Hypothesis], scores: Sequence[Score], seed: int
    ) -> None:
        self.linear, self.problem, self.seed = linear, problem, seed
        self.hypotheses, self.scores = tuple(hypotheses), tuple(scores)
        self._schemes: dict[bytes, _Scheme] = {}

    @cached_property
    def _labels(self) -> list[NDArray[np.intp]]:
        return [blocks(self.problem, h)[0] for h in self.hypotheses]

    def size(self, k: int, direction: Array, procedure: Procedure) -> float:
        """Length of a vector of this direction (p,), in standard deviations of the priors, at which hypothesis k is
        detected in 80 % of campaigns; inf where it never is."""
        if not self.scores[k].count:
            return float("inf")
        run = self._run(k, direction, procedure)
        high = minimal_detectable(float(direction @ self.scores[k].whole @ direction))
        high = min(high, _LARGEST) if np.isfinite(high) else 1.0
        while run.rate(high) < _DETECTED:
            high = 2.0 * high
            if high > _LARGEST:
                return float("inf")
        low = 0.5 * high
        while run.rate(low) >= _DETECTED:
            low, high = 0.5 * low, low
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if run.rate(middle) < _DETECTED else (low, middle)
        return 0.5 * (low + high)

    def acceptance(self, k: int, direction: Array, procedure: Procedure) -> Acceptance:
        """How hypothesis k is accepted by the size at which it appears, in a direction (p,) that shows."""
        run, unit = self._run(k, direction, procedure), float(direction @ self.scores[k].whole @ direction)
        tried = [run.campaigns(s / np.sqrt(unit)) for s in np.linspace(0.0, _SHOWN, _TRIED)]
        sizes = np.sqrt(np.concatenate([statistic for statistic, _ in tried]))
        accepted = np.concatenate([accepts for _, accepts in tried]).astype(float)
        grid = np.arange(0.0, _SHOWN, _SMOOTH / 2)
        weight = np.exp(-0.5 * ((grid[:, None] - sizes) / _SMOOTH) ** 2)
        chance = (weight @ accepted) / np.maximum(weight.sum(axis=1), 1e-300)
        return Acceptance(grid, np.maximum.accumulate(chance))

    def _run(self, k: int, direction: Array, procedure: Procedure) -> _Run:
        labels = self._labels[k]
        key = labels.tobytes()
        if key not in self._schemes:
            same = [j for j, label in enumerate(self._labels) if label.tobytes() == key]
            folds = value_folds(self.problem, labels).ravel()
            self._schemes[key] = _Scheme.of(self.linear, [self.hypotheses[j] for j in same], folds, self.seed)
        return self._schemes[key].run(self.hypotheses[k], self.scores[k], direction, procedure)


@dataclass(frozen=True)
class _Scheme:
    """All hypotheses that are confirmed by the same folds."""

    places: dict[str, NDArray[np.intp]]  # of hypotheses' columns among all
    information: Array  # (Q, Q), declared parameters projected out
    gradient: Array  # (Q, D) of noise
    folds: tuple[_Fold, ...]
    chance: Array  # (D,) of an estimate of the noise that is smaller

    @classmethod
    def of(cls, linear: Linear, hypotheses: Sequence[Hypothesis], fold: NDArray[np.intp], seed: int) -> _Scheme:
        """Products with all columns, and draws of those with noise; fold (n,) of each value, -1: in none."""
        prior = linear.fixed[1]
        declared = [linear.of(linear.projected), *([] if linear.extra is None else [linear.extra])]
        columns = [linear.tested(h) for h in hypotheses]
        ends = np.cumsum([0, *(c.shape[1] for c in columns)])
        places = {h.name: np.arange(ends[j], ends[j + 1]) for j, h in enumerate(hypotheses)}
        x, d = np.hstack([*declared, *columns]), len(prior)
        x[:, (x**2).sum(axis=0) < _ROUNDING] = 0.0  # what moves nothing, and is not even the same everywhere
        used = [fold == f for f in np.unique(fold)]
        grams = np.stack([x[rows].T @ x[rows] for rows in used])  # (F, d + Q, d + Q)
        rng = np.random.default_rng([seed, 11])
        drawn = np.stack([_root(g) @ rng.normal(size=(len(g), _DRAWS)) for g in grams])  # (F, d + Q, D)
        transform = np.eye(len(grams[0]))  # parameters to directions, after drawing: these are not the same everywhere
        size = len(linear.projected)
        transform[:size, :size] = linear.spectrum.vectors
        grams, noise = transform @ grams @ transform.T, transform @ drawn
        count = [int(rows.sum()) for rows in used]
        whole, score = grams.sum(axis=0), noise.sum(axis=0)
        normal = whole[:d, :d] + _at_least(prior, _SMALL**2)
        near = np.linalg.solve(normal, np.hstack([whole[:d, d:], score[:d]]))
        left = np.hstack([whole[d:, d:], score[d:]]) - whole[d:, :d] @ near
        q = whole.shape[0] - d
        held = _at_least(prior, _SMALL)
        parts = list(zip(grams, noise, count, strict=True))[int(fold.min() < 0) :]
        folds = tuple(_fold(g, n, whole - g, score - n, held, c) for g, n, c in parts)
        return cls(places, left[:, :q], left[:, q:], folds, rng.random(_DRAWS))

    def run(self, hypothesis: Hypothesis, score: Score, direction: Array, procedure: Procedure) -> _Run:
        """One hypothesis with an effect in this direction."""
        columns = self.places[hypothesis.name]
        basis, at = score.basis, np.ix_(columns, columns)
        chance = _estimates(self, procedure)
        gains = []
        for f in self.folds:
            train = basis.T @ f.train[at] @ basis + _SMALL * np.eye(score.count)
            step = np.linalg.solve(train, basis.T @ np.hstack([f.trained[columns], (f.train[at] @ direction)[:, None]]))
            seen = basis.T @ np.hstack([f.noise[columns], (f.columns[at] @ direction)[:, None]])
            left = 2 * seen - basis.T @ f.columns[at] @ basis @ step
            gains.append(_Quadratic.of(left, step).over(f.values))
        gradient = basis.T @ np.hstack([self.gradient[columns], (self.information[at] @ direction)[:, None]])
        return _Run(
            statistic=_Quadratic.of(gradient / score.information[:, None], gradient),
            count=score.count,
            along=float(direction @ self.information[at] @ direction),
            by_noise=direction @ self.gradient[columns],
            gain=_Quadratic.mean(gains),
            variance=chance,
            procedure=procedure,
        )


def _fold(gram: Array, noise: Array, train: Array, trained: Array, held: Array, values: int) -> _Fold:
    """Products in a fold (d + Q, d + Q), (d + Q, D), and in the others, with declared directions fitted to these."""
    d = len(held)
    normal = train[:d, :d] + held
    fitted = np.linalg.solve(normal, np.hstack([train[:d, d:], trained[:d]]))  # (d, Q + D)
    q = gram.shape[0] - d
    by_columns, by_noise = fitted[:, :q], fitted[:, q:]
    outside = gram[d:, :d] - by_columns.T @ gram[:d, :d]  # (Q, d): test columns times the declared ones
    columns = gram[d:, d:] - by_columns.T @ gram[:d, d:] - outside @ by_columns
    seen = noise[d:] - by_columns.T @ noise[:d] - outside @ by_noise
    left = train[d:, d:] - train[d:, :d] @ by_columns
    score = trained[d:] - train[d:, :d] @ by_noise
    return _Fold(columns, seen, left, score, values)


def _at_least(prior: Array, least: float) -> Array:
    """A precision (d, d) with a diagonal that is nowhere less."""
    out = prior.copy()
    np.fill_diagonal(out, np.maximum(np.diag(prior), least))
    return out


def _root(gram: Array) -> Array:
    """A root (q, q) of a matrix that is the same under any library, unlike one by eigenvectors."""
    size = np.sqrt(np.where(np.diag(gram) > 0, np.diag(gram), 1.0))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    some = values > _ROUNDING * values.max(initial=0.0)
    return np.asarray(size[:, None] * ((vectors[:, some] * np.sqrt(values[some])) @ vectors[:, some].T))


def _estimates(scheme: _Scheme, procedure: Procedure) -> Array:
    """Variances (D,) of the noise as it is estimated, over the true one: chi-square over its degrees of freedom."""
    half = 0.5 * procedure.scale.checked
    return np.asarray(gammaincinv(half, scheme.chance) / half) if half < _KNOWN else np.ones(len(scheme.chance))


@dataclass(frozen=True)
class _Quadratic:
    """What grows with the square of an effect's size: constant and linear (D,), by draws of noise, and square."""

    constant: Array
    linear: Array
    square: float

    @classmethod
    def of(cls, one: Array, other: Array) -> _Quadratic:
        """Sums (D,) of products of two (m, D + 1), each its noise and, in the last column, an effect of unit size."""
        noise, effect = (one[:, :-1], other[:, :-1]), (one[:, -1:], other[:, -1:])
        linear = (noise[0] * effect[1] + effect[0] * noise[1]).sum(axis=0)
        return cls((noise[0] * noise[1]).sum(axis=0), linear, float((effect[0] * effect[1]).sum()))

    @classmethod
    def mean(cls, parts: Sequence[_Quadratic]) -> _Quadratic:
        """The mean of some; nan of none."""
        if not parts:
            return cls(np.array(np.nan), np.array(np.nan), float("nan"))
        columns = [(p.constant, p.linear, p.square) for p in parts]
        constant, linear, square = (np.mean(column, axis=0) for column in zip(*columns, strict=True))
        return cls(constant, linear, float(square))

    def over(self, count: int) -> _Quadratic:
        """The same over a number of values."""
        return _Quadratic(self.constant / count, self.linear / count, self.square / count)

    def at(self, size: float) -> Array:
        """Values (D,) at a size."""
        return np.asarray(self.constant + size * (self.linear + size * self.square))


@dataclass(frozen=True, kw_only=True)
class _Run:
    """Campaigns with one effect, of which `count` directions can be seen.

    gain: fall of the mean square of rows held out by the effect, mean of the folds.
    """

    statistic: _Quadratic
    count: int
    along: float
    by_noise: Array
    gain: _Quadratic
    variance: Array
    procedure: Procedure

    def rate(self, size: float) -> float:
        """Share of campaigns in which an effect of this size is accepted."""
        return float(self.campaigns(size)[1].mean())

    def campaigns(self, size: float) -> tuple[Array, NDArray[np.bool_]]:
        """Statistics (D,) of campaigns with an effect of this size, and whether it is accepted."""
        statistic = np.maximum(self.statistic.at(size), 0.0)
        m = np.full(len(statistic), self.count)
        variance, dof = self._scale(size)
        known = np.minimum(dof, 2 * _KNOWN)
        part = self.procedure.scale.whole
        estimated = p_of_part(statistic, m, variance, known) if part else fdtrc(m, known, statistic / (variance * m))
        p = np.where(np.isfinite(dof), estimated, chdtrc(m, statistic))
        evidence = log_evidence(statistic / variance, m)
        return statistic, (p < self.procedure.critical) & (evidence > 0) & (self.gain.at(size) > 0.0)

    def _scale(self, size: float) -> tuple[Array, Array]:
        """Estimated variances (D,) over the true one, 1 with infinite degrees of freedom where the statement stands."""
        scale, variance = self.procedure.scale, self.variance
        if scale.whole:  # what the effect does is taken for noise
            variance = variance + (size**2 * self.along + 2 * size * self.by_noise) / scale.checked
        doubted = improbable(variance, scale.checked) if scale.variance == 1.0 else np.ones(len(variance), dtype=bool)
        return np.where(doubted, variance, 1.0), np.where(doubted, scale.checked, np.inf)
