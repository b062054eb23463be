"""Drives whose readings belong to other rows, by what they should read at the measured poses.

The log of one drive that begins a row late, or loses one, leaves every pose in doubt. Each drive is judged by itself:
what all of them share is told by the readings of the instruments, as these are late then (`shifted_rows`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pkmcal_cli.gross_errors.column_faults import Explanation
from pkmcal_cli.gross_errors.plausibility import FloatArray, Hint, MovedReadings, evidence, rms
from pkmcal_cli.gross_errors.row_shift import IntArray, RowShift, find_row_shifts, shift_words, shifted, where_words
from pkmcal_cli.units.unit_text import parse_unit

_PLAINER = 2.0  # times less than a plainer cause has a shift of rows to leave


def explain_late_drives(
    readings: FloatArray,
    expected: FloatArray,
    rows: IntArray,
    sessions: IntArray,
    *,
    row_origin: Callable[[int], str],
    names: Sequence[str],
    units: Sequence[str],
) -> Explanation:
    """Drives of whole sessions, or from a row on, that read what they should a row or two before or after.

    readings (N, A): of the whole table, m or rad; expected (n, A): at the poses of the rows `rows` (n,) of it, in
    ascending order; sessions (N,): their numbers. The explanation's table is that of these rows (n, A).
    """
    hints, corrected = list[Hint](), readings[rows]
    count = len(np.unique(sessions[rows]))
    for k, name in enumerate(names):
        shifts = find_row_shifts(readings[:, [k]], expected[:, [k]], rows, sessions, lambda read, _: read)
        shifts = [s for s in shifts if _PLAINER * s.after[0] < _plainer(readings[:, k], expected[:, k], rows, s.rows)]
        every = len(shifts) == count and all(s.whole and s.shift == shifts[0].shift for s in shifts)
        moved = tuple(MovedReadings((name,), s.shift, s.first, s.unsure) for s in shifts)
        for s, m in zip(shifts[:1] if every else shifts, moved, strict=False):
            where = "" if every else where_words(s, row_origin)
            hints.append(_hint(s, name, units[k], where, moved if every else (m,)))
        for s in shifts:
            here = np.isin(rows, s.rows)
            corrected[here, k] = shifted(readings[:, [k]], sessions, s.shift)[rows[here], 0]
    return Explanation(tuple(hints), corrected)


def _plainer(read: FloatArray, expected: FloatArray, rows: IntArray, of: IntArray) -> float:
    """Rms that a constant, a scale and a play leave of a drive's errors in rows `of`; arguments as above, of one drive.

    On the way along a raster in equal steps a row is a constant, or a play where it turns.
    """
    moves = np.sign(np.diff(read, prepend=read[:1]))
    here = np.isin(rows, of) & np.isfinite(read[rows] + expected + moves[rows])
    at = rows[here]
    errors, causes = read[at] - expected[here], np.stack([np.ones(len(at)), read[at], moves[at]], axis=1)
    return rms(errors - causes @ np.linalg.lstsq(causes, errors, rcond=None)[0])


def _hint(shift: RowShift, name: str, unit: str, where: str, moved: tuple[MovedReadings, ...]) -> Hint:
    by, other = shift_words(shift.shift)
    before, after = float(shift.before[0]), float(shift.after[0])
    words = f"{evidence(parse_unit(unit), before, after)} when each row takes that of the {other}"
    message = f"the readings of `{name}` look shifted by {by}{where}: at the measured poses, {words}"
    rows = tuple(shift.rows.tolist())
    return Hint(kind="rows", names=(name,), message=message, before=before, after=after, rows=rows, moved=moved)
