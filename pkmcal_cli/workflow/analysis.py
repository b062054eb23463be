"""Sensitivity and observability from files to tables and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..calibration.identifiability import Combination
from ..calibration.observability import Observability, observability
from ..calibration.residual import design_problem
from ..calibration.selection import named, select
from ..calibration.sensitivity import sensitivity
from ..errors import UsageError, did_you_mean
from ..loading import LoadedMachine, all_poses, failed_rows, load_machine, parameter_values
from ..model import Model
from ..prediction import Rows
from ..report.console import Reporter, bar, emit_json
from ..report.numbers import finite, readable, short
from ..report.parameters import combination_json, parameter_unit
from ..rotation import Array
from ..unit_text import UnitError, parse_unit, parse_value


@dataclass(frozen=True)
class AnalysisRequest:
    """The arguments of `sensitivity` and `observability`."""

    machine: str
    poses: str | None
    grid: str | None
    parameters: str | None
    select: str
    offsets: tuple[str, ...]
    as_json: bool
    quiet: bool


@dataclass(frozen=True)
class _Setting:
    """What both analyses start from."""

    loaded: LoadedMachine
    values: Array
    selected: tuple[str, ...]
    rows: Rows
    places: tuple[str, ...]
    to: Reporter


def _prepare(request: AnalysisRequest) -> _Setting:
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    for fault in loaded.warnings:
        to.warn(fault.text())
    model = loaded.model
    selected = select(model, request.select)
    values = parameter_values(model, request.parameters)
    if request.poses is None and request.grid is None:
        rows = Rows.at(model.drawn_readings[None])
        places: tuple[str, ...] = ("the drawing",)
        to.say("note: no poses given: at the drawing only")
    else:
        poses = all_poses(loaded, request.poses, request.grid)
        lost = {int(k): "out of reach: no drive positions for this TCP pose" for k in np.nonzero(~poses.reachable)[0]}
        if lost:
            raise failed_rows(poses.places, lost)
        rows, places = poses.rows, poses.places
    return _Setting(loaded, values, selected, _offset_rows(model, rows, request.offsets), places, to)


def _offset_rows(model: Model, rows: Rows, offsets: tuple[str, ...]) -> Rows:
    """Rows with actuators moved off their set values, `NAME=VALUE unit`. Raises UsageError."""
    readings = rows.readings.copy()
    names = [a.name for a in model.actuators]
    for text in offsets:
        name, _, amount = text.partition("=")
        if name not in names:
            raise UsageError(f"--offset: the machine has no actuator `{name}`", hint=did_you_mean(name, names))
        try:
            number, unit = parse_value(amount)
        except UnitError as error:
            raise UsageError(f"--offset: {error.what}", hint=error.hint) from None
        own = parse_unit(model.actuators[names.index(name)].unit)
        if unit.text == "1":
            unit = own
        if unit.dimension != own.dimension:
            raise UsageError(f"--offset: `{amount}` does not fit `{name}`, which reads {own.text}")
        readings[:, names.index(name)] += unit.to_si(number)
    return Rows(readings, rows.forces)


def run_sensitivity(request: AnalysisRequest) -> int:
    """Show and emit sensitivities; returns the exit code. Raises PkmcalError."""
    s = _prepare(request)
    found = sensitivity(s.loaded.model, s.values, s.rows, s.selected)
    lost = {int(k): found.prediction.reason(int(k)) for k in np.nonzero(~found.prediction.solved)[0]}
    if lost:
        raise failed_rows(s.places, lost)
    units = s.loaded.machine.file_units
    length, angle = units.length, units.angle
    largest = max((p.position for p in found.parameters), default=0.0) or 1.0
    rows = [
        (
            p.name,
            f"+-{p.range / parameter_unit(s.loaded.model, p.name).scale:.4g} {parameter_unit(s.loaded.model, p.name).text}",
            readable(p.position, length),
            bar(p.position / largest),
            readable(p.orientation, angle),
        )
        for p in found.parameters
    ]
    s.to.table(
        f"Mean shift and turn of the TCP for one range of each parameter, {len(s.rows)} positions (eq. 23)",
        ("parameter", "range", "shift", "", "turn"),
        rows,
    )
    if request.as_json:
        listed = [
            {
                "name": p.name,
                "position": p.position / length.scale,
                "orientation": p.orientation,
                "unit": length.text,
                "orientation_unit": "rad",
                "range": p.range / parameter_unit(s.loaded.model, p.name).scale,
                "range_unit": parameter_unit(s.loaded.model, p.name).text,
            }
            for p in found.parameters
        ]
        emit_json({"n_rows": len(s.rows), "parameters": listed})
    return 0


def run_observability(request: AnalysisRequest) -> int:
    """Show and emit what a plan determines; returns the exit code. Raises PkmcalError."""
    s = _prepare(request)
    model = s.loaded.model
    found = observability(design_problem(model, s.rows), s.values, s.selected)
    prediction = found.evaluation.prediction
    lost = {int(k): prediction.reason(int(k)) for k in np.nonzero(~prediction.solved)[0]}
    if lost:
        raise failed_rows(s.places, lost)
    _show_observability(s, found)
    if request.as_json:
        emit_json(_observability_json(s, found))
    undetermined = {n for n, gone in zip(s.selected, found.found.undetermined(), strict=True) if gone}
    if undetermined & named(model, request.select):
        return 1
    return 0 if found.found.rank else 1


def _show_observability(s: _Setting, found: Observability) -> None:
    model, directions = s.loaded.model, found.found
    rows = []
    for name, std, gone in zip(s.selected, found.std, directions.undetermined(), strict=True):
        p = model.parameters[model.names.index(name)]
        unit = parameter_unit(model, name)
        shown = "undetermined" if gone else f"{std / unit.scale:.3g} {unit.text}"
        share = "" if gone else f"{std / p.range:.3f}"
        remark = "" if gone or std < p.range / 2 else "no better than its range tells already"
        rows.append((name, f"+-{p.range / unit.scale:.4g} {unit.text}", shown, share, remark))
    s.to.table(
        f"Expected standard uncertainty from {found.count} measured values in {len(s.rows)} positions",
        ("parameter", "range", "standard uncertainty", "std/range", "remark"),
        rows,
    )
    s.to.say()
    s.to.say(f"rank {directions.rank} of {len(s.selected)}")
    s.to.say(f"condition number {short(found.condition_number)} (Js of the paper), {short(directions.condition_number)} (whitened)")
    s.to.say(", ".join(f"{k} {short(v)}" for k, v in found.indices.items()))
    s.to.say("singular values (whitened): " + " ".join(short(float(v)) for v in directions.singular_values))
    for c in found.undetermined:
        s.to.say(f"{'not determined' if c.kind == 'null' else 'weak'}: {c.text}{_advice(c, s.selected)}")


def _advice(c: Combination, selected: tuple[str, ...]) -> str:
    """Which parameter to drop, or what to measure otherwise."""
    strongest = c.names[int(np.argmax(np.abs(c.direction)))]
    if len(c.names) == 1:
        return f"; leave it out (`--select auto,-{strongest}`) or measure where it acts"
    del selected
    return f"; hold one of them (`--select auto,-{strongest}`), measure it directly, or spread the positions"


def _observability_json(s: _Setting, found: Observability) -> dict[str, Any]:
    model = s.loaded.model
    parameters = []
    for name, std in zip(s.selected, found.std, strict=True):
        unit = parameter_unit(model, name)
        parameters.append({"name": name, "std": finite(std / unit.scale), "unit": unit.text})
    return {
        "n_rows": len(s.rows),
        "n_values": found.count,
        "condition_number": finite(found.condition_number),
        "condition_number_whitened": finite(found.found.condition_number),
        "rank": found.found.rank,
        "singular_values": [float(v) for v in found.found.singular_values],
        **found.indices,
        "parameters": parameters,
        "undetermined": [combination_json(model, c) for c in found.undetermined],
    }
