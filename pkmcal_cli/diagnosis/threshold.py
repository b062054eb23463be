"""How small a p value must be when so many correlated hypotheses are tested: the bootstrap of the smallest one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.score import Score

DRAWS = 20_000
_BLOCK = 500  # draws at once, which stay in the processor's cache


def smallest_p(linear: Linear, columns: Sequence[Array], scores: Sequence[Score], seed: int) -> Array:
    """Smallest p values (DRAWS,) over all hypotheses when nothing is missing, sorted.

    Scores of pure noise are normal with covariance C^T V^-1 C, all hypotheses together.
    """
    used = [(c @ s.basis / np.sqrt(s.information), s.count) for c, s in zip(columns, scores, strict=True) if s.count]
    if not used:
        return np.ones(DRAWS)
    joint = np.hstack([c for c, _ in used])
    counts = np.array([count for _, count in used])
    covariance = joint.T @ linear.free(joint)
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    some = values > 1e-9 * values[-1]
    root = (vectors[:, some] * np.sqrt(values[some])).T  # (rank, q)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    rng = np.random.default_rng(seed)
    out = np.empty(DRAWS)
    for first in range(0, DRAWS, _BLOCK):
        drawn = rng.standard_normal((_BLOCK, len(root))) @ root
        statistic = np.add.reduceat(np.multiply(drawn, drawn, out=drawn), starts, axis=1)
        p = np.ones(_BLOCK)
        for count in np.unique(counts):  # the largest statistic of each size has the smallest p
            p = np.minimum(p, chdtrc(count, statistic[:, counts == count].max(axis=1)))
        out[first : first + _BLOCK] = p
    return np.sort(out)


def critical_p(smallest: Array, alpha: float) -> float:
    """The alpha-quantile of the smallest p."""
    return float(np.quantile(smallest, alpha))


def effective_tests(smallest: Array) -> float:
    """Number of independent tests with the same chance of a false alarm, at 5 %; 0 where nothing can be tested."""
    p = critical_p(smallest, 0.05)
    return float(np.log(0.95) / np.log1p(-p)) if p < 1.0 else 0.0
