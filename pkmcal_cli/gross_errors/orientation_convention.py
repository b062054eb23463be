"""Orientations that are three angles, one turn after the other, or of a quaternion, where rotation vectors are meant.

Small ones hardly differ: by half the product of two of the angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from pkmcal_cli.base.rotation import exp, log
from pkmcal_cli.gross_errors.displaced import Names
from pkmcal_cli.gross_errors.plausibility import BETTER, FEW, GROSS, FloatArray, Hint, evidence, rms
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import parse_unit

_AXES = "xyz"
_QUATERNION = "quaternion"
CONVENTIONS = (*("".join(order) for order in permutations(_AXES)), _QUATERNION)
"""Axes of the instrument about which the body turns one after the other, those of most controllers first; and the
vector part of a unit quaternion."""
_AS_WELL = 2.0  # times the chi-square that the best convention leaves: the table does not tell another one from it


def rotation_vectors(read: FloatArray, convention: str) -> FloatArray:
    """Rotation vectors (N, 3), rad, of what stands for x, y and z in a convention; nan where there is none."""
    if convention == _QUATERNION:
        sine = np.sqrt((read**2).sum(axis=1, keepdims=True))
        with np.errstate(invalid="ignore"):  # no unit quaternion has a longer one
            return np.asarray(read * 2 * np.arcsin(sine) / np.where(sine > 0, sine, 1.0))
    known = np.asarray(np.isfinite(read).all(axis=1))
    turned = np.broadcast_to(np.eye(3), (len(read), 3, 3))
    for k in map(_AXES.index, convention):
        turned = exp(np.where(known, read[:, k], 0.0)[:, None] * np.eye(3)[k]) @ turned
    return np.where(known[:, None], log(turned), np.nan)


@dataclass(frozen=True)
class OtherConvention:
    """Channels, by name, that hold an orientation in a convention of their own."""

    vector: Names
    convention: str

    def put_back(self, readings: FloatArray, names: Sequence[str]) -> FloatArray:
        """Readings (N, C) of channels of these names with rotation vectors."""
        out = readings.copy()
        if all(n in names for n in self.vector):
            columns = [names.index(n) for n in self.vector]
            out[:, columns] = rotation_vectors(readings[:, columns], self.convention)
        return out


def explain_conventions(sample: Sample) -> tuple[Hint, ...]:
    """Orientations in space that another convention explains, beside errors of parameters and noise."""
    every = [triple for turns in (*sample.turns, *(t for _, t in sample.standing.values())) for triple in turns]
    hints = (_hint(sample, columns) for columns in every if len(columns) == len(_AXES))
    return tuple(hint for hint in hints if hint is not None)


def _hint(sample: Sample, columns: Sequence[int]) -> Hint | None:
    """The convention of some columns of a sample; None where these are rotation vectors, or no better in any other."""
    model, readings = sample.part.model, sample.readings
    if int(np.isfinite(readings[:, columns]).all(axis=1).sum()) < FEW:
        return None
    names = [c.name for c in model.channels]
    vector = tuple(names[k] for k in columns)
    ways = [OtherConvention(vector, convention) for convention in CONVENTIONS]
    tables = [way.put_back(readings, names) for way in ways]
    before, *after = sample.unexplained([readings, *tables])
    best = int(np.argmin(after))
    if not GROSS**2 < before < np.inf or after[best] > BETTER**2 * before:
        return None
    alike = [way for way, left in zip(ways, after, strict=True) if left <= _AS_WELL * after[best]]
    off = [rms((sample.compared(t, sample.predicted) - sample.predicted)[:, columns]) for t in (readings, tables[best])]
    proof = evidence(parse_unit(model.channels[columns[0]].unit), *off)
    message = f"{', '.join(f'`{n}`' for n in vector)} look like {_words(alike)}, not like a rotation vector: {proof} "
    message += "as that; convert them to the rotation vector, axis times angle, or leave them out"
    return Hint(kind="convention", names=vector, message=message, before=off[0], after=off[1], places=(ways[best],))


def _words(alike: Sequence[OtherConvention]) -> str:
    """What columns hold; orders of turns between which nothing decides stand side by side."""
    if alike[0].convention == _QUATERNION:
        return "the vector part of a quaternion"
    orders = [way.convention for way in alike if way.convention != _QUATERNION]
    turns = " or ".join(", then ".join(order) for order in orders)
    return f"angles of turns about the fixed axes {turns}"
