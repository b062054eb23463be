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
_AS_WELL = 1.5  # times what the best convention leaves: the table does not tell another one from it


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


def explain_conventions(sample: Sample) -> tuple[tuple[Hint, ...], float, float]:
    """Orientations in space that another convention explains.

    Returns hints, and the misfit before and after they are followed.
    """
    every = [turn for turns in (*sample.turns, *(turns for _, turns in sample.standing.values())) for turn in turns]
    hints, corrected = list[Hint](), sample.readings
    for columns in (turn for turn in every if len(turn) == len(_AXES)):
        if (hint := _hint(sample, columns)) is not None:
            hints.append(hint)
            corrected = hint.places[0].put_back(corrected, [c.name for c in sample.part.model.channels])
    return tuple(hints), *sample.misfits(corrected)


def _hint(sample: Sample, columns: Sequence[int]) -> Hint | None:
    """The convention of some columns of a sample; None where these are rotation vectors, or no better in any other."""
    model = sample.part.model
    names = [c.name for c in model.channels]
    vector = tuple(names[k] for k in columns)
    ways = [OtherConvention(vector, convention) for convention in CONVENTIONS]

    def left(table: FloatArray) -> float:
        apart = (sample.compared(table, sample.predicted) - sample.predicted)[:, list(columns)]
        return rms(apart) if int(np.isfinite(apart).all(axis=1).sum()) >= FEW else np.inf

    before, after = left(sample.readings), [left(way.put_back(sample.readings, names)) for way in ways]
    least = min(after)
    if not GROSS * rms(sample.prior_rms[list(columns)]) < before < np.inf or least > BETTER * before:
        return None
    alike = [way for way, rest in zip(ways, after, strict=True) if rest <= _AS_WELL * least]
    quoted = ", ".join(f"`{n}`" for n in vector)
    proof = evidence(parse_unit(model.channels[columns[0]].unit), before, least)
    message = f"{quoted} look like {_words(alike)}, not like a rotation vector: {proof} as that"
    message += "; convert them to the rotation vector, axis times angle, or leave them out"
    return Hint(kind="convention", names=vector, message=message, before=before, after=least, places=(alike[0],))


def _words(alike: Sequence[OtherConvention]) -> str:
    """What columns hold; orders of turns between which nothing decides stand side by side."""
    if alike[0].convention == _QUATERNION:
        return "the vector part of a quaternion"
    orders = [way.convention for way in alike if way.convention != _QUATERNION]
    turns = " or ".join(", then ".join(order) for order in orders)
    return f"angles of turns about the fixed axes {turns}"
