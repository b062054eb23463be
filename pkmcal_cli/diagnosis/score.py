"""The score of a hypothesis: what of it can be seen, and how clearly the residual shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc

from pkmcal_cli.base.rotation import Array

NONCENTRALITY = 17.07  # of a chi-square test at 0.1 % that misses 20 %; MDB (Baarda)
PLAUSIBLE = 2.0  # standard deviations of a prior: its range
UNUSUAL = 2.0  # ranges, beyond which a size is told to be unusual
FAR = 50.0 * PLAUSIBLE  # up to which an effect is looked for that nothing could show within its range

KEPT = 1e-4  # share of a column's squared length that must remain after projection


@dataclass(frozen=True)
class Score:
    """Of one hypothesis with k parameters: directions (k, m) that can be seen, their information (m,) and score (m,).

    `whole` (k, k): information, whatever can be seen; `length2` (k,): squared length of each parameter's column before
    projection; `far`: whether nothing of it could be seen within its range.
    """

    basis: Array
    information: Array
    gradient: Array
    whole: Array
    length2: Array
    far: bool = False

    @property
    def alone(self) -> Array:
        """Information (k,) of each parameter by itself."""
        return np.diag(self.whole)

    @property
    def count(self) -> int:
        """Degrees of freedom m."""
        return len(self.information)

    @cached_property
    def statistic(self) -> float:
        """T = g^T I^-1 g."""
        return float((self.gradient**2 / self.information).sum())

    @cached_property
    def estimate(self) -> Array:
        """Parameters (k,) in standard deviations of their priors."""
        return np.asarray(self.basis @ (self.gradient / self.information))

    @property
    def tail(self) -> float:
        """Log prior density of its size over that within its range, where it is far beyond it; else 0.

        Priors have the tails of a Cauchy distribution: what is far beyond its range is improbable, not impossible.
        """
        return tail_of(self.size) if self.far else 0.0

    @cached_property
    def size(self) -> float:
        """Largest number in ranges."""
        return float(np.abs(self.estimate).max(initial=0.0)) / PLAUSIBLE

    @property
    def leading(self) -> int:
        """The parameter that shows most by itself."""
        return int(np.argmax(np.where(self.length2 > 0, self.alone, -np.inf)))

    @property
    def kept(self) -> float:
        """Share of the leading parameter's column that is left after projection."""
        whole = float(self.length2[self.leading])
        return float(np.sqrt(max(float(self.alone[self.leading]), 0.0) / whole)) if whole > 0 else 0.0

    @property
    def mdb(self) -> float:
        """Minimal detectable size of the leading parameter by itself, in standard deviations of its prior."""
        return minimal_detectable(float(self.alone[self.leading]))


def log_evidence(statistic: Array, count: Array) -> Array:
    """Log evidence of hypotheses by statistic T and degrees of freedom k; minus infinity where k is 0.

    The k sizes, in directions of unit information, share a normal prior of mean 0 whose variance g is the likeliest.
    """
    m = np.maximum(count, 1)
    g = np.maximum(statistic / m - 1.0, 1.0)
    out = 0.5 * (statistic * g / (1.0 + g) - m * np.log1p(g))
    return np.asarray(np.where(count > 0, out, -np.inf))


def tail_of(size: float) -> float:
    """Log prior density of a size, in ranges, over that within its range."""
    return -float(np.log((1.0 + size**2) / 2.0)) if size > 1.0 else 0.0


def minimal_detectable(information: float) -> float:
    """The size that one test at 0.1 % finds in 80 % of campaigns; inf without information."""
    return float(np.sqrt(NONCENTRALITY / information)) if information > 0 else float("inf")


def p_of_part(statistic: Array, count: Array, variance: Array | float, dof: Array | float) -> Array:
    """p values of parts T of a sum of squares with so many degrees of freedom: F against what T leaves of it.

    Against the whole sum no effect of a small table would ever be significant: T over it is at most 1.
    """
    left = np.clip(1.0 - statistic / np.maximum(variance * dof, np.finfo(float).tiny), 0.0, 1.0)
    return np.asarray(np.where(dof > count, betainc(0.5 * np.maximum(dof - count, 1), 0.5 * count, left), 1.0))


def projected_out(
    information: Array, gradient: Array, before: Array, of_hypothesis: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Information (k, k) and gradient (k,) with those of one hypothesis projected out, whose entries are 0 then.

    before (k,): squared lengths of all columns.
    """
    at = np.nonzero(of_hypothesis & (before > 0))[0]
    length = np.sqrt(before[at])
    values, vectors = np.linalg.eigh(information[np.ix_(at, at)] / np.outer(length, length))
    kept = values > KEPT
    free = vectors[:, kept] / length[:, None]
    cross = information[:, at] @ free / values[kept]
    information = information - cross @ (free.T @ information[at])
    gradient = gradient - cross @ (free.T @ gradient[at])
    information[of_hypothesis], information[:, of_hypothesis], gradient[of_hypothesis] = 0.0, 0.0, 0.0
    return information, gradient


def score_in(information: Array, gradient: Array, before: Array) -> Score:
    """Score in the directions that remain and can be seen within the range; where none can, in those seen far beyond.

    before (k,): squared lengths of the columns before anything was projected out.
    """
    return _scores_in(information[None], gradient[None], before[None])[0]


def scores_among(
    normal: tuple[Array, Array, Array], at: Sequence[Sequence[int]], free: Sequence[Sequence[bool]]
) -> tuple[Score, ...]:
    """Scores of groups of columns, whatever those that are free do; at, free: number of each column, whether it is.

    normal: information (q, q), gradient (q,) and squared lengths (q,) of all columns. Those of one size together.
    """
    information, gradient, length2 = normal
    sizes = np.array([len(columns) for columns in at], dtype=np.intp)
    scores: dict[int, Score] = {}
    for size in np.unique(sizes):
        which = np.nonzero(sizes == size)[0].tolist()
        members = np.array([at[k] for k in which], dtype=np.intp)  # (m, size)
        inner = information[members[:, :, None], members[:, None, :]]
        slope, before = gradient[members], length2[members]
        for j, mask in ((j, np.array(free[k])) for j, k in enumerate(which) if any(free[k])):
            inner[j], slope[j] = projected_out(inner[j], slope[j], before[j], mask)
            before[j, mask] = 0.0
        scores |= zip(which, _scores_in(inner, slope, before), strict=True)
    return tuple(scores[k] for k in range(len(at)))


def _scores_in(information: Array, gradient: Array, before: Array) -> list[Score]:
    """Scores of m hypotheses of one size: information (m, k, k), gradient and `before` (m, k)."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.transpose(0, 2, 1)))
    left = values > KEPT * (vectors**2 * before[:, :, None]).sum(axis=1)
    far = ~(left & (values > NONCENTRALITY / PLAUSIBLE**2)).any(axis=1)
    seen = left & (values > NONCENTRALITY / np.where(far, FAR, PLAUSIBLE)[:, None] ** 2)
    out = []
    for k, on in enumerate(seen):
        basis = vectors[k][:, on]
        out.append(Score(basis, values[k, on], basis.T @ gradient[k], information[k], before[k], bool(far[k])))
    return out
