"""`pkmcal plan`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands import _completion
from pkmcal_cli.commands._options import (
    Alpha,
    Cluster,
    Dwell,
    Feed,
    Force,
    Grid,
    Jobs,
    Json,
    MachineFile,
    Parameters,
    Plot,
    PosesFile,
    Quiet,
    Select,
    State,
    as_request,
    choice,
)

Aim = Annotated[
    str | None,
    typer.Option(
        "--aim",
        metavar="PURPOSE",
        help='Add points for: uncertainty, "l1 5 um", l1,l3, an effect (backlash@q2), separate:EFFECT,EFFECT.',
        autocompletion=_completion.aims,
    ),
]
Points = Annotated[
    int | None, typer.Option("--points", min=1, max=400, help='Points to add; default 8, up to 100 for "l1 5 um".')
]
Next = Annotated[
    bool, typer.Option("--next", help="Points to measure next, from the table measured so far, until --aim is met.")
]
Budget = Annotated[
    int | None, typer.Option("--budget", min=1, max=400, help="Rows that --next may use, those measured included.")
]
Form = Annotated[
    str,
    choice("--as", "csv|gcode|checklist", "Form of the points to measure."),
]
Power = Annotated[
    int,
    typer.Option("--power", metavar="K", min=0, max=1000, help="Simulate and diagnose K campaigns of each effect."),
]
Output = Annotated[
    str | None, typer.Option("-o", "--output", metavar="PLAN.csv", help="Table of points to measure; - is stdout.")
]
PlanSeed = Annotated[
    int, typer.Option("--seed", min=0, help="Seed of the order, approach sides and candidate points.")
]


def plan(
    machine: MachineFile,
    poses: PosesFile = None,
    grid: Grid = None,
    parameters: Parameters = None,
    select: Select = "auto",
    aim: Aim = None,
    points: Points = None,
    next: Next = False,
    budget: Budget = None,
    power: Power = 0,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    state: State = None,
    alpha: Alpha = 0.005,
    output: Output = None,
    as_form: Form = "csv",
    dwell: Dwell = 2.0,
    feed: Feed = 1000.0,
    seed: PlanSeed = 0,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Which effects can this measurement detect and separate, and which points should be added?

    Examples:
        pkmcal plan scissors --grid "x=-200:200:6,y=-200:200:6" \\
            --aim backlash@q1
        pkmcal plan triglide --grid "x=300:400:3,y=250:300:2" -o points.csv
        cat machines/biglide.csv | pkmcal plan machines/biglide.yaml - --json
    """
    options = locals()
    from pkmcal_cli.workflow.plan import PlanRequest, run_plan

    raise typer.Exit(run_plan(as_request(PlanRequest, options)))
