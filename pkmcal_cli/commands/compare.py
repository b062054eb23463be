"""`pkmcal compare`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import FailAboveChange, Force, Json, Plot, Quiet, Style, as_request


def compare(
    files: Annotated[
        list[str],
        typer.Argument(metavar="A B ...", help="Parameter files or runs; two machines and a table; a run folder."),
    ],
    machine: Annotated[
        str | None, typer.Option("--machine", metavar="M.yaml", help="Machine whose tool point is predicted.")
    ] = None,
    alpha: Annotated[float, typer.Option("--alpha", help="Chance of an alarm where nothing has changed.")] = 0.05,
    fail_above: FailAboveChange = None,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
    style: Style = "text",
    force: Force = False,
) -> None:
    """Has the machine changed between these calibrations, in what, and what does it do to the tool point?

    Examples:
        pkmcal compare triglide triglide-nonredundant machines/triglide.csv
        pkmcal compare triglide triglide-nonredundant \\
            machines/triglide.csv --json
    """
    options = locals()
    from pkmcal_cli.base.shipped import machine_file
    from pkmcal_cli.workflow.compare import ComparisonRequest, run_comparison

    options |= {"files": [machine_file(t) for t in files], "machine": machine and machine_file(machine)}
    raise typer.Exit(run_comparison(as_request(ComparisonRequest, options)))
