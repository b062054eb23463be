"""Mistakes in the columns of drives, found by predicting again with columns exchanged, turned or scaled.

This asks no pose of the measurement, only some readings. All changes of a kind are predicted at once, of a few rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.gross_errors.plausibility import BETTER, EXPLAINED, Hint, Kind, Right, misfit
from pkmcal_cli.prediction import Request, frozen, joined_rows, predict
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words
from pkmcal_cli.units.unit_text import Unit, parse_unit

_ROWS = 16  # rows that are predicted
_MOST = 80  # changes that are tried
_SOLVED = 0.8  # share of the rows that a change must let be predicted


@dataclass(frozen=True)
class _Change:
    """Columns (A,) from which drives are taken, and the factors (A,)."""

    kind: Kind
    columns: tuple[int, ...]  # concerned
    source: Array
    factor: Array


def explain_by_prediction(
    problem: Problem, values: Array, seen: Callable[[Array, Array], Array]
) -> tuple[list[Hint], float]:
    """Changes of the drives' columns that explain the readings, each by itself, as hints; misfit as it stands.

    seen: readings as they compare with predictions, both (n, C).
    """
    few = np.linspace(0, len(problem) - 1, min(_ROWS, len(problem))).round().astype(int)
    part = problem.take(few)
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
        compared = np.where(forces, np.nan, seen(moved, predicted))
        return misfit(compared, predicted, compared)

    columns = np.arange(len(problem.model.actuators))
    none = _Change("moved", (), columns, np.ones(len(columns)))
    before = next(left(*p) for p in _predicted(part, values, [none]))
    for kind in ("rotated", "swapped", "sign", "unit"):
        changes = list(islice(_changes(problem, kind), _MOST))
        tried = zip((left(*p) for p in _predicted(part, values, changes)), changes, strict=True)
        good = [(after, change) for after, change in tried if after <= min(EXPLAINED, BETTER * before)]
        if good:
            good.sort(key=lambda each: each[0])
            return [_hint(problem, change, before, after) for after, change in good], before
    return [], before


def _predicted(
    part: Problem, values: Array, changes: Sequence[_Change]
) -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
    """Drive readings (n, A) after each change, predictions (n, C), nan where there are none, and where there are (n,).

    Effects spread their shapes over the rows as they are filed.
    """
    if not changes:
        return
    drives = [part.rows.readings[:, change.source.astype(int)] * change.factor for change in changes]
    rows = joined_rows([replace(part.rows, readings=q) for q in drives])
    prediction = predict(frozen(part.model, part.rows), values, rows, Request(compare=False))
    predicted = np.where(prediction.solved[:, None], prediction.values, np.nan)
    for k, readings in enumerate(drives):
        chunk = slice(k * len(part), (k + 1) * len(part))
        yield readings, predicted[chunk], prediction.solved[chunk]


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
        unit = parse_unit(actuators[group[0]].unit)
        factors = {"sign": (-1.0,), "unit": factors_of(unit)}.get(kind, ())
        for some in dict.fromkeys((tuple(group), *((a,) for a in group))):
            for value in factors:
                factor = ones.copy()
                factor[list(some)] = value
                yield _Change("sign" if kind == "sign" else "unit", some, plain, factor)


def _hint(problem: Problem, change: _Change, before: float, after: float) -> Hint:
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
    sources = [(a, int(change.source[a])) for a in change.columns]
    right = tuple(Right(actuators[a].name, actuators[s].name, float(change.factor[a])) for a, s in sources)
    return Hint(kind=change.kind, names=names, message=message, before=before, after=after, columns=right)


def _look(change: _Change, count: int, unit: Unit) -> str:
    look = "looks" if count == 1 else "look"
    if change.kind == "unit":
        factor = float(change.factor[change.columns[0]])
        return f"{look} {times(factor)}{unit_words(unit, factor)}"
    words = {"rotated": "shifted by one column", "swapped": "swapped", "sign": "reversed in sign"}
    return f"{look} {words[change.kind]}"
