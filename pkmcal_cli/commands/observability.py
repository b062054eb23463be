"""`pkmcal observability`."""

from __future__ import annotations

import typer

from pkmcal_cli.commands._options import (
    Force,
    Grid,
    Json,
    MachineFile,
    Offset,
    Parameters,
    Plot,
    PosesFile,
    Quiet,
    Select,
    as_request,
)


def observability(
    machine: MachineFile,
    poses: PosesFile = None,
    grid: Grid = None,
    parameters: Parameters = None,
    select: Select = "auto",
    offset: Offset = None,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """What will these positions determine, how well, and what can they not separate?

    Examples:
        pkmcal observability triglide-nonredundant \\
            --grid "x=0:950:3,y=160:390:77"
        cat machines/triglide.csv | pkmcal observability triglide - --json
    """
    options = locals()
    from pkmcal_cli.workflow.analysis import AnalysisRequest, run_observability

    raise typer.Exit(run_observability(as_request(AnalysisRequest, options)))
