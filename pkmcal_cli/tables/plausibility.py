"""Gross mistakes in measurements, looked for before any solve: columns swapped, wrong units, signs, limits.

Pure functions on arrays. What they find are hints with evidence; whether one is an error the caller decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.language.units import UNITS, Unit, parse_unit

FloatArray = NDArray[np.float64]
Kind = Literal["swapped", "moved", "unit", "sign", "offset", "limits"]

_FACTORS = (1e3, 1e-3, 1e6, 1e-6, 25.4, 1 / 25.4, 180 / np.pi, np.pi / 180)
_BETTER = 0.2  # an explanation leaves at most this share of the residual
_EXPLAINED = 0.1  # and at most this share of what is predicted
_FEW = 4  # rows below which a coincidence is likely, so that the residual itself must be gross


@dataclass(frozen=True)
class Hint:
    """A suspicion: what it is, the columns, the words, and the evidence.

    before, after: rms of measured minus predicted (SI) as it stands and if the hint is followed (limits: rows
    outside); rows: those concerned, for limits
    """

    kind: Kind
    names: tuple[str, ...]
    message: str
    before: float
    after: float
    rows: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Match:
    """Column `source` times `factor` explains the prediction of a column, leaving the rms `after`."""

    source: int
    factor: float
    before: float
    after: float


def find_gross_faults(
    measured: FloatArray,
    predicted: FloatArray,
    names: Sequence[str],
    units: Sequence[str] | None = None,
) -> tuple[Hint, ...]:
    """Columns (N, C) that explain the prediction (N, C) far better when exchanged, scaled or turned in sign.

    Both in SI, NaN where there is no value (such rows do not count); `units` are those of the file, for the
    words and so that only columns of one dimension are taken for each other. Works as well on actuators,
    against the positions that the inverse model gives for measured poses.
    """
    scale = [parse_unit(unit) for unit in units] if units is not None else [UNITS["1"]] * len(names)
    best = {i: _best(measured, predicted, i, scale) for i in range(len(names))}
    matches = {i: match for i, match in best.items() if match is not None}
    hints: list[Hint] = []
    told: set[int] = set()
    for i, match in matches.items():
        if i not in told:
            hint, columns = _explain(i, match, matches, names, scale)
            told |= columns
            hints.append(hint)
    for i in range(len(names)):
        if i not in told and (offset := _offset(measured[:, i], predicted[:, i], names[i], scale[i])):
            hints.append(offset)
    return tuple(hints)


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
            hints.append(Hint("limits", (name,), message + remedy, len(rows), left, rows))
    return tuple(hints)


# --- against predictions ----------------------------------------------------------------------


def _rms(values: FloatArray) -> float:
    """Root mean square over the rows that have a value; infinite without any."""
    good = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(good**2))) if good.size else np.inf


def _best(measured: FloatArray, predicted: FloatArray, i: int, units: Sequence[Unit]) -> _Match | None:
    """What explains column i of the prediction far better than column i itself does; None if nothing."""
    target = predicted[:, i]
    before, size = _rms(measured[:, i] - target), _rms(target)
    if not np.isfinite(before):
        return None
    found: _Match | None = None
    for j in range(measured.shape[1]):
        if units[j].dimension == units[i].dimension:
            for factor in (1.0, *_FACTORS) if j == i else (1.0,):
                for sign in (1.0, -1.0):
                    after = _rms(sign * factor * measured[:, j] - target)
                    if (j, sign * factor) != (i, 1.0) and (found is None or after < found.after):
                        found = _Match(j, sign * factor, before, after)
    rows = int(np.isfinite(measured[:, i] - target).sum())
    if found is None or found.after > _BETTER * before or found.after > _EXPLAINED * size:
        return None
    return None if rows < _FEW and before < _EXPLAINED * size else found


def _explain(
    i: int, match: _Match, matches: dict[int, _Match], names: Sequence[str], units: Sequence[Unit]
) -> tuple[Hint, set[int]]:
    """The hint for column i, and the columns that it covers."""
    j, name = match.source, names[i]
    evidence = f"residual rms {units[i].format(match.before, 3)} -> {units[i].format(match.after, 2)}"
    sign = "-" if match.factor < 0 else ""
    back = matches.get(j)
    if j != i and back is not None and back.source == i:
        turned = "" if match.factor > 0 and back.factor > 0 else ", and turned in sign,"
        before, after = float(np.hypot(match.before, back.before)), float(np.hypot(match.after, back.after))
        evidence = f"residual rms {units[i].format(before, 3)} -> {units[i].format(after, 2)}"
        message = f"`{name}` and `{names[j]}` look swapped{turned}: {evidence} when exchanged"
        return Hint("swapped", (name, names[j]), message, before, after), {i, j}
    if j != i:
        message = f"column `{names[j]}` looks like {sign}`{name}`: {evidence} when it is taken for that"
        return Hint("moved", (name, names[j]), message, match.before, match.after), {i}
    if match.factor == -1.0:
        message = f"`{name}` looks turned in sign: {evidence} with the other sign"
        return Hint("sign", (name,), message, match.before, match.after), {i}
    unit = _unit_words(units[i], abs(match.factor))
    size = f"{_times(abs(match.factor))}{unit}{' and turned in sign' if sign else ''}"
    message = f"`{name}` looks {size}: {evidence} when multiplied by {match.factor:.4g}"
    return Hint("unit", (name,), message, match.before, match.after), {i}


def _times(factor: float) -> str:
    return f"{1 / factor:.4g} times too large" if factor < 1 else f"{factor:.4g} times too small"


def _unit_words(unit: Unit, factor: float) -> str:
    """The words " (is it in m, not mm?)" where a unit of the table fits."""
    others = [u for u in UNITS.values() if u.dimension == unit.dimension and unit.text != "1"]
    for other in others:
        if np.isclose(other.scale, unit.scale * factor, rtol=1e-9):
            return f" (is it in {other.text}, not {unit.text}?)"
    return ""


def _offset(measured: FloatArray, predicted: FloatArray, name: str, unit: Unit) -> Hint | None:
    """A deviation that is large and the same everywhere: the origin lies elsewhere."""
    deviation = (measured - predicted)[np.isfinite(measured - predicted)]
    if deviation.size < _FEW:
        return None
    mean, spread = float(deviation.mean()), float(deviation.std())
    extent = float(np.ptp(predicted[np.isfinite(predicted)]))
    if extent == 0 or abs(mean) < 0.5 * extent or spread > 0.05 * abs(mean):
        return None
    before = _rms(deviation)
    evidence = f"residual rms {unit.format(before, 3)} -> {unit.format(spread, 2)} without it"
    size = unit.format(mean, 4)
    message = f"`{name}` is off by {size} in all rows (is its origin elsewhere?): {evidence}"
    return Hint("offset", (name,), message, before, spread)


# --- against limits ---------------------------------------------------------------------------


def limit_excess(values: FloatArray | float, limits: FloatArray | tuple[float, float]) -> FloatArray:
    """By how much values lie outside [low, high]; 0 inside, within rounding of a limit, and where unknown (nan)."""
    ends = np.asarray(limits)
    finite = ends[np.isfinite(ends)]
    slack = 1e-9 * float(np.abs(finite).max()) if finite.size else 0.0
    excess = np.maximum(ends[0] - values, values - ends[1])
    return np.where(excess > slack, excess, 0.0)


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
            return f"; exchanged with `{name}` all are inside"
    if fits(-values, i):
        return "; with the other sign all are inside"
    for factor in _FACTORS:
        if fits(factor * values, i):
            return f"; multiplied by {factor:.4g} all are inside{_unit_words(units[i], factor)}"
    return ""
