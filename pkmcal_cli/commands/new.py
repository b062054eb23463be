"""`pkmcal new`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands import _completion
from pkmcal_cli.commands._options import Force, Json, Quiet, as_request


def new(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="[KIND]",
            help="gantry, delta, hexapod, rrr (planar 3-RRR), cable or scissors.",
            autocompletion=_completion.one_of("gantry", "delta", "hexapod", "rrr", "cable", "scissors"),
        ),
    ] = None,
    span: Annotated[
        str | None, typer.Option("--span", metavar='"2 m"', help="Size of the machine of this kind; default: 1 m.")
    ] = None,
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

    A commented machine file of a usual kind, to be edited: its head says where. Or one from the constants of a
    printer's firmware (a linear delta, or a machine of lines); each becomes a parameter.

    Examples:
        pkmcal new gantry --span "2 m" -o my.yaml
        pkmcal new --from machines/printer.cfg -o printer.yaml
        cat machines/printer.cfg | pkmcal new --from - -o printer.yaml --json
    """
    options = locals()
    from pkmcal_cli.workflow.new import NewRequest, run_new

    raise typer.Exit(run_new(as_request(NewRequest, options)))
