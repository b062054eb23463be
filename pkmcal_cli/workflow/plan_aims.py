"""What further points of a plan are for, `--aim`: uncertainty, "l1 5 um", backlash@q2 or separate:A,B."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.error_budget import held_parameters
from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.experiment_design import Aim, Chosen, with_rows
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.added_points import Reached
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.amounts import amount, require_unit, small_example
from pkmcal_cli.workflow.named_effects import like_effect
from pkmcal_cli.workflow.outlook import held_std

OPTION = "--aim"
UNCERTAINTY, SEPARATE = "uncertainty", "separate:"
_EXAMPLE = 'write `uncertainty`, "l1 5 um", `l1,l3`, `backlash@q2` or `separate:backlash@q1,drift`'
_FEW, _MANY = 8, 100  # points to add: as many, or up to so many for a stated uncertainty


@dataclass(frozen=True)
class RequestedAim:
    """An aim; effects: names of those that it is about; limit: of the parameter's standard uncertainty, SI, or None."""

    aim: Aim
    effects: tuple[str, ...] = ()
    limit: float | None = None

    @property
    def most_points(self) -> int:
        """How many points are added, at most, where none is stated."""
        return _FEW if self.limit is None else _MANY


def requested_aim(
    text: str | None, candidates: Candidates, model: Model, selected: tuple[str, ...]
) -> RequestedAim | None:
    """What is aimed at, None where nothing is. Raises UsageError."""
    if text is None:
        return None
    if text.strip() == UNCERTAINTY:
        return RequestedAim(Aim("determine", (selected,)))
    if text.startswith(SEPARATE):
        chosen = _effects(text.removeprefix(SEPARATE), candidates)
        if len(chosen) < 2 or len(set(chosen)) < len(chosen):
            raise UsageError(
                f"{OPTION} separate: needs at least two different effects",
                hint=f"write e.g. `{OPTION} separate:backlash@q1,drift`",
            )
        return RequestedAim(Aim("separate", tuple(h.parameters for h in chosen)), tuple(h.name for h in chosen))
    name, _, value = text.strip().partition(" ")
    if value:
        return _reached(name, value, model, selected)
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if not parts:
        raise UsageError(f"{OPTION}: `{text}` names nothing", hint=_EXAMPLE)
    if all(part in model.names for part in parts):
        return RequestedAim(Aim("determine", (_selected(parts, selected),)))
    chosen = _effects(text, candidates)
    return RequestedAim(Aim("see", tuple(h.parameters for h in chosen)), tuple(h.name for h in chosen))


def _reached(name: str, value: str, model: Model, selected: tuple[str, ...]) -> RequestedAim:
    """A standard uncertainty that a parameter is to have. Raises UsageError."""
    if name not in model.names:
        hint = did_you_mean(name, model.names, _EXAMPLE)
        raise UsageError(f"{OPTION}: the machine has no parameter `{name}`", hint=hint)
    parameter_unit = parse_unit(model.parameters[model.names.index(name)].unit or "1").difference
    limit, unit = amount(OPTION, value, fitting=(parameter_unit.dimension,))
    require_unit(OPTION, f"{name} {value}", unit, parameter_unit)
    if unit.dimension != parameter_unit.dimension or limit <= 0:
        raise UsageError(
            f"{OPTION}: `{value}` is not an uncertainty of `{name}`", hint=f"write e.g. {small_example(parameter_unit)}"
        )
    return RequestedAim(Aim("determine", (_selected([name], selected),)), (), limit)


def _selected(names: list[str], selected: tuple[str, ...]) -> tuple[str, ...]:
    lost = [n for n in names if n not in selected]
    if lost:
        raise UsageError(f"{OPTION}: `{lost[0]}` is not selected", hint=f"add `--select auto,{lost[0]}`")
    return tuple(names)


def _effects(text: str, candidates: Candidates) -> list[Hypothesis]:
    return [_effect(part.strip(), candidates) for part in text.split(",") if part.strip()]


def _effect(name: str, candidates: Candidates) -> Hypothesis:
    """A hypothesis by its name, or by its keyword where it has one place only. Raises UsageError."""
    known = {h.name: h for h in candidates.single}
    if name in known:
        return known[name]
    places = [h for h in candidates.single if h.effect == name]
    if len(places) == 1:
        return places[0]
    why = dict(candidates.not_testable).get(name.partition("@")[0])
    if why is not None:
        raise UsageError(f"{OPTION}: this plan cannot show `{name}`", hint=f"add what it needs: {why}")
    hint = like_effect(name, known, _EXAMPLE)
    raise UsageError(f"{OPTION}: this machine has no effect or parameter `{name}`", hint=hint)


def fewest(
    problem: Problem, pool: Problem, chosen: Chosen, goal: RequestedAim, values: Array, selected: tuple[str, ...]
) -> tuple[Chosen, Reached]:
    """Of the points chosen, in the order of their gain, as few as keep the limit; all where none do."""
    ((name,),) = goal.aim.parameters
    assert goal.limit is not None

    def std(count: int) -> float:
        some = problem if not count else with_rows(problem, pool.take(chosen.rows[:count]))
        observed = observability(some, values, selected)
        lost = observed.directions.undetermined()[observed.selected.index(name)]
        return float("inf") if lost else float(observed.std[observed.selected.index(name)])

    before, most = std(0), len(chosen.rows)
    low, high = (0, 0) if before <= goal.limit else (0, most)
    if before > goal.limit >= std(most):
        while high - low > 1:  # more points never tell less
            middle = (low + high) // 2
            low, high = (low, middle) if std(middle) <= goal.limit else (middle, high)
    rows = np.asarray(chosen.rows[:high])
    return Chosen(rows, chosen.before, chosen.after), Reached(name, goal.limit, before, std(high))


def fewest_beside_held(
    problem: Problem, pool: Problem, chosen: Chosen, goal: RequestedAim, values: Array, selected: tuple[str, ...]
) -> tuple[Chosen, Reached]:
    """The same, and what parameters that are not identified add to the uncertainty then: no points take that away."""
    chosen, reached = fewest(problem, pool, chosen, goal, values, selected)
    if not math.isfinite(reached.after):
        return chosen, reached
    rows = with_rows(problem, pool.take(chosen.rows))
    observed = observability(rows, values, selected)
    held = held_parameters(problem, observed.selected, () if observed.datum is None else observed.datum.held)
    added = held_std(rows, values, observed.selected, held, reached.name) if held else 0.0
    return chosen, replace(reached, held=added)
