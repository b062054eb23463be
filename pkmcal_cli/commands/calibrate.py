"""`pkmcal calibrate`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Accept,
    Force,
    Json,
    Loosen,
    Loss,
    MachineFile,
    Parameters,
    PriorOrFile,
    Quiet,
    RunFolder,
    Seed,
    Select,
    Starts,
    Uncertainty,
    as_request,
)


def calibrate(
    machine: MachineFile,
    measurements: Annotated[
        list[str], typer.Argument(metavar="MEAS.csv", help="Measured rows, each file a session; - is stdin.")
    ],
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PARAMS.yaml", help="Parameter file to write; - is stdout.")
    ] = None,
    select: Select = "auto",
    holdout: Annotated[
        str | None,
        typer.Option("--holdout", metavar="K|session|cells|FILE.csv|none", help="Data to hold out; default: 5 folds."),
    ] = None,
    parameters: Parameters = None,
    loss: Loss = "squares",
    prior: PriorOrFile = "none",
    loosen: Loosen = None,
    uncertainty: Uncertainty = "linear",
    starts: Starts = 0,
    seed: Seed = 0,
    max_rms: Annotated[
        str | None,
        typer.Option("--max-rms", metavar="VALUE", help="Exit with 1 if the (held-out) position rms is larger."),
    ] = None,
    accept: Accept = False,
    run: RunFolder = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Which dimensions explain the measurements, and how uncertain are they?

    Example: pkmcal calibrate machines/triglide.yaml machines/triglide.csv -o triglide.params.yaml
    """
    options = locals()
    from pkmcal_cli.calibration.complete_fit import FitOptions
    from pkmcal_cli.workflow.calibrate import CalibrationRequest, run_calibration

    fit_options = as_request(FitOptions, options)
    raise typer.Exit(run_calibration(as_request(CalibrationRequest, options, fit_options=fit_options)))
