"""Plans from files to tables, JSON and a table of points that the machine can run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.bench import bench_proposals
from pkmcal_cli.calibration.observability import observability
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.calibration.residual import evaluate, reasons
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis, candidates_of
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.diagnosis.plan import Aim, Chosen, Plan, best_points, plan_of, whitened_blocks, with_rows
from pkmcal_cli.loading.covariates import with_directions
from pkmcal_cli.loading.machine import LoadedMachine, load_machine, load_parameters
from pkmcal_cli.loading.poses import PoseSource, failed_rows
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import DIRECTIONS, drive_positions
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.failed_rows import FailedRows
from pkmcal_cli.report.plan import PlanReport
from pkmcal_cli.workflow.arguments import given, one_stdin, selection
from pkmcal_cli.workflow.schedule import write_schedule
from pkmcal_cli.workflow.sides import moves_together, sides

_POOL = 400  # candidate points, at least; twice as many as are wanted
_NO_APPROACH = (
    "more drives hold their position than there are degrees of freedom: no column `approach.DRIVE`, as drives that go "
    "there one by one would strain the machine; `dir.DRIVE` are the sides of a straight motion of the TCP"
)
_WIDER = 0.1  # by which share of the plan's box candidates may lie outside it


@dataclass(frozen=True, kw_only=True)
class PlanRequest:
    """The arguments of `plan`."""

    machine: str
    poses: str | None
    grid: str | None
    parameters: str | None
    select: str
    see: str | None
    separate: str | None
    determine: str | None
    points: int
    output: str | None
    seed: int
    as_json: bool
    quiet: bool
    force: bool


def run_plan(request: PlanRequest) -> int:
    """Show what a plan can do and which points to add; returns the exit code. Raises PkmcalError."""
    _check(request)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine, receptive=True)
    selected = selection(loaded.model, request.select)
    source = PoseSource(loaded=loaded, path=request.poses, grid=request.grid)
    poses = source.together()
    rows = with_directions(poses.rows, [a.name for a in loaded.model.actuators])
    start = load_parameters(loaded.model, request.parameters)
    for text in start.warnings:
        to.warn(text)
    inputs = loaded.inputs | start.inputs | source.inputs
    check_target(request.output, inputs, force=request.force)
    found = candidates_of(loaded.model, selected, rows)
    values = np.append(start.values, _nulls(found, loaded.model))
    problem = design_problem(found.model, rows, poses.measured)
    if not problem.count:
        what, hint = "no channel has a sigma: nothing would be measured", "declare a sensor with `reads:` and `sigma:`"
        raise BadInput.single(what, Location(request.machine), hint, "sensors")
    failed = FailedRows(reasons(problem, evaluate(problem, values)), poses.place, len(problem))
    failed.show(to)
    problem = _predicted(problem, failed)
    plan = plan_of(found, problem, values, selected)
    aim = _aim(request, found, loaded.model, selected)
    added, chosen = None, None
    if aim is not None:
        added, chosen = _added(loaded, plan, problem, values=values, selected=selected, aim=aim, request=request)
    bench = bench_proposals(problem.model, observability(problem, values, selected).found)
    nominal = request.parameters is None
    report = PlanReport(loaded.machine, plan, at_nominal=nominal, aim=aim, added=added, chosen=chosen, bench=bench)
    report.show(to)
    if request.output is not None:
        every = _scheduled(loaded, problem, added, values, request.seed)
        count = write_schedule(loaded, every, request.seed, request.output, inputs, request.force)
        to.say(f"written: {request.output} ({count} rows in the order of measurement)")
        to.notes([_NO_APPROACH] if moves_together(loaded) else [])
    if request.as_json:
        emit_json(report.json() | failed.json())
    return 0


def _predicted(problem: Problem, failed: FailedRows) -> Problem:
    """The rows of a plan that can be predicted. Raises BadInput where half cannot."""
    if 2 * len(failed.reasons) >= len(problem):
        raise failed_rows(failed.place, dict(failed.reasons))
    return problem.take(np.array([k for k in range(len(problem)) if k not in failed.reasons], dtype=np.intp))


def _nulls(found: Candidates, model: Model) -> Array:
    return found.model.nominal[len(model.parameters) :]


def _check(request: PlanRequest) -> None:
    """Whether the arguments go together, and the result can be written. Raises UsageError and OutputError."""
    if len(given(request.see, request.separate, request.determine)) > 1:
        raise UsageError("give one of --see, --separate and --determine", hint="one aim at a time")
    if request.as_json and request.output is not None and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    one_stdin(request.machine, request.poses, request.parameters)
    check_target(request.output, given(request.machine, request.poses, request.parameters), force=request.force)


def _aim(request: PlanRequest, found: Candidates, model: Model, selected: tuple[str, ...]) -> Aim | None:
    """What further points are for, None where none are wanted. Raises UsageError."""
    if request.determine is not None:
        names = selection(model, request.determine, "--determine")
        lost = [n for n in names if n not in selected]
        if lost:
            raise UsageError(f"--determine: `{lost[0]}` is not selected", hint=f"--select auto,{lost[0]}")
        return Aim("determine", (names,))
    text, option = (request.see, "--see") if request.see is not None else (request.separate, "--separate")
    if text is None:
        return None
    chosen = [_hypothesis(part.strip(), found, option) for part in text.split(",")]
    if option == "--see":
        return Aim("see", tuple(h.parameters for h in chosen))
    if len(set(chosen)) < 2 or len(set(chosen)) < len(chosen):
        raise UsageError("--separate: give two different effects or more", hint="--separate backlash@q1,drift")
    return Aim("separate", tuple(h.parameters for h in chosen))


def _hypothesis(name: str, found: Candidates, option: str) -> Hypothesis:
    """A hypothesis by its name, or by its keyword where it has one place only."""
    known = {h.name: h for h in found.hypotheses}
    if name in known:
        return known[name]
    places = [h for h in found.hypotheses if h.effect == name]
    if len(places) == 1:
        return places[0]
    why = dict(found.not_testable).get(name.partition("@")[0])
    if why is not None:
        raise UsageError(f"{option}: `{name}` cannot be seen by this plan", hint=f"it needs {why}")
    hint = f"one of {', '.join(h.name for h in places[:8])}" if places else did_you_mean(name, known)
    raise UsageError(f"{option}: no effect `{name}` on this machine", hint=hint)


def _scheduled(loaded: LoadedMachine, problem: Problem, added: Problem | None, values: Array, seed: int) -> Rows:
    """Rows to measure: those planned, from random sides, and those added, from theirs."""
    drawn = sides(loaded, _places(problem.model, problem.rows, values), np.random.default_rng([seed, 1]))
    columns = {f"dir.{a.name}": column for a, column in zip(loaded.model.actuators, drawn.T, strict=True)}
    planned = replace(problem, rows=replace(problem.rows, columns={**problem.rows.columns, **columns}))
    return planned.rows if added is None else with_rows(planned, added).rows


def _added(
    loaded: LoadedMachine,
    plan: Plan,
    problem: Problem,
    values: Array,
    selected: tuple[str, ...],
    aim: Aim,
    request: PlanRequest,
) -> tuple[Problem, Chosen]:
    """Points to add, out of reachable ones within and a little around the plan."""
    pool = _pool(loaded, problem, values, max(_POOL, 2 * request.points), request.seed)
    both = with_rows(problem, pool)
    others = [n for group in aim.parameters for n in group if n not in selected]
    linear = linear_problem(both, values, selected, others, None)
    chosen = best_points(linear, whitened_blocks(linear, len(both)), len(problem), aim, request.points)
    return pool.take(chosen.rows), chosen


def _pool(loaded: LoadedMachine, problem: Problem, values: Array, size: int, seed: int) -> Problem:
    """Candidate points: random reachable poses, sides that they can be reached from, covariates of the plan."""
    model, rng = problem.model, np.random.default_rng(seed)
    place = _places(model, problem.rows, values)
    low, high = place.min(axis=0), place.max(axis=0)
    wide = _WIDER * (high - low)
    drawn = rng.uniform(low - wide, high + wide, (size, 6))
    drawn[:, [k for k, c in enumerate(DIRECTIONS) if c not in model.independent_coordinates]] = np.nan
    found = drive_positions(model, drawn)
    good = found.status == 0
    for a, actuator in enumerate(model.actuators):
        lower, upper = actuator.limits
        good &= (found.readings[:, a] >= lower) & (found.readings[:, a] <= upper)
    readings = found.readings[good]
    some = rng.integers(0, len(problem), len(readings))  # whose covariates they have
    columns = {name: column[some] for name, column in problem.rows.columns.items()}
    towards = sides(loaded, drawn[good], rng)
    columns |= {f"dir.{a.name}": column for a, column in zip(model.actuators, towards.T, strict=True)}
    rows = Rows(readings, np.full(readings.shape, np.nan), columns)
    solved = predict(model, values, rows, Request()).solved
    return design_problem(model, rows.take(np.nonzero(solved)[0]))


def _places(model: Model, rows: Rows, values: Array) -> Array:
    """TCP coordinates (N, 6) of rows, rotation vectors in the drawing's sense."""
    from pkmcal_cli.model.model import tcp_model

    bare = replace(tcp_model(model), effects=(), parameters=model.parameters)
    found = predict(bare, values, rows).values
    out = np.zeros((len(rows), 6))
    for k, channel in enumerate(bare.channels):
        out[:, DIRECTIONS.index(channel.name)] = found[:, k]
    return out
