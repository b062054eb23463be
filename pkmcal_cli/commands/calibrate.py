"""`pkmcal calibrate`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Force,
    Json,
    Loss,
    MachineFile,
    Parameters,
    Prior,
    Quiet,
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
        typer.Option("--holdout", metavar="K|session|cells|FILE.csv|none", help="Held-out error; default 5 folds."),
    ] = None,
    parameters: Parameters = None,
    loss: Loss = "squares",
    prior: Prior = "none",
    uncertainty: Uncertainty = "linear",
    starts: Starts = 0,
    seed: Seed = 0,
    max_rms: Annotated[
        str | None,
        typer.Option("--max-rms", metavar="VALUE", help="Exit 1 if the (held-out) position rms is above."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Which true dimensions explain what was measured, and how sure are they?

    Example: pkmcal calibrate machines/triglide.yaml machines/triglide.csv -o triglide.params.yaml
    """
    options = locals()
    from pkmcal_cli.calibration.fitted import Treatment
    from pkmcal_cli.workflow.calibrate import CalibrationRequest, run_calibration

    how = as_request(Treatment, options)
    raise typer.Exit(run_calibration(as_request(CalibrationRequest, options, how=how)))
