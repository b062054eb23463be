"""What each effect does to the readings: simulated one by one at its plausible size, beside what parameters take up."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.misfit import residuals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.diagnosis.visible_sizes import absorbing
from pkmcal_cli.effects import Column, catalogue
from pkmcal_cli.prediction import Prediction, Request, fixed_smoothing, predict
from pkmcal_cli.units.measurands import Measurand

_EQUAL = 1e-9  # relative: sizes that differ by rounding
_NOTHING = 1e-9  # of the machine's size, rad, and of the largest force: what rounding moves
_LAST = 1e12
_RELAXED = 1e-10  # J: strain energy of a machine in which nothing is strained
UNLOADED = "nothing is strained at these poses"
_AT_REST: dict[Column, str] = {
    "temperature": "the temperature is that of reference in every pose",
    "payload": "there is no payload in any pose",
    "direction": "no pose has a direction of approach",
}


@dataclass(frozen=True)
class Movement:
    """What one parameter at a size (SI) moves: largest and rms change (C,) of every reading, SI, nan where none is.

    `lost`: why poses have no solution with it, by row.
    """

    parameter: str
    size: float
    largest: Array
    rms: Array
    lost: dict[int, str]


@dataclass(frozen=True)
class SimulatedEffect:
    """An effect at one place. `scale` (C,): by which changes of different readings are compared.

    `reason`: why it moves nothing; "" where it does. `taken_up_by`: identified parameters that move the readings alike.
    """

    hypothesis: Hypothesis
    movements: tuple[Movement, ...]
    scale: Array
    taken_up_by: tuple[str, ...]
    reason: str

    @cached_property
    def leading(self) -> tuple[Movement, int]:
        """The parameter that moves a reading most, and the number of this reading; of equals the first."""
        sizes = np.nan_to_num([m.rms / self.scale for m in self.movements], nan=-1.0)
        k, c = np.unravel_index(np.argmax(sizes >= sizes.max() * (1 - _EQUAL)), sizes.shape)
        return self.movements[int(k)], int(c)

    @property
    def share(self) -> float:
        """Rms change of that reading, in its scale."""
        movement, channel = self.leading
        return float(np.nan_to_num(movement.rms[channel] / self.scale[channel]))


def simulated_effects(
    candidates: Candidates, problem: Problem, values: Array, selected: tuple[str, ...], still: Prediction
) -> tuple[SimulatedEffect, ...]:
    """Every effect that the poses can show, by what it moves, most first.

    `problem`: of the candidates' model, which `still` predicts in all rows at parameter values (P,); `selected`: the
    parameters that a calibration identifies.
    """
    problem = replace(problem, model=fixed_smoothing(problem.model, values, problem.rows))
    hypotheses = [h for h in candidates.single if h.effect != RELEASE]
    taken = _taken_up(problem, values, selected, hypotheses, still)
    nothing = _rounding(problem, still)
    scale = _scale(problem, nothing)
    strained = still.energy is not None and bool((still.energy > _RELAXED).any())
    simulated = []
    for h in hypotheses:
        movements = tuple(_movements(problem, values, h, still))
        reason = _why_still(h, movements, nothing, strained)
        simulated.append(SimulatedEffect(h, movements, scale, () if reason else taken.get(h.name, ()), reason))
    return tuple(sorted(simulated, key=lambda s: -s.share))


def _movements(problem: Problem, values: Array, hypothesis: Hypothesis, still: Prediction) -> Iterator[Movement]:
    """By each parameter of an effect, but for those that are no part of it."""
    model = problem.model
    before = replace(problem, readings=still.values, measured=np.isfinite(still.values))
    for name in hypothesis.parameters:
        if name in hypothesis.free:
            continue
        k = model.names.index(name)
        moved = values.copy()
        moved[k] += model.parameters[k].range
        prediction = predict(model, moved, problem.rows, Request(), still.start)
        change = np.where(before.measured, -residuals(before, prediction.values), np.nan)
        on = np.isfinite(change)
        count = np.maximum(on.sum(axis=0), 1)
        largest = np.where(on.any(axis=0), np.where(on, np.abs(change), 0.0).max(axis=0, initial=0.0), np.nan)
        rms = np.where(on.any(axis=0), np.sqrt(np.where(on, change**2, 0.0).sum(axis=0) / count), np.nan)
        lost = {int(row): prediction.reason(int(row)) for row in np.nonzero(~prediction.solved)[0]}
        yield Movement(name, model.parameters[k].range, largest, rms, lost)


def _taken_up(
    problem: Problem, values: Array, selected: tuple[str, ...], hypotheses: list[Hypothesis], still: Prediction
) -> dict[str, tuple[str, ...]]:
    """Identified parameters that move the readings as effects do, by the effects' names."""
    if not problem.count or not selected:
        return {}
    linear = linear_problem(problem, values, selected, [n for h in hypotheses for n in h.parameters], still.start)
    by = {h.name: absorbing(linear, h, np.eye(len(h.parameters))[linear.score_of(h).leading]) for h in hypotheses}
    return {name: names for name, names in by.items() if names}


def _rounding(problem: Problem, still: Prediction) -> Array:
    """Changes (C,) of readings, SI, up to which nothing has moved."""
    sizes = []
    for c, channel in enumerate(problem.model.channels):
        read = np.abs(still.values[:, c][np.isfinite(still.values[:, c])]).max(initial=1.0)
        size = problem.model.length if channel.dimension == "length" else 1.0
        sizes.append(read if channel.measurand is Measurand.FORCE else size)
    return _NOTHING * np.array(sizes)


def _scale(problem: Problem, nothing: Array) -> Array:
    """What a change of each reading (C,) is compared with: its standard uncertainty; those without one come last."""
    on: NDArray[np.bool_] = problem.measured
    sigma = np.sqrt(np.where(on, problem.sigma**2, 0.0).sum(axis=0) / np.maximum(on.sum(axis=0), 1))
    return np.where(on.any(axis=0), sigma, _LAST * nothing)


def _why_still(hypothesis: Hypothesis, movements: tuple[Movement, ...], nothing: Array, strained: bool) -> str:
    """Why an effect moves nothing; "" where it moves a reading."""
    effect = catalogue()[hypothesis.effect]
    if (effect.enters == "stiffness" or effect.reactive) and not strained:
        return UNLOADED
    if any((np.nan_to_num(m.largest) > nothing).any() for m in movements):
        return ""
    lost = {reason for m in movements for reason in m.lost.values()}
    if lost and all(np.isnan(m.largest).all() for m in movements):
        return f"no pose has a solution with it: {sorted(lost)[0]}"
    reasons_at_rest = [_AT_REST[need] for need in effect.needs if need in _AT_REST]
    return reasons_at_rest[0] if reasons_at_rest else "no reading feels it"
