"""Plans from files to tables, JSON and a table of points that the machine can run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.bench_measurements import bench_proposals
from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.calibration.residual import evaluate, reasons
from pkmcal_cli.diagnosis.experiment_design import Aim, Chosen, Plan, best_points, plan_of, whitened_blocks, with_rows
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis, candidates_of
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.diagnosis.power import Campaigns
from pkmcal_cli.language.tool_point import ToolPoint
from pkmcal_cli.loading.covariates import with_directions
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_parameters
from pkmcal_cli.loading.pose_channels import known_channels, planned_channels
from pkmcal_cli.loading.tool_coordinates import required_tool_point, tool_motion
from pkmcal_cli.loading.workspace_poses import out_of_workspace
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.touching import tcp_places, touching
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.plan_report import PlanReport
from pkmcal_cli.workflow.alpha import check_alpha
from pkmcal_cli.workflow.arguments import given, one_stdin, require_measured, selection
from pkmcal_cli.workflow.plan_power import power_of_plan
from pkmcal_cli.workflow.pose_set import PoseSet, default_poses, pose_set
from pkmcal_cli.workflow.schedule import write_schedule
from pkmcal_cli.workflow.sides import moves_together, sides
from pkmcal_cli.workflow.touched_poses import readings_at_touch, touching_poses

_POOL = 400  # candidate points, at least; twice as many as are wanted
_NO_APPROACH = (
    "no column `approach.DRIVE`: more drives hold their position than there are degrees of freedom, so moving them one "
    "by one would strain the machine; `dir.DRIVE` is for a straight motion of the TCP"
)
_ROUNDS = 10  # draws of candidate points, until there are enough in the workspace
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
    power: int
    alpha: float
    output: str | None
    seed: int
    as_json: bool
    quiet: bool
    force: bool


def run_plan(request: PlanRequest) -> int:
    """Show what a plan can do and which points to add; returns the exit code. Raises PkmcalError."""
    _check(request)
    to = Reporter(request.quiet)
    loaded, poses = _read(request, to)
    selected = selection(loaded.model, request.select)
    start = load_parameters(loaded.model, request.parameters)
    for text in start.warnings:
        to.warn(text)
    poses = touching_poses(to, loaded, start.values, poses)
    rows = with_directions(poses.poses.rows, [a.name for a in loaded.model.actuators])
    inputs = loaded.inputs | start.inputs | poses.inputs
    check_target(request.output, inputs, force=request.force)
    candidates = candidates_of(loaded.model, selected, rows)
    values = np.append(start.values, _nulls(candidates, loaded.model))
    channels = planned_channels(loaded.model, poses.poses.measured, poses.poses.touched)
    problem = design_problem(candidates.model, rows, channels)
    require_measured(problem)
    problem, used = _predicted(problem, poses, values, to)
    plan = plan_of(candidates, problem, values, selected, request.alpha, request.seed)
    aim = _aim(request, candidates, loaded.model, selected)
    tool, added, chosen = used.tool, None, None
    if aim is not None:
        tool = _posed(loaded, to, used)
        added, chosen = _added(loaded, plan, problem, values=values, selected=selected, aim=aim, request=request)
    bench = bench_proposals(problem.model, observability(problem, values, selected).directions)
    campaigns = Campaigns(plan, values, selected, request.alpha, request.seed)
    rates, at_nominal = (
        power_of_plan(request.power, _wanted(request, candidates), campaigns, to),
        request.parameters is None,
    )
    report = PlanReport(
        loaded.machine, plan, at_nominal=at_nominal, aim=aim, added=added, chosen=chosen, bench=bench, rates=rates
    )
    _show(report, Loads.of(problem.model, values, problem.rows, used.poses.place), to)
    if request.output is not None:
        _write(request.output, request, loaded, _scheduled(loaded, problem, added, values, request.seed), inputs, to)
    if request.as_json:
        emit_json({"tool_point": tool and tool.name, **report.json(), **used.failed.json()})
    return 0


def _write(
    output: str, request: PlanRequest, loaded: LoadedMachine, every: Rows, inputs: dict[str, str], to: Reporter
) -> None:
    """The schedule as a file or a stream. Raises OutputError."""
    count = write_schedule(loaded, every, request.seed, output, inputs, request.force)
    to.say(f"written: {output} ({count} rows in the order of measurement)")
    to.notes([_NO_APPROACH] if moves_together(loaded) else [])


def _wanted(request: PlanRequest, candidates: Candidates) -> list[str]:
    """Names of the effects that are to be seen or separated. Raises UsageError."""
    wanted = [part.strip() for part in (request.see or request.separate or "").split(",") if part.strip()]
    return [_hypothesis(name, candidates, "--see" if request.see else "--separate").name for name in wanted]


def _read(request: PlanRequest, to: Reporter) -> tuple[LoadedMachine, PoseSet]:
    """The machine, with what sessions have for themselves, and the poses of the plan."""
    loaded = load_machine(request.machine, receptive=True)
    wanted = request.output or request.see or request.separate or request.determine
    if wanted is not None and all(d.force_controlled for d in loaded.model.topology.drives):
        what = "no actuator holds a position, so there are no points to choose or to schedule"
        raise UsageError(what, hint="leave out --see, --separate, --determine and -o")
    if not any(p.per_session for p in loaded.model.parameters):  # else the sessions must be known first
        selection(loaded.model, request.select)
    chosen = request.poses is None and request.grid is None and loaded.model.workspace is not None
    poses = default_poses(to, loaded) if chosen else pose_set(to, loaded, request.poses, request.grid)
    return loaded.for_sessions(poses.every.rows.session_names), poses


def _predicted(problem: Problem, poses: PoseSet, values: Array, to: Reporter) -> tuple[Problem, PoseSet]:
    """The rows of a plan that can be predicted, and their poses; the others are told. Raises BadInput where half of a
    table cannot, or none is left.
    """
    lost = reasons(problem, evaluate(problem, values))
    used = (poses.without_points if 2 * len(lost) >= len(problem) else poses.without)(lost)
    used.failed.show(to)
    return problem.take(np.delete(np.arange(len(problem)), list(lost))), used


def _show(report: PlanReport, loads: Loads, to: Reporter) -> None:
    """The plan, then what drives and ropes bear in it."""
    report.show(to)
    loads.show(to)


def _posed(loaded: LoadedMachine, to: Reporter, poses: PoseSet) -> ToolPoint:
    """The tool point, of whose poses points are chosen; it is told unless it was. Raises BadInput without any."""
    tool_motion(loaded)
    tool = required_tool_point(loaded)
    to.notes([] if poses.tool is not None else [tool.text])
    return tool


def _nulls(candidates: Candidates, model: Model) -> Array:
    return candidates.model.nominal[len(model.parameters) :]


def _check(request: PlanRequest) -> None:
    """Whether the arguments go together, and the result can be written. Raises UsageError and OutputError."""
    if len(given(request.see, request.separate, request.determine)) > 1:
        raise UsageError("--see, --separate and --determine exclude each other", hint="give only one of them")
    if request.as_json and request.output is not None and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    check_alpha(request.alpha)
    one_stdin(request.machine, request.poses, request.parameters)
    check_target(request.output, given(request.machine, request.poses, request.parameters), force=request.force)


def _aim(request: PlanRequest, candidates: Candidates, model: Model, selected: tuple[str, ...]) -> Aim | None:
    """What further points are for, None where none are wanted. Raises UsageError."""
    if request.determine is not None:
        names = selection(model, request.determine, "--determine")
        lost = [n for n in names if n not in selected]
        if lost:
            raise UsageError(f"--determine: `{lost[0]}` is not selected", hint=f"add `--select auto,{lost[0]}`")
        return Aim("determine", (names,))
    text, option = (request.see, "--see") if request.see is not None else (request.separate, "--separate")
    if text is None:
        return None
    chosen = [_hypothesis(part.strip(), candidates, option) for part in text.split(",")]
    if option == "--see":
        return Aim("see", tuple(h.parameters for h in chosen))
    if len(set(chosen)) < 2 or len(set(chosen)) < len(chosen):
        raise UsageError(
            "--separate needs at least two different effects", hint="write e.g. `--separate backlash@q1,drift`"
        )
    return Aim("separate", tuple(h.parameters for h in chosen))


def _hypothesis(name: str, candidates: Candidates, option: str) -> Hypothesis:
    """A hypothesis by its name, or by its keyword where it has one place only."""
    known = {h.name: h for h in candidates.single}
    if name in known:
        return known[name]
    places = [h for h in candidates.single if h.effect == name]
    if len(places) == 1:
        return places[0]
    why = dict(candidates.not_testable).get(name.partition("@")[0])
    if why is not None:
        raise UsageError(f"{option}: this plan cannot show `{name}`", hint=f"add what it needs: {why}")
    hint = f"name one of {', '.join(h.name for h in places[:8])}" if places else did_you_mean(name, known)
    raise UsageError(f"{option}: this machine has no effect `{name}`", hint=hint)


def _scheduled(loaded: LoadedMachine, problem: Problem, added: Problem | None, values: Array, seed: int) -> Rows:
    """Rows to measure: those planned, from random sides, and those added, from theirs."""
    drawn = sides(loaded, tcp_places(problem.model, values, problem.rows), np.random.default_rng([seed, 1]))
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
    poses, readings = _drawn(loaded, tcp_places(model, values, problem.rows), size, rng)
    some = rng.integers(0, len(problem), len(readings))  # whose covariates they have
    columns = {name: column[some] for name, column in problem.rows.columns.items()}
    towards = sides(loaded, poses, rng)
    columns |= {f"dir.{a.name}": column for a, column in zip(model.actuators, towards.T, strict=True)}
    rows = Rows(readings, np.full(readings.shape, np.nan), columns)
    touched = known_channels(model) & problem.measured.all(axis=0)  # probes that touch at every pose of the plan
    rows, done = touching(model, values, rows, readings_at_touch(model, np.tile(touched, (len(rows), 1))))
    good = np.nonzero(done & predict(model, values, rows, Request()).solved)[0]
    return design_problem(model, rows.take(good), planned_channels(model, None, np.tile(touched, (len(good), 1))))


def _drawn(loaded: LoadedMachine, places: Array, size: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Random poses (n, 6) in the workspace, and their drive readings (n, A). Raises BadInput where there is none.

    In coordinates that it does not limit, and where there is none: in the box of places (N, 6), and a little around it.
    """
    model, workspace = loaded.model, loaded.model.workspace
    low, high = places.min(axis=0), places.max(axis=0)
    wide, held = _WIDER * (high - low), model.independent_coordinates
    low, high = low - wide, high + wide
    limits = np.array([a.limits for a in model.actuators])
    if workspace is not None:
        ends = np.stack(workspace.bounds)
        limited = np.isfinite(ends).all(axis=0)
        low, high = np.where(limited, ends, [low, high])
        held = model.tool_motion.most_of([c for c, some in zip(DIRECTIONS, limited, strict=True) if some])
    found: list[tuple[Array, Array]] = []
    for _ in range(_ROUNDS if workspace is not None else 1):
        drawn = rng.uniform(low, high, (size, len(DIRECTIONS)))
        drawn[:, [k for k, c in enumerate(DIRECTIONS) if c not in held]] = np.nan
        inverse = drive_positions(model, drawn, held=held)
        good = inverse.reached & ((inverse.readings >= limits[:, 0]) & (inverse.readings <= limits[:, 1])).all(axis=1)
        good &= True if workspace is None else workspace.holds(inverse.poses, inverse.readings)
        found.append((inverse.poses[good], inverse.readings[good]))
        if sum(len(poses) for poses, _ in found) >= size:
            break
    poses, readings = (np.concatenate(parts)[:size] for parts in zip(*found, strict=True))
    if workspace is not None and not len(poses):
        raise out_of_workspace(loaded)
    return poses, readings
