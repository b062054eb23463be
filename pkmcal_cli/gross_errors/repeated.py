"""Readings that repeat others to the last digit where the machine has moved: a stuck sensor, copied cells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.gross_errors.plausibility import GROSS, Hint, spread
from pkmcal_cli.gross_errors.sample import Sample

_FEWEST = 3  # readings that repeat another: two may be one slip
_MOVED = 0.02  # share of the spread of predictions, below which readings that are noted coarsely may agree
_LISTED = 3


def repeated_readings(sample: Sample, row_origin: Callable[[int], str]) -> tuple[Hint, ...]:
    """Channels with such readings. No noise repeats itself; rows are compared by how far predictions are apart."""
    moved = np.maximum(GROSS * sample.prior_rms, _MOVED * spread(sample.predicted))
    hints = []
    for k, channel in enumerate(sample.part.model.channels):
        rows = _repeating(sample.readings[:, k], sample.predicted[:, k], float(moved[k]))
        if len(rows) < _FEWEST:
            continue
        shown = ", ".join(row_origin(int(sample.rows[r])) for r in rows[:_LISTED])
        more = f" and {len(rows) - _LISTED} more" if len(rows) > _LISTED else ""
        message = (
            f"`{channel.name}` repeats the reading of another row exactly, though the machine has moved, in "
            f"{len(rows)} rows: {shown}{more} (is the sensor stuck, or were cells filled in or copied?)"
        )
        known = tuple(int(r) for r in sample.rows[rows])
        hints.append(
            Hint(kind="repeated", names=(channel.name,), message=message, before=len(rows), after=0.0, rows=known)
        )
    return tuple(hints)


def _repeating(readings: NDArray[np.float64], predicted: NDArray[np.float64], moved: float) -> NDArray[np.intp]:
    """Rows whose reading (n,) is that of an earlier row, where the prediction (n,) was another by more than `moved`."""
    known = np.nonzero(np.isfinite(readings) & np.isfinite(predicted))[0]
    out = []
    order = known[np.lexsort((known, readings[known]))]
    for group in np.split(order, np.nonzero(np.diff(readings[order]))[0] + 1):
        if len(group) > 1:
            apart = np.abs(predicted[group] - predicted[group[0]])
            out += group[apart > moved].tolist()
    return np.array(sorted(out), dtype=np.intp)
