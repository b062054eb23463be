"""`pkmcal report`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Alpha,
    Force,
    Json,
    Loss,
    MachineOrRun,
    Parameters,
    Prior,
    Quiet,
    Seed,
    Select,
    as_request,
)


def report(
    machine: MachineOrRun,
    measurements: Annotated[
        list[str] | None,
        typer.Argument(metavar="MEAS.csv", help="Measured rows, each file a session; after RUN: AFTER.csv."),
    ] = None,
    after: Annotated[
        str | None, typer.Option("--after", metavar="AFTER.csv", help="Rows measured after correction; judged instead.")
    ] = None,
    output: Annotated[str, typer.Option("-o", "--output", metavar="FILE.html", help="Page to write.")] = "report.html",
    tolerance: Annotated[
        str | None,
        typer.Option("--tolerance", metavar='"5 um"', help="Tolerance of a position error; verdict by ISO 14253-1."),
    ] = None,
    select: Select = "auto",
    parameters: Parameters = None,
    loss: Loss = "squares",
    prior: Prior = "none",
    alpha: Alpha = 0.005,
    seed: Seed = 0,
    circle_feed: Annotated[
        float | None, typer.Option("--circle-feed", metavar="F", help="Feed of measured circles, mm/min (ISO 230-4).")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Is the machine within its tolerance, what is wrong with it, and how sure is that? One page to hand over.

    Examples:
        pkmcal report triglide machines/triglide.csv --tolerance "100 um" \\
            -o triglide.html
        pkmcal report biglide machines/biglide.csv -o biglide.html --json
    """
    options = locals()
    from pkmcal_cli.workflow.report import ReportRequest, run_report

    raise typer.Exit(run_report(as_request(ReportRequest, options | {"measurements": measurements or []})))
