"""`pkmcal plan`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Alpha,
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
    see: Annotated[
        str | None, typer.Option("--see", metavar="EFFECT", help="Add points that best show this effect.")
    ] = None,
    separate: Annotated[
        str | None, typer.Option("--separate", metavar="EFFECT,EFFECT", help="Add points that separate these effects.")
    ] = None,
    determine: Annotated[
        str | None, typer.Option("--determine", metavar="NAME,...", help="Add points for these parameters (D-optimal).")
    ] = None,
    points: Annotated[int, typer.Option("--points", min=1, max=400, help="Number of points to add.")] = 8,
    power: Annotated[
        int,
        typer.Option("--power", metavar="K", min=0, max=1000, help="Simulate and diagnose K campaigns of each effect."),
    ] = 0,
    alpha: Alpha = 0.005,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PLAN.csv", help="Table of points to measure; - is stdout.")
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of the order, approach sides and candidate points.")
    ] = 0,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Which effects can this measurement detect and separate, and which points should be added?

    Example: pkmcal plan machines/scissors.yaml --grid "x=-200:200:6,y=-200:200:6" --separate backlash@q1,backlash@q2
    """
    options = locals()
    from pkmcal_cli.workflow.plan import PlanRequest, run_plan

    raise typer.Exit(run_plan(as_request(PlanRequest, options)))
