"""`pkmcal plan`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Force,
    Grid,
    Json,
    MachineFile,
    Parameters,
    PosesFile,
    Quiet,
    Select,
    as_request,
)


def plan(
    machine: MachineFile,
    poses: PosesFile = None,
    grid: Grid = None,
    parameters: Parameters = None,
    select: Select = "auto",
    see: Annotated[str | None, typer.Option("--see", metavar="EFFECT", help="Add points that show it best.")] = None,
    separate: Annotated[
        str | None, typer.Option("--separate", metavar="EFFECT,EFFECT", help="Add points that tell them apart.")
    ] = None,
    determine: Annotated[
        str | None, typer.Option("--determine", metavar="NAME,...", help="Add points for parameters (D-optimal).")
    ] = None,
    points: Annotated[int, typer.Option("--points", min=1, max=400, help="How many points to add.")] = 8,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PLAN.csv", help="Table to run; - is stdout.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of orders, sides and candidate points.")] = 0,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """What will this measurement be able to detect and tell apart, and which points should be added?

    Example: pkmcal plan machines/scissors.yaml --grid "x=-200:200:6,y=-200:200:6" --separate backlash@q1,backlash@q2
    """
    options = locals()
    from pkmcal_cli.workflow.plan import PlanRequest, run_plan

    raise typer.Exit(run_plan(as_request(PlanRequest, options)))
