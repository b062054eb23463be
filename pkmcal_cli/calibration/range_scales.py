"""How far off nominal parameters are in terms of their ranges, and how noisy instruments: both stated, both guesses.

The true offset of a parameter, in half ranges, is normal with variance tau^2 / w. tau belongs to all parameters of one
kind (length, angle, stiffness, zero of a drive); w to the parameter alone, so one that is wild widens no other (1 for
those that are not identified, of which nothing is learned). The variance of an instrument's noise is phi times what is
stated. A weak prior says that what is stated is right: tau log-normal about 1 (two of three are within a factor of 2
either way, and one of a thousand is too small by any factor: a wrong unit), w about 1 with 10 degrees of freedom, but
one parameter of fifty is wild, off by 4 to 16,000 times as much as its kind: a slip (where it is beyond three half
ranges by the data and the ranges as stated; else its range is believed); phi with what the stated sigma is worth. The
problem is linear here, so all is drawn by Gibbs sampling (Gelman et al. 2013, Bayesian Data Analysis, ch. 11), tau on
a grid (Ritter and Tanner 1992), always with the same random numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array

_FACTOR = 2.0  # by which ranges are off: one standard deviation
_SLIPPED = 1e-3  # share of ranges that are too small by any factor: in a wrong unit; too wide ones do no harm
LOG_TAU = np.linspace(-4.0, 14.0, 721)
"""Logarithms of the factors that are considered."""
LOG_PRIOR = np.log(
    (1.0 - _SLIPPED) * np.exp(-0.5 * (LOG_TAU / np.log(_FACTOR)) ** 2) / (np.log(_FACTOR) * np.sqrt(2.0 * np.pi))
    + np.where(LOG_TAU > 0.0, _SLIPPED / LOG_TAU[-1], 0.0)
)
"""Logarithms of their density before the data."""
_HALF_PRECISION = 0.5 * np.exp(-2.0 * LOG_TAU)
_OWN_FREEDOM = 10.0
_STUDENT = math.gamma((_OWN_FREEDOM + 1) / 2) / math.gamma(_OWN_FREEDOM / 2) / math.sqrt(_OWN_FREEDOM * math.pi)
_WILD = 0.02  # share of parameters that are off by any factor
_WILDER = 4.0 ** np.arange(1, 8)
"""By what they are off more than their kind, each as likely as any other."""
_FAR = 3.0  # half ranges by which a wild one is off at least
_ROUNDING = 1e-13  # of the largest information: in what is not seen, wide offsets leave no more
_CHAINS, _STEPS, _WARMING = 40, 35, 10
_ENTRIES = 2e6  # of the matrices of chains that are worked on together
_QUIET = 1e-8  # least variance of noise, in stated ones
_KNOWN = 1e5  # half ranges over uncertainty: what is known better than that is known


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What G instruments say of the offsets z (q,) from nominal, in half ranges, about where a fit ended.

    Chi-square of each is squares - 2 score (z - centre) + (z - centre) information (z - centre): information (G, q, q),
    score (G, q), squares (G,), centre (q,). counts (G,): equations; freedom (G,): degrees of freedom that the stated
    sigma is worth, inf where it is exact. kinds (q,); `estimated` (q,): whether an offset is identified, so that its
    kind learns from it.
    """

    information: Array
    score: Array
    squares: Array
    counts: Array
    freedom: Array
    centre: Array
    kinds: tuple[str, ...]
    estimated: NDArray[np.bool_]

    def with_noise(self, variance: float) -> Evidence:
        """The same with noise of a known variance, in stated ones."""
        return replace(
            self,
            information=self.information / variance,
            score=self.score / variance,
            squares=self.squares / variance,
            freedom=np.full(len(self.freedom), np.inf),
        )

    def of_known(self, spread: Array, errors: Array) -> Evidence:
        """The same by independent errors of an earlier calibration, which is taken at its word; held ones as they were.

        spread (p, p): of the identified parameters, in half ranges, by such errors; errors (p,): what it was off, known
        less found.
        """
        p, q = len(spread), len(self.centre)
        transform = np.eye(q)
        transform[:p, :p] = spread
        return replace(
            self,
            information=transform.T @ self.information @ transform,
            score=self.score @ transform,
            centre=np.append(-errors, np.zeros(q - p)),
            estimated=np.zeros(q, dtype=bool),
        )

    def beside_datum(
        self, beside: Array, offsets: Array, kinds: tuple[str, ...], ranged: NDArray[np.bool_]
    ) -> Evidence:
        """The same of p identified parameters, of g of a datum after them, and of held ones.

        beside (p, g): by what the former are off where one of the latter is; offsets (g,): where these are held;
        ranged (g,): whether their kinds learn from them.
        """
        p, g, q = *beside.shape, len(self.centre)
        transform = np.hstack([np.eye(q)[:, :p], np.vstack([beside, np.zeros((q - p, g))]), np.eye(q)[:, p:]])
        return replace(
            self,
            information=transform.T @ self.information @ transform,
            score=self.score @ transform,
            centre=np.insert(self.centre, p, offsets),
            kinds=(*self.kinds[:p], *kinds, *self.kinds[p:]),
            estimated=np.insert(self.estimated, p, ranged),
        )

    def taken(self, offsets: NDArray[np.intp], instruments: NDArray[np.intp]) -> Evidence:
        """The same in another order."""
        return Evidence(
            information=self.information[np.ix_(instruments, offsets, offsets)],
            score=self.score[np.ix_(instruments, offsets)],
            squares=self.squares[instruments],
            counts=self.counts[instruments],
            freedom=self.freedom[instruments],
            centre=self.centre[offsets],
            kinds=tuple(self.kinds[k] for k in offsets),
            estimated=self.estimated[offsets],
        )

    @property
    def far(self) -> NDArray[np.bool_]:
        """Offsets (q,) far beyond their ranges, were ranges and noise as stated: others are not asked how far."""
        information = self.information.sum(axis=0)
        pulled = self.score.sum(axis=0) + information @ self.centre
        offsets = np.linalg.solve(np.eye(len(pulled)) + information, pulled)
        return np.asarray(self.estimated & (np.abs(offsets) > _FAR))

    def tamed(self) -> Evidence:
        """The same, but nothing is known so well that rounding would matter."""
        size, vectors = np.linalg.eigh(self.information.sum(axis=0))
        share = np.minimum(1.0, _KNOWN / np.sqrt(np.maximum(size, 1.0)))
        tame = (vectors * share) @ vectors.T
        return replace(self, information=tame @ self.information @ tame, score=self.score @ tame)


