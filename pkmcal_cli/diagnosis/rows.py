"""Single bad rows: every row is a hypothesis of its own, a free shift of its readings (data snooping, Baarda)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.linear import Linear, Scale

MOST = 0.05  # share of rows that may be taken out; more are no outliers but an effect
_HEAVY = (3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0)
_BETTER = 2.5  # log-likelihood by which heavy tails must be the better description
_FEW = 40  # residuals that say nothing about tails
_USUAL = 1e-3  # chance that any row of normal noise is set aside before the tails are looked at


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
    """Scores of all rows; p values by heavy tails where the other rows have them."""
    rest = linear.rest.reshape(measured.shape)
    a, factor = linear._factor
    from scipy.linalg import cho_solve

    blocks = a.reshape(*measured.shape, -1)
    spread = cho_solve(factor, a.T).T.reshape(blocks.shape) if a.shape[1] else blocks
    information = np.eye(measured.shape[1]) * measured[:, :, None] - np.einsum("nck,ndk->ncd", blocks, spread)
    information += np.eye(measured.shape[1]) * ~measured[:, :, None]
    clear = np.linalg.eigvalsh(information)[:, 0] > 1e-3  # else one row alone holds a parameter
    information[~clear] = np.eye(measured.shape[1])
    statistic = np.einsum("nc,nc->n", rest, np.linalg.solve(information, rest[..., None])[..., 0])
    count = np.where(clear, measured.sum(axis=1), 0)
    p = scale.p_value(statistic, np.maximum(count, 1))
    p[count == 0] = 1.0
    freedom = heavy_tails(_others(linear, measured & clear[:, None], information, p) / np.sqrt(scale.variance))
    if freedom is not None:
        p = np.maximum(p, _heavy_p(statistic / scale.variance, count, freedom))
    return RowScores(np.where(count > 0, statistic, 0.0) / scale.variance, count, p)


def _others(linear: Linear, measured: NDArray[np.bool_], information: Array, p: Array) -> Array:
    """Residuals (n,), without sign, of rows that normal noise could make, as they are without the others."""
    odd = np.nonzero(p < _USUAL / len(p))[0]
    odd = odd[np.argsort(p[odd], kind="stable")][: max(int(MOST * len(p)), 1)]
    free = np.zeros((*measured.shape, len(odd), measured.shape[1]))
    for k, row in enumerate(odd):
        free[row, :, k] = np.eye(measured.shape[1])
    extra = free.reshape(measured.size, -1)
    rest = linear.projecting(linear.projected, extra=extra).rest.reshape(measured.shape) if len(odd) else linear.rest
    usual = measured.copy()
    usual[odd] = False
    size = np.sqrt(np.einsum("ncc->nc", information))
    return np.asarray(np.abs(rest.reshape(measured.shape) / size)[usual])


def heavy_tails(values: Array) -> float | None:
    """Degrees of freedom of the t distribution that describes residuals (n,), without bad rows, best; None: normal.

    Residuals in standard uncertainties, without sign, cut off at the largest.
    """
    if len(values) < _FEW:
        return None
    bound = float(values.max()) * (1 + 1e-9)
    normal = _log_likelihood(values, bound, np.inf)
    best, freedom = max((_log_likelihood(values, bound, f), f) for f in _HEAVY)
    return freedom if best > normal + _BETTER else None


def _log_likelihood(values: Array, bound: float, freedom: float) -> float:
    """Of |values| as a scaled t, truncated at `bound`; the scale is fitted."""
    from scipy.stats import norm, t

    shape = norm() if np.isinf(freedom) else t(freedom)
    scales = np.geomspace(0.4, 1.6, 25)
    z = values[None] / scales[:, None]
    inside = np.log(2 * shape.cdf(bound / scales) - 1)
    total = shape.logpdf(z).sum(axis=1) - len(values) * (np.log(scales) + inside)
    return float(total.max())


def _heavy_p(statistic: Array, count: NDArray[np.int_], freedom: float) -> Array:
    """p values of rows under a t distribution of unit variance, all channels as one."""
    unit = np.sqrt(np.maximum(freedom / (freedom - 2), 1.0))
    size = np.sqrt(statistic) * unit
    return np.asarray(np.minimum(2 * np.maximum(count, 1) * stdtr(freedom, -size), 1.0))
