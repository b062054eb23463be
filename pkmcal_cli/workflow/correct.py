"""From targets of the tool point to a table of corrected set values."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.assessment import Assessment, assessed
from pkmcal_cli.correction.commands import corrected, depends_on_sides
from pkmcal_cli.correction.formats import format_named
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.correction.set_values import Aim
from pkmcal_cli.correction.strained_pose import held_drives
from pkmcal_cli.correction.uncertainty import KnownTo
from pkmcal_cli.csv_files.writer import open_writer
from pkmcal_cli.loading.evidence import Evidence
from pkmcal_cli.loading.load_machine import Start, load_machine, load_parameters
from pkmcal_cli.loading.targets import Targets, read_targets
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.correction_picture import correction_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.correction import CorrectionReport
from pkmcal_cli.report.provenance import provenance, provenance_lines
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.workflow.arguments import given, one_stdin
from pkmcal_cli.workflow.command_table import CommandTable
from pkmcal_cli.workflow.conditions import Conditions, conditions
from pkmcal_cli.workflow.export import Export, exported, write_export
from pkmcal_cli.workflow.plots import Plot, check_plot
from pkmcal_cli.workflow.run_folder import Run, check_run, keep_run

_COMMANDS = "commands.csv"
_MOST = 1e6  # of seconds, or mm/min


@dataclass(frozen=True, kw_only=True)
class CorrectionRequest:
    """The arguments of `correct`."""

    machine: str
    targets: str | None
    grid: str | None
    parameters: str | None
    at: str | None
    redundant: str
    as_format: str | None
    dwell: float
    feed: float
    output: str | None
    plot: str | None
    run: str | None
    as_json: bool
    quiet: bool
    force: bool

    @property
    def choice(self) -> Choice:
        """What the redundancy is used for. Raises UsageError."""
        choices: tuple[Choice, ...] = get_args(Choice)
        for choice in choices:
            if self.redundant == choice:
                return choice
        hint = did_you_mean(self.redundant, get_args(Choice), f"use one of {', '.join(get_args(Choice))}")
        raise UsageError(f"--redundant: `{self.redundant}` is not a choice", hint=hint)


def run_correction(request: CorrectionRequest) -> int:
    """Correct and write; returns the exit code (1 when rows of a table have no set values). Raises PkmcalError."""
    _checked(request)
    choice, export = request.choice, _export(request)
    check_run(request.run, request.machine, request.targets, request.parameters)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    for fault in loaded.warnings:
        to.warn(fault)
    if export is not None:
        names = given(request.machine, request.targets, request.parameters)
        export.check([loaded.model.actuators[a].name for a in held_drives(loaded.model)], names)
    stated = conditions(loaded.machine, request.at)
    targets = read_targets(loaded, request.targets, request.grid, stated.values)
    model = loaded.model.for_sessions(targets.rows.session_names)
    start = load_parameters(model, request.parameters)
    for text in start.warnings:
        to.warn(text)
    to.notes(targets.notes)
    result = _assessed(model, start, targets, stated, choice)
    report = CorrectionReport(model=model, start=start, targets=targets, result=result, choice=choice)
    report.show(to)
    inputs = loaded.inputs | start.inputs | dict(targets.inputs)
    head = provenance(inputs, redundant=choice, at=request.at)
    more: dict[str, Any] = {}
    files: dict[str, str] = {}
    if result is not None and len(result.correction.good) and export is not None:
        written = exported(export, loaded, model, start, targets, result)
        more = {"export": written.json(write_export(export, written, inputs, head, to))}
    elif result is not None and len(result.correction.good):
        table = CommandTable(loaded.machine, model, targets.forces, _covariates(model, targets), targets.held)
        files = _write(request, table, report, result, inputs, head)
    if request.plot is not None:
        _draw(Plot(request.plot, inputs, request.force), request, report, loaded.machine.file_units.length, to)
    answer = report.json() | {"output": request.output, "at": request.at, "provenance": head}
    if request.as_json:
        emit_json(answer | more)
    code = 1 if report.lost.reasons and not targets.grid else 0
    keep_run(request.run, inputs, _run(request.machine, answer, files, code), to)
    return code


def _draw(plot: Plot, request: CorrectionRequest, report: CorrectionReport, length: Unit, to: Reporter) -> None:
    """The picture. Raises OutputError."""
    named = titles(request.machine, "correction", given(request.parameters, request.targets))
    plot.write(correction_picture(report.model, report.result, report.targets.held, named, length), to)


def _assessed(model: Model, start: Start, targets: Targets, stated: Conditions, choice: Choice) -> Assessment | None:
    """Corrected set values and how sure they are; None where no target is within reach."""
    made = corrected(model, start.values, Aim(poses=targets.poses, held=targets.held, rows=targets.rows), choice)
    evidence = start.evidence or Evidence({})
    if made is None:
        return None
    return assessed(model, start.values, made, _known(model, start, stated, evidence), evidence.measured)


def _write(
    request: CorrectionRequest,
    table: CommandTable,
    report: CorrectionReport,
    result: Assessment,
    inputs: dict[str, str],
    head: dict[str, Any],
) -> dict[str, str]:
    """The table of commands, and what of it a kept run has. Raises OutputError."""
    comments, cells = ["set values corrected by pkmcal", *provenance_lines(head)], table.cells(report.ids, result)
    target = "-" if request.output is None else request.output
    with open_writer(target, table.columns, inputs, comments=comments, force=request.force) as writer:
        writer.write(cells)
    return {} if request.run is None else {_COMMANDS: _text_of(table.columns, cells, comments)}


def _run(machine: str, answer: dict[str, Any], files: dict[str, str], code: int) -> Run:
    """What is kept of a correction."""
    done = f"{answer['n_corrected']} of {answer['n_targets']} targets corrected"
    return Run(command="correct", machine=machine, result=answer, code=code, verdict=done, files=files)


def _text_of(
    columns: Sequence[tuple[str, str | None]], cells: Sequence[Array | Sequence[str]], comments: Sequence[str]
) -> str:
    """The table as a text."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / _COMMANDS
        with open_writer(str(file), columns, (), comments=comments) as writer:
            writer.write(cells)
        return file.read_text(encoding="utf-8")


