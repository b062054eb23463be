"""Readings that belong to the row before or after, from some row on."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.gross_errors.plausibility import BETTER, EXPLAINED, FloatArray, spread

IntArray = NDArray[np.intp]
Seen = Callable[[FloatArray, FloatArray], FloatArray]
"""Readings (n, C) as they compare with predictions (n, C): brought into their frame, nan where nothing compares."""

SHIFTS = (1, -1, 2, -2)
_FEWEST = 6  # rows that a shift must explain: fewer may agree by chance


@dataclass(frozen=True, kw_only=True)
class RowShift:
    """Rows `rows` (numbers in the table) take the readings `shift` rows further on.

    first: number of the row from which on all of the session do; unsure: how many rows before it may, or hold a reading
    that was left out or entered twice; before, after: rms (C,) of measured less predicted in
    these rows, SI; whole: whether all rows of the session.
    """

    shift: int
    rows: IntArray
    first: int
    unsure: int
    before: FloatArray
    after: FloatArray
    whole: bool


def shifted(readings: FloatArray, session: IntArray, shift: int) -> FloatArray:
    """Readings (N, C) of the row `shift` further on in the same session; nan where there is none."""
    out = np.full_like(readings, np.nan)
    numbers = np.arange(len(readings))
    known = (numbers + shift >= 0) & (numbers + shift < len(readings))
    known[known] &= session[numbers[known] + shift] == session[known]
    out[known] = readings[numbers[known] + shift]
    return out


def find_row_shifts(
    readings: FloatArray, predicted: FloatArray, rows: IntArray, session: IntArray, seen: Seen
) -> list[RowShift]:
    """Shifts of all readings (N, C) by up to two rows, a session (N,) at a time, from some row of it to its end.

    predicted (n, C): of the rows `rows` (n,), in ascending order.
    """
    size = spread(predicted)
    size = np.where(size > 0, size, np.inf)  # what does not move shows no shift
    residual = {k: seen(shifted(readings, session, k)[rows], predicted) - predicted for k in (0, *SHIFTS)}
    cost = {k: ((r / size) ** 2) for k, r in residual.items()}
    shifts = []
    for number in np.unique(session[rows]).tolist():
        in_session = np.nonzero(session[rows] == number)[0]
        best = _best(cost, in_session)
        if best is not None:
            shift, first = best
            part = in_session[first:]
            before, after = (np.sqrt(_mean(residual[k][part] ** 2, residual[shift][part])) for k in (0, shift))
            begin = int(np.nonzero(session == number)[0][0]) if first == 0 else int(rows[part[0]])
            gap = 0 if first == 0 else begin - int(rows[in_session[first - 1]]) - 1  # rows that were not looked at
            shifts.append(
                RowShift(
                    shift=shift, rows=rows[part], first=begin, unsure=gap + abs(shift), before=before, after=after,
                    whole=first == 0,
                )
            )  # fmt: skip
    return shifts


def _best(cost: dict[int, FloatArray], in_session: IntArray) -> tuple[int, int] | None:
    """The shift, and the place among rows `in_session` from which on it holds, that explain most; None if none does."""
    best: tuple[float, int, int] | None = None
    for shift in SHIFTS:
        both = np.isfinite(cost[0][in_session]) & np.isfinite(cost[shift][in_session])
        still, moved = (np.where(both, cost[k][in_session], 0.0).sum(axis=1) for k in (0, shift))
        tail = np.cumsum((still - moved)[::-1])[::-1]  # what is gained by shifting from a row on
        start = int(tail.argmax())
        last = min(start + abs(shift), len(in_session) - 1)
        for first in range(start, last + 1):
            if first < last and moved[first] > BETTER**2 * still[first]:
                continue
            readings = both[first:]  # a reading that was left out makes the rows where the shift begins fit neither way
            before, after = still[first:].sum(), moved[first:].sum()
            clear = after <= BETTER**2 * before and after <= EXPLAINED**2 * readings.sum()
            if clear and readings.any(axis=1).sum() >= _FEWEST and (best is None or tail[first] > best[0]):
                best = (float(tail[first]), shift, first)
                break
    return None if best is None else best[1:]


def _mean(values: FloatArray, like: FloatArray) -> FloatArray:
    """Means (C,) over the rows where both have a value; nan without."""
    both = np.isfinite(values) & np.isfinite(like)
    count = both.sum(axis=0)
    total = np.where(both, values, 0.0).sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def apply_shifts(readings: FloatArray, session: IntArray, shifts: Iterable[tuple[int, int, int]]) -> FloatArray:
    """Readings (N, C) put right by shifts: rows, from which row of a session on, how many before that become nan."""
    out = readings.copy()
    for shift, first, unsure in shifts:
        edge = np.arange(max(0, first - unsure), first)
        out[edge[session[edge] == session[first]]] = np.nan
        rows = first + np.nonzero(session[first:] == session[first])[0]
        out[rows] = shifted(readings, session, shift)[rows]
    return out


def shift_words(shift: int) -> tuple[str, str]:
    """The words "one row" and "next row", where readings stand one row too early; so for all `SHIFTS`."""
    other = {1: "next row", -1: "row before", 2: "row two after", -2: "row two before"}[shift]
    return {1: "one row", 2: "two rows"}[abs(shift)], other


def where_words(shift: RowShift, row_origin: Callable[[int], str]) -> str:
    """The words " from FILE:7 to FILE:20" for the rows that are shifted."""
    return f" from {row_origin(int(shift.rows[0]))} to {row_origin(int(shift.rows[-1]))}"
