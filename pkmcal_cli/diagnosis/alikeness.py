"""How alike hypotheses are: angles between what they explain, declared parameters and other effects projected out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.score import Score


def cosines(
    linear: Linear, hypotheses: Sequence[Hypothesis], scores: Sequence[Score], one: int, others: Sequence[int]
) -> list[float]:
    """Cosines of the smallest angle between one hypothesis and others, by their numbers."""
    basis_of_one = linear.free(_basis(linear, hypotheses[one], scores[one]))
    bases = (_basis(linear, hypotheses[k], scores[k]) for k in others)
    return [min(float(np.linalg.norm(basis.T @ basis_of_one, 2)), 1.0) if basis.size else 0.0 for basis in bases]


def _basis(linear: Linear, hypothesis: Hypothesis, score: Score) -> Array:
    """Columns (n, m) of a hypothesis, orthonormal in the metric of what is left after projection."""
    return np.asarray(linear.tested(hypothesis) @ score.basis / np.sqrt(score.information))
