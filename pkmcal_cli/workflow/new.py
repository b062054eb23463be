"""A machine file from what is there already."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.outputs import check_target, write_text
from pkmcal_cli.loading.printers.read import read_printer
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.printer_machine import machine_text


@dataclass(frozen=True, kw_only=True)
class NewRequest:
    """The arguments of `new`."""

    source: str | None
    output: str
    quiet: bool
    force: bool


def run_new(request: NewRequest) -> int:
    """Read constants and write the machine file; returns the exit code. Raises PkmcalError."""
    if request.source is None:
        hint = "for example `pkmcal new --from printer.cfg -o machine.yaml`"
        raise UsageError("--from is missing: say what the machine is made from", hint=hint)
    check_target(request.output, [request.source], force=request.force)
    to = Reporter(request.quiet)
    printer = read_printer(request.source)
    to.notes(printer.notes)
    with write_text(request.output, printer.inputs, force=request.force) as file:
        file.write(machine_text(printer))
    to.say(f"{printer.firmware}, {printer.kinematics}: {len(printer.constants)} constants read")
    return 0
