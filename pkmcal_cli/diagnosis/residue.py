"""What an accepted effect leaves behind when its true shape is richer than the catalogue's: no new effect, no unknown.

A residue enters where the effect enters and depends on what the effect depends on, but with a free shape. What is
significant only without the residues of accepted effects belongs to their shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal_cli.calibration.identify import Fit
from pkmcal_cli.calibration.residual import Problem, linearise_at
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.effects import WIDTHS, Effect, EffectParameter
from pkmcal_cli.effects.base import legendre
from pkmcal_cli.model import ModelParameter
from pkmcal_cli.rotation import Array
from pkmcal_cli.sockets import PlacedEffect

_TRAVEL = range(2, 19)  # degrees of shapes over the travel, which resolve some five waves
_FEW = range(1, 5)  # of shapes that multiply direction or temperature
_TIME = range(3, 9)
_GUIDED = ("command", "guide", "carriage")


def residue_columns(problem: Problem, fit: Fit, accepted: Sequence[Hypothesis]) -> Array:
    """Columns (n, k) of the residues of accepted effects, whitened, of unit length; none (n, 0) for parameters."""
    model = problem.model
    placed = {e.name: e for e in model.effects}
    made = [_residue(placed[h.name], model.layout.planar) for h in accepted if h.name in placed]
    names = tuple(n for e in made for n in e.parameters)
    if not names:
        return np.zeros((problem.readings.size, 0))
    parameters = tuple(ModelParameter(n, 0.0, 1.0, (-np.inf, np.inf), "", "", True) for n in names)
    wide = replace(problem, model=model.with_effects(tuple(made), parameters))
    values = np.append(fit.values, np.zeros(len(names)))
    columns = linearise_at(wide, values, names, fit.after.state).jacobian
    length = np.sqrt((columns**2).sum(axis=0))
    return np.asarray(columns[:, length > 0] / length[length > 0])


def _residue(placed: PlacedEffect, planar: bool) -> PlacedEffect:
    """The effect's port, moved in the effect's directions by free shapes."""
    effect = placed.effect
    parts = _parts(effect, planar)
    count = len(_shapes(effect))
    names = tuple(f"{part}.{shape}" for part in parts for shape in range(count))
    formula = _formula(effect, parts)
    wide = replace(
        effect, keyword="residue", parameters=tuple(EffectParameter(n, "1", 1.0, "") for n in names), formula=formula
    )
    return replace(placed, effect=wide, parameters=tuple(f"residue {placed.name}.{n}" for n in names))


def _parts(effect: Effect, planar: bool) -> list[int]:
    """Which of the port's numbers the effect moves."""
    if WIDTHS[effect.port] == 1:
        return [0]
    return list(range(2 if planar else 3))  # places; turns and scales of frames have no residue


def _formula(effect: Effect, parts: list[int]) -> Callable[..., Any]:
    def formula(at: Any, *sizes: Any) -> Any:
        shapes = [shape(at) for shape in _shapes(effect)]
        out: list[Any] = [0.0] * WIDTHS[effect.port]
        for p, part in enumerate(parts):
            mine = sizes[p * len(shapes) : (p + 1) * len(shapes)]
            out[part] = sum(size * shape for size, shape in zip(mine, shapes, strict=True))
        return out[0] if len(out) == 1 else out

    return formula


Shape = Callable[[Any], Array]


def _shapes(effect: Effect) -> list[Shape]:
    """Free shapes (N,) of what the effect depends on."""
    guided = effect.port in _GUIDED
    if "temperature" in effect.needs:
        shapes: list[Shape] = [lambda at: at.warmth**2, _slope]
        return shapes + ([_times(lambda at: at.warmth, d) for d in (1, 2, 3)] if guided else [])
    if "direction" in effect.needs:
        return [_times(lambda at: at.direction, d) for d in _FEW]
    if "time" in effect.needs:
        return [lambda at, d=d: legendre(at.moment, d) for d in _TIME]  # type: ignore[misc]
    if any(option.name == "period" for option in effect.options):
        return [_wave(harmonic, part) for harmonic in (2, 3) for part in (np.cos, np.sin)]
    if guided:
        return [_times(lambda at: 1.0, d) for d in _TRAVEL]
    return []


def _times(factor: Callable[[Any], Any], degree: int) -> Shape:
    return lambda at: factor(at) * legendre(at.share, degree)


def _wave(harmonic: int, part: Callable[[Array], Array]) -> Shape:
    return lambda at: part(2 * np.pi * harmonic * at.travel / at.option("period"))


def _slope(at: Any) -> Array:
    """Change of the temperature from row to row, in the order of time where it is known."""
    time = at.table.columns.get("time")
    order = np.arange(at.rows) if time is None else np.argsort(time, kind="stable")
    out = np.empty(at.rows)
    out[order] = np.gradient(at.warmth[order])
    return out
