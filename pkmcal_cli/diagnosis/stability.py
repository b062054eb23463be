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
    more = evidence[chosen] - _evidence(grams.sum(axis=0), counts, prior, pull, scores)
    best_of = [
        int(ranked(_evidence(np.tensordot(w, grams, 1), counts, prior, pull, scores) + more)[0]) for w in weights
    ]
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


def _evidence(gram: Array, counts: Sequence[int], prior: Array, pull: Array, scores: Scored) -> Array:
    """Log evidence (H,) of hypotheses from one Gram matrix; prior (p, p) and pull (p,) of what is projected out."""
    p = counts[0]
    right = gram[:p, p:].copy()
    right[:, -1] += pull
    left = gram[p:, p:] - gram[p:, :p] @ np.linalg.solve(gram[:p, :p] + prior, right)
    statistic, first = [], 0
    for count in counts[1:]:
        block = slice(first, first + count)
        score = left[block, -1]
        statistic.append(float(score @ np.linalg.lstsq(left[block, block], score, rcond=1e-9)[0]))
        first += count
    return log_evidence(np.array(statistic) / scores.scale.variance, np.array(counts[1:]))


def _blocks(problem: Problem, hypothesis: Hypothesis) -> NDArray[np.intp]:
    """Block (N,) of each row."""
    effect = catalogue().get(hypothesis.effect)
    needs = set() if effect is None else set(effect.needs)
    if hypothesis.session or {"time", "temperature", "session"} & needs:
        rank = np.argsort(time_order(problem))
        return np.asarray(rank * _STRETCHES // len(rank), dtype=np.intp)
    labels = cells(problem, _EVERY)
    return labels if len(np.unique(labels)) >= _FEWEST else np.arange(len(problem))
