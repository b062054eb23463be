"""What an accepted effect leaves behind when its true shape is richer than the catalogue's: no new effect, no unknown.

A model discrepancy enters where the effect enters and depends on what the effect depends on, but with a free shape.
What is significant only without the model discrepancies of accepted effects belongs to their shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.unit_columns import UnitColumn, unit_columns
from pkmcal_cli.effects import Effect
from pkmcal_cli.effects.effect import legendre
from pkmcal_cli.model.effect_sites import PlacedEffect

_TRAVEL = range(2, 19)  # degrees of shapes over the travel, which resolve some five waves
_BENT = 3  # of these, that bend a line a little
_FEW = range(1, 5)  # of shapes that multiply direction or temperature
_TIME = range(3, 9)
GUIDED = ("command", "guide", "carriage")
Shape = Callable[[Any], Array]


def discrepancy_columns(
    problem: Problem, fit: Fit, accepted: Sequence[Hypothesis], known: KnownResults
) -> Array:
    """Columns (n, k) of the model discrepancies of accepted effects, whitened, of unit length; parameters have none."""
    columns = _discrepancies(problem, fit, accepted, _shapes, known).values()
    return np.hstack([np.zeros((problem.readings.size, 0)), *columns])


def own_discrepancies(
    problem: Problem, fit: Fit, hypotheses: Sequence[Hypothesis], known: KnownResults
) -> dict[str, Array]:
    """The same of each hypothesis by itself, by name, as far as they may be the effect's own discrepancy.

    Of effects that are in proportion to the travel only what bends it a little: the rest has other names.
    """
    return _discrepancies(problem, fit, hypotheses, _own_shapes, known)


def _discrepancies(
    problem: Problem,
    fit: Fit,
    hypotheses: Sequence[Hypothesis],
    shapes_of: Callable[[Effect], list[Shape]],
    known: KnownResults,
) -> dict[str, Array]:
    by_name = {e.name: e for e in problem.model.effects}
    names = {h.name: [p.name for p in h.placed if p.name in by_name] for h in hypotheses}
    every = [by_name[n] for n in dict.fromkeys(n for each in names.values() for n in each)]
    placed = [e for e in every if shapes_of(e.effect)]

    def compute(missing: list[int]) -> list[list[Array]]:
        units = _units(problem, fit, [placed[k] for k in missing], known)
        return [_shaped(each, len(problem), shapes_of) for each in units]

    of, keys = (problem, fit, shapes_of), [("shaped", e.name) for e in placed]
    shaped = known.each(of, keys, compute, lambda columns: sum(c.nbytes for c in columns))
    summed = dict(zip((e.name for e in placed), shaped, strict=True))
    blocks = {h: [c for n in members for c in summed.get(n, ())] for h, members in names.items()}
    return {h: _unit_length(np.hstack(columns)) for h, columns in blocks.items() if columns}


def _shaped(units: Sequence[UnitColumn], rows: int, shapes_of: Callable[[Effect], list[Shape]]) -> list[Array]:
    """Columns (n, k) of the free shapes of one effect, by number of its entry; its effect sites have one shape."""
    parts: dict[int, Array] = {}
    for unit in units:
        values = [np.broadcast_to(shape(unit.inputs), rows) for shape in shapes_of(unit.placed.effect)]
        columns = unit.shaped(np.stack(values, axis=1))
        parts[unit.part] = parts[unit.part] + columns if unit.part in parts else columns
    return list(parts.values())


def _units(
    problem: Problem, fit: Fit, placed: Sequence[PlacedEffect], known: KnownResults
) -> list[list[UnitColumn]]:
    """Unit columns of each effect."""

    def compute(missing: list[int]) -> list[list[UnitColumn]]:
        units = unit_columns(problem, fit.values, fit.after.start, [placed[k] for k in missing])
        return [[u for u in units if u.placed is placed[k]] for k in missing]

    return known.each((problem, fit), [("units", e.name) for e in placed], compute)


def _unit_length(columns: Array) -> Array:
    length = np.sqrt((columns**2).sum(axis=0))
    return np.asarray(columns[:, length > 0] / length[length > 0])


def _own_shapes(effect: Effect) -> list[Shape]:
    """Free shapes that are still the same effect."""
    spread = not effect.proportional and any(option.name in ("over", "period") for option in effect.options)
    return _shapes(effect) if effect.needs or spread else _shapes(effect)[:_BENT]


_OTHER = 0.3  # share of a shape that must be left once the effect's own columns are projected out, or it is the effect
_SHARES = (0.1, 0.2, 0.3)  # rms of what an effect has beyond its named shape, over the effect's own


@dataclass(frozen=True)
class OwnDiscrepancy:
    """What speaks for an effect's shape to deviate from its formula: log evidence gained (0 if nothing does), and the
    covariance (k, k) that such a shape adds to the sizes of the effect's columns."""

    evidence: float
    covariance: Array


