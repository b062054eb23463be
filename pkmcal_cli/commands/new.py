"""`pkmcal new`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Force, Json, Quiet, as_request


def new(
    source: Annotated[
        str | None, typer.Option("--from", metavar="FILE", help="printer.cfg (Klipper) or config.g (RepRapFirmware).")
    ] = None,
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="MACHINE.yaml", help="File to write; default: stdout.")
    ] = "-",
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Which machine file describes what I have?

    From the constants of a printer's firmware: a linear delta, or a machine of lines. Each becomes a parameter.

    Examples:
        pkmcal new --from machines/printer.cfg -o printer.yaml
        cat machines/printer.cfg | pkmcal new --from - -o printer.yaml --json
    """
    options = locals()
    from pkmcal_cli.workflow.new import NewRequest, run_new

    raise typer.Exit(run_new(as_request(NewRequest, options)))
