"""Displacements without a name: how well a free shape over a drive's or guide's travel, or over time, explains a table.

A shape is a Gaussian process; its spread and width are the likeliest ones, declared parameters being projected out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.compiler.placed_effects import placed_shape
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.scale import Scale
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
from pkmcal_cli.model.effect_sites import PlacedEffect, in_session
from pkmcal_cli.prediction import Rows, WarmStart

_WIDTHS = (0.04, 0.08, 0.15, 0.3)  # of shapes, in shares of the axis
_MOST_KNOTS = 41
_SPREADS = np.logspace(-2, 6, 33)  # squared, in units of the noise
_HYPERPARAMETERS = 2.0  # log evidence that the likeliest spread and width are worth
_FEWEST = 3  # places on an axis, for each knot
_REFINED = 3  # places where a shape gets more knots
_REFINEMENTS, _PARTS = 4, 4  # how often, and into how many parts the steepest gap between two knots is cut


@dataclass(frozen=True, kw_only=True)
class FittedShape:
    """A free shape at a place with its likeliest spread and width, its log evidence and the statistic it explains."""

    placed: PlacedEffect
    evidence: float
    statistic: float
    curve: Array  # (K,) at the knots, m or rad

    @property
    def effect(self) -> Unexplained:
        """The effect, with its shape."""
        assert isinstance(self.placed.effect, Unexplained)
        return self.placed.effect


@dataclass(frozen=True)
class ShapeSite:
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


def places(problem: Problem, values: Array, start: WarmStart | None) -> tuple[ShapeSite, ...]:
    """All places where a shape may be in a table; at parameter values (P,), SI."""
    bare = bare_shapes(problem)
    units = unit_columns(problem, values, start, bare)
    out = []
    for placed in bare:
        sites = tuple(u for u in units if u.placed is placed)
        effect = placed.effect
        assert isinstance(effect, Unexplained)
        x = tuple(_in_its_rows(effect.at(u.inputs), problem.rows, placed.acts_in) for u in sites)
        if sites and all(np.isfinite(each).all() for each in x) and max(float(np.ptp(each)) for each in x) > 0:
            out.append(ShapeSite(placed, sites, x))
    return tuple(out)


def bare_shapes(problem: Problem) -> list[PlacedEffect]:
    """A displacement at every drive and guide, over its travel, and at every drive over time; of any shape."""
    any_shape = FreeShape(knots=(0.0, 1.0, 2.0), spread=1.0, width=1.0)
    axes: list[tuple[Axis, str]] = [("travel", "")]
    axes += [("time", suffix) for suffix in _over_time(problem.rows)]
    return [
        placed_shape(unexplained(entry, any_shape, axis), name + suffix, sites)
        for entry in ENTRIES
        for axis, suffix in axes
        if axis == "travel" or entry == "command"
        for name, sites in problem.model.sites.get(entry, {}).items()
    ]


def _over_time(rows: Rows) -> list[str]:
    """What follows the name of a drive where its shape is one over time; none where times are not known.

    Such a shape belongs to its session, where there is one only or their times overlap: it says nothing of another.
    Sessions one after the other have one course of time, which tells them apart.
    """
    time, named = rows.columns.get("time", np.full(len(rows), np.nan)), rows.named_sessions
    if not np.isfinite(time).all():
        return []
    spans = sorted((float(t.min()), float(t.max())) for s in named if len(t := time[_flags(rows, s)]))
    if len(spans) > 1 and all(before[1] <= after[0] for before, after in pairwise(spans)):
        return [OVER_TIME]
    return [in_session(OVER_TIME, s) for s in named] or [OVER_TIME]


def _in_its_rows(x: Array, rows: Rows, session: str) -> Array:
    """Places (N,); those of rows of other sessions, in which a shape does nothing, are the first one of its own."""
    inside = _flags(rows, session) if session else np.ones(len(x), dtype=bool)
    return np.where(inside, x, x[inside].min(initial=np.inf)) if inside.any() else np.full(len(x), np.nan)


def _flags(rows: Rows, session: str) -> NDArray[np.bool_]:
    """Which rows (N,) belong to a session."""
    return np.asarray(rows.columns[f"session.{session}"] > 0)


def fitted_shapes(linear: Linear, scale: Scale, kinds: Sequence[ShapeSite]) -> list[FittedShape]:
    """The likeliest shape at each place, best first; the number of places and widths is counted."""
    price = float(np.log(max(len(kinds), 1) * len(_WIDTHS))) + _HYPERPARAMETERS
    coarse = [(f, site) for site in kinds if (f := _likeliest(linear, scale, site, price)) is not None]
    coarse.sort(key=lambda pair: -pair[0].evidence)
    refined = [_refined(linear, scale, *pair, price) for pair in coarse[:_REFINED]]
    return sorted([*refined, *(f for f, _ in coarse[_REFINED:])], key=lambda f: -f.evidence)


def _likeliest(linear: Linear, scale: Scale, site: ShapeSite, price: float) -> FittedShape | None:
    """The shape of most evidence, with even knots."""
    low, high = site.span
    distinct = len(np.unique(np.round((np.concatenate(site.x) - low) / (high - low), 3)))
    candidates = []
    for width in (share * (high - low) for share in _WIDTHS):
        knots = even_knots(low, high, width / 2, _MOST_KNOTS)
        if len(knots) * _FEWEST <= distinct:
            candidates.append(_with_spread(linear, scale, site, knots, width, price))
    return max((f for f in candidates if f is not None), key=lambda f: f.evidence, default=None)


def _refined(linear: Linear, scale: Scale, shape: FittedShape, site: ShapeSite, price: float) -> FittedShape:
    """The shape with more knots where it is steepest, as long as its evidence grows by it."""
    for _ in range(_REFINEMENTS):
        spline = shape.effect.shape
        steepest = int(np.argmax(np.abs(np.diff(shape.curve)))) if len(shape.curve) else 0
        between = np.linspace(spline.knots[steepest], spline.knots[steepest + 1], _PARTS + 1)[1:-1]
        knots = tuple(sorted((*spline.knots, *between.tolist())))
        finer = _with_spread(linear, scale, site, knots, spline.width, price)
        if finer is None or finer.evidence < shape.evidence + 1.0:
            break
        shape = finer
    return shape


def _with_spread(
    linear: Linear, scale: Scale, site: ShapeSite, knots: tuple[float, ...], width: float, price: float
) -> FittedShape | None:
    """A shape with its likeliest spread; None where it moves nothing."""
    unit = FreeShape(knots=knots, spread=1.0, width=width)
    columns = linear.whitened(site.columns(unit))
    values, vectors = np.linalg.eigh(columns.T @ linear.free(columns))
    values = np.maximum(values, 0.0) / scale.variance
    largest = float(values.max(initial=0.0))
    if largest <= 0.0:
        return None
    gradient = vectors.T @ (columns.T @ linear.unexplained) / scale.variance
    variance = _SPREADS[:, None] / largest
    evidence = 0.5 * (variance * gradient**2 / (1 + variance * values) - np.log1p(variance * values)).sum(axis=1)
    k = int(np.argmax(evidence))
    size = float(variance[k, 0])
    weights = vectors @ (size * gradient / (1 + size * values))
    bare = site.bare.effect
    assert isinstance(bare, Unexplained)
    effect = unexplained(bare.enters, replace(unit, spread=float(np.sqrt(size))), bare.axis)
    return FittedShape(
        placed=placed_shape(effect, site.bare.at, site.bare.sites),
        evidence=float(evidence[k]) - price,
        statistic=float((size * gradient**2 / (1 + size * values)).sum()) * scale.variance,
        curve=unit.factor @ weights,
    )
