"""Drives that count from another zero, or other steps, by what they should read at the measured poses.

Where rows are predicted, and no zero is unknown, the search for causes tells constants and scales of drives, with their
uncertainties. Where most rows cannot be assembled no fit can begin, and where zeros are unknown a fit takes a wrong
sign or unit for errors of all else.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.gross_errors.column_faults import Explanation
from pkmcal_cli.gross_errors.plausibility import (
    BETTER,
    EXPLAINED,
    FEW,
    GROSS,
    FloatArray,
    Hint,
    Kind,
    Right,
    evidence,
    rms,
    spread,
)
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words
from pkmcal_cli.units.unit_text import Unit, parse_unit

_MUCH = 0.1  # of the largest error of a drive, both as shares of what it travels, from which on that of another is told
_SIMPLER = 2.0  # times what more numbers leave: they have to leave less
_NEAR = 0.05  # by which a factor may miss that of a sign or unit, as errors of dimensions let it


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
        unit = parse_unit(units[k])
        right = _right(readings[:, k], expected[:, k], names[k], unit)
        column = right.factor * readings[:, k] + right.shift
        size, after = float(before[k]), rms(column - expected[:, k])
        if GROSS * after > size or np.isfinite(column - expected[:, k]).sum() < FEW:
            continue
        corrected[:, k] = column
        hints.append(_hint(right, unit, size, after))
    return Explanation(tuple(hints), corrected)


def explain_steps(
    readings: FloatArray, expected: FloatArray, names: Sequence[str], units: Sequence[str]
) -> tuple[Hint, ...]:
    """Drives with a wrong sign, unit or other steps whose zeros anybody may choose; arguments as of `explain_zeros`."""
    hints = []
    for k, (read, should) in enumerate(zip(readings.T, expected.T, strict=True)):
        unit, known = parse_unit(units[k]), np.isfinite(read - should)
        if known.sum() <= FEW:
            continue
        right = _affine(read[known], should[known], names[k], unit)
        travelled = float(spread(should[known, None])[0])
        before, after = float(spread((read - should)[known, None])[0]), rms(right.factor * read + right.shift - should)
        if before > EXPLAINED * travelled and after <= min(BETTER * before, EXPLAINED * travelled):
            hints.append(_hint(right, unit, before, after))
    return tuple(hints)


def _hint(right: Right, unit: Unit, before: float, after: float) -> Hint:
    message = f"{_words(right, unit)}: {evidence(unit, before, after)} if that is corrected"
    known = abs(right.factor) in factors_of(unit)
    kind: Kind = "sign" if right.factor == -1.0 else "unit" if known else "offset"
    return Hint(kind=kind, names=(right.name,), message=message, before=before, after=after, columns=(right,))


def _right(read: FloatArray, expected: FloatArray, name: str, unit: Unit) -> Right:
    """The readings of a drive (n,) with another zero, with other steps if that leaves less, or with both."""
    known = np.isfinite(read) & np.isfinite(expected)
    read, expected = read[known], expected[known]
    shift = float(np.median(expected - read)) if known.any() else 0.0
    factor = float(read @ expected) / max(float(read @ read), np.finfo(float).tiny)
    scaled, shifted = rms(factor * read - expected), rms(read + shift - expected)
    right = Right(name, name, factor) if _SIMPLER * scaled < shifted else Right(name, name, 1.0, shift)
    if min(scaled, shifted) <= EXPLAINED * spread(expected[:, None])[0] or known.sum() <= FEW:
        return right
    both = _affine(read, expected, name, unit)
    return both if _SIMPLER * rms(both.factor * read + both.shift - expected) < min(scaled, shifted) else right


def _affine(read: FloatArray, expected: FloatArray, name: str, unit: Unit) -> Right:
    """The readings of a drive (n,) with other steps and another zero; the factor of a sign or unit that is near."""
    off = read - read.mean()
    factor = float(off @ expected) / max(float(off @ off), np.finfo(float).tiny)
    common = (sign * f for f in (1.0, *factors_of(unit)) for sign in (1.0, -1.0))
    factor = next((u for u in common if u != 1.0 and abs(factor / u - 1.0) < _NEAR), factor)
    return Right(name, name, factor, float(np.mean(expected - factor * read)))


def _words(right: Right, unit: Unit) -> str:
    name, at = f"`{right.name}`", "at the measured poses"
    if right.factor == 1.0:
        by, more = unit.format(abs(right.shift), 4), "more" if right.shift < 0 else "less"
        return f"{name} reads {by} {more} than it should {at} (is its zero right?)"
    zero = ", counted from another zero" if right.shift else ""
    size, turned = abs(right.factor), " and reversed in sign" if right.factor < 0 else ""
    if size == 1.0:
        return f"{name} looks reversed in sign{zero}"
    if size in factors_of(unit):
        return f"{name} looks {times(size)}{unit_words(unit, size)}{turned}{zero}"
    return f"{name} reads {1 / size:.3g} times what it should {at} (are its steps right?){turned}{zero}"
