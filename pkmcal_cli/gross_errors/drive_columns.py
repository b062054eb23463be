"""Mistakes in the columns of drives, found by predicting again with columns exchanged, turned, scaled or a row late.

This asks no pose of the measurement, only some readings. All changes of a kind are predicted at once, of a few rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.gross_errors.plausibility import BETTER, EXPLAINED, Hint, Kind, MovedReadings, Right, misfit
from pkmcal_cli.gross_errors.row_shift import IntArray, shift_words, shifted
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.prediction import Request, frozen, joined_rows, predict
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words
from pkmcal_cli.units.unit_text import Unit, parse_unit

_ROWS = 16  # rows that are predicted
_MOST = 80  # changes that are tried
_SOLVED = 0.8  # share of the rows that a change must let be predicted


@dataclass(frozen=True)
class _Change:
    """Columns (A,) from which drives are taken, the factors (A,), and from how many rows further on those concerned."""

    kind: Kind
    columns: tuple[int, ...]  # concerned
    source: Array
    factor: Array
    shift: int = 0


def explain_by_prediction(sample: Sample, values: Array, sessions: IntArray) -> tuple[list[Hint], float]:
    """Changes of the drives' columns that explain the readings, each by itself, as hints; misfit as it stands.

    sessions (N,): of the rows of the whole table.
    """
    few = np.linspace(0, len(sample.part) - 1, min(_ROWS, len(sample.part))).round().astype(int)
    part, logged = sample.part.take(few), _Log(sample.whole.rows.readings, sample.rows[few], sessions)
    readings = np.where(part.measured, part.readings, np.nan)
    read_only = part.model.measuring(Measurand.DRIVE)  # drives that are read only
    forces = np.array([c.measurand is Measurand.FORCE for c in part.model.channels])
    if not (~forces & part.measured.any(axis=0)).any():
        forces[:] = False  # else they are no witnesses: small errors of a stiff machine make large ones

    def left(drives: Array, predicted: Array, solved: NDArray[np.bool_]) -> float:
        if solved.mean() < _SOLVED:
            return np.inf
        moved = readings.copy()
        moved[:, read_only] = np.where(
            part.measured[:, read_only], drives[:, [part.model.channels[k].index for k in read_only]], np.nan
        )
        compared = np.where(forces, np.nan, sample.seen(moved, predicted))
        return misfit(compared, predicted, compared)

    columns = np.arange(len(part.model.actuators))
    none = _Change("moved", (), columns, np.ones(len(columns)))
    before = next(left(*p) for p in _predicted(part, logged, values, [none]))
    for kind in ("rotated", "swapped", "sign", "unit", "rows"):
        changes = list(islice(_changes(part, kind), _MOST))
        tried = zip((left(*p) for p in _predicted(part, logged, values, changes)), changes, strict=True)
        good = [(after, change) for after, change in tried if after <= min(EXPLAINED, BETTER * before)]
        if good:
            good.sort(key=lambda each: each[0])
            return [_hint(part, change, before, after, sessions) for after, change in good], before
    return [], before


@dataclass(frozen=True)
class _Log:
    """Drive readings (N, A) of a table with its sessions (N,), and the numbers (n,) of the rows that are predicted."""

    readings: Array
    rows: IntArray
    sessions: IntArray

    def after(self, change: _Change) -> tuple[Array, NDArray[np.bool_]]:
        """Readings (n, A) after a change, and where (n,) there are such."""
        readings = self.readings.copy()
        if change.shift:
            concerned = list(change.columns)
            readings[:, concerned] = shifted(readings[:, concerned], self.sessions, change.shift)
        changed, before = readings[self.rows][:, change.source.astype(int)] * change.factor, self.readings[self.rows]
        lost = np.isnan(changed) & ~np.isnan(before)
        return np.where(lost, before, changed), ~lost.any(axis=1)


def _predicted(
    part: Problem, logged: _Log, values: Array, changes: Sequence[_Change]
) -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
    """Drive readings (n, A) after each change, predictions (n, C), nan where there are none, and where there are (n,).

    Effects spread their shapes over the rows as they are filed.
    """
    if not changes:
        return
    drives = [logged.after(change) for change in changes]
    rows = joined_rows([replace(part.rows, readings=q) for q, _ in drives])
    prediction = predict(frozen(part.model, part.rows), values, rows, Request(compare=False))
    predicted = np.where(prediction.solved[:, None], prediction.values, np.nan)
    for k, (readings, there) in enumerate(drives):
        chunk = slice(k * len(part), (k + 1) * len(part))
        yield readings, np.where(there[:, None], predicted[chunk], np.nan), prediction.solved[chunk]


def _changes(problem: Problem, kind: str) -> Iterator[_Change]:
    """Changes of one kind, the likely ones first."""
    actuators = problem.model.actuators
    used = [a for a in range(len(actuators)) if not np.isnan(problem.rows.readings[:, a]).all()]
    plain, ones = np.arange(len(actuators)), np.ones(len(actuators))
    for dimension in sorted({actuators[a].dimension for a in used}):
        group = [a for a in used if actuators[a].dimension == dimension]
        if kind == "rotated" and len(group) > 2:
            for shift in (1, -1):
                source = plain.copy()
                source[group] = np.roll(group, shift)
                yield _Change("rotated", tuple(group), source, ones)
        if kind == "swapped":
            for i, j in combinations(group, 2):
                source = plain.copy()
                source[[i, j]] = [j, i]
                yield _Change("swapped", (i, j), source, ones)
        if kind == "rows":
            for a in group:
                yield from (_Change("rows", (a,), plain, ones, shift) for shift in (1, -1))
        unit = parse_unit(actuators[group[0]].unit)
        factors = {"sign": (-1.0,), "unit": factors_of(unit)}.get(kind, ())
        for some in dict.fromkeys((tuple(group), *((a,) for a in group))):
            for value in factors:
                factor = ones.copy()
                factor[list(some)] = value
                yield _Change("sign" if kind == "sign" else "unit", some, plain, factor)


def _hint(problem: Problem, change: _Change, before: float, after: float, sessions: IntArray) -> Hint:
    actuators = problem.model.actuators
    names = tuple(actuators[a].name for a in change.columns)
    quoted = " and ".join(f"`{n}`" for n in names) if len(names) < 3 else ", ".join(f"`{n}`" for n in names)
    unit = parse_unit(actuators[change.columns[0]].unit)
    message = f"{quoted} {_look(change, len(names), unit)}"
    if change.kind == "rotated":
        holder = sorted((int(change.source[a]), a) for a in change.columns)
        message += (
            f" (`{actuators[holder[0][0]].name}` has the readings of `{actuators[holder[0][1]].name}`, and so on)"
        )
    was = f"{100 * before:.3g} % before" if np.isfinite(before) else "most rows out of reach before"
    message += f": after correction, {100 * after:.2g} % of the variation of the readings is unexplained ({was})"
    right, moved = tuple[Right, ...](), tuple[MovedReadings, ...]()
    if change.shift:
        first = np.unique(sessions, return_index=True)[1].tolist()
        moved = tuple(MovedReadings(names, change.shift, row, abs(change.shift)) for row in first)
    else:
        sources = [(a, int(change.source[a])) for a in change.columns]
        right = tuple(Right(actuators[a].name, actuators[s].name, float(change.factor[a])) for a, s in sources)
    return Hint(kind=change.kind, names=names, message=message, before=before, after=after, columns=right, moved=moved)


def _look(change: _Change, count: int, unit: Unit) -> str:
    look = "looks" if count == 1 else "look"
    if change.kind == "unit":
        factor = float(change.factor[change.columns[0]])
        return f"{look} {times(factor)}{unit_words(unit, factor)}"
    if change.shift:
        by, other = shift_words(change.shift)
        return f"{look} shifted by {by} (each row with the reading of the {other})"
    words = {"rotated": "shifted by one column", "swapped": "swapped", "sign": "reversed in sign"}
    return f"{look} {words[change.kind]}"
