"""From targets of the tool point to a table of corrected set values."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, get_args

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.correction.assessment import Assessment, assessed
from pkmcal_cli.correction.commanded_machine import CommandedMachine
from pkmcal_cli.correction.commands import corrected, depends_on_sides, with_first_sides
from pkmcal_cli.correction.formats import format_named
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.correction.set_values import Aim
from pkmcal_cli.correction.strained_pose import held_drives
from pkmcal_cli.correction.uncertainty import KnownTo
from pkmcal_cli.correction.whole_steps import in_whole_steps
from pkmcal_cli.csv_files.origin import Origin, beside
from pkmcal_cli.csv_files.writer import Values, check_table, open_writer
from pkmcal_cli.loading.evidence import Evidence
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_parameters
from pkmcal_cli.loading.targets import Targets, read_targets
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.correction_picture import correction_picture
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.correction import CorrectionReport
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.workflow.arguments import one_stdin, present
from pkmcal_cli.workflow.command_table import CommandTable
from pkmcal_cli.workflow.conditions import Conditions, conditions
from pkmcal_cli.workflow.export import Export, exported, write_export
from pkmcal_cli.workflow.plots import Plot, check_plot
from pkmcal_cli.workflow.run_folder import Run, check_run, keep_run
from pkmcal_cli.workflow.schedule_forms import DWELL, FEED, check_motion
from pkmcal_cli.workflow.target_units import in_another_unit

_COMMANDS = "commands.csv"
_PROGRAMS = "gcode"  # how the names of formats begin that move the machine


@dataclass(frozen=True, kw_only=True)
class CorrectionRequest:
    """The arguments of `correct`."""

    machine: str
    targets: str | None = None
    grid: str | None = None
    parameters: str | None = None
    at: str | None = None
    redundant: str = "min-force"
    as_format: str | None = None
    dwell: float = DWELL
    feed: float = FEED
    output: str | None = None
    plot: str | None = None
    run: str | None = None
    as_json: bool = False
    quiet: bool = False
    force: bool = False

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
    export = _export(request)
    names = present(request.machine, request.targets, request.parameters)
    check_run(request.run, names, (request.output, request.plot))
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    if export is not None:
        export.check([loaded.model.actuators[a].name for a in held_drives(loaded.model)], names)
    made = correction(request, to, loaded)
    report, result, targets, inputs = made.report, made.report.result, made.report.targets, made.inputs
    written = None
    if result is not None and len(result.correction.good) and export is not None:
        written = exported(export, loaded, report.model, report.start, targets, result)
    report.show(to)
    head = provenance(inputs, redundant=request.choice, at=request.at)
    more: dict[str, Any] = {}
    files: dict[str, str] = {}
    if written is not None and export is not None:
        named, files = write_export(export, written, inputs, head, to)
        more = {"export": written.json(named)}
    elif result is not None and len(result.correction.good):
        files = _write(request, made, head)
    if request.plot is not None:
        Plot(request.plot, inputs, request.force).write(correction_drawn(request, made), to)
    result_of = report.json() | {"output": request.output, "at": request.at} | more
    answer = enveloped("correct", "incomplete" if made.code else "complete", result_of, head)
    if request.as_json:
        emit_json(answer)
    keep_run(request.run, inputs, _run(request.machine, answer, files, made.code), to)
    return made.code


def correction_drawn(request: CorrectionRequest, made: Corrected) -> Picture:
    """Errors before and after, and what the drives bear."""
    report, length = made.report, made.loaded.machine.file_units.length
    named = titles(request.machine, "correction", present(request.parameters, request.targets))
    return correction_picture(report.model, report.result, report.targets.held, named, length)


@dataclass(frozen=True)
class Corrected:
    """A correction of a machine."""

    loaded: LoadedMachine
    report: CorrectionReport

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of all that was read."""
        return self.loaded.inputs | self.report.start.inputs | dict(self.report.targets.inputs)

    @property
    def code(self) -> int:
        """1 where rows of a table have no set values."""
        return 1 if self.report.lost.reasons and not self.report.targets.grid else 0

    @property
    def columns(self) -> list[tuple[str, str | None]]:
        """Names and units of the table of commands."""
        return self._table.columns

    @property
    def cells(self) -> list[Values]:
        """Columns of the targets that have commands, SI; none where no target has."""
        return [] if self.report.result is None else self._table.cells(self.report.ids, self.report.result)

    @cached_property
    def _table(self) -> CommandTable:
        model, targets = self.report.model, self.report.targets
        return CommandTable(self.loaded.machine, model, targets.forces, _covariates(model, targets), targets.held)


