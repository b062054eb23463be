"""Drives that count from another zero, or other steps, so that most rows cannot be assembled and no fit can begin.

They are judged by what they should read at the measured poses, where redundant drives agree. Where rows are predicted
the search for causes tells constants and scales of drives, with their uncertainties.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.gross_errors.column_faults import Explanation
from pkmcal_cli.gross_errors.plausibility import FEW, GROSS, FloatArray, Hint, Right, evidence, rms, spread
from pkmcal_cli.units.unit_text import Unit, parse_unit

_MUCH = 0.1  # of the largest error of a drive, both as shares of what it travels, from which on that of another is told
_SIMPLER = 2.0  # times what a constant leaves: a scale has to leave less


def explain_zeros(
    readings: FloatArray, expected: FloatArray, names: Sequence[str], units: Sequence[str]
) -> Explanation:
    """Constants and scales of those drives that are furthest off; both (n, A), m or rad, nan where not known.

    units: of the table, for the words.
    """
    hints, corrected = list[Hint](), readings.copy()
    before = np.array([rms(e) for e in (readings - expected).T])  # (A,), infinite where nothing is known
    share = np.where(np.isfinite(before), before / np.maximum(spread(expected), np.finfo(float).tiny), 0.0)
    for k in np.nonzero(share >= _MUCH * share.max(initial=0.0))[0].tolist():
        right = _right(readings[:, k], expected[:, k], names[k])
        column = right.factor * readings[:, k] + right.shift
        size, after = float(before[k]), rms(column - expected[:, k])
        if GROSS * after > size or np.isfinite(column - expected[:, k]).sum() < FEW:
            continue
        corrected[:, k], unit = column, parse_unit(units[k])
        message = f"{_words(right, unit)}: {evidence(unit, size, after)} if that is corrected"
        hint = Hint(kind="offset", names=(names[k],), message=message, before=size, after=after, columns=(right,))
        hints.append(hint)
    return Explanation(tuple(hints), corrected)


def _right(read: FloatArray, expected: FloatArray, name: str) -> Right:
    """The readings of a drive (n,) with another zero, or with other steps if that leaves less."""
    known = np.isfinite(read) & np.isfinite(expected)
    read, expected = read[known], expected[known]
    shift = float(np.median(expected - read)) if known.any() else 0.0
    factor = float(read @ expected) / max(float(read @ read), np.finfo(float).tiny)
    scaled, shifted = rms(factor * read - expected), rms(read + shift - expected)
    return Right(name, name, factor) if _SIMPLER * scaled < shifted else Right(name, name, 1.0, shift)


def _words(right: Right, unit: Unit) -> str:
    if right.factor == 1.0:
        by, more = unit.format(abs(right.shift), 4), "more" if right.shift < 0 else "less"
        return f"`{right.name}` reads {by} {more} than it should at the measured poses (is its zero right?)"
    times = f"{1 / right.factor:.4g} times"
    return f"`{right.name}` reads {times} what it should at the measured poses (are its steps right?)"
