"""Orientations that an instrument reads which stands anywhere: how it is turned is known by its points alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import exp, log, other_way_round
from pkmcal_cli.gross_errors.plausibility import BETTER, EXPLAINED, FloatArray, Hint, Right, evidence, rms, spread
from pkmcal_cli.units.file_units import Unit, parse_unit
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words

Turns = Sequence[Sequence[int]]
"""Columns of each rotation vector that one instrument reads: three, in the plane one."""


def turned_back(read: FloatArray, predicted: FloatArray, rotation: FloatArray) -> FloatArray:
    """Rotation vectors (N, k) as read, turned by a rotation (d, d) of the instrument; the way round that is predicted.

    Nan where not all components were read.
    """
    if read.shape[1] == 1:
        back = read + np.arctan2(rotation[1, 0], rotation[0, 0])
        return np.asarray(back - 2 * np.pi * np.round((back - predicted) / (2 * np.pi)))
    known = np.isfinite(read).all(axis=1, keepdims=True)
    back = log(rotation @ exp(np.where(known, read, 0.0)))
    other = other_way_round(back)
    nearer = ((other - predicted) ** 2).sum(axis=1) < ((back - predicted) ** 2).sum(axis=1)
    return np.where(known, np.where(nearer[:, None], other, back), np.nan)


def lever(places: FloatArray) -> float:
    """Rms distance of places (n, d) from the axis through their middle about which they show a rotation least, m."""
    known = places[np.isfinite(places).all(axis=1)]
    if not len(known):
        return 0.0
    sizes = np.linalg.svd(known - known.mean(axis=0), compute_uv=False)[places.shape[1] - 2 :]
    return float(np.sqrt((sizes**2).sum() / len(known)))


@dataclass(frozen=True)
class _Change:
    """Some columns times a factor."""

    columns: tuple[int, ...]
    factor: float

    def hint(self, names: Sequence[str], unit: Unit, before: float, after: float) -> Hint:
        """What is suspected, with the evidence."""
        suspected = tuple(names[k] for k in self.columns)
        look = f"{', '.join(f'`{n}`' for n in suspected)} look{'s' if len(suspected) == 1 else ''}"
        proof = f"{evidence(unit, before, after)} as the points show the instrument turned,"
        if self.factor < 0:
            message = f"{look} reversed in sign: {proof} with the opposite sign"
        else:
            message = f"{look} {times(self.factor)}{unit_words(unit, self.factor)}: {proof} "
            message += f"when multiplied by {self.factor:.4g}"
        right = tuple(Right(n, n, self.factor) for n in suspected)
        kind = "sign" if self.factor < 0 else "unit"
        return Hint(kind=kind, names=suspected, message=message, before=before, after=after, columns=right)  # type: ignore[arg-type]


def explain_turns(
    readings: FloatArray,
    predicted: FloatArray,
    columns: Sequence[int],
    rotation: FloatArray,
    names: Sequence[str],
    units: Sequence[str],
) -> tuple[tuple[Hint, ...], FloatArray]:
    """Which sign or unit explains the rotation vectors in some columns of readings (N, C); and readings put right."""
    unit, there = parse_unit(units[columns[0]]), predicted[:, columns]
    each = tuple((k,) for k in columns) if len(columns) > 1 else ()
    changes = [_Change(tuple(columns), f) for f in (-1.0, *factors_of(unit))] + [_Change(c, -1.0) for c in each]

    def left(table: FloatArray) -> float:
        return rms(turned_back(table[:, columns], there, rotation) - there)

    before, size = left(readings), float(np.sqrt((spread(there) ** 2).sum()))
    if not np.isfinite(before):
        return (), readings
    after, change = min(((left(_changed(readings, c)), c) for c in changes), key=lambda tried: tried[0])
    if after > BETTER * before or after > EXPLAINED * size:
        return (), readings
    return (change.hint(names, unit, before, after),), _changed(readings, change)


def _changed(readings: FloatArray, change: _Change) -> FloatArray:
    out = readings.copy()
    out[:, change.columns] *= change.factor
    return out
