"""Simulation from poses to a measurement table, block by block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.csv_files.writer import TableWriter, open_writer
from pkmcal_cli.loading.covariates import with_directions
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_parameters
from pkmcal_cli.loading.pose_channels import Channels, known_channels, touched_channels
from pkmcal_cli.loading.poses import Poses, PoseSource
from pkmcal_cli.loading.tool_coordinates import required_tool_point
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Request, Rows, WarmStart, predict
from pkmcal_cli.prediction.touching import touching
from pkmcal_cli.prediction.unknown_shapes import outside_knots
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.failed_rows import skipped
from pkmcal_cli.report.limitations import outside_text
from pkmcal_cli.report.loads import Loads, limited
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.report.provenance import provenance, provenance_lines
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.arguments import checked_method, given, one_stdin, require_forces
from pkmcal_cli.workflow.error_map import ErrorMap
from pkmcal_cli.workflow.plots import check_plot
from pkmcal_cli.workflow.simulated_noise import Noise
from pkmcal_cli.workflow.simulated_plot import KeptRows
from pkmcal_cli.workflow.simulated_rows import Tally
from pkmcal_cli.workflow.table import SimulatedTable
from pkmcal_cli.workflow.touched_poses import no_touch, readings_at_touch, touches_text

_SHOWN = 20  # failed rows told one by one


@dataclass(frozen=True, kw_only=True)
class SimulationRequest:
    """The arguments of `simulate`."""

    machine: str
    poses: str | None
    grid: str | None
    parameters: str | None
    method: str
    noise: str
    seed: int
    forces: bool
    uncertainty: bool
    output: str | None
    plot: str | None
    as_json: bool
    quiet: bool
    force: bool


def run_simulation(request: SimulationRequest) -> int:
    """Simulate and write; returns the exit code (1 when rows could not be solved). Raises PkmcalError."""
    target = _checked(request)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    require_forces(request.forces, loaded)
    for fault in loaded.warnings:
        to.warn(fault)
    source = PoseSource(loaded=loaded, path=request.poses, grid=request.grid)
    blocks = iter(source)
    first = next(blocks, None)  # so that its sessions are known, and the head can name the table with its sha256
    model = loaded.model.for_sessions(first.rows.session_names if first is not None else ())
    start = load_parameters(model, request.parameters)
    for text in start.warnings:
        to.warn(text)
    work = _work(request, loaded, model, start, source, first)
    if work.noise.silent:
        to.warn(f"warning: no `sigma` declared for {', '.join(work.noise.silent)}: no noise added there")
    inputs = loaded.inputs | start.inputs | source.inputs
    head = provenance(inputs, seed=request.seed, noise=request.noise, method=request.method)
    comments = ["simulated by pkmcal, not measured", *provenance_lines(head)]
    writing = open_writer(target, work.columns, inputs, comments=comments, force=request.force)
    with writing as writer, to.progress() as tick:
        for block in chain([first] if first is not None else [], blocks):
            work.simulate(block, writer, tick)
        lines = skipped(work.tally.by_reason, work.tally.seen) if source.points is not None else []
    tool = source.tool or (None if work.errors is None else required_tool_point(loaded))
    to.notes(source.notes if source.tool is not None or tool is None else [tool.text, *source.notes])
    to.notes([] if model.channels else ["the machine has no sensors: the table has no readings"])
    for text in (*source.travels.warnings(), *lines):
        to.warn(text)
    if work.tally.touched:
        to.notes([touches_text(model, work.tally.touched, work.tally.rows)])
    to.notes(_substructure_notes(model, request.method))
    _tell(to, work, by_row=source.points is None)
    work.kept.draw(loaded, inputs | source.inputs, to)
    if request.as_json:
        emit_json({"tool_point": tool and tool.name} | _json(work, head))
    return 1 if work.tally.n_failed and source.points is None else 0


def _substructure(model: Model) -> list[str]:
    """The drives that are not redundant, whose rigid pose the paper's methods begin with."""
    return [d.name for d in model.held_drives if not d.redundant]


