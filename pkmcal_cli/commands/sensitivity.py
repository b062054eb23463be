"""`pkmcal sensitivity`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Grid, Json, MachineFile, Offset, Parameters, PosesFile, Quiet, as_request


def sensitivity(
    machine: MachineFile,
    poses: PosesFile = None,
    grid: Grid = None,
    parameters: Parameters = None,
    select: Annotated[
        str | None,
        typer.Option("--select", metavar="NAMES", help="Parameters: auto, all, names, patterns; default: all."),
    ] = None,
    offset: Offset = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Which parameters move the TCP most, in position and orientation, over their ranges?

    Example: pkmcal sensitivity machines/scissors.yaml --grid "x=-200:200:5,y=-200:200:5" --offset q1="-50 um"
    """
    options = locals()
    from pkmcal_cli.workflow.analysis import AnalysisRequest, run_sensitivity

    raise typer.Exit(run_sensitivity(as_request(AnalysisRequest, options)))
