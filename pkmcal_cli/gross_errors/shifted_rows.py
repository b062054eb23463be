"""Readings that belong to other rows, as an explanation of a table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.gross_errors.plausibility import Hint, MovedReadings, evidence, misfit
from pkmcal_cli.gross_errors.reason import Reason
from pkmcal_cli.gross_errors.row_shift import RowShift, apply_shifts, find_row_shifts, shift_words, where_words
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import parse_unit

IntArray = NDArray[np.intp]


def shifted_rows(sample: Sample, sessions: IntArray, row_origin: Callable[[int], str]) -> Reason:
    """Whether readings belong to other rows: all of them, or those of some instruments."""
    best = Reason((), np.inf, np.inf)
    for channels in _blocks(sample):
        shifted = _shifted(sample, channels, sessions, row_origin)
        if shifted.complete:
            return shifted
        best = min(best, shifted, key=lambda r: r.after)
    return best


def _blocks(sample: Sample) -> list[list[int]]:
    """Channels that may be shifted together: all, of instruments outside the drives, of one instrument or drive."""
    model = sample.part.model
    measured = [k for k in range(len(model.channels)) if sample.part.measured[:, k].any()]
    outside = [k for k in measured if not model.channels[k].measurand.of_drive]
    by_name: dict[str, list[int]] = {}
    for sensor in model.sensors:
        by_name.setdefault(sensor.name, []).extend(int(k) for k in sensor.channels)
    by_name |= {model.channels[k].name: [k] for k in model.measuring(Measurand.DRIVE)}
    blocks = [measured, outside, *([k for k in each if k in measured] for each in by_name.values())]
    return [list(b) for b in dict.fromkeys(tuple(sorted(b)) for b in blocks) if b]


def _shifted(sample: Sample, channels: list[int], sessions: IntArray, row_origin: Callable[[int], str]) -> Reason:
    """Whether the readings of some channels belong to other rows."""
    readings = np.where(sample.whole.measured, sample.whole.readings, np.nan)
    predicted = sample.predicted
    some = np.full_like(readings, np.nan)
    some[:, channels] = readings[:, channels]
    shifts = find_row_shifts(some, predicted, sample.rows, sessions, sample.seen)
    right = readings.copy()
    right[:, channels] = apply_shifts(some, sessions, ((s.shift, s.first, s.unsure) for s in shifts))[:, channels]
    seen, corrected = (sample.seen(table[sample.rows], predicted) for table in (readings, right))
    alike = len({s.shift for s in shifts}) == 1 and all(s.whole for s in shifts)
    every = alike and len(shifts) == len(np.unique(sessions))
    shown = shifts[:1] if every else shifts
    names = [c.name for c in sample.part.model.channels]
    whose = "" if len(channels) == len(names) else " of " + ", ".join(f"`{names[k]}`" for k in channels)
    moved = tuple(MovedReadings(tuple(names[k] for k in channels), s.shift, s.first, s.unsure) for s in shifts)
    hints = tuple(
        _row_hint(sample, s, whose, "" if every else where_words(s, row_origin), moved if every else (m,))
        for s, m in zip(shown, moved, strict=False)
    )
    return Reason(hints, *(misfit(table, predicted, seen) for table in (seen, corrected)))


def _row_hint(sample: Sample, shift: RowShift, whose: str, where: str, moved: tuple[MovedReadings, ...]) -> Hint:
    """The channel that shows a shift most clearly gives the figures."""
    channels = sample.part.model.channels
    with np.errstate(invalid="ignore", divide="ignore"):
        fall = np.nan_to_num(shift.before / np.maximum(shift.after, sample.prior_rms))
    k = int(fall.argmax())
    unit = parse_unit(channels[k].unit)
    (by, other), before, after = shift_words(shift.shift), float(shift.before[k]), float(shift.after[k])
    words = f"{evidence(unit, before, after)} when each row takes the readings of the {other}"
    message = f"the readings{whose} look shifted by {by}{where}: `{channels[k].name}` {words}"
    names, rows_off = (channels[k].name,), tuple(shift.rows.tolist())
    return Hint(kind="rows", names=names, message=message, before=before, after=after, rows=rows_off, moved=moved)
