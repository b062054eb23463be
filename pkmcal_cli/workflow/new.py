"""A machine file from what is there already."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target, write_text
from pkmcal_cli.loading.printers.constants import Printer
from pkmcal_cli.loading.printers.read import read_printer
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.printer_machine import machine_text
from pkmcal_cli.report.provenance import provenance


@dataclass(frozen=True, kw_only=True)
class NewRequest:
    """The arguments of `new`."""

    source: str | None
    output: str
    as_json: bool
    quiet: bool
    force: bool


def run_new(request: NewRequest) -> int:
    """Read constants and write the machine file; returns the exit code. Raises PkmcalError."""
    if request.source is None:
        hint = "for example `pkmcal new --from printer.cfg -o machine.yaml`"
        raise UsageError("--from is missing: say what the machine is made from", hint=hint)
    if request.as_json and is_stream(request.output):
        what = "--json and the machine file both write to stdout"
        raise UsageError(what, hint="write the machine file with `-o MACHINE.yaml`")
    check_target(request.output, [request.source], force=request.force)
    to = Reporter(request.quiet)
    printer = read_printer(request.source)
    to.notes(printer.notes)
    with write_text(request.output, printer.inputs, force=request.force) as file:
        file.write(machine_text(printer))
    if request.as_json:
        result = _json(printer) | {"output": request.output}
        emit_json(enveloped("new", "complete", result, provenance(printer.inputs)))
    to.say(f"{printer.firmware}, {printer.kinematics}: {len(printer.constants)} constants read")
    return 0


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
