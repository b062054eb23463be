"""`plan --next`: from a table that grows, the points to measure next, until a parameter is as well known as is wanted.

What is left to do follows from what was measured: parameters as fitted, noise as the residuals show it. So a surprise
(more noise, poses that cannot be had) changes the next points instead of spoiling the plan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput, UsageError
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import Calibration, FitOptions, calibrated
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.diagnosis.experiment_design import best_points, whitened_blocks, with_rows
from pkmcal_cli.diagnosis.hypotheses import candidates_of
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.gross_errors.hints import nothing_measured
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_measurements, load_parameters
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.report.added_points import OTHER_MEASUREMENTS, Added, Reached
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import finite, readable
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.workflow.approaches import Approaches
from pkmcal_cli.workflow.arguments import selection
from pkmcal_cli.workflow.candidate_points import candidate_points
from pkmcal_cli.workflow.next_batch import IN_WORDS, Advice, advice, batch
from pkmcal_cli.workflow.outlook import Outlook, held_std
from pkmcal_cli.workflow.plan_aims import RequestedAim, fewest, requested_aim
from pkmcal_cli.workflow.unsolved_rows import unsolved

_POOL = 1000
_NEAR = 0.05  # of a drive's travel in the table: points so near to one that could not be measured are not proposed
_NO_WORKSPACE = (
    "help: candidate points lie around the measured ones; declare `workspace:` in the machine file to use all of it"
)
_EXAMPLE = 'write e.g. --aim "l1 5 um"'


@dataclass(frozen=True, kw_only=True)
class NextPoints:
    """How well the parameter is known by `rows` measured, and what is to be measured next; noise: times the stated."""

    loaded: LoadedMachine
    rows: int
    budget: int
    noise: float
    advice: Advice  # the command that looks for a cause where there is more than noise
    added: Added
    ways: Approaches
    needed: int
    value: float  # of the parameter as it is known now, SI
    inputs: Mapping[str, str] = field(default_factory=dict)  # sha256 by name
    with_sessions: bool = False  # whether the table has a column for them

    @property
    def status(self) -> str:
        """`reached`: stop; `continue`; `not_reached`: the budget is spent, or will not do."""
        assert self.added.reached is not None
        if self.added.reached.before <= self.added.reached.limit:
            return "reached"
        return "continue" if len(self.added.points) else "not_reached"

    @property
    def rows_to_append(self) -> Rows:
        """The points as rows of the same table: with sessions where it has a column for them."""
        rows = self.added.points.rows
        return rows if self.with_sessions else rows.without_sessions()

    def show(self, to: Reporter) -> None:
        """The verdict first, then the points."""
        reached, unit = self.added.reached, parameter_unit(self.loaded.model, self._name)
        assert reached is not None
        known = f"{self._name} is {_text(reached.before, unit, 'known to ')}"
        aim = f"wanted {readable(reached.limit, unit)}"
        if self.status == "reached":
            to.say(f"REACHED with {count(self.rows, 'row')}: {known}, {aim}")
        elif self.status == "not_reached":
            to.fail(f"NOT REACHED within {count(self.budget, 'row')}: {known}, {aim}; {self._remedy}")
            if self.loaded.model.workspace is None and self.rows < self.budget:
                to.say(_NO_WORKSPACE)
        else:
            after = _text(reached.after, unit)
            more = f"about {count(self.needed, 'further row')} needed (then {after} expected)"
            to.say(f"continue: {known}, {aim}; {more}; next {len(self.added.points)}:")
        if self.advice:
            to.warn(f"warning: residuals are {self.noise:.2g} times the stated noise: {IN_WORDS[self.advice]}")
        if len(self.added.points):
            self.added.show_points(to, self.loaded.model)
            self._show_session(to)

    @property
    def _remedy(self) -> str:
        """What to do where the budget does not do."""
        reached = self.added.reached
        assert reached is not None
        if reached.within_reach(self.needed):
            return "use other measurements, or more"
        return f"further rows hardly help, only {OTHER_MEASUREMENTS}"

    def _show_session(self, to: Reporter) -> None:
        """Which session the points go on with, and what to do if they are measured in another."""
        rows = self.rows_to_append
        if rows.session_names:
            name = rows.session_names[int(rows.session[0])]
            text = f"they go on with session `{name}`; if they are measured in another, write its name in their column"
            to.say(f"{text} `session`: what each session has for itself then needs rows of its own")

    @property
    def _name(self) -> str:
        assert self.added.reached is not None
        return self.added.reached.name

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        model = self.loaded.model
        return {
            "status": self.status,
            "n_rows": self.rows,
            "budget": self.budget,
            "needed": self.needed,
            "noise": finite(self.noise),
            "aim": self.added.json(model),
            "points": self.added.cells(model),
        }


def _text(std: float, unit: Any, before: str = "") -> str:
    return before + readable(std, unit) if math.isfinite(std) else "undetermined"


def next_points(
    machine: str, table: str, parameters: str | None, select: str, aim: str | None, budget: int, seed: int, to: Reporter
) -> NextPoints:
    """The points to measure next. Raises PkmcalError."""
    loaded = load_machine(machine, receptive=True, tables=[table])
    measured = load_measurements(loaded, [table])
    to.notes(measured.notes)
    loaded = loaded.for_sessions(measured.named_sessions)
    problem = problem_of(loaded.model, measured)
    if not problem.count:
        raise BadInput([nothing_measured(loaded, problem)])
    selected = selection(problem.model, select)
    problem = with_unknown_sides(problem, selected)
    start = load_parameters(problem.model, parameters)
    for text in start.remarks(bool(measured.named_sessions), selected):
        to.warn(text)
    goal = requested_aim(aim, candidates_of(loaded.model, selected, problem.rows), problem.model, selected)
    if goal is None or goal.limit is None:
        raise UsageError("--next needs an uncertainty at which to stop", hint=_EXAMPLE)
    doubted = replace(problem, model=_doubted(problem.model))
    try:
        session = np.asarray(measured.session)
        with to.stages() as observe:
            fit = calibrated(doubted, selected, start.values, FitOptions(), session, observe=observe)
    except RowsFailed as failure:
        raise unsolved(measured, failure.evaluation.prediction) from None
    campaign = _Campaign.of(problem, fit)
    inputs = loaded.inputs | start.inputs | measured.inputs
    with to.step("points to measure next"):
        proposal = _proposed(loaded, campaign, goal, budget, seed)
    return replace(proposal, inputs=inputs, with_sessions="session" in measured.labels)


def _doubted(model: Model) -> Model:
    """The model whose stated sigmas are worth as little as unknown ones; exact ones stay.

    A mean of what few rows show and what is stated would end a campaign too early where there is more noise.
    """
    channels = tuple(replace(c, sigma_is="unknown") if c.sigma_is == "stated" else c for c in model.channels)
    drives = tuple(replace(a, sigma_is="unknown") if a.sigma_is == "stated" else a for a in model.actuators)
    return replace(model, channels=channels, actuators=drives)


@dataclass(frozen=True, kw_only=True)
class _Campaign:
    """What was measured, set values (n, A) that could not be, and what follows: values (P,), std (p,), noise.

    by_held: the part (p,) of std that parameters add which are not identified, `held`.
    """

    problem: Problem
    lost: Array
    values: Array
    selected: tuple[str, ...]
    std: Array
    by_held: Array
    held: tuple[str, ...]
    noise: float
    advice: Advice

    @classmethod
    def of(cls, problem: Problem, fit: Calibration) -> _Campaign:
        """Of a table, and its fit."""
        done = np.nonzero(problem.measured.any(axis=1))[0]
        noise = float(fit.budget.scales.typical_noise.max()) ** 0.5
        return cls(
            problem=problem.take(done),
            lost=np.delete(problem.rows.readings, done, axis=0),
            values=fit.robust.fit.values,
            selected=fit.robust.fit.selected,
            std=fit.intervals.std,
            by_held=fit.budget.std_by_held,
            held=fit.budget.held,
            noise=noise,
            advice=advice(noise, fit.robust.fit.dof, len(done)),
        )

    @property
    def going_on(self) -> NDArray[np.intp]:
        """Rows of the session that was measured last, by time where all rows have one: the earlier ones are over."""
        rows = self.problem.rows
        time = rows.columns.get("time", np.full(len(rows), np.nan))
        last = int(np.argmax(time)) if np.isfinite(time).all() else -1
        return np.nonzero(rows.session == rows.session[last])[0]

    def held_after(self, further: Problem, name: str) -> float:
        """What these add to the uncertainty of a parameter after further rows, SI, as the design has it."""
        before, after = (
            held_std(rows, self.values, self.selected, self.held, name)
            for rows in (self.problem, with_rows(self.problem, further))
        )
        return float(self.by_held[self.selected.index(name)]) * (after / before if before > 0.0 else 1.0)


def _proposed(loaded: LoadedMachine, campaign: _Campaign, goal: RequestedAim, budget: int, seed: int) -> NextPoints:
    """Next points by the design that the fitted machine asks for, with the noise that was seen."""
    ((name,),) = goal.aim.parameters
    assert goal.limit is not None
    std = float(campaign.std[campaign.selected.index(name)]) if name in campaign.selected else math.nan
    std = math.inf if math.isnan(std) else std
    left = budget - len(campaign.problem) if std > goal.limit else 0
    size, own_seed = max(_POOL, 2 * left), seed + len(campaign.problem)
    pool, ways = candidate_points(loaded, campaign.problem, campaign.values, size, own_seed, campaign.going_on)
    far = _far(pool.rows.readings, campaign)
    pool, ways = pool.take(far), ways.take(far)
    linear = linear_problem(with_rows(campaign.problem, pool), campaign.values, campaign.selected, [], None)
    blocks = whitened_blocks(linear, len(campaign.problem) + len(pool))
    chosen = best_points(linear, blocks, len(campaign.problem), goal.aim, max(left, 0), exchange=False)
    held = campaign.held_after(pool.take(chosen.rows), name) if math.isfinite(std) else 0.0
    outlook = Outlook.of(campaign.noise, _design_std(campaign, name), std, goal.limit, held)
    promised = replace(goal, limit=outlook.promised(goal.limit))
    chosen, reached = fewest(campaign.problem, pool, chosen, promised, campaign.values, campaign.selected)
    needed = len(chosen.rows)
    first = chosen.rows[: batch(needed, len(campaign.problem), campaign.advice) if reached.done else 0]
    reach = Reached(name, goal.limit, std, outlook.std(reached.after))
    added = Added(goal.aim, pool.take(first), replace(chosen, rows=first), reach)
    value = float(campaign.values[campaign.problem.model.names.index(name)])
    return NextPoints(
        loaded=loaded, rows=len(campaign.problem), budget=budget, noise=campaign.noise, advice=campaign.advice,
        added=added, ways=ways.take(first), needed=needed, value=value,
    )  # fmt: skip


def _design_std(campaign: _Campaign, name: str) -> float:
    """What the rows promise at the stated noise, SI; inf where the parameter is not determined."""
    observed = observability(campaign.problem, campaign.values, campaign.selected)
    k = observed.selected.index(name)
    return math.inf if observed.directions.undetermined()[k] else float(observed.std[k])


def _far(readings: Array, campaign: _Campaign) -> NDArray[np.intp]:
    """Candidates (n, A) that are not near set values at which nothing could be measured."""
    if not len(campaign.lost):
        return np.arange(len(readings))
    travel = np.ptp(campaign.problem.rows.readings, axis=0)
    scale = np.where(travel > 0, travel, 1.0) * _NEAR
    apart = np.abs(readings[:, None] - campaign.lost[None]) / scale
    return np.nonzero((apart.max(axis=2) > 1).all(axis=1))[0]
