"""Shapes without a name are unknown between and beyond their knots: what that adds to a variance is computed here.

The variance is sum (dz/ds)^2 v over the sites s of shapes, v being that of a Gaussian process given its knots
(Rasmussen and Williams 2006).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects.effect import EffectParameter
from pkmcal_cli.effects.unexplained import Unexplained
from pkmcal_cli.model.effect_sites import EffectSite, PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import ModelParameter
from pkmcal_cli.prediction.inputs import SiteInputs
from pkmcal_cli.prediction.pipeline import predict
from pkmcal_cli.prediction.rows import Request, Rows, WarmStart


def between_knots(model: Model, values: Array, rows: Rows, start: WarmStart | None) -> Array:
    """Compute the variance (N, C) of the readings, SI, by what the values at the knots of shapes do not know of."""
    return np.asarray((by_unknown_shapes(model, values, rows, start) ** 2).sum(axis=2))


def by_unknown_shapes(model: Model, values: Array, rows: Rows, start: WarmStart | None) -> Array:
    """Compute what a standard deviation of each site of a shape (S) between its knots does to readings (N, C, S), SI.

    Each site counts by itself; the others of its guide are elsewhere on it.
    """
    shaped = [(e, s) for e in model.effects if isinstance(e.effect, Unexplained) for s in e.sites]
    if not shaped:
        return np.zeros((len(rows), len(model.channels), 0))
    names = tuple(f"level {k}.size" for k in range(len(shaped)))
    levels = tuple(_level(e, site, name) for (e, site), name in zip(shaped, names, strict=True))
    parameters = tuple(
        ModelParameter(name=n, nominal=0.0, range=1.0, bounds=(-np.inf, np.inf), unit="", dimension="", identify=True)
        for n in names
    )
    wide = model.with_effects(levels, parameters)
    by_level = predict(wide, np.append(values, np.zeros(len(names))), rows, Request(parameters=names), start).jacobian
    assert by_level is not None
    missing = np.stack([_missing(e, SiteInputs(s, model, rows, e, None)) for e, s in shaped], axis=1)  # (N, S)
    return np.asarray(by_level * np.sqrt(missing)[:, None, :])


def outside_knots(model: Model, rows: Rows) -> dict[str, int]:
    """Name the shapes that some rows are outside of, and count these rows: there a shape is not known."""
    out = {}
    for placed in model.effects:
        if isinstance(placed.effect, Unexplained):
            effect, (low, *_, high) = placed.effect, placed.effect.shape.knots
            margin = 1e-9 * (high - low)
            x = np.stack([effect.at(SiteInputs(site, model, rows, placed, None)) for site in placed.sites])
            beyond = ((x < low - margin) | (x > high + margin)).any(axis=0)
            if placed.acts_in:
                beyond &= rows.columns.get(f"session.{placed.acts_in}", np.zeros(len(rows))) > 0
            if beyond.any():
                out[placed.name] = int(beyond.sum())
    return out


def _missing(placed: PlacedEffect, inputs: SiteInputs) -> Array:
    assert isinstance(placed.effect, Unexplained)
    return placed.effect.shape.missing_variance(placed.effect.at(inputs))


def _level(placed: PlacedEffect, site: EffectSite, name: str) -> PlacedEffect:
    """The same displacement at one site, by as much everywhere."""
    effect = replace(
        placed.effect,
        keyword="level",
        parameters=(EffectParameter(name="size", unit="1", range=1.0, text=""),),
        formula=lambda at, size: size,
    )
    return replace(placed, effect=effect, sites=(site,), parameters=(name,))
