"""Rows that do not stand in the order in which they were measured."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.tables.measurement_set import Measurements


def time_order_notes(measurements: Measurements) -> list[str]:
    """That the order of rows goes by their `time`, where they stand otherwise in a session."""
    time = measurements.covariates.get("time")
    if time is None or not np.isfinite(time).all():
        return []
    back = (np.diff(time) < 0) & (np.diff(measurements.session) == 0)
    n = int(np.count_nonzero(back))
    if not n:
        return []
    times = "once" if n == 1 else f"{n} times"
    return [f"`time` goes back {times} from a row to the next: the order of the rows is taken from `time`"]
