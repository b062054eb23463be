"""`pkmcal simulate`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import (
    Force,
    Grid,
    Json,
    MachineFile,
    Method,
    Parameters,
    Plot,
    PosesFile,
    Quiet,
    as_request,
)


def simulate(
    machine: MachineFile,
    poses: PosesFile = None,
    grid: Grid = None,
    parameters: Parameters = None,
    method: Method = "exact",
    noise: Annotated[str, typer.Option("--noise", metavar='declared|none|"10 um"', help="Noise to add.")] = "none",
    seed: Annotated[int, typer.Option("--seed", help="Seed of the noise.")] = 0,
    forces: Annotated[bool, typer.Option("--forces", help="Add drive forces and strain energy.")] = False,
    uncertainty: Annotated[
        bool, typer.Option("--uncertainty", help="Add the TCP uncertainty from the calibration of -p (u.x, u.y ...).")
    ] = False,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="OUT.csv", help="Table to write; default: stdout.")
    ] = None,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """What would the instruments read at these positions?

    Rows of TCP coordinates use the set values of the nominal machine. `calibrate` can read the table. A machine without
    actuators needs no positions.

    Examples:
        pkmcal simulate triglide --grid "x=200:700:5,y=200:350:4" \\
            --noise declared --seed 1
        cat machines/triglide.csv | pkmcal simulate triglide - \\
            -o simulated.csv --json
    """
    options = locals()
    from pkmcal_cli.workflow.simulate import run_simulation
    from pkmcal_cli.workflow.simulation import SimulationRequest

    raise typer.Exit(run_simulation(as_request(SimulationRequest, options)))
