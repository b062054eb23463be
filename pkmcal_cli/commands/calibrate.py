"""`pkmcal calibrate`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Accept,
    FailAbove,
    Force,
    Holdout,
    Jobs,
    Json,
    Loosen,
    Loss,
    MachineFile,
    MaxRms,
    MeasuredFiles,
    Method,
    Parameters,
    Plot,
    PriorOrFile,
    Quiet,
    RunFolder,
    Seed,
    Select,
    Starts,
    Style,
    Uncertainty,
    as_request,
)

Output = Annotated[
    str | None, typer.Option("-o", "--output", metavar="PARAMS.yaml", help="Parameter file to write; - is stdout.")
]


def calibrate(
    machine: MachineFile,
    measurements: MeasuredFiles,
    output: Output = None,
    select: Select = "auto",
    holdout: Holdout = None,
    parameters: Parameters = None,
    method: Method = "exact",
    loss: Loss = "squares",
    prior: PriorOrFile = "none",
    loosen: Loosen = None,
    uncertainty: Uncertainty = "linear",
    starts: Starts = 0,
    seed: Seed = 0,
    jobs: Jobs = 1,
    fail_above: FailAbove = None,
    max_rms: MaxRms = None,
    accept: Accept = False,
    run: RunFolder = None,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
    style: Style = "text",
    force: Force = False,
) -> None:
    """Which dimensions explain the measurements, and how uncertain are they?

    Examples:
        pkmcal calibrate triglide machines/triglide.csv -o triglide.params.yaml
        pkmcal calibrate hangprinter machines/hangprinter_2021-12-16.csv \\
            machines/hangprinter_2022-04-12.csv
        cat machines/biglide.csv | pkmcal calibrate biglide - --json
    """
    options = locals()
    from pkmcal_cli.calibration.complete_fit import FitOptions
    from pkmcal_cli.workflow.calibrate import run_calibration
    from pkmcal_cli.workflow.calibration import CalibrationRequest

    request = as_request(CalibrationRequest, options, fit_options=as_request(FitOptions, options))
    raise typer.Exit(run_calibration(request))
