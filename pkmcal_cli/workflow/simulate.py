"""Simulation from poses to a measurement table, block by block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, get_args

import numpy as np

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.csv_files.writer import TableWriter, open_writer
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.loading.machine import load_machine, load_parameters
from pkmcal_cli.loading.poses import Place, Poses, PoseSource
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Method, Prediction, Request, predict
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.numbers import finite
from pkmcal_cli.report.provenance import provenance, provenance_lines
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.arguments import given, one_stdin
from pkmcal_cli.workflow.error_map import ErrorMap
from pkmcal_cli.workflow.noise import Noise
from pkmcal_cli.workflow.table import SimulatedTable

_SHOWN = 20  # failed rows told one by one
_LISTED = 1000  # failed rows in the JSON


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
    as_json: bool
    quiet: bool
    force: bool


@dataclass
class _Tally:
    """What has been simulated so far."""

    seen: int = 0
    rows: int = 0
    n_failed: int = 0
    failed: list[tuple[Place, str]] = field(default_factory=list)
    low: Array | None = None
    high: Array | None = None

    def add(self, values: Array) -> None:
        """Count rows and widen the extent of the channels."""
        self.rows += len(values)
        if len(values):
            low, high = np.nanmin(values, axis=0, initial=np.inf), np.nanmax(values, axis=0, initial=-np.inf)
            self.low = low if self.low is None else np.minimum(self.low, low)
            self.high = high if self.high is None else np.maximum(self.high, high)

    def fail(self, block: Poses, reasons: dict[int, str]) -> None:
        """Count rows without a solution; list the first ones."""
        self.n_failed += len(reasons)
        room = _LISTED - len(self.failed)
        self.failed += [(block.place(k), reasons[k]) for k in sorted(reasons)[: max(room, 0)]]


def run_simulation(request: SimulationRequest) -> int:
    """Simulate and write; returns the exit code (1 when rows could not be solved). Raises PkmcalError."""
    target = _checked(request)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    for fault in loaded.warnings:
        to.warn(fault.text())
    source = PoseSource(loaded=loaded, path=request.poses, grid=request.grid)
    blocks = iter(source)
    first = next(blocks, None)  # so that its sessions are known, and the head can name the table with its sha256
    model = loaded.model.for_sessions(first.rows.session_names if first is not None else ())
    start = load_parameters(model, request.parameters)
    for text in start.warnings:
        to.warn(text)
    errors = ErrorMap.of(model, start, request.parameters, request.method) if request.uncertainty else None
    noise = Noise.of(model, request.noise, request.seed)
    if noise.silent:
        to.warn(f"warning: no sigma is declared for {', '.join(noise.silent)}: no noise there")
    inputs = loaded.inputs | start.inputs | source.inputs
    head = provenance(inputs, seed=request.seed, noise=request.noise, method=request.method)
    joined = _names_others(first)
    table = SimulatedTable(loaded.machine, model, source.forces, request.forces, source.covariates, joined)
    work = _Work(model=model, request=request, values=start.values, noise=noise, table=table, errors=errors)
    comments = ["simulated by pkmcal: these are no measurements", *provenance_lines(head)]
    writing = open_writer(target, work.columns, inputs, comments=comments, force=request.force)
    with writing as writer, to.progress() as tick:
        for block in chain([first] if first is not None else [], blocks):
            work.simulate(block, writer, tick)
    to.notes(source.notes)
    for text in source.travels.warnings():
        to.warn(text)
    _tell(to, work.tally)
    if errors is not None:
        to.say(errors.text)
    if request.as_json:
        told = {} if errors is None else {"uncertainty": errors.json()}
        emit_json(_json(model, request, work.tally, head) | told)
    return 1 if work.tally.n_failed else 0


def _names_others(block: Poses | None) -> bool:
    """Whether rows name others, to which a sensor measures."""
    return block is not None and block.rows.partner is not None


def _checked(request: SimulationRequest) -> str:
    """The target, when the arguments go together. Raises UsageError and OutputError."""
    if request.method not in get_args(Method):
        raise UsageError(f"--method: `{request.method}` is none", hint=did_you_mean(request.method, get_args(Method)))
    if request.seed < 0:
        raise UsageError(f"--seed: {request.seed} is negative", hint="a whole number from 0")
    target = "-" if request.output is None else request.output
    if request.as_json and is_stream(target):
        raise UsageError("--json and the table both go to stdout", hint="write the table with `-o OUT.csv`")
    one_stdin(request.machine, request.poses, request.parameters)
    check_target(target, given(request.machine, request.poses, request.parameters), force=request.force)
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
    tally: _Tally = field(default_factory=_Tally)

    @property
    def columns(self) -> list[tuple[str, str | None]]:
        """Of the table, then uncertainties."""
        return [*self.table.columns, *(self.errors.columns if self.errors is not None else [])]

    def simulate(self, block: Poses, writer: TableWriter, tick: Callable[[int], None] | None) -> None:
        """Predict and write one block; rows without a solution are told, not written."""
        driven, disturbed = self.noise.draw(block.rows)
        reachable = np.nonzero(block.reachable)[0]
        tally = self.tally
        if not len(reachable):
            tally.seen += len(block)
            tally.fail(block, block.lost)
            return
        asked = Request(self.request.method, forces=self.request.forces)  # type: ignore[arg-type]
        found = predict(self.model, self.values, driven.take(reachable), asked, progress=tick)
        reasons = {int(reachable[k]): found.reason(int(k)) for k in np.nonzero(~found.solved)[0]}
        tally.fail(block, reasons | block.lost)
        good = np.nonzero(found.solved)[0]
        rows = reachable[good]
        readings = found.values[good] + self.noise.of_channels(disturbed[rows], found.values[good])
        tally.add(readings)
        ids = [block.place(int(k)).id or str(tally.seen + int(k) + 1) for k in rows]
        tally.seen += len(block)
        cells = self.table.cells(ids, block.rows.take(rows), readings, _only(found, good))
        writer.write([*cells, *self._uncertainties(block, rows, found.state.take(good))])

    def _uncertainties(self, block: Poses, rows: Array, state: State) -> list[Array]:
        if self.errors is None:
            return []
        places = {k: block.place(int(row)) for k, row in enumerate(rows)}
        return self.errors.cells(block.rows.take(rows), state, places)


def _only(found: Prediction, rows: Array) -> Prediction:
    """Forces and energy of some rows."""
    from dataclasses import replace

    if found.forces is None or found.energy is None:
        return found
    return replace(found, forces=found.forces[rows], energy=found.energy[rows])


def _tell(to: Reporter, tally: _Tally) -> None:
    to.say(f"{count(tally.rows, 'row')} simulated")
    for place, reason in tally.failed[:_SHOWN]:
        to.fail(f"{place}: {reason}")
    if tally.n_failed > _SHOWN:
        to.fail(f"... and {tally.n_failed - _SHOWN} more")
    if tally.n_failed:
        to.fail(f"without a solution, not in the table: {count(tally.n_failed, 'row')}")


def _json(model: Model, request: SimulationRequest, tally: _Tally, head: dict[str, Any]) -> dict[str, Any]:
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
        "provenance": head,
    }