def _substructure_notes(model: Model, method: str) -> list[str]:
    """Which drives give the rigid pose of the paper's methods; without redundant drives it is given by all."""
    if method == "exact" or not model.redundant_drives:
        return []
    redundant = ", ".join(d.name for d in model.redundant_drives)
    return [f"--method {method}: the rigid pose is that of {', '.join(_substructure(model))}, without {redundant}"]


def _error_map(request: SimulationRequest, loaded: LoadedMachine, model: Model, start: Start) -> ErrorMap:
    """The error map of the tool point. Raises UsageError and BadInput where there is none."""
    required_tool_point(loaded)
    return ErrorMap.of(model, start, request.parameters, request.method)


def _work(
    request: SimulationRequest,
    loaded: LoadedMachine,
    model: Model,
    start: Start,
    source: PoseSource,
    first: Poses | None,
) -> _Work:
    """What the simulation needs besides its rows. Raises PkmcalError."""
    joined = _names_others(first)
    return _Work(
        model=model,
        request=request,
        values=start.values,
        noise=Noise.of(model, request.noise, request.seed),
        table=SimulatedTable(loaded.machine, model, source.forces, request.forces, source.covariates, joined),
        errors=_error_map(request, loaded, model, start) if request.uncertainty else None,
        loads=Loads(model=model),
        kept=KeptRows(
            model=model, values=start.values, method=request.method, forces_asked=request.forces, plot=request.plot,
            tables=given(request.parameters, request.poses), force=request.force,
        ),
    )


def _names_others(block: Poses | None) -> bool:
    """Whether rows name others, to which a sensor measures."""
    return block is not None and block.rows.partner is not None


def _checked(request: SimulationRequest) -> str:
    """The target, when the arguments go together. Raises UsageError and OutputError."""
    checked_method(request.method)
    if request.seed < 0:
        raise UsageError(f"--seed: {request.seed} is negative", hint="give a whole number from 0")
    target = "-" if request.output is None else request.output
    if request.as_json and is_stream(target):
        raise UsageError("--json and the table both write to stdout", hint="write the table with `-o OUT.csv`")
    one_stdin(request.machine, request.poses, request.parameters)
    inputs = given(request.machine, request.poses, request.parameters)
    check_target(target, inputs, force=request.force)
    check_plot(request.plot, inputs, target, force=request.force)
    return target


