"""Readings of an instrument that does not stand where the machine file says: one rigid motion explains them all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import log
from pkmcal_cli.gross_errors.frame_turns import Turns
from pkmcal_cli.gross_errors.mirror import Points, brought_back, motion_of
from pkmcal_cli.gross_errors.plausibility import BETTER, FEW, GROSS, FloatArray, Hint, evidence, misfit, rms
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import Unit, parse_unit

_FAR = 30.0
"""Times what parameters in their ranges and noise cause: less may be ranges that were guessed too small."""
_MUCH = 0.1  # share of the largest component from which on another one is told
_AS_WELL = 1.5  # times what the best motion leaves: a shift alone does as well


def explain_place(sample: Sample) -> tuple[tuple[Hint, ...], float, float]:
    """Instruments of a stated place whose readings are far off, but all by one shift, or by one rigid motion.

    Returns hints, and the misfit before and after they are followed.
    """
    hints, corrected = list[Hint](), sample.readings.copy()
    for name, (points, turns) in sample.standing.items():
        columns = [k for p in points for k in p]
        left = corrected - sample.predicted
        expected = sample.prior_rms[columns]
        far = np.array([rms(left[:, k]) for k in columns])
        if not (far > _FAR * expected)[np.isfinite(far)].any():
            continue
        words, moved = _best(sample, corrected, points, turns)
        rest = np.array([rms((moved - sample.predicted)[:, k]) for k in columns])
        known = np.isfinite(far) & np.isfinite(rest)
        total = rms(far[known]), rms(rest[known])
        if not known.any() or (rest > GROSS * expected)[known].any() or total[1] > BETTER * total[0]:
            continue
        channels, corrected = sample.part.model.channels, moved
        proof = evidence(parse_unit(channels[columns[0]].unit), *total)
        message = f"the readings of `{name}` look taken from another place, {words}: {proof} without that; "
        message += "if it stands there, state `frame: fitted`, else look for another origin, tool or zero"
        names = tuple(channels[k].name for k in columns)
        hints.append(Hint(kind="offset", names=names, message=message, before=total[0], after=total[1]))
    before, after = (misfit(table, sample.predicted, sample.readings) for table in (sample.readings, corrected))
    return tuple(hints), before, after


def _best(sample: Sample, readings: FloatArray, points: Points, turns: Turns) -> tuple[str, FloatArray]:
    """In words, and the readings (n, C) moved back: by a shift, or where that leaves more by a rigid motion."""
    columns = [k for p in points for k in p]
    shifts = [_shift(readings, sample.predicted, [p[k] for p in points]) for k in range(len(points[0]))]
    shifted = readings.copy()
    for point in points:
        shifted[:, list(point)] -= np.array(shifts)
    whole = len(points[0]) == (2 if sample.part.model.topology.planar else 3)
    motion = motion_of(readings, sample.predicted, points) if whole else None
    left = rms((shifted - sample.predicted)[:, columns])
    if motion is None:
        return _shift_words(sample, points[0], shifts), shifted
    moved = brought_back(readings, sample.predicted, points, turns)
    if left <= _AS_WELL * rms((moved - sample.predicted)[:, columns]):
        return _shift_words(sample, points[0], shifts), shifted
    return f"{_turn_words(motion[0])} and {_shift_words(sample, points[0], shifts)} (in the middle)", moved


def _shift(readings: FloatArray, predicted: FloatArray, columns: Sequence[int]) -> float:
    """By how much readings are larger on average; 0 with few of them."""
    off = (readings - predicted)[:, columns]
    known = np.isfinite(off)
    return float(off[known].mean()) if known.sum() >= FEW else 0.0


def _shift_words(sample: Sample, point: Sequence[int], shifts: Sequence[float]) -> str:
    channels, largest = sample.part.model.channels, max(map(abs, shifts))
    parts = [(channels[k], s) for k, s in zip(point, shifts, strict=True) if abs(s) >= _MUCH * largest]
    return "shifted by " + ", ".join(f"`{c.name}` {_text(parse_unit(c.unit), s)}" for c, s in parts)


def _text(unit: Unit, value: float) -> str:
    return unit.format(value, 3)


def _turn_words(rotation: FloatArray) -> str:
    """How far readings are turned, in the plane with its sense."""
    if len(rotation) == 2:
        angle = float(np.arctan2(rotation[0, 1], rotation[0, 0]))
    else:
        angle = float(np.linalg.norm(log(rotation[None])[0]))
    return f"turned by {parse_unit('deg').format(angle, 3)}"
