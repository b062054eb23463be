"""Intervals of 95 % by the wild bootstrap, which needs no sigma and no independence within blocks.

The residuals of a block (one pose in one session) are multiplied by a common random sign (Wu 1986, Liu 1988; for
clusters Cameron, Gelbach, Miller 2008), and fitted by one step of Gauss and Newton. Few blocks, or blocks of great
leverage, know a variance badly: intervals are those of Student's t with the degrees of freedom that the variance of
each parameter has (Bell and McCaffrey 2002). Noise of which there is one draw only (a length measured on the bench, a
prior) has the standard uncertainty that is stated.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.error_budget import COVER
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import replicate_groups
from pkmcal_cli.calibration.intervals import Intervals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise

Index = NDArray[np.intp]
_REPEATS = 1000
_SEGMENT = 1_000_000  # numbers that are drawn at a time
_FEWEST = 12  # degrees of freedom of a variance


def bootstrap_intervals(
    problem: Problem, fit: Fit, index: Array, session: Array, seed: int, gain: float = 1.0
) -> Intervals:
    """By signs drawn for blocks: rows of one pose in one session (N,); index (p,) of the selected parameters.

    gain: what steps of a robust fit are longer by, as its weights change.
    """
    near, directions = linearise(problem, fit.last), fit.directions
    label = _labels(problem, _blocks(problem, session), near.known)
    count = int(label.max(initial=-1)) + 1
    seen = directions.vectors[~directions.held] * directions.ranges  # (d, p)
    q, upper = np.linalg.qr(near.jacobian @ seen.T)
    by_score = np.linalg.solve(upper, seen).T if len(seen) else np.zeros((len(index), 0))  # (p, d)
    roots = _roots(q, label, count)
    residual = _times(roots, near.residual - q @ (q.T @ near.residual))
    rng, drawn = np.random.default_rng(seed), label >= 0
    scores = _sums(residual[drawn, None] * q[drawn], label[drawn], count)
    by_blocks = gain * _products(lambda shape: rng.choice([-1.0, 1.0], size=shape), scores) @ by_score.T  # (R, p)
    size = np.where(np.arange(len(label)) < len(label) - near.known, 1.0, np.sqrt(directions.spread))  # of ranges
    once = _products(lambda shape: rng.normal(size=shape), size[~drawn, None] * q[~drawn]) @ by_score.T
    held = (
        rng.normal(size=(_REPEATS, int(directions.held.sum())))
        / 2.0
        @ directions.vectors[directions.held]
        * directions.ranges
        * np.sqrt(directions.spread)
    )
    steps, data = by_blocks + once + held, by_blocks.std(axis=0)
    share = np.divide(steps.std(axis=0), data, out=np.full(len(data), np.inf), where=data > 0)
    return _from_steps(fit, index, steps, _freedom(q, roots, by_score) * share**4)


def _sums(x: Array, label: Index, count: int) -> Array:
    """Sums (count, d) of rows x (n, d) with the same label (n,)."""
    out = np.zeros((count, x.shape[1]))
    np.add.at(out, label, x)
    return out


def _products(draw: Callable[[tuple[int, int]], Array], x: Array) -> Array:
    """Products (R, d) of x (m, d) with random vectors (m,), drawn a segment of the repeats at a time."""
    step = max(_SEGMENT // max(len(x), 1), 1)
    sizes = [min(step, _REPEATS - done) for done in range(0, _REPEATS, step)]
    return np.vstack([draw((size, len(x))) @ x for size in sizes])


def _labels(problem: Problem, blocks: Index, known: int) -> Index:
    """Block of each residual (n,); -1 for those whose noise is as stated, as they are alone of their kind.

    These are what was measured once, on the bench, and what is known besides the rows, `known` residuals.
    """
    channels = problem.model.channels
    label = np.repeat(blocks[:, None], len(channels), axis=1)
    label[:, [not np.isnan(c.once) for c in channels]] = -1
    return np.concatenate([label.ravel(), np.full(known, -1)])


def _from_steps(fit: Fit, index: Array, steps: Array, freedom: Array) -> Intervals:
    """Standard uncertainties and intervals of drawn steps (R, p), of variances with degrees of freedom (p,)."""
    from scipy.special import stdtrit

    std = steps.std(axis=0)
    std[fit.directions.undetermined()] = np.nan
    factor = stdtrit(np.clip(freedom, 1.0, 1e6), 0.975) / COVER
    low, high = np.quantile(steps, [0.025, 0.975], axis=0)
    half = np.stack([low, high], axis=1) * factor[:, None]
    half[np.isnan(std)] = np.nan
    least = float(freedom[np.isfinite(std)].min(initial=np.inf))
    remark = "" if least >= _FEWEST else f"few poses: the bootstrap is approximate ({least:.0f} degrees of freedom)"
    return Intervals("bootstrap", fit.values[index][:, None] + half, std, remark)


def _blocks(problem: Problem, session: Array) -> Index:
    """Number of the block of each row (N,): the same pose in the same session; rows that are joined stay together."""
    keys = np.stack([replicate_groups(problem), session], axis=1)
    return problem.clusters.together(np.unique(keys, axis=0, return_inverse=True)[1].ravel())


def _roots(q: Array, label: Index, count: int) -> list[tuple[Index, Array]]:
    """Rows of each block, and (I - H)^(-1/2) of it, which makes residuals as large as errors are (CR2)."""
    out = []
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(count + 1))
    for first, last in pairwise(ends):
        members = order[first:last]
        value, vector = np.linalg.eigh(np.eye(len(members)) - q[members] @ q[members].T)
        root = np.where(value > 1e-6, 1.0 / np.sqrt(np.maximum(value, 1e-6)), 0.0)
        out.append((members, vector * root @ vector.T))
    return out


def _times(roots: list[tuple[Index, Array]], x: Array) -> Array:
    """Rows (n, ...) of every block times its root; others as they are."""
    out = x.copy()
    for members, root in roots:
        out[members] = root @ x[members]
    return out


def _freedom(q: Array, roots: list[tuple[Index, Array]], by_score: Array) -> Array:
    """Degrees of freedom (p,) of the variances of parameters, linear `by_score` (p, d), if errors are white.

    Satterthwaite's of a sum of squares with matrix G^T G, column g of G being (I - H) A_g q_g a (Bell and McCaffrey
    2002): 2 mean^2 / variance = (tr G^T G)^2 / tr (G^T G)^2.
    """
    trace = square = np.zeros(len(by_score))
    cross = np.zeros((len(by_score), q.shape[1], q.shape[1]))
    for members, root in roots:
        part = root @ q[members] @ by_score.T  # A_g q_g a
        explained = q[members].T @ part  # (d, p)
        size, inside = (part**2).sum(axis=0), (explained**2).sum(axis=0)
        trace = trace + size - inside
        square = square + size**2 - 2 * size * inside
        cross += np.einsum("dp,ep->pde", explained, explained)
    square = square + (cross**2).sum(axis=(1, 2))
    return np.asarray(np.divide(trace**2, square, out=np.full(len(square), np.inf), where=square > 0))
