"""`pkmcal correct`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands import _completion
from pkmcal_cli.commands._options import (
    Dwell,
    Feed,
    Force,
    Grid,
    Json,
    MachineFile,
    Parameters,
    Plot,
    Quiet,
    RunFolder,
    as_request,
)

_FORMATS = (
    "adjust", "beckhoff", "csv", "gcode", "gcode-drives", "gcode-printer", "klipper", "linuxcnc", "reprapfirmware",
)  # fmt: skip
_CHOICES = ("min-force", "min-energy", "preload", "nominal")
Redundant = Annotated[
    str,
    typer.Option(
        "--redundant",
        metavar="CHOICE",
        help="min-force, min-energy, preload or nominal.",
        autocompletion=_completion.one_of(*_CHOICES),
    ),
]
AsFormat = Annotated[
    str | None,
    typer.Option(
        "--as",
        metavar="FORMAT",
        help=f"What a control takes instead: {', '.join(_FORMATS)} (docs/correct.md).",
        autocompletion=_completion.one_of(*_FORMATS),
    ),
]


def correct(
    machine: MachineFile,
    targets: Annotated[
        str | None, typer.Argument(metavar="TARGETS.csv", help="Wanted TCP coordinates; - is stdin.")
    ] = None,
    grid: Grid = None,
    parameters: Parameters = None,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar='"T=23,session=may"', help='Circumstances, session; "T=23 +- 0.5": how sure.'),
    ] = None,
    redundant: Redundant = "min-force",
    as_format: AsFormat = None,
    dwell: Dwell = 2.0,
    feed: Feed = 1000.0,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="COMMANDS.csv", help="File to write; default: stdout.")
    ] = None,
    plot: Plot = None,
    run: RunFolder = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Which set values bring the TCP to these targets?

    Redundant drives carry least force, hold least strain energy, keep the preload, or stay at nominal set values.

    Examples:
        pkmcal correct gantry --grid "x=200:1300:4,y=200:1500:4" -o commands.csv
        pkmcal calibrate machines/biglide.yaml machines/biglide.csv -o - \\
            | pkmcal correct biglide --grid "x=300:400:2" -p - -o c.csv --json
    """
    options = locals()
    from pkmcal_cli.workflow.correct import CorrectionRequest, run_correction

    raise typer.Exit(run_correction(as_request(CorrectionRequest, options)))
