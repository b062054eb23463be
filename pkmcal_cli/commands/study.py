"""`pkmcal study`."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from pkmcal_cli.commands._options import (
    Cluster,
    Force,
    Jobs,
    Json,
    Plot,
    Quiet,
    Select,
    State,
    as_request,
)

Machines = Annotated[
    list[str], typer.Argument(metavar="MACHINE.yaml", help="Machine files or names of shipped ones, to be compared.")
]
Points = Annotated[
    str, typer.Option("--points", metavar="N,N,...", help="Numbers of measured points, e.g. 10,20,40,80.")
]
Noise = Annotated[
    str, typer.Option("--noise", metavar="VALUE|declared", help='Noise of the readings: declared, or e.g. "10 um".')
]
Repeat = Annotated[
    int, typer.Option("--repeat", metavar="K", min=2, max=100_000, help="Calibrations of each number of points.")
]
Within = Annotated[
    str | None,
    typer.Option(
        "--within", metavar="BOX", help='Where points are, instead of the workspace: "x=0:950,y=160:390".'
    ),
]
Validation = Annotated[
    int, typer.Option("--validation", metavar="N", min=1, max=10_000, help="Other points, for the tool point.")
]
Held = Annotated[
    Literal["drawn", "nominal"],
    typer.Option("--held", help="What is not identified: drawn within its range too, or as nominal."),
]
Output = Annotated[
    str | None, typer.Option("-o", "--output", metavar="STUDY.csv", help="Table to write; - is stdout.")
]


def study(
    machines: Machines,
    points: Points = "10,20,40,80",
    noise: Noise = "declared",
    repeat: Repeat = 200,
    within: Within = None,
    select: Select = "auto",
    held: Held = "drawn",
    validation: Validation = 10,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of errors, points and noise.")] = 0,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    state: State = None,
    output: Output = None,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """How many points does a calibration need, and what does redundancy change?

    Examples:
        pkmcal study scissors --points 10,20 --noise "10 um" --repeat 5
        pkmcal study triglide triglide-nonredundant --within "x=0:950,y=160:390" \\
            --held nominal --points 10,40 --repeat 5
        cat machines/scissors.yaml | pkmcal study - --points 10 --repeat 2 --json
    """
    options = locals()
    from pkmcal_cli.base.shipped import machine_file
    from pkmcal_cli.workflow.study import StudyRequest, run_study

    options["machines"] = [machine_file(text) for text in machines]
    raise typer.Exit(run_study(as_request(StudyRequest, options)))
