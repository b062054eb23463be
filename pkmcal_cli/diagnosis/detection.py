"""The size of an effect that is detected in 80 % of campaigns, by all that a diagnosis asks of it. Linear near null.

A hypothesis is accepted where its p value is below the threshold, unless it stands on one row, or rows held out are
predicted worse with it; it is named where its evidence is not far below that of those that resemble it. What of it no
smooth shape explains counts as noise in this evidence, as a diagnosis estimates it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, ndtri

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.confirm import blocks, value_folds
from pkmcal_cli.diagnosis.contest import Contestants
from pkmcal_cli.diagnosis.drawn_noise import SMALL, Columns, DrawnNoise, drawn_noise
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.noise_tests import FREE
from pkmcal_cli.diagnosis.quadratic import Quadratic
from pkmcal_cli.diagnosis.score import Score, minimal_detectable
from pkmcal_cli.diagnosis.selection_bias import Acceptance
from pkmcal_cli.diagnosis.trial import Check, Counted, OneRow, Procedure, Trial

_DETECTED = 0.8
_PARTS = 64  # of an interval of a factor of two: finer than so many draws tell
_RARE = 1e-4  # rates that are not told apart from 0 and 1
_TRIED, _SHOWN = 24, 20.0  # sizes from which is learned how effects are accepted, up to so many standard uncertainties
_SMOOTH = 0.15  # standard uncertainties
_BINS = 32  # of such a width, in which campaigns are counted before they are smoothed
_KNOWN = 1e8  # degrees of freedom, half
_LARGEST = 1e4  # standard deviations of a prior: as good as never
_CARRIES = 0.1  # share of the information in a direction, from which on a row may be all that speaks for an effect


class Detection:
    """Detectable sizes of hypotheses at a linearised problem, which may be taken for `rivals`."""

    def __init__(
        self,
        linear: Linear,
        problem: Problem,
        hypotheses: Sequence[Hypothesis],
        seed: int,
        rivals: Sequence[Hypothesis] = (),
    ) -> None:
        self.linear, self.problem, self.seed = linear, problem, seed
        self.hypotheses, self.scores = tuple(hypotheses), linear.scores_of(hypotheses)
        self._rivals = tuple(rivals)
        self._schemes: dict[tuple[bytes, bool, float], _Scheme] = {}

    @cached_property
    def _labels(self) -> list[NDArray[np.intp]]:
        return [blocks(self.problem, h)[0] for h in self.hypotheses]

    def size(self, k: int, direction: Array, procedure: Procedure) -> float:
        """Length of a vector of this direction (p,), in standard deviations of the priors, at which hypothesis k is
        detected in 80 % of campaigns; inf where it never is."""
        if not self.scores[k].count:
            return float("inf")
        trial = self._trial(k, direction, procedure)
        begin = minimal_detectable(float(direction @ self.scores[k].whole @ direction))
        return _reaching(trial.rate, min(begin, _LARGEST) if np.isfinite(begin) else 1.0)

    def acceptance(self, k: int, direction: Array, procedure: Procedure) -> Acceptance:
        """How hypothesis k is accepted by the size at which it appears, in a direction (p,) that shows."""
        trial, unit = self._trial(k, direction, procedure), float(direction @ self.scores[k].whole @ direction)
        tried = [trial.campaigns(s / np.sqrt(unit)) for s in np.linspace(0.0, _SHOWN, _TRIED)]
        sizes = np.sqrt(np.concatenate([statistic for statistic, _ in tried]))
        return _smoothed(sizes, np.concatenate([accepts for _, accepts in tried]))

    def _trial(self, k: int, direction: Array, procedure: Procedure) -> Trial:
        labels, rough, checked = self._labels[k], procedure.scale.rough, procedure.scale.checked
        key = (labels.tobytes(), rough, checked)
        if key not in self._schemes:
            same = [self.hypotheses[j] for j, label in enumerate(self._labels) if label.tobytes() == key[0]]
            names = {h.name for h in same}
            others = [h for h in self._rivals if h.name not in names]
            folds = value_folds(self.problem, labels).ravel()
            shapes = self._shapes if rough else np.zeros((len(self.linear.residual), 0))
            self._schemes[key] = _Scheme.of(self.linear, (same, others), folds, shapes, checked, self.seed)
        return self._schemes[key].trial(self.hypotheses[k], direction, procedure)

    @cached_property
    def _shapes(self) -> Array:
        """Columns (n, k) that no effect counts as noise along."""
        groups = group_columns(self.problem).values()
        return np.hstack([np.zeros((len(self.linear.residual), 0)), *map(self.linear.whitened, groups)])


def _smoothed(sizes: Array, accepted: NDArray[np.bool_]) -> Acceptance:
    """Share of campaigns (n,) accepted near each size: counted in narrow bins, which are then weighed."""
    step = _SMOOTH / _BINS
    bins = round((_SHOWN + 8 * _SMOOTH) / step)
    near = sizes < bins * step
    place = (sizes[near] / step).astype(np.intp)
    tried, taken = np.bincount(place, minlength=bins), np.bincount(place, accepted[near], minlength=bins)
    grid, middle = np.arange(0.0, _SHOWN, _SMOOTH / 2), (np.arange(bins) + 0.5) * step
    weight = np.exp(-0.5 * ((grid[:, None] - middle) / _SMOOTH) ** 2)
    chance = (weight @ taken) / np.maximum(weight @ tried, 1e-300)
    return Acceptance(grid, np.maximum.accumulate(chance))


@dataclass(frozen=True, kw_only=True)
class _Scheme:
    """All hypotheses that are confirmed by the same folds."""

    columns: Columns
    channels: int
    variance: Array  # (D,) of the noise as it is estimated, over the true one
    drawn: DrawnNoise
    contestants: Contestants
    shapes: NDArray[np.intp]  # their places among columns
    rows: dict[int, tuple[NDArray[np.intp], Array]]  # that may carry an effect: places of values, inverse information
    carriers: dict[Hypothesis, list[int]]  # rows that may carry one
    shaped: Linear  # with the shapes projected out too

    @classmethod
    def of(
        cls,
        linear: Linear,
        hypotheses: tuple[Sequence[Hypothesis], Sequence[Hypothesis]],
        fold: NDArray[np.intp],
        shapes: Array,
        checked: float,
        seed: int,
    ) -> _Scheme:
        """Of those confirmed by a fold (n,) of each value, -1: in none, and others; shapes (n, k); checked: degrees of
        freedom by which the noise is estimated."""
        judged = [part for h in hypotheses[0] for part in h.nested_parts]
        columns = Columns.of(linear, [*judged, *(part for h in hypotheses[1] for part in h.nested_parts)])
        scores = dict(zip(columns.places, linear.scores_of(list(columns.places)), strict=True))
        carriers = {part: _carriers(linear, part, scores[part]) for part in judged}
        rows = sorted({row for some in carriers.values() for row in some})
        held_out = 1 + max((int(columns.places[part].max(initial=-1)) for part in judged), default=-1)
        besides = np.hstack([shapes, _of_rows(linear, rows)])
        drawn = drawn_noise(linear, columns, held_out, besides, fold, seed)
        first, c = columns.values.shape[1] + shapes.shape[1], linear.channels
        places = {row: first + c * j + np.arange(c) for j, row in enumerate(rows)}
        return cls(
            columns=columns,
            channels=c,
            variance=_drawn_variances(0.5 * checked, drawn.chance),
            drawn=drawn,
            contestants=Contestants.of([*hypotheses[0], *hypotheses[1]], scores, drawn),
            shapes=np.arange(columns.values.shape[1], first),
            rows={row: (at, _inverse(drawn.information[np.ix_(at, at)])) for row, at in places.items()},
            carriers=carriers,
            shaped=linear.projecting(linear.projected, extra=shapes if shapes.shape[1] else None),
        )

    def trial(self, hypothesis: Hypothesis, direction: Array, procedure: Procedure) -> Trial:
        """One hypothesis with an effect in this direction."""
        columns = self.drawn.places[hypothesis.whole]
        return Trial(
            contest=self.contestants.against(hypothesis, self.drawn.information[:, columns] @ direction, direction),
            checks=tuple(self._check(part, columns, direction) for part in self.contestants.parts_of(hypothesis)),
            counted=self._counted(columns, direction, procedure),
            procedure=procedure,
        )

    def _check(self, part: Hypothesis, columns: NDArray[np.intp], direction: Array) -> Check:
        """Of a part, with an effect of these columns in a direction (p,)."""
        score, places, folds = self.contestants.scores[part], self.drawn.places[part], self.drawn.folds
        basis = score.basis

        def of(products: Array, noise: Array) -> Array:  # (F, m, D + 1)
            effect = products[:, places][:, :, columns] @ direction
            return np.asarray(basis.T @ np.concatenate([noise[:, places], effect[..., None]], axis=2))

        train = basis.T @ folds.train[:, places][:, :, places] @ basis + SMALL * np.eye(score.count)
        step = np.linalg.solve(train, of(folds.train, folds.trained))
        left = 2 * of(folds.columns, folds.noise) - basis.T @ folds.columns[:, places][:, :, places] @ basis @ step
        left /= (folds.values * len(folds.values))[:, None, None]
        gain = Quadratic.of(left.reshape(-1, left.shape[2]), step.reshape(-1, step.shape[2]))
        rows = tuple(self._row(row, part, columns, direction) for row in self.carriers[part])
        return Check(gain, rows, score.count)

    def _row(self, row: int, part: Hypothesis, columns: NDArray[np.intp], direction: Array) -> OneRow:
        """A row that may carry a part: what it adds to the statistic, and the statistic with its values left out."""
        score, places, (at, out) = self.contestants.scores[part], self.drawn.places[part], self.rows[row]
        known = np.hstack([self.drawn.gradient, (self.drawn.information[:, columns] @ direction)[:, None]])
        between = score.basis.T @ self.drawn.information[np.ix_(places, at)]  # (m, C)
        gradient, of_row = score.basis.T @ known[places], known[at]
        raw = score.basis.T @ self.columns.values[self.channels * row : self.channels * (row + 1), places].T
        rest, information = gradient - between @ out @ of_row, np.diag(score.information) - between @ out @ between.T
        without = Quadratic.of(_inverse(information) @ rest, rest)
        return OneRow(Quadratic.of(gradient / score.information[:, None], raw @ of_row), without)

    @cached_property
    def _among_shapes(self) -> Array:
        """Inverse information of the shapes."""
        return _inverse(self.drawn.information[np.ix_(self.shapes, self.shapes)])

    def _counted(self, columns: NDArray[np.intp], direction: Array, procedure: Procedure) -> Counted:
        """What of an effect counts as noise, and how the noise is estimated."""
        scale, drawn, variance = procedure.scale, self.drawn, self.variance
        effect = drawn.information[:, columns] @ direction
        linear = direction @ drawn.gradient[columns]
        if scale.whole:
            square = float(direction @ effect[columns])
            return Counted(variance=variance, square=square / scale.checked, linear=linear / scale.checked)
        if not scale.rough:
            return Counted(variance=variance, square=0.0, linear=np.zeros_like(variance))
        linear = linear - self._among_shapes @ effect[self.shapes] @ drawn.gradient[self.shapes]
        left = self.shaped.free(self.columns.values[:, columns] @ direction)
        kept, whole = self.shaped.freedom > FREE, float(left @ left)
        mean = float((left[kept] ** 2 / self.shaped.freedom[kept]).mean())
        return Counted(variance=variance, square=mean, linear=linear * (mean / whole if whole > 0 else 0.0))


def _reaching(rate: Callable[[float], float], begin: float) -> float:
    """The size at which a rate that grows reaches what counts as detected, looked for from `begin` on; inf for never.

    Known to a share of a factor of two. Sizes in between are tried where a normal distribution would have it.
    """
    high, above = begin, rate(begin)
    low, below = 0.0, 0.0
    while above < _DETECTED:
        low, below = high, above
        high = 2.0 * high
        if high > _LARGEST:
            return float("inf")
        above = rate(high)
    while not low:
        half = rate(0.5 * high)
        low, below, high, above = (0.5 * high, half, high, above) if half < _DETECTED else (0.0, 0.0, 0.5 * high, half)
    step, first, last = (high - low) / _PARTS, 0, _PARTS
    while last - first > 1:
        seen = ndtri(np.clip([below, _DETECTED, above], _RARE, 1 - _RARE))
        share = (seen[1] - seen[0]) / (seen[2] - seen[0]) if seen[2] > seen[0] else 0.5
        tried = min(max(first + round(share * (last - first)), first + 1), last - 1)
        there = rate(low + tried * step)
        first, below, last, above = (tried, there, last, above) if there < _DETECTED else (first, below, tried, there)
    return low + 0.5 * (first + last) * step


def _drawn_variances(half: float, chance: Array) -> Array:
    """Estimates (D,) of a variance of 1 at chances (D,), with twice `half` degrees of freedom."""
    return np.asarray(gammaincinv(half, chance) / half) if half < _KNOWN else np.ones(len(chance))


def _inverse(information: Array) -> Array:
    """Of an information (p, p), zero along what it does not contain."""
    return np.asarray(np.linalg.pinv(information, rcond=1e-9, hermitian=True))


def _of_rows(linear: Linear, rows: Sequence[int]) -> Array:
    """A column (n,) for each value of some rows."""
    out = np.zeros((*linear.on.shape, len(rows), linear.channels))
    for k, row in enumerate(rows):
        out[row, :, k] = np.eye(linear.channels)
    return linear.whitened(out.reshape(linear.on.size, -1))


def _carriers(linear: Linear, part: Hypothesis, score: Score) -> list[int]:
    """Rows that have much of the information in a direction."""
    if not score.count:
        return []
    unit = linear.free(linear.tested(part) @ (score.basis / np.sqrt(score.information)))
    share = (unit**2).reshape(*linear.on.shape, -1).sum(axis=1).max(axis=1)
    return np.flatnonzero(share > _CARRIES).tolist()
