"""`pkmcal improve`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands import _completion
from pkmcal_cli.commands._options import (
    Accept,
    Alpha,
    FailAbove,
    FailOn,
    Force,
    Jobs,
    Json,
    Loss,
    MachineFile,
    MeasuredFiles,
    Parameters,
    Prior,
    Quiet,
    RunFolder,
    Select,
    Style,
    as_request,
)

Only = Annotated[
    str | None,
    typer.Option(
        "--only",
        metavar="EFFECTS",
        help="Test only these effects, e.g. zero@all,scale@upper; few rows are enough.",
        autocompletion=_completion.effects,
    ),
]


def improve(
    machine: MachineFile,
    measurements: MeasuredFiles,
    validation: Annotated[
        str | None, typer.Option("--validation", metavar="VAL.csv", help="Rows used only for reporting.")
    ] = None,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="M-improved.yaml", help="Improved machine file to write.")
    ] = None,
    select: Select = "auto",
    parameters: Parameters = None,
    loss: Loss = "squares",
    prior: Prior = "none",
    only: Only = None,
    alpha: Alpha = 0.005,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the bootstrap.")] = 0,
    jobs: Jobs = 1,
    accept: Accept = False,
    fail_on: FailOn = None,
    fail_above: FailAbove = None,
    run: RunFolder = None,
    as_json: Json = False,
    quiet: Quiet = False,
    style: Style = "text",
    force: Force = False,
) -> None:
    """Which effects does the machine file lack, and how much do they improve held-out points?

    Examples:
        pkmcal improve hangprinter machines/hangprinter_2021-12-16.csv \\
            -o improved.yaml
        pkmcal improve hangprinter machines/hangprinter_2021-12-16.csv \\
            machines/hangprinter_2022-04-12.csv --fail-on none
        cat machines/biglide.csv | pkmcal improve machines/biglide.yaml - --json
    """
    options = locals()
    from pkmcal_cli.workflow.improve import ImproveRequest, run_improvement
    from pkmcal_cli.workflow.search_case import CaseRequest

    raise typer.Exit(run_improvement(as_request(ImproveRequest, options, case=as_request(CaseRequest, options))))