def correction(request: CorrectionRequest, to: Listener, machine: LoadedMachine | None = None) -> Corrected:
    """Corrected set values; `machine`: where it is loaded already. Raises PkmcalError."""
    choice = request.choice
    loaded = load_machine(request.machine) if machine is None else machine
    for fault in loaded.warnings:
        to.warn(fault)
    stated = conditions(loaded.machine, request.at)
    targets = read_targets(loaded, request.targets, request.grid, stated.values, to, stated.session)
    if request.as_format is not None:
        format_named(request.as_format).check(CommandedMachine(loaded, targets.held))
    model = loaded.model.for_sessions(targets.rows.named_sessions)
    start = load_parameters(model, request.parameters)
    _check_session(stated.session, model, start, request.parameters)
    for text in start.remarks(bool(targets.rows.named_sessions)):
        to.warn(text)
    to.notes(targets.notes)
    if (request.as_format or "").startswith(_PROGRAMS) and depends_on_sides(model):
        aim = Aim(poses=targets.poses, held=targets.held, rows=targets.rows)
        targets = replace(targets, rows=with_first_sides(model, start.values, aim))
    with to.step("set values"):
        result = _assessed(model, start, targets, stated, request)
    if not targets.grid:
        lost = result is None or not len(result.correction.good)
        for text in in_another_unit(loaded.machine, model, start.values, targets, choice if lost else None):
            to.warn(text)
    unit = loaded.machine.file_units.length
    report = CorrectionReport(
        model=model, file_unit=unit, start=start, targets=targets, result=result, choice=choice
    )  # fmt: skip
    return Corrected(loaded, report)


def _check_session(name: str, model: Model, start: Start, path: str | None) -> None:
    """Whether a session of the command line is one of which something is known. Raises UsageError."""
    known = dict.fromkeys([*start.unknown.known, *(e.acts_in for e in model.effects if e.acts_in and not e.session)])
    if not name or name in known:
        return
    file = f"{path} says nothing of it" if path is not None else "there is no parameter file"
    ways = f"name one of {', '.join(known)}" if known else "give `-p` of a calibration with the column `session`"
    raise UsageError(f"--at: nothing is known of session `{name}`: {file}", hint=ways)


def _assessed(
    model: Model, start: Start, targets: Targets, stated: Conditions, request: CorrectionRequest
) -> Assessment | None:
    """Corrected set values and how sure they are; None where no target is within reach."""
    aim = Aim(poses=targets.poses, held=targets.held, rows=targets.rows)
    made = corrected(model, start.values, aim, request.choice)
    evidence = start.evidence or Evidence({})
    if made is None:
        return None
    if request.as_format is None:  # forms of controls have units of their own
        made = in_whole_steps(model, start.values, made)
    return assessed(model, start.values, made, _known(model, start, stated, evidence), evidence.measured)


def _write(request: CorrectionRequest, made: Corrected, head: dict[str, Any]) -> dict[str, str]:
    """The table of commands, and what of it a kept run has. Raises OutputError."""
    origin, cells = Origin("commands", "set values corrected by pkmcal", head), made.cells
    target = "-" if request.output is None else request.output
    with open_writer(target, made.columns, made.inputs, origin=origin, force=request.force) as writer:
        writer.write(cells)
    return {} if request.run is None else _texts_of(made.columns, cells, origin)


def _run(machine: str, answer: dict[str, Any], files: dict[str, str], code: int) -> Run:
    """What is kept of a correction."""
    done = f"{answer['n_corrected']} of {answer['n_targets']} targets corrected"
    return Run(command="correct", machine=machine, result=answer, code=code, verdict=done, files=files)


def _texts_of(
    columns: Sequence[tuple[str, str | None]], cells: Sequence[Values], origin: Origin
) -> dict[str, str]:
    """The table, and what is beside it, as texts."""
    with tempfile.TemporaryDirectory() as folder:
        with open_writer(Path(folder) / _COMMANDS, columns, (), origin=origin) as writer:
            writer.write(cells)
        names = (_COMMANDS, beside(_COMMANDS))
        return {name: (Path(folder) / name).read_text(encoding="utf-8") for name in names}


def _checked(request: CorrectionRequest) -> str:
    """The target of the table, when the arguments go together. Raises UsageError and OutputError."""
    target = "-" if request.output is None else request.output
    if request.as_json and is_stream(target):
        raise UsageError("--json and the table both write to stdout", hint="write the table with `-o COMMANDS.csv`")
    one_stdin(request.machine, request.targets, request.parameters)
    inputs = present(request.machine, request.targets, request.parameters)
    check_plot(request.plot, inputs, target, force=request.force)
    if request.as_format is None:
        check_table(target, inputs, force=request.force)
    return target


def _export(request: CorrectionRequest) -> Export | None:
    """What is to be written for a control; None without `--as`. Raises UsageError."""
    check_motion(request.dwell, request.feed, program=(request.as_format or "").startswith(_PROGRAMS))
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
    return KnownTo(
        names=names,
        covariance=covariance,
        half_ranges=0.5 * model.ranges[[model.names.index(n) for n in names]],
        conditions=stated.std,
        unexplained=evidence.of_tool,
    )


def _covariates(model: Model, targets: Targets) -> tuple[str, ...]:
    """Columns beside the set values: those of the targets, and sides of approach where they matter."""
    sides = [f"dir.{a.name}" for a in model.actuators] if depends_on_sides(model) else []
    return tuple(dict.fromkeys([*targets.covariates, *sides]))
