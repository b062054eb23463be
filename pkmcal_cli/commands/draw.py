"""`pkmcal draw`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Force, Grid, Json, MachineFile, Parameters, PosesFile, Quiet, as_request


def draw(
    machine: MachineFile,
    poses: PosesFile = None,
    grid: Grid = None,
    parameters: Parameters = None,
    row: Annotated[
        int | None, typer.Option("--row", metavar="K", min=1, help="Row of the table or grid, from 1; default: 1.")
    ] = None,
    forces: Annotated[bool, typer.Option("--forces", help="Show forces of members and drives.")] = False,
    scale: Annotated[
        float | None,
        typer.Option("--scale", metavar="FACTOR", help="Magnification of displacements; default: automatic."),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE.svg|png|pdf", help="Picture; default: drawn on the terminal."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """What does this machine look like, and how is it strained?

    The reference configuration, or one row of a table. Where the control believes the machine to be is grey: nominal
    parameters, no effects, redundant drives following. Where it is by `-p` and its file is black, exaggerated.

    Examples:
        pkmcal draw machines/triglide.yaml
        pkmcal draw hexapod7 machines/hexapod7.csv --row 3 --scale 200 \\
            -o hexapod.svg
        cat machines/triglide.csv | pkmcal draw triglide - --row 5 --json
    """
    options = locals()
    from pkmcal_cli.workflow.draw import DrawingRequest, run_drawing

    raise typer.Exit(run_drawing(as_request(DrawingRequest, options)))
