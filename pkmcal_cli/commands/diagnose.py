"""`pkmcal diagnose`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Alpha,
    FailOn,
    Force,
    Json,
    Loss,
    MachineFile,
    MeasuredFiles,
    Parameters,
    Plot,
    Prior,
    Quiet,
    RunFolder,
    Select,
    Style,
    as_request,
)


def diagnose(
    machine: MachineFile,
    measurements: MeasuredFiles,
    select: Select = "auto",
    parameters: Parameters = None,
    loss: Loss = "squares",
    prior: Prior = "none",
    alpha: Alpha = 0.005,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the bootstrap.")] = 0,
    plots: Annotated[
        str | None,
        typer.Option("--plots", metavar="DIR", help="Folder for pictures (SVG); - draws them on the terminal."),
    ] = None,
    plot: Plot = None,
    fail_on: FailOn = None,
    run: RunFolder = None,
    as_json: Json = False,
    quiet: Quiet = False,
    style: Style = "text",
    force: Force = False,
) -> None:
    """Which physical effect explains the residuals that remain after calibration?

    Examples:
        pkmcal diagnose hangprinter machines/hangprinter_2021-12-16.csv
        pkmcal diagnose hangprinter machines/hangprinter_2021-12-16.csv \\
            machines/hangprinter_2022-04-12.csv --fail-on none
        cat machines/biglide.csv | pkmcal diagnose biglide - --json
    """
    options = locals()
    from pkmcal_cli.workflow.diagnose import DiagnosisRequest, run_diagnosis
    from pkmcal_cli.workflow.search_case import CaseRequest

    raise typer.Exit(run_diagnosis(as_request(DiagnosisRequest, options, case=as_request(CaseRequest, options))))