@dataclass(kw_only=True)
class _Work:
    """Simulation block by block, into a table."""

    model: Model
    request: SimulationRequest
    values: Array
    noise: Noise
    table: SimulatedTable
    errors: ErrorMap | None
    loads: Loads
    kept: KeptRows
    tally: Tally = field(default_factory=Tally)

    @property
    def columns(self) -> list[tuple[str, str | None]]:
        """Of the table, then uncertainties."""
        return [*self.table.columns, *(self.errors.columns if self.errors is not None else [])]

    def simulate(self, block: Poses, writer: TableWriter, tick: Callable[[int], None] | None) -> None:
        """Predict and write one block; rows without a solution are told, not written."""
        driven, disturbed = self.noise.draw(block.rows)
        shift = driven.readings - block.rows.readings
        block, touched, lost = self._at_touch(block, shift, disturbed)
        driven, lost = block.rows.moved(shift), lost | block.lost
        reachable = np.array([k for k in range(len(block)) if k not in lost], dtype=np.intp)
        tally = self.tally
        if not len(reachable):
            tally.seen += len(block)
            tally.fail(block, lost)
            return
        forces = self.request.forces or limited(self.model)
        asked = Request(self.request.method, forces=forces)  # type: ignore[arg-type]
        prediction = predict(self.model, self.values, driven.take(reachable), asked, progress=tick)
        reasons = {int(reachable[k]): prediction.reason(int(k)) for k in np.nonzero(~prediction.solved)[0]}
        tally.fail(block, reasons | lost)
        self.loads.add(self.values, driven.take(reachable), prediction, lambda k: block.place(int(reachable[k])))
        good = np.nonzero(prediction.solved)[0]
        rows = reachable[good]
        tally.outside.update(outside_knots(self.model, block.rows.take(rows)))
        readings = prediction.values[good] + self.noise.of_channels(disturbed[rows], prediction.values[good])
        known = known_channels(self.model)
        readings[:, known] = readings_at_touch(self.model, touched[rows])[:, known]
        tally.touched += int(touched[rows].any(axis=1).sum())
        tally.add(readings)
        ids = [block.place(int(k)).id or str(tally.seen + int(k) + 1) for k in rows]
        tally.seen += len(block)
        only, start = _only(prediction, good), prediction.start.take(good)
        u = self._uncertainties(block, rows, start)
        writer.write([*self.table.cells(ids, block.rows.take(rows), readings, only), *u])
        self.kept.add(driven.take(rows), readings, only.forces, u, start)

    def _at_touch(self, block: Poses, shift: Array, disturbed: Array) -> tuple[Poses, Channels, dict[int, str]]:
        """The block at commands at which its probes touch, where they do (N, C), and why rows have no such commands.

        What a probe reads is known; its noise is where it triggers.
        """
        touched = touched_channels(self.model, self.table.machine, len(block), block.touched)
        touched &= block.reachable[:, None]
        if not touched.any():
            return block, touched, {}
        reading = readings_at_touch(self.model, touched)
        wanted = reading - self.noise.of_channels(disturbed, np.nan_to_num(reading))
        rows, done = touching(self.model, self.values, block.rows, wanted, shift)
        lost = {int(k): no_touch(self.model, touched[k]) for k in np.nonzero(~done)[0]}
        return replace(block, rows=self._directed(rows)), touched, lost

    def _directed(self, rows: Rows) -> Rows:
        """Rows with the directions of motion that follow from their order, where the poses gave none."""
        columns = {n: c for n, c in rows.columns.items() if not n.startswith("dir.") or n in self.table.covariates}
        if len(columns) == len(rows.columns):
            return rows
        return with_directions(replace(rows, columns=columns), [a.name for a in self.model.actuators])

    def _uncertainties(self, block: Poses, rows: Array, start: WarmStart) -> list[Array]:
        if self.errors is None:
            return []
        places = {k: block.place(int(row)) for k, row in enumerate(rows)}
        return self.errors.cells(block.rows.take(rows), start, places)


def _only(prediction: Prediction, rows: Array) -> Prediction:
    """Forces and energy of some rows."""
    if prediction.forces is None or prediction.energy is None:
        return prediction
    return replace(prediction, forces=prediction.forces[rows], energy=prediction.energy[rows])


def _tell(to: Reporter, work: _Work, by_row: bool) -> None:
    tally = work.tally
    to.say(f"{count(tally.rows, 'row')} simulated")
    for place, reason in tally.failed[: _SHOWN if by_row else 0]:
        to.fail(f"{place}: {reason}")
    if by_row and tally.n_failed > _SHOWN:
        to.fail(f"... and {tally.n_failed - _SHOWN} more")
    if by_row and tally.n_failed:
        to.fail(f"not in the table (no solution): {count(tally.n_failed, 'row')}")
    work.loads.show(to)
    for text in outside_text(tally.outside):
        to.warn(text)
    if work.errors is not None:
        to.say(work.errors.text)


def _json(work: _Work, head: dict[str, Any]) -> dict[str, Any]:
    model, request, tally = work.model, work.request, work.tally
    channels = []
    for k, channel in enumerate(model.channels):
        unit = parse_unit(channel.unit)
        low, high = (None if x is None else finite(unit.from_si(float(x[k]))) for x in (tally.low, tally.high))
        channels.append({"name": channel.name, "unit": unit.text, "min": low, "max": high})
    failed = [{"file": p.file, "line": p.line, "id": p.id or None, "reason": r} for p, r in tally.failed]
    return {
        "n_rows": tally.rows,
        "n_failed": tally.n_failed,
        "failed": failed,
        "method": request.method,
        "noise": request.noise,
        "seed": request.seed,
        "output": request.output,
        "channels": channels,
        "loads": work.loads.json(),
        "provenance": head,
        **({} if request.method == "exact" else {"substructure": _substructure(model)}),
        **({} if work.errors is None else {"uncertainty": work.errors.json()}),
    }
