"""Orientations that are three angles, one turn after the other, or of a quaternion, where rotation vectors are meant.

Small ones hardly differ: by half the product of two of the angles. They may be in another unit as well, and rotation
vectors or angles may be counted from another orientation, as that of the first row, or told in other axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from pkmcal_cli.base.rotation import exp, log
from pkmcal_cli.gross_errors.displaced import Names
from pkmcal_cli.gross_errors.frame_turns import LEAST_TURN, best_turn, orientations, turned_by
from pkmcal_cli.gross_errors.plausibility import BETTER, FEW, GROSS, FloatArray, Hint, evidence, rms
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import parse_unit

_AXES = "xyz"
_VECTOR, _QUATERNION = "vector", "quaternion"
CONVENTIONS = (*("".join(order) for order in permutations(_AXES)), _QUATERNION)
"""Axes of the instrument about which the body turns one after the other, those of most controllers first; and the
vector part of a unit quaternion."""
_UNITS = {1.0: "", math.radians(1.0): " in degrees", math.degrees(1.0): " in radians"}  # by what factor they are right
_AS_WELL = 2.0  # times the chi-square that the best convention leaves: the table does not tell another one from it


def rotation_vectors(read: FloatArray, convention: str) -> FloatArray:
    """Rotation vectors (N, 3), rad, of what stands for x, y and z in a convention; nan where there is none."""
    if convention == _VECTOR:
        return read
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
    """Channels, by name, that hold an orientation in a convention of their own, right times a factor.

    back (3, 3): what turns it back, of the body (`first`) or the axes; None where nothing does.
    """

    vector: Names
    convention: str
    factor: float = 1.0
    back: FloatArray | None = None
    first: bool = True

    def put_back(self, readings: FloatArray, names: Sequence[str]) -> FloatArray:
        """Readings (N, C) of channels of these names with rotation vectors."""
        out = readings.copy()
        if all(n in names for n in self.vector):
            columns = [names.index(n) for n in self.vector]
            out[:, columns] = rotation_vectors(self.factor * readings[:, columns], self.convention)
            if self.back is not None:
                out[:, columns] = turned_by(out[:, columns], self.back, self.first)
        return out

    @property
    def words(self) -> str:
        """What the columns look like."""
        if self.convention == _VECTOR:
            return self._counted
        if self.convention == _QUATERNION:
            like = "like the vector part of a quaternion"
        else:
            about = ", then ".join(self.convention)
            like = f"like angles{_UNITS[self.factor]} of turns about the fixed axes {about}"
        return f"{like}, not like a rotation vector" + (f", and {self._counted}" if self.back is not None else "")

    @property
    def _counted(self) -> str:
        assert self.back is not None
        size = parse_unit("deg").format(float(np.linalg.norm(log(self.back))), 3)
        counted = "counted from another orientation, as that of the first row" if self.first else "given in other axes"
        return f"{counted} ({size} off)"


def explain_conventions(sample: Sample) -> tuple[Hint, ...]:
    """Orientations in space that another convention explains, beside errors of parameters and noise."""
    standing = [triple for _, turns in sample.standing.values() for triple in turns]
    every = [(triple, True) for triple in standing]
    every += [(triple, False) for triples in sample.turns for triple in triples]
    hints = (_hint(sample, columns, stands) for columns, stands in every if len(columns) == len(_AXES))
    return tuple(hint for hint in hints if hint is not None)


def _hint(sample: Sample, columns: Sequence[int], stands: bool) -> Hint | None:
    """The convention of some columns of a sample; None where these are rotation vectors, or no better in any other.

    stands: whether the machine file says how the instrument is turned.
    """
    model, readings = sample.part.model, sample.readings
    few = int(np.isfinite(readings[:, columns]).all(axis=1).sum()) < FEW
    if few or not GROSS**2 < sample.unexplained([readings])[0] < np.inf:
        return None
    names = [c.name for c in model.channels]
    ways = list(_ways(sample, columns, tuple(names[k] for k in columns), stands))
    tables = [way.put_back(readings, names) for way in ways]
    before, *after = sample.unexplained([readings, *tables])
    least = min(after)
    best = next(k for k, left in enumerate(after) if left <= _AS_WELL * least)  # of those that do as well, the simplest
    if least > BETTER**2 * before or (ways[best].back is not None and least > GROSS**2):
        return None
    off = [rms((sample.compared(t, sample.predicted) - sample.predicted)[:, columns]) for t in (readings, tables[best])]
    proof = evidence(parse_unit(model.channels[columns[0]].unit), *off)
    message = f"{', '.join(f'`{n}`' for n in ways[best].vector)} look {ways[best].words}: {proof} as that; "
    message += "convert them to rotation vectors (axis times angle) from the reference configuration, or leave them out"
    return Hint(
        kind="convention", names=ways[best].vector, message=message, before=off[0], after=off[1], places=(ways[best],)
    )


def _ways(sample: Sample, columns: Sequence[int], vector: Names, stands: bool) -> Iterator[OtherConvention]:
    """What the columns may hold, the simplest first; a wrong unit alone is told elsewhere."""
    yield from (OtherConvention(vector, c, factor) for factor, c in product(_UNITS, CONVENTIONS))
    names, there = [c.name for c in sample.part.model.channels], orientations(sample.predicted[:, columns])
    for convention in (_VECTOR, *CONVENTIONS) if stands else ():
        plain = OtherConvention(vector, convention)
        read = orientations(plain.put_back(sample.readings, names)[:, columns])
        known = np.isfinite(read).all(axis=(1, 2)) & np.isfinite(there).all(axis=(1, 2))
        for first in (True, False) if int(known.sum()) >= FEW else ():
            back = best_turn(read[known], there[known], first)
            if float(np.linalg.norm(log(back))) > LEAST_TURN:
                yield replace(plain, back=back, first=first)
