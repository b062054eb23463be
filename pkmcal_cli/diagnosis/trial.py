"""Campaigns with one effect of any size: whether a diagnosis names it, by the noise that was drawn.

It is named if one of the hypotheses that explain the residual is accepted, and it is among those that hold 95 % of the
evidence. Accepted is what is significant, does not stand on one row, and helps rows held out; the latter two are
judged for the effect itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
        evidence = log_evidence(statistic / variance, contest.count[:, None])
        evidence += np.array([tail_of(size * far) for far in contest.far])[:, None]
        significant = (statistic / variance > self._limit(contest.count, doubted)) & (evidence > 0)
        evidence += contest.preference[:, None]
        best = _best(evidence, contest.hypothesis)  # (H, D) number of the part
        draws = np.arange(statistic.shape[1])
        of_best, significant = evidence[best, draws], significant[best, draws]
        for k, parts in enumerate(contest.groups):
            if len(parts):
                of_best[k, of_best[parts].max(axis=0) >= of_best[k]] = -np.inf
        near = _among_credible(of_best)
        named = near[0] & (near & significant).any(axis=0) & self._checked(size, best[0], variance, doubted)
        return statistic[best[0], draws], named

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
                least = self.procedure.scale.least_statistic(np.array([check.count]), ODD_ROW, doubted)[0]
                passed &= without / variance >= least
            out |= passed & (part == k)
        return out

    def _limit(self, count: NDArray[np.intp], doubted: NDArray[np.bool_]) -> Array:
        return self.procedure.scale.least_statistic(count, self.procedure.critical, doubted)

    def _scale(self, size: float) -> tuple[Array, NDArray[np.bool_]]:
        """Estimated variances (D,) over the true one, 1 where the statement stands; whether it does not."""
        scale, variance = self.procedure.scale, np.maximum(self.counted.at(size), 0.0)
        doubted = improbable(variance, scale.checked) if scale.variance == 1.0 else np.ones(len(variance), dtype=bool)
        return np.where(doubted, variance, 1.0), doubted


def _best(evidence: Array, hypothesis: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number (H, D) of the part with most evidence (P, D) of each hypothesis."""
    starts = np.flatnonzero(np.diff(hypothesis, prepend=-1))
    ends = np.append(starts[1:], len(hypothesis))
    return np.stack([a + np.argmax(evidence[a:b], axis=0) for a, b in zip(starts, ends, strict=True)])


def _among_credible(evidence: Array) -> NDArray[np.bool_]:
    """Which hypotheses (H, D) hold 95 % of the evidence (H, D), each draw's best first."""
    weight = np.exp(evidence - evidence.max(axis=0))
    order = np.argsort(-evidence, axis=0, kind="stable")
    ranked = np.take_along_axis(weight, order, axis=0)
    before = np.cumsum(ranked, axis=0) - ranked
    out = np.zeros(evidence.shape, dtype=bool)
    np.put_along_axis(out, order, before < CREDIBLE * weight.sum(axis=0), axis=0)
    return out
