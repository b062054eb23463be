"""Readings that belong to other rows in no order: shuffled, sorted, noted backwards, two rows exchanged."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.gross_errors.plausibility import BETTER, GROSS, Hint, evidence, rms
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import parse_unit

IntArray = NDArray[np.intp]

_FEWEST = 6  # rows
_CHANNELS = 2  # by one number alone, anything can be put in an order that fits
_OFF = 10.0  # times what errors of parameters and noise cause: residual of a row that is said to be another's
_LISTED = 3


def permuted_rows(sample: Sample, row_origin: Callable[[int], str]) -> tuple[Hint, ...]:
    """Whether another order of the rows leaves no more than errors of parameters and noise.

    The order with the least sum of squares (assignment problem), all channels of a row moving together.
    """
    if sample.frames or len(sample.rows) < len(sample.whole):
        return ()
    read = np.isfinite(sample.seen(sample.readings, sample.predicted)).any(axis=0)
    used = np.nonzero(read & (sample.prior_rms > 0))[0]
    readings, predicted = (v[:, used] / sample.prior_rms[used] for v in (sample.readings, sample.predicted))
    rows = np.nonzero(np.isfinite(readings + predicted).all(axis=1))[0]
    if len(used) < _CHANNELS or len(rows) < _FEWEST:
        return ()
    cost = ((readings[rows][None] - predicted[rows][:, None]) ** 2).sum(axis=2)  # of row i with the readings of row j
    from scipy.optimize import linear_sum_assignment  # dear to import, and only where something is grossly wrong

    source = linear_sum_assignment(cost)[1]
    still, best = np.diag(cost), cost[np.arange(len(rows)), source]
    moved = np.nonzero((source != np.arange(len(rows))) & (still > _OFF**2) & (best < BETTER**2 * still))[0]
    left = readings[rows][source] - predicted[rows]
    if len(moved) < 2 or any(rms(r) > GROSS for r in left.T):
        return ()
    return (_hint(sample, used, rows, source, moved, row_origin),)


def _hint(
    sample: Sample,
    used: IntArray,
    rows: IntArray,
    source: IntArray,
    moved: IntArray,
    row_origin: Callable[[int], str],
) -> Hint:
    """In words; the channel with the largest residual gives the figures."""
    residual = (sample.readings - sample.predicted)[rows][:, used]
    after = sample.readings[rows][source][:, used] - sample.predicted[rows][:, used]
    k = int(np.argmax((residual[moved] ** 2).sum(axis=0) / sample.prior_rms[used] ** 2))
    channel = sample.part.model.channels[int(used[k])]
    pairs = [
        f"{row_origin(int(sample.rows[rows[i]]))} those of {row_origin(int(sample.rows[rows[source[i]]]))}"
        for i in moved[:_LISTED]
    ]
    more = f" and {len(moved) - _LISTED} more" if len(moved) > _LISTED else ""
    before, left = rms(residual[moved, k]), rms(after[moved, k])
    words = evidence(parse_unit(channel.unit), before, left)
    message = (
        f"the readings of {len(moved)} rows look exchanged ({'; '.join(pairs)}{more}): `{channel.name}` {words} there"
    )
    places = tuple(int(r) for r in sample.rows[rows[moved]])
    return Hint(kind="rows", names=(channel.name,), message=message, before=before, after=left, rows=places)
