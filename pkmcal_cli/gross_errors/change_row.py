"""The row from which on readings are off by far more, or less, than before: something was changed there."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.gross_errors.sample import Sample

_FEWEST = 6  # rows on either side
_TIMES = 5.0  # rms on one side over that on the other


def change_row(sample: Sample) -> int | None:
    """Number of the first such row in the table: where one scatter before and another after explain residuals best.

    None where nothing is grossly off, or where both sides are alike. Rows must be in the order of measurement.
    """
    if not sample.gross:
        return None
    residual = sample.seen(sample.readings, sample.predicted) - sample.predicted
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(sample.prior_rms > 0, residual / sample.prior_rms, np.nan)
    known = np.isfinite(relative).any(axis=1)
    square = np.nanmax(np.where(np.isfinite(relative), relative, 0.0) ** 2, axis=1)[known]
    rows, count = sample.rows[known], len(square)
    if count < 2 * _FEWEST:
        return None
    splits = np.arange(_FEWEST, count - _FEWEST + 1)
    before = np.cumsum(square)[splits - 1]
    early, late = (np.maximum(v, 1e-300) for v in (before / splits, (square.sum() - before) / (count - splits)))
    best = int(np.argmin(splits * np.log(early) + (count - splits) * np.log(late)))
    ratio = float(np.sqrt(late[best] / early[best]))
    return int(rows[splits[best]]) if max(ratio, 1.0 / ratio) > _TIMES else None
