"""Readings of instruments that stand anywhere: known up to a rigid motion, so only what no motion explains is told.

Kabsch 1976: the best rotation between two sets of points, by a singular value decomposition.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.language.units import parse_unit
from pkmcal_cli.rotation import best_rotation
from pkmcal_cli.tables.plausibility import BETTER, EXPLAINED, FloatArray, Hint, evidence, factors_of, times, unit_words

Points = Sequence[Sequence[int]]
"""Columns of the coordinates of each point that one instrument sees."""

_SPARE = 2  # points more than axes: below, a motion explains nearly anything


def brought_back(readings: FloatArray, predicted: FloatArray, points: Points) -> FloatArray:
    """Readings (N, C) with those of one instrument moved rigidly onto their prediction (N, C).

    Nan where a point has not all of its coordinates, and everywhere where there are too few points.
    """
    out = readings.copy()
    columns = np.concatenate([np.asarray(p, dtype=int) for p in points])
    out[:, columns] = np.nan
    here, there = (np.concatenate([table[:, list(p)] for p in points]) for table in (readings, predicted))
    known = np.isfinite(here).all(axis=1) & np.isfinite(there).all(axis=1)
    if known.sum() < here.shape[1] + _SPARE:
        return out
    turn, shift = _motion(here[known], there[known])
    moved = np.where(known[:, None], here @ turn.T + shift, np.nan).reshape(len(points), len(readings), -1)
    for point, place in zip(points, moved, strict=True):
        out[:, list(point)] = place
    return out


def _motion(here: FloatArray, there: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotation (d, d) and shift (d,) that bring points `here` (n, d) closest to `there`."""
    a, b = here.mean(axis=0), there.mean(axis=0)
    turn = best_rotation(here - a, there - b)
    return turn, b - turn @ a


def explain_frame(
    readings: FloatArray, predicted: FloatArray, points: Points, names: Sequence[str], units: Sequence[str]
) -> tuple[tuple[Hint, ...], FloatArray]:
    """What explains the readings (N, C) of one instrument where no rigid motion does: a mirror image or a unit.

    Returns hints, and the readings if these are followed. A mirror image is that of any one axis turned in sign and
    of any two exchanged: a rotation leads from one to the other, so which it was cannot be told.
    """
    columns = [k for p in points for k in p]
    before, size = _misfit(readings, predicted, points)
    unit = parse_unit(units[columns[0]])
    changes: list[tuple[list[int], float]] = [([p[0] for p in points], -1.0)]
    for axes in (columns, *([p[k] for p in points] for k in range(len(points[0])))):
        changes += [(list(axes), factor) for factor in factors_of(unit)]
    best: tuple[float, list[int], float, FloatArray] | None = None
    for axes, factor in changes:
        changed = readings.copy()
        changed[:, axes] *= factor
        after = _misfit(changed, predicted, points)[0]
        if after <= BETTER * before and after <= EXPLAINED * size and (best is None or after < best[0]):
            best = (after, axes, factor, changed)
    if best is None or not np.isfinite(before):
        return (), readings
    after, axes, factor, changed = best
    told = columns if factor < 0 else axes
    quoted = ", ".join(f"`{names[k]}`" for k in told)
    if factor < 0:
        message = f"{quoted} look mirrored: one axis turned in sign, or two columns swapped: "
        message += f"{evidence(unit, before, after)} after the best rigid motion with one axis turned"
    else:
        words = f"{times(factor)}{unit_words(unit, factor)}"
        message = f"{quoted} look{'s' if len(told) == 1 else ''} {words}: "
        message += f"{evidence(unit, before, after)} after the best rigid motion when multiplied by {factor:.4g}"
    hint = Hint("mirrored" if factor < 0 else "unit", tuple(names[k] for k in told), message, before, after)
    return (hint,), changed


def _misfit(readings: FloatArray, predicted: FloatArray, points: Points) -> tuple[float, float]:
    """Rms of what no rigid motion explains, and rms of the predicted points about their mean; infinite without any."""
    moved = brought_back(readings, predicted, points)
    columns = [k for p in points for k in p]
    rest = (moved - predicted)[:, columns]
    known = np.isfinite(rest)
    if not known.any():
        return np.inf, 0.0
    there = np.concatenate([predicted[:, list(p)] for p in points])
    there = there[np.isfinite(there).all(axis=1)]
    return float(np.sqrt(np.mean(rest[known] ** 2))), float(np.sqrt(np.mean((there - there.mean(axis=0)) ** 2)))
