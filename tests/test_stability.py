"""Evidence in resamples of the rows: that of least squares with the rows repeated."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.score import log_evidence
from pkmcal_cli.diagnosis.stability import _evidence


def test_evidence_of_resamples_is_that_of_repeated_rows() -> None:
    """Of hypotheses of one, two and one columns, beside three that are projected out."""
    rng = np.random.default_rng(3)
    rows, counts = rng.normal(size=(40, 8)), [3, 1, 2, 1]
    weights = rng.integers(0, 4, size=(6, 40)).astype(float)
    grams = np.einsum("dn,ni,nj->dij", weights, rows, rows)
    scores = SimpleNamespace(scale=SimpleNamespace(variance=1.7))
    found = _evidence(grams, counts, 1e-12 * np.eye(3), np.zeros(3), scores)  # type: ignore[arg-type]
    for weight, evidence in zip(weights, found, strict=True):
        repeated = np.repeat(rows, weight.astype(int), axis=0)
        fixed, residual, first = repeated[:, :3], repeated[:, -1], 3
        for count, value in zip(counts[1:], evidence, strict=True):
            both = np.hstack([fixed, repeated[:, first : first + count]])
            gained = np.array((_left(fixed, residual) - _left(both, residual)) / 1.7)
            assert value == pytest.approx(float(log_evidence(gained, np.array(count))), rel=1e-8)
            first += count


def _left(columns: Array, values: Array) -> float:
    """Sum of squares that least squares leave."""
    return float(((values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]) ** 2).sum())
