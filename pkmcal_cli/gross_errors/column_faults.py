"""Columns that are exchanged, rotated, scaled, turned in sign or shifted, by what they should read.

Pure functions on arrays. They work on measured channels against predictions, and on drives against the positions that
the inverse model gives for measured poses.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pkmcal_cli.gross_errors.plausibility import (
    BETTER,
    EXPLAINED,
    FEW,
    GROSS,
    FloatArray,
    Hint,
    Right,
    evidence,
    rms,
    spread,
)
from pkmcal_cli.units.file_units import UNITS, Unit, parse_unit
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words

_RING = 3  # columns of the smallest ring; two are swapped


@dataclass(frozen=True)
class Explanation:
    """Hints, and the table (N, C) as it is when they are followed."""

    hints: tuple[Hint, ...]
    corrected: FloatArray


@dataclass(frozen=True)
class _Match:
    """Column `source` times `factor` explains the prediction of a column, leaving the rms `after`."""

    source: int
    factor: float
    before: float
    after: float


@dataclass(kw_only=True)
class _Table:
    """What is compared: measured and predicted (N, C), names, units, prior rms of residuals (C,)."""

    measured: FloatArray
    predicted: FloatArray
    names: tuple[str, ...]
    units: tuple[Unit, ...]
    prior_rms: FloatArray
    steady: bool = False
    explained: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        known = np.where(np.isfinite(self.measured), self.predicted, np.nan)
        size = np.array([rms(c) for c in known.T]) if self.steady else spread(known)
        size = np.where(np.isfinite(size), size, 0.0)
        before = np.array([rms(column) for column in (self.measured - self.predicted).T])
        self.before = np.where(np.isfinite(before), before, np.nan)
        self.informative = (size > GROSS * self.prior_rms) & (size > 0)  # a column that stays explains nothing
        self.gross = self.informative & (before > GROSS * self.prior_rms) & np.isfinite(before)

    def rest(self, i: int, source: int, factor: float = 1.0) -> float:
        """Rms of column i if it is another column times a factor."""
        return rms(factor * self.measured[:, source] - self.predicted[:, i])

    def match(self, i: int, source: int, factor: float = 1.0) -> _Match:
        """Column i taken from another one."""
        return _Match(source, factor, float(self.before[i]), self.rest(i, source, factor))

    def size(self, i: int) -> float:
        """Rms of the prediction."""
        return rms(self.predicted[:, i])

    def quoted(self, columns: Iterable[int]) -> str:
        """Names in words: "`x`, `y` and `z`"."""
        quoted = [f"`{self.names[i]}`" for i in columns]
        return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"


def explain_columns(
    measured: FloatArray,
    predicted: FloatArray,
    names: Sequence[str],
    units: Sequence[str] | None = None,
    prior_rms: FloatArray | None = None,
    steady: bool = False,
) -> Explanation:
    """Columns (N, C) that explain the prediction (N, C) far better when exchanged, scaled or turned in sign.

    Both in SI, NaN where there is no value (such rows do not count); `units` are those of the file, for the
    words and so that only columns of one dimension are taken for each other. `prior_rms` (C,): rms that errors of
    parameters and noise cause; residuals not far above it need no explanation, nor do predictions that hardly move,
    but if `steady`: then each column is explained by itself, its size being a sign or unit.
    """
    scale = [parse_unit(unit) for unit in units] if units is not None else [UNITS["1"]] * len(names)
    expected = np.zeros(len(names)) if prior_rms is None else prior_rms
    table = _Table(
        measured=measured,
        predicted=predicted,
        names=tuple(names),
        units=tuple(scale),
        prior_rms=expected,
        steady=steady,
    )
    best = {i: _best(table, i) for i in np.nonzero(table.gross)[0].tolist()}
    matches = {i: match for i, match in best.items() if match is not None} | ({} if steady else _rotation(table))
    for i, match in list(matches.items()):
        j = match.source
        if j not in matches and table.rest(j, i) < BETTER * table.before[j]:
            matches[j] = table.match(j, i)  # it stays, and cannot tell by itself that they are swapped
    corrected, matches = measured.copy(), dict(sorted(matches.items()))
    for i, match in matches.items():
        corrected[:, i] = match.factor * measured[:, match.source]
    hints = [*_rings(table, matches), *_exchanges(table, matches), *_rescaled(table, matches)]
    if not steady:
        hints += _shifted(table, [i for i in range(len(names)) if i not in matches], corrected)
    return Explanation(tuple(hints), corrected)


def _shifted(table: _Table, columns: Iterable[int], corrected: FloatArray) -> list[Hint]:
    """Columns from another origin, or from another end, which are put right in `corrected` (N, C)."""
    hints = []
    for i in columns:
        if hint := _offset(table, i):
            corrected[:, i] -= np.nanmean(table.measured[:, i] - table.predicted[:, i])
        elif hint := _mirrored(table, i):
            corrected[:, i] = hint.columns[0].shift - table.measured[:, i]
        hints += [hint] if hint else []
    return hints


def _best(table: _Table, i: int) -> _Match | None:
    """What explains column i of the prediction far better than column i itself does; None if nothing."""
    best: _Match | None = None
    for j in [i] if table.steady else range(len(table.names)):
        if table.units[j].dimension == table.units[i].dimension:
            for factor in (1.0, *factors_of(table.units[i])) if j == i else (1.0,):
                for sign in (1.0, -1.0):
                    match = table.match(i, j, sign * factor)
                    if (j, sign * factor) != (i, 1.0) and (best is None or match.after < best.after):
                        best = match
    size = table.size(i)
    rows = int(np.isfinite(table.measured[:, i] - table.predicted[:, i]).sum())
    if best is None or best.after > BETTER * best.before or best.after > EXPLAINED * size:
        return None
    return None if rows < FEW and best.before < EXPLAINED * size else best


def _rotation(table: _Table) -> dict[int, _Match]:
    """Matches of all columns of a dimension if rotating them by one explains them; together, as some may be alike."""
    for dimension in {unit.dimension for unit in table.units}:
        group = [i for i, u in enumerate(table.units) if u.dimension == dimension and np.isfinite(table.before[i])]
        if len(group) < _RING or not table.gross[group].any() or not table.informative[group].all():
            continue
        sizes = np.array([table.size(i) for i in group])
        before = float(np.sqrt(np.mean((table.before[group] / sizes) ** 2)))
        for shift in (1, -1):
            matches = {i: table.match(i, j) for i, j in zip(group, np.roll(group, shift).tolist(), strict=True)}
            ratios = np.array([match.after for match in matches.values()]) / sizes
            if np.sqrt(np.mean(ratios**2)) <= BETTER * before and ratios.max() <= EXPLAINED:
                return matches
    return {}


def _rings(table: _Table, matches: dict[int, _Match]) -> list[Hint]:
    """One hint for three or more columns that are exchanged in a ring."""
    hints = []
    for first in matches:
        ring = [first]
        while (source := _plain(matches, ring[-1])) is not None and source not in ring:
            ring.append(source)
        if source != first or len(ring) < _RING or table.explained & set(ring):
            continue
        table.explained |= set(ring)
        before = rms(np.array([matches[i].before for i in ring]))
        after = rms(np.array([matches[i].after for i in ring]))
        holder = sorted((matches[i].source, i) for i in ring)  # column `source` has the readings of column i
        parts = [f"`{table.names[j]}` has the readings of `{table.names[i]}`" for j, i in holder[:1]]
        parts += [f"`{table.names[j]}` those of `{table.names[i]}`" for j, i in holder[1:]]
        order = sorted(ring)
        by_one = [i for _, i in holder] in (order[1:] + order[:1], order[-1:] + order[:-1])
        look = "look shifted by one column" if by_one else "look exchanged in a cycle"
        message = f"{table.quoted(order)} {look} ({', '.join(parts)})"
        message += f": {evidence(table.units[first], before, after)} after correction"
        names = tuple(table.names[i] for i in order)
        right = _right(table, matches, order)
        hints.append(Hint(kind="rotated", names=names, message=message, before=before, after=after, columns=right))
    return hints


def _plain(matches: dict[int, _Match], i: int) -> int | None:
    """The column that explains column i as it stands; None without."""
    match = matches.get(i)
    return match.source if match is not None and match.factor == 1.0 else None


def _exchanges(table: _Table, matches: dict[int, _Match]) -> list[Hint]:
    """Two columns that are swapped, and columns that are taken for others."""
    hints = []
    for i, match in matches.items():
        j, unit, name = match.source, table.units[i], table.names[i]
        if i in table.explained or j == i:
            continue
        back = matches.get(j)
        if back is not None and back.source == i and j not in table.explained:
            table.explained |= {i, j}
            turned = "" if match.factor > 0 and back.factor > 0 else " and reversed in sign"
            before, after = float(np.hypot(match.before, back.before)), float(np.hypot(match.after, back.after))
            words = evidence(unit, before, after)
            message = f"`{name}` and `{table.names[j]}` look swapped{turned}: {words} when swapped back"
            names = name, table.names[j]
            right = _right(table, matches, (i, j))
            hints.append(Hint(kind="swapped", names=names, message=message, before=before, after=after, columns=right))
            continue
        sign, words = "-" if match.factor < 0 else "", evidence(unit, match.before, match.after)
        message = f"column `{table.names[j]}` looks like {sign}`{name}`: {words} when it is read as that"
        names = name, table.names[j]
        hints.append(Hint(kind="moved", names=names, message=message, before=match.before, after=match.after))
    return hints


def _rescaled(table: _Table, matches: dict[int, _Match]) -> list[Hint]:
    """Columns in a wrong unit or turned in sign; those with one mistake are told together."""
    alike: dict[tuple[float, Unit], list[int]] = {}
    for i, match in matches.items():
        if match.source == i:
            alike.setdefault((match.factor, table.units[i]), []).append(i)
    hints = []
    for (factor, unit), columns in alike.items():
        before = rms(np.array([matches[i].before for i in columns]))
        after = rms(np.array([matches[i].after for i in columns]))
        look = f"{table.quoted(columns)} {'looks' if len(columns) == 1 else 'look'}"
        words = evidence(unit, before, after)
        kind: Literal["sign", "unit"] = "sign" if factor == -1.0 else "unit"
        if factor == -1.0:
            message = f"{look} reversed in sign: {words} with the opposite sign"
        else:
            size = f"{times(abs(factor))}{unit_words(unit, abs(factor))}{' and reversed in sign' if factor < 0 else ''}"
            message = f"{look} {size}: {words} when multiplied by {factor:.4g}"
        names = tuple(table.names[i] for i in columns)
        right = _right(table, matches, columns)
        hints.append(Hint(kind=kind, names=names, message=message, before=before, after=after, columns=right))
    return hints


def _right(table: _Table, matches: dict[int, _Match], columns: Iterable[int]) -> tuple[Right, ...]:
    """Columns as they are right."""
    pairs = ((i, matches[i]) for i in columns)
    return tuple(Right(table.names[i], table.names[match.source], match.factor) for i, match in pairs)


def _mirrored(table: _Table, i: int) -> Hint | None:
    """A column that runs the other way, from another origin."""
    measured, predicted, name = table.measured[:, i], table.predicted[:, i], table.names[i]
    total = (measured + predicted)[np.isfinite(measured + predicted)]
    if total.size < FEW or not table.gross[i]:
        return None
    centre, scatter = float(total.mean()), float(total.std())
    if scatter > BETTER * min(spread((measured - predicted)[:, None])[0], table.size(i)):
        return None
    unit, before = table.units[i], float(table.before[i])
    words = f"{evidence(unit, before, scatter)} as {unit.format(centre, 6)} - `{name}`"
    message = f"`{name}` looks reversed in sign, from another origin: {words}"
    right = (Right(name, name, -1.0, centre),)
    return Hint(kind="sign", names=(name,), message=message, before=before, after=scatter, columns=right)


def _offset(table: _Table, i: int) -> Hint | None:
    """A deviation that is large and the same everywhere: the origin lies elsewhere."""
    unit, predicted = table.units[i], table.predicted[:, i]
    difference = table.measured[:, i] - predicted
    deviation = difference[np.isfinite(difference)]
    if deviation.size < FEW or not table.gross[i]:
        return None
    mean, scatter = float(deviation.mean()), float(deviation.std())
    extent = float(np.ptp(predicted[np.isfinite(predicted)]))
    if abs(mean) < 0.5 * extent or scatter > 0.05 * abs(mean):
        return None
    before = rms(deviation)
    words = f"{evidence(unit, before, scatter)} without this offset"
    message = f"`{table.names[i]}` is off by {unit.format(mean, 4)} in all rows (is the origin wrong?): {words}"
    right = (Right(table.names[i], table.names[i], 1.0, -mean),)
    return Hint(kind="offset", names=(table.names[i],), message=message, before=before, after=scatter, columns=right)
