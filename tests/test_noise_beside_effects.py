"""Noise that is estimated from residuals which contain an effect: the effect is judged by what is left beside it.

A clearance is not smooth over the poses: in few rows most of what it does would count as noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest, f

from pkmcal_cli.diagnosis.scoring import Scored, scored
from tests.test_detection_few_rows import few, share

NAME, FACTOR = "clearance@rod2", 3.0  # of a sigma that is stated too small


def drawn(seed: int, size: float, name: str = NAME, factor: float = FACTOR) -> Scored:
    """Residuals of 20 rows with an effect so many standard uncertainties large; the effect, whole, scored."""
    case = few("scissors", 20)
    (effect,) = (h.whole for h in case.hypotheses if h.name == name)
    score = case.linear.score_of(effect)
    signature = case.linear.tested(effect) @ score.basis @ (size / np.sqrt(score.information * score.count))
    noise = np.random.default_rng(seed).normal(size=len(signature))
    residual = case.linear.on.ravel() * factor * (signature + noise)
    return scored(replace(case.linear, residual=residual), case.problem, [effect])


def test_an_effect_that_most_of_the_residual_is_of_is_significant() -> None:
    """Nine standard uncertainties: by any noise that contains it T is below the number of values that are free."""
    seen = [drawn(seed, 9.0) for seed in range(40)]
    assert all(s.scale.rough and s.scale.variance > 2 * FACTOR**2 for s in seen), "half of it is the effect"
    assert all(s.scores[0].statistic / s.scale.variance < s.linear.dof for s in seen)
    assert sum(float(s.p_values[0]) < few("scissors", 20).procedure.critical for s in seen) >= 36


def test_noise_is_not_less_than_stated() -> None:
    """Of stated noise the estimate beside the effect is often less; F with it all the same."""
    case = few("scissors", 20)
    most = case.linear.dof - 1
    seen = [drawn(seed, 9.0, factor=1.0) for seed in range(60)]
    least = [float(f.sf(s.scores[0].statistic, 1, most)) for s in seen if s.scale.variance > 1]
    p = [float(s.p_values[0]) for s in seen if s.scale.variance > 1]
    assert len(p) > 30 and all(np.array(p) > np.array(least))


@pytest.mark.parametrize(("name", "numbers"), [(NAME, 1), ("pitch_curve@q3", 5)])
def test_p_values_of_noise_are_uniform_where_they_matter(name: str, numbers: int) -> None:
    """1 % below 1 %, 0.1 % below 0.1 %, of 1200 tables without any effect and with a sigma that is three times too
    small (binomial test at 1 %)."""
    seen = [drawn(seed, 0.0, name) for seed in range(100, 1300)]
    p = np.array([float(s.p_values[0]) for s in seen])
    assert seen[0].scores[0].count == numbers
    for level in (0.05, 0.01, 0.001):
        assert binomtest(int((p < level).sum()), len(p), level).pvalue > 0.01, (level, (p < level).mean())


def test_beside_an_effect_that_leaves_few_values_the_noise_is_that_of_all() -> None:
    """Curves of four drives, 20 numbers at once, leave less than 10 of 24 degrees of freedom."""
    seen = drawn(1, 18.0, "pitch_curve@each")
    assert seen.scale.rough and seen.scores[0].statistic > 0.5 * seen.scale.variance * seen.scale.dof
    assert float(seen.p_values[0]) == seen.scale.p_of(seen.scores[0]) > 1e-9


def test_the_promised_size_is_detected_in_80_percent_of_campaigns() -> None:
    """Within three standard deviations of both counts, 10 %."""
    assert share(few("scissors", 20), NAME) == pytest.approx(0.8, abs=0.1)
