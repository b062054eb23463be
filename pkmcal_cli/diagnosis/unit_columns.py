"""What a unit displacement of an entry does to the readings, row by row: any shape of it is this times the shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise_at
from pkmcal_cli.effects import FRAME_PARTS, WIDTHS, Effect, EffectParameter
from pkmcal_cli.model.effect_sites import EffectSite, PlacedEffect
from pkmcal_cli.model.parts import ModelParameter
from pkmcal_cli.prediction import WarmStart
from pkmcal_cli.prediction.inputs import SiteInputs


@dataclass(frozen=True)
class UnitColumn:
    """Column (N, C), whitened, of number `part` of an entry at one effect site; `inputs` are for its shapes."""

    placed: PlacedEffect
    part: int
    inputs: SiteInputs
    column: Array

    def shaped(self, shapes: Array) -> Array:
        """Columns (N * C, k) of shapes (N, k)."""
        return np.asarray((self.column[:, :, None] * shapes[:, None, :]).reshape(self.column.size, shapes.shape[1]))


def unit_columns(
    problem: Problem, values: Array, start: WarmStart | None, placed: Sequence[PlacedEffect]
) -> list[UnitColumn]:
    """Unit columns at the places of effects, whatever their formulas are: one per effect site and number of its entry.

    `values`: of the problem's parameters (P,).
    """
    model = problem.model
    made = [(e, s, part) for e in placed for s in e.sites for part in _parts(e.effect, s)]
    if not made:
        return []
    names = tuple(f"unit {k}.size" for k in range(len(made)))
    units = tuple(_unit(e, s, part, name) for (e, s, part), name in zip(made, names, strict=True))
    parameters = tuple(
        ModelParameter(name=n, nominal=0.0, range=1.0, bounds=(-np.inf, np.inf), unit="", dimension="", identify=True)
        for n in names
    )
    wide = replace(problem, model=model.with_effects(units, parameters), prior=None)
    columns = linearise_at(wide, np.append(values, np.zeros(len(names))), names, start).jacobian
    return [
        UnitColumn(e, part, SiteInputs(s, model, problem.rows, e, None), column.reshape(problem.readings.shape))
        for (e, s, part), column in zip(made, columns.T, strict=True)
    ]


def _parts(effect: Effect, site: EffectSite) -> list[int]:
    """Which of the entry's numbers count: shifts that the effect site feels, not turns and scales of frames."""
    shifts = list(range(WIDTHS[effect.enters]))
    if effect.enters == "frame":
        shifts = [*shifts[FRAME_PARTS["shift"]], *shifts[FRAME_PARTS["reading"]]]
    return [k for k in shifts if site.matrix[:, k].any()]


def _unit(placed: PlacedEffect, site: EffectSite, part: int, name: str) -> PlacedEffect:
    width = WIDTHS[placed.effect.enters]

    def formula(at: Any, size: Any) -> Any:
        return size if width == 1 else [size if k == part else 0.0 for k in range(width)]

    effect = replace(
        placed.effect,
        keyword="unit",
        parameters=(EffectParameter(name="size", unit="1", range=1.0, text=""),),
        formula=formula,
    )
    return replace(placed, effect=effect, sites=(site,), parameters=(name,))
