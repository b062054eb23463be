"""A machine file from what is there already, or one to begin with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target, write_text
from pkmcal_cli.loading.machine_templates import SPANS, names, template
from pkmcal_cli.loading.printers.constants import Printer
from pkmcal_cli.loading.printers.read import read_printer
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.printer_machine import machine_text
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.units.dimensions import LENGTH
from pkmcal_cli.workflow.amounts import amount

_SPAN = "1 m"
_EXAMPLE = 'for example `pkmcal new gantry --span "2 m" -o my.yaml`, or `pkmcal new --from printer.cfg -o my.yaml`'


@dataclass(frozen=True, kw_only=True)
class NewRequest:
    """The arguments of `new`."""

    kind: str | None
    span: str | None
    source: str | None
    output: str
    as_json: bool
    quiet: bool
    force: bool

    def require_one(self) -> None:
        """Raises UsageError unless it is said what the machine is made from, and where JSON goes."""
        if self.kind is None and self.source is None:
            raise UsageError(f"say what kind of machine it is: {_kinds()}", hint=_EXAMPLE)
        if self.kind is not None and self.source is not None:
            raise UsageError("give a kind of machine or --from, not both", hint=_EXAMPLE)
        if self.span is not None and self.kind is None:
            raise UsageError(
                "--span applies to a kind of machine only; --from reads the dimensions from its file", hint=_EXAMPLE
            )
        if self.as_json and is_stream(self.output):
            message = "--json and the machine file both write to stdout"
            raise UsageError(message, hint="write the machine file with `-o MACHINE.yaml`")


def run_new(request: NewRequest) -> int:
    """Write the machine file; returns the exit code. Raises PkmcalError."""
    request.require_one()
    if request.source is not None:
        return _from_printer(request, request.source)
    return _from_template(request, str(request.kind))


def _from_printer(request: NewRequest, source: str) -> int:
    """From the constants of a printer's firmware."""
    check_target(request.output, [source], force=request.force)
    to = Reporter(request.quiet)
    printer = read_printer(source)
    to.notes(printer.notes)
    with write_text(request.output, printer.inputs, force=request.force) as file:
        file.write(machine_text(printer))
    if request.as_json:
        result = _json(printer) | {"output": request.output}
        emit_json(enveloped("new", "complete", result, provenance(printer.inputs)))
    to.say(f"{printer.firmware}, {printer.kinematics}: {len(printer.constants)} constants read")
    return 0


def _from_template(request: NewRequest, kind: str) -> int:
    """From the template of a kind."""
    if kind not in names():
        hint = did_you_mean(kind, names(), f"use one of {_kinds()}; other machines: docs/my-machine.md")
        raise UsageError(f"unknown kind of machine: `{kind}`", hint=hint)
    text = _SPAN if request.span is None else request.span
    span = _span(text)
    check_target(request.output, [], force=request.force)
    to, made = Reporter(request.quiet), template(kind)
    with write_text(request.output, [], force=request.force) as file:
        file.write(made.scaled(span))
    if request.as_json:
        result = {"kind": kind, "span": span, "notes": [], "output": request.output}
        emit_json(enveloped("new", "complete", result, provenance({})))
    to.say(made.description)
    to.say(f"span, {made.span}: {text}; dimensions, ranges and sigmas are examples of that size: state your own")
    if not is_stream(request.output):
        to.say(f"written: {request.output}; edit it, then run `pkmcal check {request.output}`")
    return 0


def _span(text: str) -> float:
    """A length in m. Raises UsageError."""
    hint = 'state a number and a unit, for example "2 m" or "400 mm"'
    try:
        value, unit = amount("--span", text, fitting=(LENGTH,))
    except UsageError as error:
        raise UsageError(error.what, hint=hint) from None
    if unit.dimension != LENGTH:
        raise UsageError(f"--span: `{text}` is not a length", hint=hint)
    if not SPANS[0] <= value <= SPANS[1]:
        raise UsageError(f"--span: `{text}` is not a size of a machine", hint="use a length from 10 mm to 30 m")
    return value


def _kinds() -> str:
    return ", ".join(f"`{name}`" for name in names())


def _json(printer: Printer) -> dict[str, Any]:
    constants = {
        name: {"value": stated.text, "file": stated.where.file, "line": stated.where.line}
        for name, stated in printer.constants.items()
    }
    return {
        "firmware": printer.firmware,
        "kinematics": printer.kinematics,
        "constants": constants,
        "notes": list(printer.notes),
    }
