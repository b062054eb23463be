"""Campaigns with one effect of any size: whether a diagnosis names it, by the noise that was drawn.

It is named if it is among those hypotheses that hold 95 % of the evidence, and one that has as much of it is accepted.
Accepted is what is significant, does not stand on one row, and helps rows held out; the latter two are judged for the
effect itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.noise_tests import improbable
from pkmcal_cli.diagnosis.quadratic import Quadratic, Quadratics
from pkmcal_cli.diagnosis.refine import CREDIBLE
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.score import log_evidence, tail_of
from pkmcal_cli.diagnosis.search import ODD_ROW


@dataclass(frozen=True)
class Procedure:
    """What a hypothesis must pass: p value below `critical`, with noise of this scale."""

    critical: float
    scale: Scale


@dataclass(frozen=True, kw_only=True)
class Contest:
    """P parts of H hypotheses that explain the residual: sums of squares, how many numbers each (P,), number of its
    hypothesis (P,), ascending; size (P,) by an effect of unit size, 0 where it does not matter; log evidence (P,) by
    which each is preferred. groups: of each hypothesis, those that take its place where they have as much evidence.
    """

    squares: Quadratics
    count: NDArray[np.intp]
    hypothesis: NDArray[np.intp]
    far: Array
    preference: Array
    groups: Sequence[NDArray[np.intp]]


@dataclass(frozen=True)
class OneRow:
    """A row that may carry an effect: what it contributes to the statistic, and the statistic without it."""

    contribution: Quadratic
    without: Quadratic


@dataclass(frozen=True)
class Check:
    """Of one part of a hypothesis: what it gains on rows held out, the rows that may carry it, and its numbers."""

    gain: Quadratic
    rows: tuple[OneRow, ...]
    count: int


@dataclass(frozen=True, kw_only=True)
class Counted:
    """What of an effect counts as noise: its square, and products with noise (D,).

    variance (D,) of the noise as it is estimated without it, over the true one.
    """

    variance: Array
    square: float
    linear: Array

    def at(self, size: float) -> Array:
        """Estimated variances (D,) with an effect of this size."""
        return self.variance + size**2 * self.square + 2 * size * self.linear


@dataclass(frozen=True, kw_only=True)
class Trial:
    """Campaigns with one effect. contest: its hypothesis first; checks: of its parts."""

    contest: Contest
    checks: tuple[Check, ...]
    counted: Counted
    procedure: Procedure

    def rate(self, size: float) -> float:
        """Share of campaigns in which an effect of this size is named."""
        return float(self.campaigns(size)[1].mean())

    def campaigns(self, size: float) -> tuple[Array, NDArray[np.bool_]]:
        """Statistics (D,) of campaigns with an effect of this size, and whether it is named."""
        contest, (variance, doubted) = self.contest, self._scale(size)
        statistic = contest.squares.at(size)
        ratio = statistic / variance
        evidence = log_evidence(ratio, contest.count[:, None])
        evidence += np.array([tail_of(size * far) for far in contest.far])[:, None]
        beside = statistic / self._variance_beside(variance)
        significant = (beside > _where(doubted, self._limits)) & (evidence > 0)
        evidence += contest.preference[:, None]
        best = np.argmax(evidence[: len(self.checks)], axis=0)  # part of the hypothesis that stands for it
        draws = np.arange(len(best))
        reached = evidence >= evidence[best, draws]
        named = (significant & reached).any(axis=0) & self._credible(evidence)
        return statistic[best, draws], named & self._checked(size, best, variance, doubted)

    def _credible(self, evidence: Array) -> NDArray[np.bool_]:
        """Whether (D,) its hypothesis is among those that hold 95 % of the evidence of parts (P, D)."""
        of_each = np.maximum.reduceat(evidence, np.flatnonzero(np.diff(self.contest.hypothesis, prepend=-1)), axis=0)
        for k, parts in enumerate(self.contest.groups):
            if len(parts):
                of_each[k, of_each[parts].max(axis=0) >= of_each[k]] = -np.inf
        weight = np.exp(of_each - of_each.max(axis=0))
        before = np.where(of_each > of_each[0], weight, 0.0).sum(axis=0)
        return np.asarray(before < CREDIBLE * weight.sum(axis=0))

    def _checked(
        self, size: float, part: NDArray[np.intp], variance: Array, doubted: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Whether (D,) the part of the hypothesis that stands for it helps rows held out and stands on several rows."""
        out = np.zeros(len(part), dtype=bool)
        for k, check in enumerate(self.checks):
            passed = check.gain.at(size) > 0.0
            if check.rows:
                most = np.argmax([row.contribution.at(size) for row in check.rows], axis=0)
                without = np.stack([row.without.at(size) for row in check.rows])[most, np.arange(len(most))]
                limits = self.procedure.scale.least_statistics(np.array([check.count]), ODD_ROW)
                passed &= without / variance >= _where(doubted, limits)[0]
            out |= passed & (part == k)
        return out

    @cached_property
    def _limits(self) -> tuple[Array, Array]:
        return self.procedure.scale.least_statistics(self.contest.count, self.procedure.critical)

    def _variance_beside(self, variance: Array) -> Array:
        """Variances (D,) by which a hypothesis is significant: of an estimate that is rough, without what it does."""
        if not self.procedure.scale.rough:
            return variance
        return np.where(variance == 1.0, 1.0, np.maximum(self.counted.variance, 1.0))

    def _scale(self, size: float) -> tuple[Array, NDArray[np.bool_]]:
        """Estimated variances (D,) over the true one, 1 where the statement stands; whether it does not."""
        scale, variance = self.procedure.scale, np.maximum(self.counted.at(size), 0.0)
        doubted = improbable(variance, scale.checked) if scale.variance == 1.0 else np.ones(len(variance), dtype=bool)
        return np.where(doubted, variance, 1.0), doubted


def _where(doubted: NDArray[np.bool_], limits: tuple[Array, Array]) -> Array:
    """Limits (P, D) with stated noise, and with estimated noise where the statement is doubted (D,)."""
    return np.where(doubted, limits[1][:, None], limits[0][:, None])
