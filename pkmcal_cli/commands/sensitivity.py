"""`pkmcal sensitivity`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands import _completion
from pkmcal_cli.commands._options import (
    Force,
    Grid,
    Json,
    MachineFile,
    Method,
    Offset,
    Parameters,
    Plot,
    PosesFile,
    Quiet,
    as_request,
)

SelectAll = Annotated[
    str | None,
    typer.Option(
        "--select",
        metavar="NAMES",
        help="Parameters: auto, all, names, patterns; default: all.",
        autocompletion=_completion.parameters,
    ),
]
Sizes = Annotated[
    list[str] | None,
    typer.Option(
        "--size",
        metavar='"[NAMES=]30 um"',
        help="Size in place of the ranges; can be repeated.",
        autocompletion=_completion.sizes,
    ),
]


def sensitivity(
    machine: MachineFile,
    poses: PosesFile = None,
    grid: Grid = None,
    parameters: Parameters = None,
    select: SelectAll = None,
    size: Sizes = None,
    channel: Annotated[
        str | None,
        typer.Option(
            "--channel",
            metavar="x",
            help="One coordinate of the tool point, with its sign.",
            autocompletion=_completion.coordinates,
        ),
    ] = None,
    offset: Offset = None,
    method: Method = "exact",
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="SHIFTS.csv", help="Shifts of --channel by position.")
    ] = None,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Which parameters move the TCP most, in position and orientation, over their ranges?

    Examples:
        pkmcal sensitivity scissors --grid "x=-200:200:5,y=-200:200:5" \\
            --offset q1="-50 um"
        cat machines/triglide.csv | pkmcal sensitivity triglide - --json
    """
    options = locals()
    from pkmcal_cli.workflow.analysis import SensitivityRequest, run_sensitivity

    raise typer.Exit(run_sensitivity(as_request(SensitivityRequest, options)))
