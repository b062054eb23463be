"""`pkmcal check`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Json, MachineFile, Parameters, Quiet, Style, as_request


def check(
    machine: MachineFile,
    measurements: Annotated[
        list[str] | None, typer.Argument(metavar="MEAS.csv", help="Tables to check; or more machines, each by itself.")
    ] = None,
    parameters: Parameters = None,
    tolerance: Annotated[
        str | None,
        typer.Option(
            "--tolerance", metavar='"20 um"', help="Of positions, or by an angle of orientations, with -p."
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    style: Style = "text",
) -> None:
    """Is this machine what I mean, does this table fit it, and do the parameters of `-p` still hold?

    Examples:
        pkmcal check machines/triglide.yaml machines/triglide.csv
        pkmcal check hangprinter machines/hangprinter_2021-12-16.csv \\
            machines/hangprinter_2022-04-12.csv --json
        cat machines/triglide.csv | pkmcal check machines/triglide.yaml -
    """
    options = locals()
    from pkmcal_cli.base.shipped import machine_file
    from pkmcal_cli.workflow.check import CheckRequest, run_check

    options["measurements"] = measurements and [machine_file(text) for text in measurements]
    raise typer.Exit(run_check(as_request(CheckRequest, options)))
