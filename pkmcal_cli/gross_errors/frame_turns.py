"""Orientations that an instrument reads which stands anywhere: how it is turned is known by its points alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import exp, log, other_way_round
from pkmcal_cli.gross_errors.plausibility import (
    BETTER,
    EXPLAINED,
    GROSS,
    FloatArray,
    Hint,
    Right,
    evidence,
    rms,
    spread,
)
from pkmcal_cli.units.file_units import Unit, parse_unit
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words

LEAST_TURN = 0.05
"""What is less, rad, is no convention of axes."""

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


def orientations(vectors: FloatArray) -> FloatArray:
    """Of rotation vectors (N, 3), or angles (N, 1) in the plane; (N, d, d), nan where one is not whole."""
    missing = np.asarray(~np.isfinite(vectors).all(axis=1))
    whole = np.zeros((len(vectors), 3))
    whole[:, 3 - vectors.shape[1] :] = np.where(missing[:, None], 0.0, vectors)
    axes = 2 if vectors.shape[1] == 1 else 3
    out = exp(whole)[:, :axes, :axes]
    out[missing] = np.nan
    return np.asarray(out)


def vectors_of(rotations: FloatArray) -> FloatArray:
    """Rotation vectors (N, 3) of rotations (N, 3, 3), or angles (N, 1) in the plane; nan where one is not whole."""
    if rotations.shape[1:] == (2, 2):
        return np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])[:, None]
    whole = np.isfinite(rotations).all(axis=(1, 2))
    out = np.full((len(rotations), 3), np.nan)
    out[whole] = log(rotations[whole])
    return out


def best_turn(read: FloatArray, expected: FloatArray, first: bool) -> FloatArray:
    """The rotation (d, d) that brings orientations (N, d, d) nearest to others: of bodies (`first`) or of axes."""
    inverse = np.swapaxes(read, 1, 2)
    pairs = inverse @ expected if first else expected @ inverse
    u, _, vt = np.linalg.svd(pairs.sum(axis=0))
    u[:, -1] *= np.linalg.det(u @ vt)
    return np.asarray(u @ vt)


def turned_by(vectors: FloatArray, back: FloatArray, first: bool) -> FloatArray:
    """Rotation vectors (N, k), rad, turned by a rotation (d, d) of bodies (`first`), or of axes."""
    turned = orientations(vectors)
    return vectors_of(turned @ back if first else back @ turned)


@dataclass(frozen=True)
class _Change:
    """Some columns times a factor."""

    columns: tuple[int, ...]
    factor: float

    def of(self, readings: FloatArray) -> FloatArray:
        """The readings (N, C), changed."""
        out = readings.copy()
        out[:, self.columns] *= self.factor
        return out

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


@dataclass(frozen=True)
class _Counted:
    """Rotation vectors in some columns that are counted from another orientation, or told in other axes.

    An instrument that stands anywhere reads R B of a body that has turned by B. R B Q are those counted from another
    orientation (as R B R^-1 from the reference pose), and Q R B those in other axes, back (d, d) being Q^-1.
    """

    columns: tuple[int, ...]
    back: FloatArray
    first: bool

    @classmethod
    def of_best(cls, readings: FloatArray, expected: FloatArray, columns: tuple[int, ...], first: bool) -> _Counted:
        """With the turn that brings readings (N, C) nearest to predictions (N, d, d); `first`: of the body."""
        return cls(columns, best_turn(orientations(readings[:, columns]), expected, first), first)

    @property
    def size(self) -> float:
        """By how much it turns, rad."""
        return float(np.linalg.norm(vectors_of(self.back[None])))

    def of(self, readings: FloatArray) -> FloatArray:
        """The readings (N, C), turned."""
        out = readings.copy()
        out[:, self.columns] = turned_by(readings[:, self.columns], self.back, self.first)
        return out

    def hint(self, names: Sequence[str], unit: Unit, before: float, after: float) -> Hint:
        """What is suspected, with the evidence. A turn known by the nominal machine alone puts nothing right."""
        suspected = tuple(names[k] for k in self.columns)
        look = f"{', '.join(f'`{n}`' for n in suspected)} look{'s' if len(suspected) == 1 else ''}"
        other = "counted from another orientation, as from the reference pose"
        suspicion = other if self.first else "given in other axes"
        size = parse_unit("deg").format(self.size, 3)
        message = f"{look} {suspicion}: {evidence(unit, before, after)} when turned by {size} in all rows. Give "
        message += "orientations of the body in the axes in which the instrument gives its points, or leave them out"
        return Hint(kind="rotated", names=suspected, message=message, before=before, after=after)


def explain_turns(
    readings: FloatArray,
    predicted: FloatArray,
    columns: Sequence[int],
    rotation: FloatArray,
    names: Sequence[str],
    units: Sequence[str],
    expected: FloatArray | None = None,
) -> tuple[tuple[Hint, ...], FloatArray]:
    """What explains rotation vectors in some columns of readings (N, C): sign, unit, a turn; and readings put right.

    A turn that ranges and noise may cause, rms `expected` (C,), is none: zeros of wrists are parameters.
    """
    unit, there = parse_unit(units[columns[0]]), predicted[:, columns]
    each = tuple((k,) for k in columns) if len(columns) > 1 else ()
    changes = [_Change(tuple(columns), f) for f in (-1.0, *factors_of(unit))] + [_Change(c, -1.0) for c in each]
    seen = rotation.T @ orientations(there)  # as predicted in the axes of the instrument
    known = np.isfinite(readings[:, columns]).all(axis=1) & np.isfinite(seen).all(axis=(1, 2))
    sides = () if not known.any() else (True, False) if each else (True,)
    counted = [_Counted.of_best(readings[known], seen[known], tuple(columns), first) for first in sides]
    least = 0.0 if expected is None else GROSS * float(np.linalg.norm(expected[list(columns)]))
    counted = [c for c in counted if c.size > max(LEAST_TURN, least)]

    def left(table: FloatArray) -> float:
        return rms(turned_back(table[:, columns], there, rotation) - there)

    before, size = left(readings), float(np.sqrt((spread(there) ** 2).sum()))
    if not np.isfinite(before):
        return (), readings
    every: list[_Change | _Counted] = [*changes, *counted]
    tried = [(left(change.of(readings)), change) for change in every]
    after, change = min(tried, key=lambda one: one[0])
    if after > BETTER * before or after > EXPLAINED * size:
        return (), readings
    return (change.hint(names, unit, before, after),), change.of(readings)
