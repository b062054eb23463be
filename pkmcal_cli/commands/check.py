"""`pkmcal check`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Json, MachineFile, Quiet, Style


def check(
    machine: MachineFile,
    measurements: Annotated[list[str] | None, typer.Argument(metavar="MEAS.csv", help="Tables to check.")] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    style: Style = "text",
) -> None:
    """Is this machine what I mean, and does this table fit it?

    Example: pkmcal check machines/triglide.yaml machines/triglide.csv
    """
    from pkmcal_cli.workflow.check import run_check

    raise typer.Exit(run_check(machine, tuple(measurements or ()), as_json, quiet, style))
