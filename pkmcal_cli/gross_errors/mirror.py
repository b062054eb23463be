"""Readings of instruments that stand anywhere: known up to a rigid motion, so only what no motion explains is told.

Kabsch 1976: the best rotation between two sets of points, by a singular value decomposition.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pkmcal_cli.base.rotation import best_motion
from pkmcal_cli.gross_errors.frame_turns import Turns, explain_turns, turned_back
from pkmcal_cli.gross_errors.plausibility import BETTER, EXPLAINED, FloatArray, Hint, Kind, Right, evidence
from pkmcal_cli.units.file_units import Unit, parse_unit
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words

Points = Sequence[Sequence[int]]
"""Columns of the coordinates of each point that one instrument sees."""

MORE_THAN_AXES = 2
"""Points more than axes: below, a motion explains nearly anything."""


def brought_back(readings: FloatArray, predicted: FloatArray, points: Points, turns: Turns = ()) -> FloatArray:
    """Readings (N, C) with those of one instrument, points and `turns`, moved rigidly onto their prediction (N, C).

    The motion is that of the points. Nan where a point or a rotation vector has not all of its coordinates, and
    everywhere where there are too few points.
    """
    out = readings.copy()
    columns = np.concatenate([np.asarray(p, dtype=int) for p in (*points, *turns)])
    out[:, columns] = np.nan
    motion = motion_of(readings, predicted, points)
    if motion is None:
        return out
    rotation, shift = motion
    for point in points:
        here, there = readings[:, list(point)], predicted[:, list(point)]
        known = np.isfinite(here + there).all(axis=1, keepdims=True)
        out[:, list(point)] = np.where(known, here @ rotation.T + shift, np.nan)
    for vector in turns:
        out[:, list(vector)] = turned_back(readings[:, list(vector)], predicted[:, list(vector)], rotation)
    return out


def motion_of(readings: FloatArray, predicted: FloatArray, points: Points) -> tuple[FloatArray, FloatArray] | None:
    """Rotation (d, d) and shift (d,) that bring readings (N, C) of points onto predictions; None with too few."""
    here, there = (np.concatenate([table[:, list(p)] for p in points]) for table in (readings, predicted))
    known = np.asarray(np.isfinite(here).all(axis=1) & np.isfinite(there).all(axis=1))
    return None if known.sum() < here.shape[1] + MORE_THAN_AXES else best_motion(here[known], there[known])


@dataclass(frozen=True)
class _Change:
    """Columns times a factor, those that are `suspects`; or exchanged with others of the same number."""

    columns: tuple[int, ...]
    factor: float = 1.0
    others: tuple[int, ...] = ()
    suspects: tuple[int, ...] = ()

    def of(self, readings: FloatArray) -> FloatArray:
        """The readings (N, C), changed."""
        out = readings.copy()
        out[:, self.columns] *= self.factor
        if self.others:
            out[:, [*self.columns, *self.others]] = readings[:, [*self.others, *self.columns]]
        return out

    def hint(self, names: Sequence[str], unit: Unit, before: float, after: float) -> Hint:
        """What is suspected, with the evidence."""
        columns = self.suspects or (*self.columns, *self.others)
        words = [f"`{names[k]}`" for k in columns]
        proof = f"{evidence(unit, before, after)} after the best rigid motion"
        kind: Kind
        if self.others:
            kind, half = "swapped", len(words) // 2
            message = f"{', '.join(words[:half])} and {', '.join(words[half:])} look swapped: {proof} when swapped back"
        elif self.factor < 0 and not self.suspects:
            kind, message = "sign", f"{words[0]} looks reversed in sign: {proof} with the opposite sign"
        elif self.factor < 0:
            kind = "mirrored"
            message = f"{', '.join(words)} look mirrored (one axis reversed in sign, or two columns swapped): "
            message += f"{proof} with one axis reversed"
        else:
            kind, look = "unit", f"look{'s' if len(words) == 1 else ''}"
            message = f"{', '.join(words)} {look} {times(self.factor)}{unit_words(unit, self.factor)}: "
            message += f"{proof} when multiplied by {self.factor:.4g}"
        right = [(k, k, self.factor) for k in self.columns]
        if self.others:
            both = list(zip(self.columns, self.others, strict=True))
            right = [*((i, j, 1.0) for i, j in both), *((j, i, 1.0) for i, j in both)]
        by_name = tuple(Right(names[i], names[j], factor) for i, j, factor in right)
        suspected = tuple(names[k] for k in columns)
        return Hint(kind=kind, names=suspected, message=message, before=before, after=after, columns=by_name)


def _changes(points: Points, unit: Unit) -> Iterator[_Change]:
    """A mirror image; units of all, of one axis, of one point, of one column; points exchanged, or one axis of them.

    Where there are several points, of each also a sign, or two axes exchanged.
    """
    every = tuple(k for p in points for k in p)
    yield _Change(tuple(p[0] for p in points), -1.0, suspects=every)
    axes = [tuple(p[k] for p in points) for k in range(len(points[0]))]
    each = [(k,) for k in every] if len(points) > 1 else []
    yield from (_Change(column, -1.0) for column in each)
    for columns in dict.fromkeys((every, *axes, *(tuple(p) for p in points), *each)):
        for factor in factors_of(unit):
            yield _Change(columns, factor)
    for point in points if len(points) > 1 else ():
        yield from (_Change((a,), others=(b,)) for a, b in combinations(point, 2))
    for one, other in combinations(points, 2):
        yield _Change(tuple(one), others=tuple(other))
        for a, b in zip(one, other, strict=True):
            yield _Change((a,), others=(b,))


def explain_frame(
    readings: FloatArray,
    predicted: FloatArray,
    points: Points,
    names: Sequence[str],
    units: Sequence[str],
    turns: Turns = (),
    expected: FloatArray | None = None,
) -> tuple[tuple[Hint, ...], FloatArray]:
    """What explains the readings (N, C) of one instrument where no rigid motion does: mirror image, unit, exchange.

    Returns hints, and the readings if these are followed. A mirror image is that of any one axis turned in sign and
    of any two exchanged: a rotation leads from one to the other, so which it was cannot be told. Orientations, `turns`,
    are judged by the motion of the points as they are then; `expected` (C,): rms that ranges and noise cause.
    """
    hints, right = _explain_points(readings, predicted, points, names, units)
    if turns and (motion := motion_of(right, predicted, points)) is not None:
        for vector in turns:
            more, right = explain_turns(right, predicted, vector, motion[0], names, units, expected=expected)
            hints += more
    return hints, right


def _explain_points(
    readings: FloatArray, predicted: FloatArray, points: Points, names: Sequence[str], units: Sequence[str]
) -> tuple[tuple[Hint, ...], FloatArray]:
    unit = parse_unit(units[points[0][0]])
    before, size = _misfit(readings, predicted, points)
    if not np.isfinite(before):
        return (), readings
    tried = [(_misfit(change.of(readings), predicted, points)[0], change) for change in _changes(points, unit)]
    after, change = min(tried, key=lambda each: each[0])
    if after > BETTER * before or after > EXPLAINED * size:
        return (), readings
    return (change.hint(names, unit, before, after),), change.of(readings)


def _misfit(readings: FloatArray, predicted: FloatArray, points: Points) -> tuple[float, float]:
    """Rms of what no rigid motion explains, and rms of the predicted points about their mean; infinite without any."""
    moved = brought_back(readings, predicted, points)
    columns = [k for p in points for k in p]
    misfit = (moved - predicted)[:, columns]
    known = np.isfinite(misfit)
    if not known.any():
        return np.inf, 0.0
    there = np.concatenate([predicted[:, list(p)] for p in points])
    there = there[np.isfinite(there).all(axis=1)]
    return float(np.sqrt(np.mean(misfit[known] ** 2))), float(np.sqrt(np.mean((there - there.mean(axis=0)) ** 2)))
