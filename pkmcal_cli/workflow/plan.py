"""Plans from files to tables, JSON and a table of points that the machine can run."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.workers import Workers
from pkmcal_cli.calibration.bench_measurements import BenchProposal, bench_proposals
from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.calibration.residual import evaluate, reasons
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.csv_files.writer import check_table
from pkmcal_cli.diagnosis.experiment_design import Plan, best_points, plan_of, whitened_blocks, with_rows
from pkmcal_cli.diagnosis.hypotheses import candidates_of
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.diagnosis.power import Campaigns
from pkmcal_cli.language.tool_point import ToolPoint
from pkmcal_cli.loading.covariates import with_sides
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_parameters
from pkmcal_cli.loading.pose_channels import planned_channels
from pkmcal_cli.loading.tool_coordinates import required_tool_point, tool_motion
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.touching import tcp_places
from pkmcal_cli.report.added_points import Added
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.plan_report import PlanReport
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.workflow.alpha import check_alpha
from pkmcal_cli.workflow.approaches import Approaches, ApproachFrom, approaches, no_approach
from pkmcal_cli.workflow.arguments import one_stdin, present, require_measured, selection
from pkmcal_cli.workflow.candidate_points import candidate_points
from pkmcal_cli.workflow.next_points import next_points
from pkmcal_cli.workflow.plan_aims import RequestedAim, fewest_beside_held, requested_aim
from pkmcal_cli.workflow.plan_picture import PlannedRows, draw_plan
from pkmcal_cli.workflow.plan_power import power_of_plan
from pkmcal_cli.workflow.plots import Plot, check_plot
from pkmcal_cli.workflow.pose_set import PoseSet, pose_set
from pkmcal_cli.workflow.schedule import ScheduleOptions, write_schedule
from pkmcal_cli.workflow.schedule_forms import check_drives, check_form
from pkmcal_cli.workflow.state import State, check_state
from pkmcal_cli.workflow.tensioned_poses import tensioned_poses
from pkmcal_cli.workflow.touched_poses import touching_poses
from pkmcal_cli.workflow.unstrained import is_unstrained

_POOL = 400  # candidate points, at least; twice as many as are wanted
_NEXT = 'write e.g. pkmcal plan M.yaml MEAS.csv --next --budget 40 --aim "l1 5 um"'
_NOT_NEXT = {"points": "finds how many points are needed", "power": "simulates no campaigns", "grid": "reads a table"}


@dataclass(frozen=True, kw_only=True)
class PlanRequest:
    """The arguments of `plan`."""

    machine: str
    poses: str | None
    grid: str | None
    parameters: str | None
    select: str
    aim: str | None
    points: int | None
    next: bool
    budget: int | None
    power: int
    jobs: int
    cluster: str | None
    state: str | None
    alpha: float
    output: str | None
    plot: str | None
    as_form: str
    dwell: float
    feed: float
    seed: int
    as_json: bool
    quiet: bool
    force: bool


def run_plan(request: PlanRequest) -> int:
    """Show what a plan can do and which points to add; returns the exit code. Raises PkmcalError."""
    _check(request)
    workers, to = Workers.of(request.jobs, request.cluster), Reporter(request.quiet)
    if request.next:
        return _run_next(request, to)
    loaded, poses = _read(request, to)
    selected = selection(loaded.model, request.select)
    start = load_parameters(loaded.model, request.parameters)
    poses, inputs = _prepared(request, loaded, start, poses, to)
    rows, used, ways = _approached(loaded, start.values, poses, request, to)
    candidates = candidates_of(loaded.model, selected, rows)
    values = np.append(start.values, candidates.model.nominal[len(loaded.model.parameters) :])
    channels = planned_channels(loaded.model, used.poses.measured, used.poses.touched)
    problem = design_problem(candidates.model, rows, channels)
    require_measured(problem)
    problem, used, ways = _predicted(problem, used, ways, values, to)
    goal = requested_aim(request.aim, candidates, loaded.model, selected)
    tool = used.tool if goal is None else _posed(loaded, to, used)
    with to.step("what each effect would show"):
        plan = plan_of(candidates, problem, values, selected, request.alpha, request.seed)
    with to.step("points to add"):
        added, towards = (None, None) if goal is None else _added(loaded, plan, values, selected, goal, request)
    campaigns = Campaigns(plan, values, selected, request.alpha, request.seed)
    aimed = () if goal is None else goal.effects
    rates = power_of_plan(request.power, aimed, campaigns, workers, _state(request, inputs), to)
    unstrained, bench = is_unstrained(loaded, request.parameters, rows), _bench(problem, values, selected)
    report = PlanReport(loaded.machine, plan, unstrained=unstrained, added=added, bench=bench, rates=rates)
    report.show(to)
    drawn = PlannedRows(values, problem.rows, None if added is None else added.points.rows)
    draw_plan(_plot(request, inputs), plan, loaded, drawn, to)
    Loads.of(problem.model, values, problem.rows, used.poses.row_origin).show(to)
    if ways is not None:
        rows = problem.rows if added is None else with_rows(problem, added.points).rows
        _write(request, loaded, rows, ways if towards is None else ways.followed_by(towards), inputs, to)
    if request.as_json:
        shown = {"tool_point": tool and tool.name, **report.json(), **used.failed.json()}
        emit_json(enveloped("plan", "complete", shown, provenance(inputs, seed=request.seed)))
    return 0


def _prepared(
    request: PlanRequest, loaded: LoadedMachine, start: Start, poses: PoseSet, to: Reporter
) -> tuple[PoseSet, dict[str, str]]:
    """Poses where probes touch; sha256 by name of all that was read. Raises OutputError."""
    for text in start.remarks(bool(poses.every.rows.named_sessions)):
        to.warn(text)
    poses = touching_poses(to, loaded, start.values, tensioned_poses(to, loaded, start.values, poses))
    inputs = loaded.inputs | start.inputs | poses.inputs
    _check_output(request, inputs)
    return poses, inputs


def _plot(request: PlanRequest, inputs: Collection[str]) -> Plot | None:
    """The picture that is wanted; None where there is none."""
    if request.plot is None:
        return None
    return Plot(request.plot, inputs, request.force, present(request.parameters, request.poses))


def _state(request: PlanRequest, inputs: Mapping[str, str]) -> State:
    """Campaigns that were simulated before. Raises BadInput."""
    asked = {name: getattr(request, name) for name in ("grid", "select", "aim", "power", "alpha", "seed")}
    return State.read(request.state, "plan", asked, inputs)


def _bench(problem: Problem, values: Array, selected: tuple[str, ...]) -> tuple[BenchProposal, ...]:
    """Lengths worth measuring on the bench."""
    return bench_proposals(problem.model, observability(problem, values, selected).directions)


def _run_next(request: PlanRequest, to: Reporter) -> int:
    """Points to measure next, of a table that grows; 1 where the budget does not do."""
    assert request.poses is not None and request.budget is not None
    proposal = next_points(
        machine=request.machine, table=request.poses, parameters=request.parameters, select=request.select,
        aim=request.aim, budget=request.budget, seed=request.seed, to=to,
    )  # fmt: skip
    check_drives(request.as_form, request.output, proposal.loaded.model)
    proposal.show(to)
    drawn = PlannedRows(proposal.loaded.model.nominal, None, proposal.added.points.rows)
    draw_plan(_plot(request, proposal.inputs), None, proposal.loaded, drawn, to)
    if len(proposal.added.points):
        _write(request, proposal.loaded, proposal.rows_to_append, proposal.ways, proposal.inputs, to)
    if request.as_json:
        head = provenance(proposal.inputs, seed=request.seed)
        emit_json(enveloped("plan", proposal.status, proposal.json(), head))
    return int(proposal.status == "not_reached")


def _write(
    request: PlanRequest, loaded: LoadedMachine, rows: Rows, ways: Approaches, inputs: Mapping[str, str], to: Reporter
) -> None:
    """The schedule, where it is wanted. Raises OutputError."""
    if request.output is None:
        return
    origin = Origin("plan", "points to measure, in this order", provenance(inputs, seed=request.seed))
    options = ScheduleOptions(request.as_form, request.seed, request.dwell, request.feed, request.force, origin)
    for line in write_schedule(loaded, rows, ways, options, request.output, inputs):
        to.say(line)


def _approached(
    loaded: LoadedMachine, values: Array, poses: PoseSet, request: PlanRequest, to: Reporter
) -> tuple[Rows, PoseSet, Approaches | None]:
    """Rows with the sides that they are approached from: those of the schedule, or of a table that was measured."""
    model, rows = loaded.model, poses.poses.rows
    stands_still = all(d.force_controlled for d in model.topology.drives)
    if stands_still or (request.output is None and poses.poses.measured is not None):
        return with_sides(rows, model), poses, None
    stated_sides = np.zeros(rows.readings.shape) if poses.poses.sides is None else np.nan_to_num(poses.poses.sides)
    resting = with_sides(rows, model)
    places = tcp_places(model, values, resting)
    origin = ApproachFrom.of(model, values, resting, poses.poses.touched, stated_sides)
    with to.step("how points are approached"):
        ways = approaches(model, values, resting, places, np.random.default_rng([request.seed, 1]), origin)
    if ways.refused:
        poses = poses.without(ways.refused)  # told with those that cannot be predicted
        kept = np.delete(np.arange(len(rows)), list(ways.refused))
        if not len(kept):
            raise no_approach(model, ways.refused)
        rows, ways, stated_sides = rows.take(kept), ways.take(kept), stated_sides[kept]
    other = int((stated_sides * ways.side < 0).any(axis=1).sum())
    to.notes([f"{count(other, 'row')}: no move of the tool point approaches from all sides stated"] if other else [])
    return replace(rows, columns={**rows.columns, **ways.columns(model)}), poses, ways


def _read(request: PlanRequest, to: Reporter) -> tuple[LoadedMachine, PoseSet]:
    """The machine, with what sessions have for themselves, and the poses of the plan."""
    loaded = load_machine(request.machine, receptive=True)
    check_drives(request.as_form, request.output, loaded.model)
    if (request.output or request.aim) and all(d.force_controlled for d in loaded.model.topology.drives):
        message = "no actuator holds a position, so there are no points to choose or to schedule"
        raise UsageError(message, hint="leave out --aim and -o")
    if not any(p.per_session for p in loaded.model.parameters):  # else the sessions must be known first
        selection(loaded.model, request.select)
    poses = pose_set(to, loaded, request.poses, request.grid)
    return loaded.for_sessions(poses.every.rows.named_sessions), poses


def _predicted(
    problem: Problem, poses: PoseSet, ways: Approaches | None, values: Array, to: Reporter
) -> tuple[Problem, PoseSet, Approaches | None]:
    """The rows of a plan that can be predicted, their poses and approaches; the others are told. Raises BadInput where
    half of a table cannot, or none is left.
    """
    lost = reasons(problem, evaluate(problem, values))
    used = (poses.without_points if 2 * len(lost) >= len(problem) else poses.without)(lost)
    used.failed.show(to)
    kept = np.delete(np.arange(len(problem)), list(lost))
    return problem.take(kept), used, None if ways is None else ways.take(kept)


def _posed(loaded: LoadedMachine, to: Reporter, poses: PoseSet) -> ToolPoint:
    """The tool point, of whose poses points are chosen; it is told unless it was. Raises BadInput without any."""
    tool_motion(loaded)
    tool = required_tool_point(loaded)
    to.notes([] if poses.tool is not None else [tool.text])
    return tool


def _check(request: PlanRequest) -> None:
    """Whether the arguments go together, and the result can be written. Raises UsageError and OutputError."""
    if request.as_json and request.output is not None and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    if request.next and (request.poses is None or request.budget is None):
        raise UsageError("--next needs the table measured so far, and `--budget N`", hint=_NEXT)
    if request.points is not None and request.aim is None:
        hint = "say what they are for, `--aim uncertainty`; so many poses in all, over the workspace: `--grid 40`"
        raise UsageError("--points: points are added for an aim, and none is given", hint=hint)
    for option, why in _NOT_NEXT.items() if request.next else ():
        if getattr(request, option):
            raise UsageError(f"--{option}: --next {why}", hint=f"leave out `--{option}`")
    if request.budget is not None and not request.next:
        raise UsageError("--budget is for --next", hint=_NEXT)
    if (request.state or request.cluster or request.jobs != 1) and not request.power:
        hint = "leave them out with `--next`" if request.next else "add `--power K`"
        raise UsageError("--jobs, --cluster and --state are for simulated campaigns", hint=hint)
    check_form(request.as_form, request.dwell, request.feed)
    check_alpha(request.alpha)
    one_stdin(request.machine, request.poses, request.parameters)
    inputs = present(request.machine, request.poses, request.parameters)
    _check_output(request, inputs)
    check_plot(request.plot, inputs, request.output, force=request.force)
    check_state(request.state, inputs, request.output, request.plot)


def _check_output(request: PlanRequest, inputs: Collection[str]) -> None:
    """Whether the schedule can be written. Raises OutputError."""
    (check_table if request.as_form == "csv" else check_target)(request.output, inputs, force=request.force)


def _added(
    loaded: LoadedMachine,
    plan: Plan,
    values: Array,
    selected: tuple[str, ...],
    goal: RequestedAim,
    request: PlanRequest,
) -> tuple[Added, Approaches]:
    """Points to add, out of reachable ones within and a little around the plan, and how they are approached."""
    problem, most = plan.problem, request.points or goal.most_points
    pool, ways = candidate_points(loaded, problem, values, max(_POOL, 2 * most), request.seed)
    both = with_rows(problem, pool)
    others = [n for group in goal.aim.parameters for n in group if n not in selected]
    linear = linear_problem(both, values, selected, others, None)
    blocks = whitened_blocks(linear, len(both))
    chosen = best_points(linear, blocks, len(problem), goal.aim, most, exchange=goal.limit is None)
    reached = None
    if goal.limit is not None:
        chosen, reached = fewest_beside_held(problem, pool, chosen, goal, values, selected)
    return Added(goal.aim, pool.take(chosen.rows), chosen, reached), ways.take(chosen.rows)
