"""Simulation from poses to readings, block by block: the same for the command line and for Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, Protocol

import numpy as np

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.csv_files.writer import Values
from pkmcal_cli.language.tool_point import ToolPoint
from pkmcal_cli.loading.covariates import with_sides
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_parameters
from pkmcal_cli.loading.pose_channels import Channels, known_channels, touched_channels
from pkmcal_cli.loading.pose_source import PoseSource
from pkmcal_cli.loading.poses import Poses
from pkmcal_cli.loading.tool_coordinates import required_tool_point
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Request, Rows, WarmStart, predict
from pkmcal_cli.prediction.touching import touching
from pkmcal_cli.prediction.unknown_shapes import outside_knots
from pkmcal_cli.report.failed_rows import skipped
from pkmcal_cli.report.limitations import outside_text
from pkmcal_cli.report.loads import Loads, limited
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.arguments import checked_method, present, require_forces
from pkmcal_cli.workflow.error_map import ErrorMap
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
    poses: str | None = None
    grid: str | None = None
    parameters: str | None = None
    method: str = "exact"
    noise: str = "none"
    seed: int = 0
    forces: bool = False
    uncertainty: bool = False
    output: str | None = None
    plot: str | None = None
    as_json: bool = False
    quiet: bool = False
    force: bool = False


def checked(request: SimulationRequest) -> None:
    """Whether what is asked for makes sense. Raises UsageError."""
    checked_method(request.method)
    if request.seed < 0:
        raise UsageError(f"--seed: {request.seed} is negative", hint="give a whole number from 0")


def simulation(
    request: SimulationRequest, to: Listener, machine: LoadedMachine | None = None, *, drawable: bool = False
) -> Simulation:
    """A simulation that is ready to run; `machine`: where it is loaded already; `drawable`: what a picture needs is
    kept, also where none is written. Raises PkmcalError."""
    checked(request)
    loaded = load_machine(request.machine) if machine is None else machine
    require_forces(request.forces, loaded)
    for fault in loaded.warnings:
        to.warn(fault)
    source = PoseSource(loaded=loaded, to=to, path=request.poses, grid=request.grid)
    blocks = iter(source)
    first = next(blocks, None)  # so that its sessions are known, and the head can name the table with its sha256
    model = loaded.model.for_sessions(first.rows.named_sessions if first is not None else ())
    start = load_parameters(model, request.parameters)
    named = first is not None and bool(first.rows.named_sessions)
    for text in start.remarks(named):
        to.warn(text)
    noise = Noise.of(model, request.noise, request.seed)
    names_others = first is not None and first.rows.partner is not None
    made = Simulation(
        loaded=loaded,
        source=source,
        blocks=chain([first] if first is not None else [], blocks),
        inputs=loaded.inputs | start.inputs | source.inputs,
        model=model,
        request=request,
        values=start.values,
        noise=noise,
        table=SimulatedTable(loaded.machine, model, source.forces, request.forces, source.covariates, names_others),
        errors=_error_map(request, loaded, model, start) if request.uncertainty else None,
        loads=Loads(model=model),
        kept=KeptRows(
            model=model, values=start.values, method=request.method, forces_asked=request.forces,
            drawable=request.plot is not None or drawable, tables=present(request.parameters, request.poses),
        ),
    )  # fmt: skip
    if noise.silent:
        to.warn(f"warning: no `sigma` declared for {', '.join(noise.silent)}: no noise added there")
    return made


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
    return ErrorMap.of(model, start, request.parameters, request.method, loaded.machine.file_units.length)


class Sink(Protocol):
    """Takes rows of a table."""

    def write(self, columns: Sequence[Values]) -> None:
        """Append rows: one array (n,) a column, numbers in SI, or texts."""


@dataclass(kw_only=True)
class Simulation:
    """Simulation block by block, into a table; what was seen is known when all blocks are done.

    blocks: those of `source`, begun, so that the sessions and all inputs are known.
    """

    loaded: LoadedMachine
    source: PoseSource
    blocks: Iterator[Poses]
    inputs: dict[str, str]
    model: Model
    request: SimulationRequest
    values: Array
    noise: Noise
    table: SimulatedTable
    errors: ErrorMap | None
    loads: Loads
    kept: KeptRows
    tally: Tally = field(default_factory=Tally)
    skipped: list[str] = field(default_factory=list)  # points of a grid

    @property
    def columns(self) -> list[tuple[str, str | None]]:
        """Of the table, then uncertainties."""
        return [*self.table.columns, *(self.errors.columns if self.errors is not None else [])]

    @property
    def code(self) -> int:
        """1 where rows of a table could not be solved."""
        return 1 if self.tally.n_failed and self.source.grid is None else 0

    def run(self, writer: Sink, tick: Callable[[int], None] | None = None) -> None:
        """All blocks into a table. Raises BadInput where no point of a grid can be used."""
        for block in self.blocks:
            self._simulate(block, writer, tick)
        self.skipped = skipped(self.tally.by_reason, self.tally.seen) if self.source.grid is not None else []

    @property
    def tool(self) -> ToolPoint | None:
        """The tool point, where something is told of it."""
        return self.source.tool or (None if self.errors is None else required_tool_point(self.loaded))

    def tell(self, to: Listener) -> None:
        """What there is to say of all blocks."""
        source, tool = self.source, self.tool
        to.notes(source.notes if source.tool is not None or tool is None else [tool.text, *source.notes])
        to.notes([] if self.model.channels else ["the machine has no sensors: the table has no readings"])
        for text in (*source.travel_limits.warnings(), *self.skipped):
            to.warn(text)
        if self.tally.touched:
            to.notes([touches_text(self.model, self.tally.touched, self.tally.rows)])
        to.notes(_substructure_notes(self.model, self.request.method))
        self._tell_rows(to, by_row=source.grid is None)

    def _simulate(self, block: Poses, writer: Sink, tick: Callable[[int], None] | None) -> None:
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
        asked = Request(method=self.request.method, forces=forces)  # type: ignore[arg-type]
        prediction = predict(self.model, self.values, driven.take(reachable), asked, progress=tick)
        reasons = {int(reachable[k]): prediction.reason(int(k)) for k in np.nonzero(~prediction.solved)[0]}
        tally.fail(block, reasons | lost)
        self.loads.add(self.values, driven.take(reachable), prediction, lambda k: block.row_origin(int(reachable[k])))
        good = np.nonzero(prediction.solved)[0]
        rows = reachable[good]
        tally.outside.update(outside_knots(self.model, block.rows.take(rows)))
        readings = prediction.values[good] + self.noise.of_channels(disturbed[rows], prediction.values[good])
        known = known_channels(self.model)
        readings[:, known] = readings_at_touch(self.model, touched[rows])[:, known]
        tally.touched += int(touched[rows].any(axis=1).sum())
        tally.add(readings)
        ids = [block.row_origin(int(k)).id or str(tally.seen + int(k) + 1) for k in rows]
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
        trigger = reading - self.noise.of_channels(disturbed, np.nan_to_num(reading))
        rows, done = touching(self.model, self.values, block.rows, trigger, shift)
        lost = {int(k): no_touch(self.model, touched[k]) for k in np.nonzero(~done)[0]}
        return replace(block, rows=self._directed(rows)), touched, lost

    def _directed(self, rows: Rows) -> Rows:
        """Rows with the directions of motion that follow from their order, where the poses gave none."""
        columns = {n: c for n, c in rows.columns.items() if not n.startswith("dir.") or n in self.table.covariates}
        if len(columns) == len(rows.columns):
            return rows
        return with_sides(replace(rows, columns=columns), self.model)

    def _uncertainties(self, block: Poses, rows: Array, start: WarmStart) -> list[Array]:
        if self.errors is None:
            return []
        places = {k: block.row_origin(int(row)) for k, row in enumerate(rows)}
        return self.errors.cells(block.rows.take(rows), start, places)

    def _tell_rows(self, to: Listener, by_row: bool) -> None:
        tally = self.tally
        to.say(f"{count(tally.rows, 'row')} simulated")
        for row_origin, reason in tally.failed[: _SHOWN if by_row else 0]:
            to.fail(f"{row_origin}: {reason}", row_origin.location)
        if by_row and tally.n_failed > _SHOWN:
            to.fail(f"... and {tally.n_failed - _SHOWN} more")
        if by_row and tally.n_failed:
            to.fail(f"not in the table (no solution): {count(tally.n_failed, 'row')}")
        self.loads.show(to)
        for text in outside_text(tally.outside):
            to.warn(text)
        if self.errors is not None:
            to.say(self.errors.text)

    def json(self) -> dict[str, Any]:
        """The result for programs, without its provenance."""
        model, request, tally = self.model, self.request, self.tally
        channels = []
        for k, channel in enumerate(model.channels):
            unit = parse_unit(channel.unit)
            low, high = (None if x is None else finite(unit.from_si(float(x[k]))) for x in (tally.low, tally.high))
            channels.append({"name": channel.name, "unit": unit.text, "min": low, "max": high})
        failed = [{"file": p.file, "line": p.line, "id": p.id or None, "reason": r} for p, r in tally.failed]
        return {
            "tool_point": self.tool and self.tool.name,
            "n_rows": tally.rows,
            "n_failed": tally.n_failed,
            "failed": failed,
            "method": request.method,
            "noise": request.noise,
            "seed": request.seed,
            "output": request.output,
            "channels": channels,
            "loads": self.loads.json(),
            **({} if request.method == "exact" else {"substructure": _substructure(model)}),
            **({} if self.errors is None else {"uncertainty": self.errors.json()}),
        }


def _only(prediction: Prediction, rows: Array) -> Prediction:
    """Forces and energy of some rows."""
    if prediction.forces is None or prediction.energy is None:
        return prediction
    return replace(prediction, forces=prediction.forces[rows], energy=prediction.energy[rows])
