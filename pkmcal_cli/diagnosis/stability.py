"""Would other rows have named the same effect? Blocks of rows drawn with replacement, linear at the solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.confirm import cells
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.noise_tests import time_order
from pkmcal_cli.diagnosis.score import log_evidence
from pkmcal_cli.diagnosis.scoring import Scored
from pkmcal_cli.diagnosis.search import ranked
from pkmcal_cli.effects import catalogue

STABLE = 0.8  # share of resamples that must name the same
_DRAWS = 100
_STRETCHES = 16  # of time
_FEWEST = 8  # cells of the workspace; with fewer, rows are drawn
_RIVALS = 12  # hypotheses with most evidence that compete in the resamples
_EVERY = 1_000_000
_NUMBERS = 2_000_000  # in memory at a time


@dataclass(frozen=True)
class Stability:
    """Share of resamples that find an effect; what the others find, most often first, with shares of all."""

    share: float
    others: tuple[tuple[Hypothesis, float], ...] = ()


def stability(
    scores: Scored, evidence: Array, problem: Problem, hypothesis: Hypothesis, alike: Sequence[Hypothesis], seed: int
) -> Stability:
    """Share of resamples in which the effect, or one of those not told from it (`alike`), has most evidence.

    Or the same effect at the places of a group: repeated rows make it seem to have more sizes than it has.

    `scores`: hypotheses scored without the effect; `evidence` (H,): theirs with all rows. What that has beyond the
    linear evidence of all rows (prices, sizes beyond ranges, shapes of their own, fits) it has in all resamples.
    Blocks are stretches of time for what depends on time, else cells of the workspace.
    """
    best = ranked(evidence)[:_RIVALS]
    chosen = [int(k) for k in best if scores.scores[k].count]
    grams, counts = _grams(scores, problem, hypothesis, chosen)
    prior, pull = scores.linear.fixed[1], scores.linear.pull
    prior = prior + 1e-9 * np.eye(len(pull))
    names = {h.name for h in (hypothesis, *alike)}
    right = np.array([h.name in names or h.akin(hypothesis) for h in (scores.hypotheses[k] for k in chosen)])
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(len(grams), np.full(len(grams), 1 / len(grams)), size=_DRAWS)
    weights = drawn.astype(float)
    more = evidence[chosen] - _evidence(grams.sum(axis=0)[None], counts, prior, pull, scores)[0]
    together = np.array_split(weights, 1 + _DRAWS * grams[0].size // _NUMBERS)
    drawn_evidence = [_evidence(np.tensordot(w, grams, 1), counts, prior, pull, scores) + more for w in together]
    best_of = [int(ranked(e)[0]) for e in np.vstack(drawn_evidence)]
    shares = np.bincount(best_of, minlength=len(chosen)) / len(weights)
    order = (int(k) for k in np.argsort(-shares, kind="stable") if shares[k] > 0 and not right[k])
    others = tuple((scores.hypotheses[chosen[k]], float(shares[k])) for k in order)
    return Stability(float(shares[right].sum()), others)


def _grams(scores: Scored, problem: Problem, hypothesis: Hypothesis, chosen: Sequence[int]) -> tuple[Array, list[int]]:
    """Gram matrices (B, q, q) by block of projected columns, hypotheses' visible columns and residual; their sizes."""
    linear = scores.linear
    fixed = linear.fixed[0]
    columns = [linear.tested(scores.hypotheses[k]) @ scores.scores[k].basis for k in chosen]
    whole = np.hstack([fixed, *columns, linear.residual[:, None]])
    label = np.repeat(_blocks(problem, hypothesis), linear.channels)
    grams = np.stack([whole[label == b].T @ whole[label == b] for b in np.unique(label)])
    return grams, [fixed.shape[1], *(c.shape[1] for c in columns)]


def _evidence(grams: Array, counts: Sequence[int], prior: Array, pull: Array, scores: Scored) -> Array:
    """Log evidence (D, H) of hypotheses from Gram matrices (D, q, q); prior (p, p) and pull (p,) of what is projected
    out."""
    p = counts[0]
    right = grams[:, :p, p:].copy()
    right[..., -1] += pull
    left = grams[:, p:, p:] - grams[:, p:, :p] @ np.linalg.solve(grams[:, :p, :p] + prior, right)
    starts, size = np.cumsum([0, *counts[1:-1]]), np.array(counts[1:])
    statistic = np.zeros((len(grams), len(size)))
    for k in np.unique(size):  # those of one size together
        at = starts[size == k][:, None] + np.arange(k)  # (m, k)
        score = left[:, at, -1]
        inverse = np.linalg.pinv(left[:, at[:, :, None], at[:, None, :]], rcond=1e-9, hermitian=True)
        statistic[:, size == k] = np.einsum("dmk,dmkl,dml->dm", score, inverse, score)
    return log_evidence(statistic / scores.scale.variance, size)


def _blocks(problem: Problem, hypothesis: Hypothesis) -> NDArray[np.intp]:
    """Block (N,) of each row."""
    effect = catalogue().get(hypothesis.effect)
    needs = set() if effect is None else set(effect.needs)
    if hypothesis.session or {"time", "temperature", "session"} & needs:
        rank = np.argsort(time_order(problem))
        return np.asarray(rank * _STRETCHES // len(rank), dtype=np.intp)
    labels = cells(problem, _EVERY)
    return labels if len(np.unique(labels)) >= _FEWEST else np.arange(len(problem))
