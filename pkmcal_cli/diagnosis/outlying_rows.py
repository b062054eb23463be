"""Single bad rows: every row is a hypothesis of its own, a free shift of its readings (data snooping, Baarda)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtr, ndtri, stdtr

from pkmcal_cli.base.definite import solved
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.scale import Scale

MOST = 0.05  # share of rows that may be taken out; more are no outliers but an effect
_HEAVY = (4.0, 5.0, 6.0, 8.0, 12.0, 20.0)
_NOTHING = 1e-6  # standard uncertainties
_ODD_CHANCE = 1e-3  # chance that any row of normal noise is set aside before the tails are looked at


@dataclass(frozen=True)
class RowScores:
    """Statistic in units of the noise, degrees of freedom and p value of every row, (N,)."""

    statistic: Array
    count: NDArray[np.int_]
    p_value: Array

    def log_bayes(self, used: int) -> Array:
        """Evidence (N,) for one bad row among N: BIC, and prior odds of 1/N."""
        rows = np.asarray(self.statistic - self.count * np.log(used)) / 2
        return np.asarray(np.where(self.count > 0, rows - np.log(len(self.count)), -np.inf))


def row_scores(linear: Linear, measured: NDArray[np.bool_], scale: Scale) -> RowScores:
    """Scores of all rows, by what is measured in them (N, C), but for what stands in one and was measured on the bench.

    P values by heavy tails where the other rows have them.
    """
    measured = measured.copy()
    measured[:, list(linear.once)] = False
    residual = np.where(measured, linear.unexplained.reshape(measured.shape), 0.0)
    a, factor = linear._factor
    blocks = np.where(measured[..., None], a.reshape(*measured.shape, -1), 0.0)
    spread = solved(factor, blocks.reshape(a.shape).T).T.reshape(blocks.shape) if a.shape[1] else blocks
    information = np.eye(measured.shape[1]) * measured[:, :, None] - np.einsum("nck,ndk->ncd", blocks, spread)
    information += np.eye(measured.shape[1]) * ~measured[:, :, None]
    clear = np.linalg.eigvalsh(information)[:, 0] > 1e-3  # else one row alone holds a parameter
    information[~clear] = np.eye(measured.shape[1])
    statistic = np.einsum("nc,nc->n", residual, np.linalg.solve(information, residual[..., None])[..., 0])
    count = np.where(clear, measured.sum(axis=1), 0)
    p = scale.p_value(statistic, np.maximum(count, 1))
    p[count == 0] = 1.0
    odd = np.nonzero(p < _ODD_CHANCE / len(p))[0]
    odd = odd[np.argsort(p[odd], kind="stable")][: max(int(MOST * len(p)), 1)]
    others = linear.without([int(row) for row in odd])
    variance = _by_others(scale, others)
    within = measured & clear[:, None]
    within[odd] = False
    size = np.sqrt(np.einsum("ncc->nc", information))
    residuals = np.abs(others.unexplained.reshape(measured.shape) / size)[within]
    p = Tails.of(residuals / np.sqrt(variance)).p_value(p, statistic / variance, count)
    return RowScores(np.where(count > 0, statistic, 0.0) / variance, count, p)


def _by_others(scale: Scale, others: Linear) -> float:
    """The noise that rows are judged by, where it was estimated: as the others have it, at least as it is stated."""
    if scale.variance <= 1.0 or others.dof <= 0:
        return scale.variance
    return min(scale.variance, max(others.chi2 / others.dof, 1.0))


@dataclass(frozen=True)
class Tails:
    """How likely noise has the tails of Student's t with so many degrees of freedom, `weights` of `_HEAVY`; the rest is
    for normal noise."""

    weights: Array

    @classmethod
    def of(cls, values: Array) -> Tails:
        """By residuals (n,), without bad rows, in standard uncertainties and without sign, cut off at the largest."""
        prior = np.full(len(_HEAVY) + 1, 1 / len(_HEAVY))
        prior[-1] = max(np.sqrt(len(values)), 1.0)  # tails pay for their parameter (BIC)
        if not len(values):
            return cls(prior[:-1] / prior.sum())
        bound = float(values.max()) * (1 + 1e-9)
        if bound < _NOTHING:  # of no noise
            return cls(np.zeros(len(_HEAVY)))
        likelihood = np.array([_log_likelihood(values, bound, f) for f in (*_HEAVY, np.inf)])
        weights = prior * np.exp(likelihood - likelihood.max())
        return cls(weights[:-1] / weights.sum())

    def of_sum(self, normal_p: float) -> float:
        """p value of a sum of many squares, by that of normal noise: sums of heavy-tailed ones scatter more."""
        scatter = np.sqrt(2.0 / (np.array([_kurtosis(f) for f in _HEAVY]) - 1.0))
        heavy = ndtr(float(ndtri(max(normal_p, 1e-300))) * scatter)
        return float((1 - self.weights.sum()) * normal_p + self.weights @ np.maximum(heavy, normal_p))

    def p_value(self, normal_p: Array, statistic: Array, count: NDArray[np.int_]) -> Array:
        """p values (N,) of rows: that of normal noise, and those of noise with tails, as likely as they are."""
        heavy = np.stack([np.maximum(_heavy_p(statistic, count, f), normal_p) for f in _HEAVY])
        return np.asarray((1 - self.weights.sum()) * normal_p + self.weights @ heavy)


def _kurtosis(freedom: float) -> float:
    """Of Student's t; of 4 degrees of freedom, where it is infinite, that of some hundred values."""
    return 3 * (freedom - 2) / (freedom - 4) if freedom > 4 else 12.0


def _log_likelihood(values: Array, bound: float, freedom: float) -> float:
    """Of |values| as a scaled t, truncated at `bound`; the scale is fitted."""
    scales = np.geomspace(0.4, 1.6, 25)
    whole = ndtr(bound / scales) if np.isinf(freedom) else stdtr(freedom, bound / scales)
    density = np.array([_log_density(values / scale, freedom).sum() for scale in scales])  # one by one: values are many
    total = density - len(values) * (np.log(scales) + np.log(2 * whole - 1))
    return float(total.max())


def _log_density(z: Array, freedom: float) -> Array:
    """Of Student's t, or of a standard normal variable."""
    if np.isinf(freedom):
        return np.asarray(-0.5 * (z**2 + np.log(2 * np.pi)))
    constant = gammaln((freedom + 1) / 2) - gammaln(freedom / 2) - 0.5 * np.log(freedom * np.pi)
    return np.asarray(constant - (freedom + 1) / 2 * np.log1p(z**2 / freedom))


def _heavy_p(statistic: Array, count: NDArray[np.int_], freedom: float) -> Array:
    """p values of rows under a t distribution of unit variance, all channels as one."""
    unit = np.sqrt(np.maximum(freedom / (freedom - 2), 1.0))
    size = np.sqrt(statistic) * unit
    return np.asarray(np.minimum(2 * np.maximum(count, 1) * stdtr(freedom, -size), 1.0))