def own_discrepancy(linear: Linear, scale: Scale, columns: Array, discrepancies: Array) -> OwnDiscrepancy:
    """How far an effect with columns (n, k) has a shape of its own; discrepancies are normal with mean 0.

    Their variance is the likeliest of three shares of the effect's size, or 0.
    """
    free = linear.free(columns)
    sizes = np.linalg.pinv(columns.T @ free, rcond=1e-9, hermitian=True)
    explained = columns @ (sizes @ (columns.T @ linear.unexplained))
    after = linear.projecting(linear.projected, extra=_with(linear.extra, columns))
    left = (discrepancies * after.free(discrepancies)).sum(axis=0)
    discrepancies = discrepancies[:, left > _OTHER * (discrepancies * linear.free(discrepancies)).sum(axis=0)]
    if not discrepancies.shape[1]:
        return OwnDiscrepancy(0.0, np.zeros((columns.shape[1], columns.shape[1])))
    values, vectors = np.linalg.eigh(discrepancies.T @ after.free(discrepancies))
    values = np.maximum(values, 0.0) / scale.variance
    gradient = vectors.T @ (discrepancies.T @ after.unexplained) / scale.variance
    best, prior = 0.0, 0.0
    for share in _SHARES:
        variance = share**2 * float(explained @ explained) / discrepancies.shape[1]
        spread = 1.0 + variance * values
        evidence = 0.5 * float((variance * gradient**2 / spread - np.log(spread)).sum())
        if evidence > best:
            best, prior = evidence, variance
    moved = sizes @ (free.T @ discrepancies)
    return OwnDiscrepancy(best, prior * moved @ moved.T)


def _with(extra: Array | None, columns: Array) -> Array:
    return columns if extra is None else np.hstack([extra, columns])


def _shapes(effect: Effect) -> list[Shape]:
    """Free shapes (N,) of what the effect depends on."""
    guided = effect.enters in GUIDED
    if "time" in effect.needs:  # drifts, which are looked for only beside a temperature, but do not depend on it
        return [lambda at, d=d: legendre(at.normalised_time, d) for d in _TIME]  # type: ignore[misc]
    if "temperature" in effect.needs:
        shapes: list[Shape] = [lambda at: at.temperature_rise**2, _slope]
        return shapes + ([_times(lambda at: at.temperature_rise, d) for d in (1, 2, 3)] if guided else [])
    if "direction" in effect.needs:
        return [_times(lambda at: at.direction, d) for d in _FEW]
    if any(option.name == "period" for option in effect.options):
        return [_wave(harmonic, part) for harmonic in (2, 3) for part in (np.cos, np.sin)]
    if guided:
        return [_times(lambda at: 1.0, d) for d in _TRAVEL]
    return []


def _times(factor: Callable[[Any], Any], degree: int) -> Shape:
    return lambda at: factor(at) * legendre(at.normalised_travel, degree)


def _wave(harmonic: int, part: Callable[[Array], Array]) -> Shape:
    return lambda at: part(2 * np.pi * harmonic * at.travel / at.option("period"))


def _slope(at: Any) -> Array:
    """Change of the temperature from row to row, in the order of time where it is known."""
    time = at.table.columns.get("time")
    order = np.arange(at.rows) if time is None else np.argsort(time, kind="stable")
    out = np.empty(at.rows)
    out[order] = np.gradient(at.temperature_rise[order])
    return out
