"""Displacements without a name: how well a free shape over a drive's or guide's travel, or over time, explains a table.

A shape is a Gaussian process; its spread and width are the likeliest ones, declared parameters being projected out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.linear import Linear, Scale
from pkmcal_cli.diagnosis.unit_columns import UnitColumn, unit_columns
from pkmcal_cli.effects.unexplained import (
    ENTRIES,
    OVER_TIME,
    Axis,
    FreeShape,
    Unexplained,
    even_knots,
    unexplained,
)
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.prediction import WarmStart

_WIDTHS = (0.04, 0.08, 0.15, 0.3)  # of shapes, in shares of the axis
_MOST_KNOTS = 41
_SPREADS = np.logspace(-2, 6, 33)  # squared, in units of the noise
_HYPERPARAMETERS = 2.0  # log evidence that the likeliest spread and width are worth
_FEWEST = 3  # places on an axis, for each knot


@dataclass(frozen=True, kw_only=True)
class FittedShape:
    """A free shape at a place with its likeliest spread and width, its log evidence and the statistic it explains."""

    placed: PlacedEffect
    evidence: float
    statistic: float

    @property
    def effect(self) -> Unexplained:
        """The effect, with its shape."""
        assert isinstance(self.placed.effect, Unexplained)
        return self.placed.effect


@dataclass(frozen=True)
class Place:
    """Where a shape may be: unit columns of a drive's or guide's sites, the places x (N,) of the rows by site."""

    bare: PlacedEffect
    units: tuple[UnitColumn, ...]
    x: tuple[Array, ...]

    @property
    def span(self) -> tuple[float, float]:
        """First and last place of any row."""
        return min(float(x.min()) for x in self.x), max(float(x.max()) for x in self.x)

    def columns(self, shape: FreeShape) -> Array:
        """Columns (N * C, K) of the weights of a shape, whitened."""
        return np.asarray(sum(u.shaped(shape.basis(x)) for u, x in zip(self.units, self.x, strict=True)))


def places(problem: Problem, values: Array, start: WarmStart | None) -> tuple[Place, ...]:
    """All places where a shape may be in a table; at parameter values (P,), SI."""
    bare = list(_bare(problem))
    units = unit_columns(problem, values, start, bare)
    out = []
    for placed in bare:
        own = tuple(u for u in units if u.placed is placed)
        effect = placed.effect
        assert isinstance(effect, Unexplained)
        x = tuple(effect.at(u.inputs) for u in own)
        if own and all(np.isfinite(each).all() for each in x) and max(float(np.ptp(each)) for each in x) > 0:
            out.append(Place(placed, own, x))
    return tuple(out)


def _bare(problem: Problem) -> list[PlacedEffect]:
    """A displacement at every drive and guide, over its travel, and at every drive over time."""
    any_shape = FreeShape(knots=(0.0, 1.0, 2.0), spread=1.0, width=1.0)
    axes: list[tuple[Axis, str]] = [("travel", "")]
    if np.isfinite(problem.rows.columns.get("time", np.nan)).all():
        axes.append(("time", OVER_TIME))
    return [
        PlacedEffect(unexplained(entry, any_shape, axis), name + suffix, sites, (), {})
        for entry in ENTRIES
        for axis, suffix in axes
        if axis == "travel" or entry == "command"
        for name, sites in problem.model.sites.get(entry, {}).items()
    ]


def fitted_shapes(linear: Linear, scale: Scale, kinds: Sequence[Place]) -> list[FittedShape]:
    """The likeliest shape at each place, best first; the number of places and widths is counted."""
    price = float(np.log(max(len(kinds), 1) * len(_WIDTHS))) + _HYPERPARAMETERS
    found = [_likeliest(linear, scale, place, price) for place in kinds]
    return sorted((f for f in found if f is not None), key=lambda f: -f.evidence)


def _likeliest(linear: Linear, scale: Scale, place: Place, price: float) -> FittedShape | None:
    low, high = place.span
    distinct = len(np.unique(np.round((np.concatenate(place.x) - low) / (high - low), 3)))
    best: FittedShape | None = None
    for share in _WIDTHS:
        width = share * (high - low)
        knots = even_knots(low, high, width / 2, _MOST_KNOTS)
        if len(knots) > distinct // _FEWEST:
            continue
        unit = FreeShape(knots=knots, spread=1.0, width=width)
        columns = linear.whitened(place.columns(unit))
        values, vectors = np.linalg.eigh(columns.T @ linear.free(columns))
        values = np.maximum(values, 0.0) / scale.variance
        gradient = vectors.T @ (columns.T @ linear.unexplained) / scale.variance
        largest = float(values.max(initial=0.0))
        if largest <= 0.0:
            continue
        variance = _SPREADS[:, None] / largest
        evidence = 0.5 * (variance * gradient**2 / (1 + variance * values) - np.log1p(variance * values)).sum(axis=1)
        k = int(np.argmax(evidence))
        if best is None or evidence[k] - price > best.evidence:
            shape = replace(unit, spread=float(np.sqrt(_SPREADS[k] / largest)))
            statistic = float((variance[k] * gradient**2 / (1 + variance[k] * values)).sum())
            bare = place.bare.effect
            assert isinstance(bare, Unexplained)
            effect = unexplained(bare.enters, shape, bare.axis)
            names = tuple(f"{effect.keyword}@{place.bare.at}.{p.name}" for p in effect.parameters)
            placed = replace(place.bare, effect=effect, parameters=names)
            best = FittedShape(placed=placed, evidence=float(evidence[k]) - price, statistic=statistic)
    return best
