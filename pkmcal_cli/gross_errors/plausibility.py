"""Suspicions of gross mistakes, with their evidence; drives outside their limits.

Pure functions on arrays. What they find are hints; whether one is an error the caller decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.model.limits import limit_excess
from pkmcal_cli.units.file_units import UNITS, Unit, parse_unit
from pkmcal_cli.units.mistaken_units import factors_of, unit_words

FloatArray = NDArray[np.float64]
Kind = Literal[
    "swapped", "rotated", "moved", "unit", "sign", "mirrored", "offset", "rows", "copies", "limits", "repeated",
    "convention",
]

BETTER = 0.2  # an explanation leaves at most this share of the residual
EXPLAINED = 0.1  # and at most this share of what is predicted
FEW = 4  # rows below which a coincidence is likely, so that the residual itself must be gross
_MOVES = 0.01  # share of the spread of readings below which a prediction stays where it is
GROSS = 5.0  # times what errors of parameters and noise cause: a residual that no fit takes away


@dataclass(frozen=True)
class Right:
    """A column as it is right: times a factor that which `source` holds, then shifted, SI."""

    name: str
    source: str
    factor: float
    shift: float = 0.0


@dataclass(frozen=True)
class MovedReadings:
    """Readings of columns that stand in wrong rows: those of a session from row `first` on are `shift` rows further.

    unsure: how many rows before that nobody can tell the readings of.
    """

    names: tuple[str, ...]
    shift: int
    first: int
    unsure: int


class Displaced(Protocol):
    """Readings that were taken elsewhere than the machine file says."""

    def put_back(self, readings: FloatArray, names: Sequence[str]) -> FloatArray:
        """Readings (N, C) of channels of these names as they would have been where it says."""


@dataclass(frozen=True, kw_only=True)
class Hint:
    """A suspicion: what it is, the columns, the words, and the evidence.

    before, after: rms of measured minus predicted (SI) as it stands and if the hint is followed (limits: rows
    outside); rows: those concerned, for limits; columns, moved, places: what puts the table right, empty where nothing
    does
    """

    kind: Kind
    names: tuple[str, ...]
    message: str
    before: float
    after: float
    rows: tuple[int, ...] = ()
    columns: tuple[Right, ...] = ()
    moved: tuple[MovedReadings, ...] = ()
    places: tuple[Displaced, ...] = ()

    @property
    def mends(self) -> bool:
        """Whether it says how the table is put right."""
        return bool(self.columns or self.moved or self.places)

    def of_some(self, rows: NDArray[np.intp], words: str) -> Hint:
        """The same of some rows (n,) of a table, which `words` tell: it says not how the whole table is put right."""
        return replace(self.unmended(words), rows=tuple(int(rows[k]) for k in self.rows))

    def unmended(self, words: str) -> Hint:
        """The same after `words`, without saying how the table is put right."""
        return replace(self, message=words + self.message, columns=(), moved=(), places=())


def find_limit_faults(
    readings: FloatArray, limits: FloatArray, names: Sequence[str], units: Sequence[str] | None = None
) -> tuple[Hint, ...]:
    """Actuators outside their limits: readings (N, A), limits (A, 2) in SI; infinite is none, NaN is inside.

    Says where all would be inside with another unit, the other sign, or another actuator's column.
    """
    scale = [parse_unit(unit) for unit in units] if units is not None else [UNITS["1"]] * len(names)
    hints = []
    for i, name in enumerate(names):
        outside = _outside(readings[:, i], limits[i])
        rows = tuple(int(row) for row in np.nonzero(outside)[0])
        if rows:
            worst = readings[limit_excess(readings[:, i], limits[i]).argmax(), i]
            low, high = (scale[i].format(float(limit), 6) for limit in limits[i])
            message = (
                f"`{name}` is outside its limits ({low} to {high}) in {len(rows)} of {len(readings)} rows, "
                f"at worst {scale[i].format(float(worst), 6)}"
            )
            remedy = _inside(readings, limits, i, names, scale)
            left = 0 if remedy else len(rows)
            hints.append(
                Hint(kind="limits", names=(name,), message=message + remedy, before=len(rows), after=left, rows=rows)
            )
    return tuple(hints)


# --- against limits ---------------------------------------------------------------------------


def _outside(values: FloatArray, limits: FloatArray) -> NDArray[np.bool_]:
    """Rows (N,) outside [low, high] by more than rounding."""
    return limit_excess(values, limits) > 0


def _inside(readings: FloatArray, limits: FloatArray, i: int, names: Sequence[str], units: Sequence[Unit]) -> str:
    """What would bring all readings of an actuator inside its limits, so that they fill some of them."""
    values = readings[:, i]

    def fits(changed: FloatArray, k: int) -> bool:
        good = changed[np.isfinite(changed)]
        width = float(limits[k, 1] - limits[k, 0])
        return good.size > 0 and not _outside(good, limits[k]).any() and float(np.ptp(good)) > 0.05 * width

    for j, name in enumerate(names):
        alike = j != i and units[j].dimension == units[i].dimension
        both = alike and _outside(readings[:, j], limits[j]).any()
        if both and fits(readings[:, j], i) and fits(values, j):
            return f"; all are inside when swapped with `{name}`"
    if fits(-values, i):
        return "; all are inside with the opposite sign"
    wrong = _outside(values[np.isfinite(values)], limits[i]).mean() > 0.5  # a unit is wrong in all rows
    for factor in factors_of(units[i]) if wrong else ():
        if fits(factor * values, i):
            return f"; all are inside when multiplied by {factor:.4g}{unit_words(units[i], factor)}"
    return ""


# --- what hints share -------------------------------------------------------------------------


def rms(values: FloatArray) -> float:
    """Root mean square over the cells that have a value; infinite without any."""
    good = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(good**2))) if good.size else np.inf


def spread(values: FloatArray) -> FloatArray:
    """Standard deviation (C,) of columns (N, C) over the cells that have a value; 0 without any."""
    known = np.isfinite(values)
    count = np.maximum(known.sum(axis=0), 1)
    mean = np.where(known, values, 0.0).sum(axis=0) / count
    return np.asarray(np.sqrt((np.where(known, values - mean, 0.0) ** 2).sum(axis=0) / count))


def misfit(measured: FloatArray, predicted: FloatArray, read: FloatArray) -> float:
    """Rms of measured less predicted (N, C), each column in spreads of its prediction.

    Where that hardly moves, in spreads of what was read (N, C). Columns where neither moves count not, nor do those
    with few values.
    """
    size, other = spread(predicted), spread(read)
    size = np.where(size > _MOVES * other, size, other)
    moves = (size > 0) & (np.isfinite(measured - predicted).sum(axis=0) >= FEW)
    return rms((measured - predicted)[:, moves] / size[moves])


def evidence(unit: Unit, before: float, after: float) -> str:
    """The words "residual rms 3.2 mm -> 0.11 mm"."""
    return f"residual rms {unit.format(before, 3)} -> {unit.format(after, 2)}"
