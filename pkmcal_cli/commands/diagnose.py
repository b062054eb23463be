"""`pkmcal diagnose`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Json, MachineFile, Quiet, Select, as_request


def diagnose(
    machine: MachineFile,
    measurements: Annotated[
        list[str], typer.Argument(metavar="MEAS.csv", help="Measured rows, each file a session; - is stdin.")
    ],
    select: Select = "auto",
    alpha: Annotated[float, typer.Option("--alpha", help="False-alarm rate of the whole diagnosis.")] = 0.005,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the bootstrap.")] = 0,
    plots: Annotated[
        str | None,
        typer.Option("--plots", metavar="DIR", help="Folder for pictures (SVG); - draws them on the terminal."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What is left after calibration, and which physical effect explains it?

    Example: pkmcal diagnose machines/hangprinter.yaml machines/hangprinter_2021-12-16.csv
    """
    options = locals()
    from pkmcal_cli.workflow.diagnose import DiagnosisRequest, run_diagnosis

    raise typer.Exit(run_diagnosis(as_request(DiagnosisRequest, options)))
