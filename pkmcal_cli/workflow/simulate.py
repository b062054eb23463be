"""Simulation from poses to a measurement table, block by block."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np

from ..csv_write import TableWriter, open_writer
from ..errors import UsageError, did_you_mean
from ..files import check_target, is_stream
from ..loading import LoadedMachine, Poses, load_machine, parameter_values, read_poses
from ..model import Model
from ..prediction import Method, Prediction, Request, Rows, predict
from ..report.console import Reporter, emit_json
from ..report.numbers import finite
from ..rotation import Array
from ..unit_text import UnitError, parse_unit, parse_value

_SHOWN = 20  # failed rows told one by one


@dataclass(frozen=True)
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
    output: str | None
    as_json: bool
    quiet: bool
    force: bool


@dataclass
class _Tally:
    """What has been simulated so far."""

    rows: int = 0
    failed: list[dict[str, str]] = field(default_factory=list)
    low: Array | None = None
    high: Array | None = None

    def add(self, values: Array) -> None:
        """Count rows and widen the extent of the channels."""
        self.rows += len(values)
        if len(values):
            low, high = values.min(axis=0), values.max(axis=0)
            self.low = low if self.low is None else np.minimum(self.low, low)
            self.high = high if self.high is None else np.maximum(self.high, high)


def run_simulation(request: SimulationRequest) -> int:
    """Simulate and write; returns the exit code (1 when rows could not be solved). Raises PkmcalError."""
    if request.method not in get_args(Method):
        raise UsageError(f"--method: `{request.method}` is none", hint=did_you_mean(request.method, get_args(Method)))
    if request.as_json and (request.output is None or is_stream(request.output)):
        raise UsageError("--json and the table both go to stdout", hint="write the table with `-o OUT.csv`")
    target = request.output or "-"
    check_target(target, force=request.force)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    for fault in loaded.warnings:
        to.warn(fault.text())
    values = parameter_values(loaded.model, request.parameters)
    noise = _Noise.of(loaded.model, request.noise, request.seed)
    tally = _Tally()
    with open_writer(target, _columns(loaded.model, request.forces), force=request.force) as writer, _progress(to) as tick:
        told = False
        for block in read_poses(loaded, request.poses, request.grid):
            if block.both and not told:
                to.say("note: the table has actuator positions and TCP coordinates: the actuator positions are driven")
                told = True
            _simulate_block(loaded, request, values, noise, block, writer, tally, tick)
    _tell(to, tally)
    if request.as_json:
        emit_json(_json(loaded.model, request, tally))
    return 1 if tally.failed else 0


def _simulate_block(
    loaded: LoadedMachine,
    request: SimulationRequest,
    values: Array,
    noise: _Noise,
    block: Poses,
    writer: TableWriter,
    tally: _Tally,
    tick: Any,
) -> None:
    """Predict and write one block; rows without a solution are told, not written."""
    model = loaded.model
    reachable = np.nonzero(block.reachable)[0]
    rows = block.rows.take(reachable)
    driven = noise.driven(rows)
    prediction = predict(model, values, driven, Request(request.method, forces=request.forces), progress=tick)  # type: ignore[arg-type]
    reasons = {int(reachable[k]): prediction.reason(int(k)) for k in np.nonzero(~prediction.solved)[0]}
    reasons |= {int(k): "out of reach: no drive positions for this TCP pose" for k in np.nonzero(~block.reachable)[0]}
    tally.failed += [{"row": block.places[k], "id": block.ids[k], "reason": reasons[k]} for k in sorted(reasons)]
    good = np.nonzero(prediction.solved)[0]
    readings = noise.read(prediction.values[good])
    tally.add(readings)
    ids = [block.ids[reachable[k]] for k in good]
    writer.write(_cells(model, ids, rows.readings[good], readings, prediction, good, request.forces, tally.rows))


def _columns(model: Model, forces: bool) -> list[tuple[str, str | None]]:
    """Columns of the table: id, positions of position-controlled drives, channels, forces, energy."""
    held = [(a.name, a.unit) for a, d in zip(model.actuators, model.layout.drives, strict=True) if not d.force_controlled]
    out: list[tuple[str, str | None]] = [("id", None), *held, *((c.name, c.unit) for c in model.channels)]
    if forces:
        out += [(f"{a.name}.force", "N" if a.dimension == "length" else "Nm") for a in model.actuators]
        out.append(("strain_energy_J", None))
    return out


def _cells(
    model: Model, ids: list[str], positions: Array, readings: Array, prediction: Prediction, good: Array, forces: bool, total: int
) -> list[Any]:
    held = [a for a, d in enumerate(model.layout.drives) if not d.force_controlled]
    first = total - len(readings)
    names = [name or str(first + k + 1) for k, name in enumerate(ids)]
    cells: list[Any] = [names, *(positions[:, a] for a in held), *readings.T]
    if forces:
        assert prediction.forces is not None and prediction.energy is not None
        cells += [*prediction.forces[good].T, prediction.energy[good]]
    return cells


@dataclass
class _Noise:
    """Gaussian noise of channels (C,) and of drive readings (A,), SI."""

    channels: Array
    drives: Array
    generator: np.random.Generator

    @classmethod
    def of(cls, model: Model, text: str, seed: int) -> _Noise:
        """`declared`, `none` or one value for all channels of its dimension. Raises UsageError."""
        generator = np.random.default_rng(seed)
        channels, drives = np.zeros(len(model.channels)), np.zeros(len(model.actuators))
        if text == "declared":
            slots = model.layout.slots.constants
            channels = np.nan_to_num([c.sigma for c in model.channels])
            gains = np.array([abs(slots[a.gain_slot]) for a in model.actuators])
            drives = np.nan_to_num([a.sigma for a in model.actuators]) / gains
        elif text != "none":
            try:
                number, unit = parse_value(text)
            except UnitError as error:
                raise UsageError(f"--noise: {error.what}", hint='declared, none or a value such as "10 um"') from None
            fits = [parse_unit(c.unit).dimension == unit.dimension for c in model.channels]
            if not any(fits) or number < 0:
                raise UsageError(f"--noise: `{text}` fits no channel", hint='a value such as "10 um", not negative')
            channels[fits] = unit.to_si(number)
        return cls(channels, drives, generator)

    def driven(self, rows: Rows) -> Rows:
        """Where the drives really stand when they read `rows`."""
        if not self.drives.any():
            return rows
        return Rows(rows.readings + self.generator.normal(size=rows.readings.shape) * self.drives, rows.forces)

    def read(self, values: Array) -> Array:
        """Readings with noise, (N, C)."""
        return values + self.generator.normal(size=values.shape) * self.channels if self.channels.any() else values


@contextmanager
def _progress(to: Reporter) -> Iterator[Any]:
    """A counter of rows on a terminal; nothing elsewhere."""
    if not to.console.is_terminal or to.console.quiet:
        yield None
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.completed:.0f} rows")
    with Progress(SpinnerColumn(), text, TimeElapsedColumn(), console=to.console, transient=True) as progress:
        task = progress.add_task("rows", total=None)
        yield lambda rows: progress.advance(task, rows)


def _tell(to: Reporter, tally: _Tally) -> None:
    to.say(f"{tally.rows} rows simulated")
    for failure in tally.failed[:_SHOWN]:
        to.warn(f"{failure['row']}: {failure['reason']}")
    if len(tally.failed) > _SHOWN:
        to.warn(f"... and {len(tally.failed) - _SHOWN} more")
    if tally.failed:
        to.warn(f"{len(tally.failed)} rows have no solution and are not in the table")


def _json(model: Model, request: SimulationRequest, tally: _Tally) -> dict[str, Any]:
    channels = []
    for k, channel in enumerate(model.channels):
        unit = parse_unit(channel.unit)
        low = math.nan if tally.low is None else float(tally.low[k])
        high = math.nan if tally.high is None else float(tally.high[k])
        channels.append(
            {"name": channel.name, "unit": unit.text, "min": finite(unit.from_si(low)), "max": finite(unit.from_si(high))}
        )
    return {
        "n_rows": tally.rows,
        "failed": tally.failed,
        "method": request.method,
        "noise": request.noise,
        "seed": request.seed,
        "output": request.output,
        "channels": channels,
    }