def _checked(request: CorrectionRequest) -> str:
    """The target of the table, when the arguments go together. Raises UsageError and OutputError."""
    target = "-" if request.output is None else request.output
    if request.as_json and is_stream(target):
        raise UsageError("--json and the table both write to stdout", hint="write the table with `-o COMMANDS.csv`")
    one_stdin(request.machine, request.targets, request.parameters)
    inputs = given(request.machine, request.targets, request.parameters)
    check_plot(request.plot, inputs, target, force=request.force)
    if request.as_format is None:
        check_target(target, inputs, force=request.force)
    return target


def _export(request: CorrectionRequest) -> Export | None:
    """What is to be written for a control; None without `--as`. Raises UsageError."""
    for option, value in (("--dwell", request.dwell), ("--feed", request.feed)):
        if not 0 < value < _MOST:
            raise UsageError(f"{option}: {value:g} is not a positive number", hint="give, for example, `--dwell 2`")
    if request.as_format is None:
        return None
    target = "-" if request.output is None else request.output
    return Export(
        format=format_named(request.as_format), target=target, choice=request.choice, dwell=request.dwell,
        feed=request.feed, force=request.force,
    )  # fmt: skip


def _known(model: Model, start: Start, stated: Conditions, evidence: Evidence) -> KnownTo | None:
    """How well parameters and circumstances are known; None where the parameter file does not say."""
    if start.covariance is None:
        return None
    names, covariance = start.covariance
    left = dict(evidence.unexplained)
    turning = left.pop("orientation", 0.0)
    return KnownTo(
        names=names,
        covariance=covariance,
        half_ranges=0.5 * model.ranges[[model.names.index(n) for n in names]],
        conditions=stated.std,
        unexplained=(left.get("position", max(left.values(), default=0.0)), turning),
    )


def _covariates(model: Model, targets: Targets) -> tuple[str, ...]:
    """Columns beside the set values: those of the targets, and sides of approach where they matter."""
    sides = [f"dir.{a.name}" for a in model.actuators] if depends_on_sides(model) else []
    return tuple(dict.fromkeys([*targets.covariates, *sides]))