@dataclass(frozen=True, kw_only=True)
class Scales:
    """Drawn variances (M, q) of the offsets in half ranges squared, phi (M, G) of instruments, tau (M,) of kinds."""

    variances: Array
    noise: Array
    factors: Mapping[str, Array]

    @cached_property
    def typical(self) -> Array:
        """Standard deviations (q,) of the offsets, in half ranges."""
        return np.asarray(np.sqrt(np.median(self.variances, axis=0)))

    @cached_property
    def typical_noise(self) -> Array:
        """By what the stated variances of the instruments (G,) are multiplied."""
        return np.asarray(np.median(self.noise, axis=0))


def drawn_scales(evidence: Evidence, begin: Array | None = None, seed: int = 0) -> Scales:
    """Draws of the scales after the data, the same in whatever order parameters and instruments are named.

    begin (q,): factors of the ranges of offsets, the same for a kind, about which they begin; 1 without.
    """
    order, instruments = _order(evidence)
    first = np.ones(len(order)) if begin is None else begin[order]
    drawn = _drawn(evidence.taken(order, instruments), first, seed)
    back = np.argsort(order)
    return replace(drawn, variances=drawn.variances[:, back], noise=drawn.noise[:, np.argsort(instruments)])


def _order(evidence: Evidence) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Offsets and instruments by what is known of them."""
    size = np.einsum("gii->i", evidence.information)
    keys = zip(evidence.estimated, size, np.abs(evidence.centre), strict=True)
    offsets = sorted(enumerate(keys), key=lambda item: item[1])
    of_instruments = sorted(enumerate(zip(evidence.counts, evidence.squares, strict=True)), key=lambda item: item[1])
    return np.array([k for k, _ in offsets], dtype=np.intp), np.array([k for k, _ in of_instruments], dtype=np.intp)


def _drawn(evidence: Evidence, begin: Array, seed: int) -> Scales:
    rng, tamed = np.random.default_rng(seed), evidence.tamed()
    far = tamed.far
    kinds, kind_of = np.unique(tamed.kinds, return_inverse=True)
    shape = (_CHAINS, len(kind_of))
    first = [begin[kind_of == k].max() ** 2 for k in range(len(kinds))]
    tau2, weights = np.tile(first, (_CHAINS, 1)), np.ones(shape)
    noise = np.ones((_CHAINS, len(tamed.counts)))
    drawn: list[tuple[Array, Array, Array]] = []
    for step in range(_STEPS):
        offsets = _offsets(rng, tamed, tau2[:, kind_of] / weights, noise)
        weights = np.where(tamed.estimated, _weights(rng, offsets**2 / tau2[:, kind_of], far), 1.0)
        tau2 = _of_kinds(rng, weights * offsets**2 * tamed.estimated, kind_of, tamed.estimated, len(kinds))
        noise = _of_instruments(rng, tamed, offsets)
        if step >= _WARMING:
            drawn.append((tau2[:, kind_of] / weights, noise, np.sqrt(tau2)))
    variances, noises, taus = (np.concatenate(part) for part in zip(*drawn, strict=True))
    return Scales(variances=variances, noise=noises, factors=dict(zip(kinds.tolist(), taus.T, strict=True)))


def _offsets(rng: np.random.Generator, evidence: Evidence, variance: Array, noise: Array) -> Array:
    """Offsets (M, q) given their variances (M, q) and those of the instruments (M, G)."""
    q, weights = len(evidence.centre), 1.0 / noise
    if not q:
        return variance
    pulled = weights @ (evidence.score + evidence.information @ evidence.centre)  # (M, q)
    out = rng.normal(size=variance.shape)
    together = max(int(_ENTRIES / q**2), 1)  # chains
    for first in range(0, len(out), together):
        some = slice(first, first + together)
        precision = (weights[some] @ evidence.information.reshape(-1, q * q)).reshape(-1, q, q)
        floor = _ROUNDING * np.einsum("mkk->mk", precision).max(axis=1, initial=0.0)[:, None]
        precision[:, np.arange(q), np.arange(q)] += 1.0 / variance[some] + floor
        drawn = np.linalg.cholesky(precision) @ out[some, :, None] + pulled[some, :, None]
        out[some] = np.linalg.solve(precision, drawn)[..., 0]
    return out


def _of_instruments(rng: np.random.Generator, evidence: Evidence, offsets: Array) -> Array:
    """phi (M, G) given offsets (M, q)."""
    step = offsets - evidence.centre
    misfit = evidence.squares - 2.0 * step @ evidence.score.T + ((step @ evidence.information) * step).sum(axis=2).T
    freedom = np.where(np.isfinite(evidence.freedom), evidence.freedom, 0.0)
    total = np.maximum(misfit, 0.0) + freedom
    drawn = np.maximum(total / rng.chisquare(np.maximum(evidence.counts + freedom, 1.0), total.shape), _QUIET)
    return np.where(np.isfinite(evidence.freedom), drawn, 1.0)


def _weights(rng: np.random.Generator, squares: Array, far: NDArray[np.bool_]) -> Array:
    """Weights w (M, q) given squared offsets in tau: of Student's distribution; where `far` (q,), or of a wider one."""
    weights = np.asarray(rng.gamma((_OWN_FREEDOM + 1) / 2, 2 / (_OWN_FREEDOM + squares)))
    if not far.any():
        return weights
    squares = squares[:, far]
    tame = (1.0 - _WILD) * _STUDENT * (1.0 + squares / _OWN_FREEDOM) ** (-(_OWN_FREEDOM + 1) / 2)
    wild = _WILD / len(_WILDER) * np.exp(-0.5 * squares[..., None] / _WILDER**2) / (_WILDER * np.sqrt(2.0 * np.pi))
    below = np.concatenate([tame[..., None], wild], axis=-1).cumsum(axis=-1)  # (M, far, 1 + scales)
    chosen = (below < below[..., -1:] * rng.random((*squares.shape, 1))).sum(axis=-1)
    weights[:, far] = np.where(chosen == 0, weights[:, far], np.append(np.nan, _WILDER**-2)[chosen])
    return weights


def _of_kinds(
    rng: np.random.Generator, squares: Array, kind_of: NDArray[np.intp], on: NDArray[np.bool_], kinds: int
) -> Array:
    """tau^2 (M, K) given weighted squares of offsets (M, q) of kinds `kind_of` (q,); 1 where none is identified."""
    out = np.ones((len(squares), kinds))
    for k in np.unique(kind_of[on]):
        count = int((on & (kind_of == k)).sum())
        total = squares[:, kind_of == k].sum(axis=1)[:, None]
        density = (LOG_PRIOR - count * LOG_TAU) - total * _HALF_PRECISION  # (M, grid), its logarithm
        density -= density.max(axis=1, keepdims=True)
        below = np.exp(density, out=density).cumsum(axis=1)
        chosen = (below < below[:, -1:] * rng.random((len(squares), 1))).sum(axis=1)
        out[:, k] = np.exp(2.0 * LOG_TAU[chosen])
    return out
