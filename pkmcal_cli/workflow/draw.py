"""A machine in one row, as a picture or in characters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import BadInput, UsageError
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_parameters
from pkmcal_cli.loading.pose_source import PoseSource
from pkmcal_cli.loading.poses import OUT_OF_REACH, RowOrigin, reference_poses
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.machine_picture import default_scale, displacement_text, machine_picture, newtons
from pkmcal_cli.pictures.machine_shape import machine_shape
from pkmcal_cli.pictures.picture import check_picture, write_picture
from pkmcal_cli.pictures.shapes import MachineShape
from pkmcal_cli.pictures.text_machine import BELIEVED, text_legend, text_machine
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Rows
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.workflow.arguments import one_stdin, present, require_forces
from pkmcal_cli.workflow.tensioned_poses import TENSIONED, UNTENSIONED, holds_ropes, tensioned, tensions_ropes


@dataclass(frozen=True, kw_only=True)
class DrawingRequest:
    """The arguments of `draw`."""

    machine: str
    poses: str | None
    grid: str | None
    parameters: str | None
    row: int | None
    forces: bool
    scale: float | None
    output: str | None
    as_json: bool
    quiet: bool
    force: bool


@dataclass(frozen=True, kw_only=True)
class _Row:
    """The row that is drawn, among the rows of its table that effects see; `number`: its index there.

    target (6,): the pose of the tool point for which the drives are set, nan or None where they are stated. believed:
    rows at which the drives are set without strain, where these are others.
    """

    rows: Rows
    number: int
    target: Array | None
    believed: Rows | None = None
    row_origin: RowOrigin
    inputs: dict[str, str]
    notes: tuple[str, ...] = ()


def run_drawing(request: DrawingRequest) -> int:
    """Draw; returns the exit code. Raises PkmcalError."""
    _check(request)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    require_forces(request.forces, loaded)
    for fault in loaded.warnings:
        to.warn(fault)
    row = _row(request, loaded, to)
    loaded = loaded.for_sessions(row.rows.named_sessions)
    start = load_parameters(loaded.model, request.parameters)
    for text in start.remarks(bool(row.rows.named_sessions)):
        to.warn(text)
    row = _tensioned(loaded.model, start.values, row)
    to.notes(row.notes)
    shape = _solved(loaded, start, row)
    factor = default_scale(shape) if request.scale is None else request.scale
    _show(request, shape, factor, row, to)
    if request.output is not None:
        inputs = loaded.inputs | start.inputs | row.inputs
        files = [f for f in (request.parameters, request.poses) if f is not None]
        named = titles(request.machine, _origin_text(row.row_origin), files)
        picture = machine_picture(shape, named, scale=factor, forces=request.forces)
        write_picture(picture, request.output, inputs, force=request.force)
        to.say(f"written: {request.output}")
    if request.as_json:
        inputs = loaded.inputs | start.inputs | row.inputs
        emit_json(enveloped("draw", "complete", _json(shape, factor, row), provenance(inputs)))
    return 0


def _check(request: DrawingRequest) -> None:
    """Whether the arguments go together. Raises UsageError and OutputError."""
    if request.scale is not None and not (math.isfinite(request.scale) and request.scale > 0):
        raise UsageError(f"--scale: `{request.scale:g}` is no factor", hint="give a positive number, e.g. 200")
    if request.quiet and request.output is None and not request.as_json:
        message = "-q suppresses the drawing on the terminal"
        raise UsageError(message, hint="write a picture with `-o FILE.svg`, or leave out -q")
    if request.row is not None and request.poses is None and request.grid is None:
        raise UsageError("--row names a row of a table", hint="add POSES.csv, or --grid")
    one_stdin(request.machine, request.poses, request.parameters)
    inputs = present(request.machine, request.poses, request.parameters)
    check_picture(request.output, inputs, force=request.force, option="-o")


def _row(request: DrawingRequest, loaded: LoadedMachine, to: Reporter) -> _Row:
    """The row that is asked for. Raises BadInput where it is out of reach, UsageError where there is none."""
    if request.poses is None and request.grid is None:
        poses = reference_poses(loaded.model)
        home, point = loaded.model.tool.reference, poses.row_origin(0)
        return _Row(rows=poses.rows, number=0, target=home, row_origin=point, inputs={})
    source = PoseSource(loaded=loaded, to=to, path=request.poses, grid=request.grid)
    seen, number, drawn = 0, request.row or 1, None
    for block in source:
        at = number - 1 - seen
        if drawn is None and at < len(block):
            if not block.reachable[at]:
                raise BadInput([block.row_origin(at).fault(OUT_OF_REACH)])
            drawn = block.rows, at, None if block.targets is None else block.targets[at], block.row_origin(at)
            if source.grid is not None:
                break
        seen += len(block)
    if drawn is None:
        raise UsageError(f"--row {number}: there are {count(seen, 'row')}", hint=f"give a number from 1 to {seen}")
    rows, index, target, point = drawn
    return _Row(rows=rows, number=index, target=target, row_origin=point, inputs=source.inputs, notes=source.notes)


def _tensioned(model: Model, values: Array, row: _Row) -> _Row:
    """The row with set values that tension its ropes, where redundant drives do."""
    if row.target is None or not np.isfinite(row.target).all() or not tensions_ropes(model):
        return row
    made = tensioned(model, values, row.target[None], row.rows.take(np.array([row.number])))
    readings = row.rows.readings.copy()
    readings[row.number] = made.rows.readings[0] if len(made.kept) else readings[row.number]
    notes = (*row.notes, f"drawn {TENSIONED}") if len(made.kept) else row.notes
    return replace(row, rows=replace(row.rows, readings=readings), believed=row.rows, notes=notes)


def _solved(loaded: LoadedMachine, start: Start, row: _Row) -> MachineShape:
    """The machine in its row. Raises BadInput where it cannot be solved."""
    shape = machine_shape(loaded, start.values, row.rows, row.number, row.believed)
    if isinstance(shape, str):
        fault = row.row_origin.fault(shape)
        untensioned = holds_ropes(loaded.model) and not tensions_ropes(loaded.model)
        raise BadInput([replace(fault, hint=UNTENSIONED) if untensioned else fault])
    return shape


def _show(request: DrawingRequest, shape: MachineShape, factor: float, row: _Row, to: Reporter) -> None:
    """The drawing in characters where there is no other, and what drives and tool point do."""
    if request.output is None:
        to.say()
        for line in text_machine(shape, factor):
            to.say(line)
        to.say()
        to.say(text_legend(shape))
    dotted = BELIEVED if request.output is None and shape.moved else ""
    to.say(f"{row.row_origin}: {_displaced(shape, factor)}{dotted}")
    if shape.moved:
        to.say(displacement_text(shape))
    if request.forces:
        rows = [(n, newtons(f, n in shape.turning)) for n, f in shape.forces.items()]
        to.table("Forces of drives", ("drive", "force"), rows)
        members = [(n, newtons(f)) for n, f in shape.tensions.items()]
        to.table("Axial forces of members (+ pulls)", ("member", "force"), members)


def _origin_text(row_origin: RowOrigin) -> str:
    """Where a row stands, in a title that names its file."""
    if row_origin.file is None:
        return str(row_origin).removeprefix("the ").removeprefix("--")
    return f"line {row_origin.line}" + (f" ({row_origin.id})" if row_origin.id else "")


def _displaced(shape: MachineShape, factor: float) -> str:
    if not shape.moved:
        return "nothing is displaced"
    return "displacements at true scale" if factor == 1 else f"displacements {factor:g} times as large"


def _json(shape: MachineShape, factor: float, row: _Row) -> dict[str, Any]:
    """The same for JSON: places in m, displacements in um, forces in N or N m."""
    return {
        "row": str(row.row_origin),
        "scale": factor,
        "tool_point": shape.tool,
        "places": [
            {"name": n, "believed": _rounded(at), "displacement": _rounded(shape.displacement(n) / 1e-6)}
            for n, at in shape.reference.places.items()
        ],
        "drives": [
            {"name": n, "reading": finite(r), "force": finite(shape.forces[n]), "turns": n in shape.turning}
            for n, r in shape.readings.items()
        ],
        "members": [{"name": n, "tension": finite(t)} for n, t in shape.tensions.items()],
    }


def _rounded(vector: np.ndarray[Any, Any]) -> list[float]:
    """Without what is rounding, and without -0."""
    return [round(float(v), 12) + 0.0 for v in vector]
