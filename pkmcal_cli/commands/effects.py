"""`pkmcal effects`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Grid, Json, Parameters, PosesFile, Quiet, Select, as_request


def effects(
    machine: Annotated[
        str | None, typer.Argument(metavar="[M.yaml]", help="Machine file or name: list the places of each effect.")
    ] = None,
    poses: PosesFile = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Show what each effect of plausible size does to the readings.")
    ] = False,
    grid: Grid = None,
    parameters: Parameters = None,
    select: Select = "auto",
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Which physical effects can a machine file declare and `diagnose` find, and what would each do to the readings?

    Examples:
        pkmcal effects machines/scissors.yaml --simulate
        cat machines/biglide.csv | pkmcal effects biglide - --simulate --json
    """
    options = locals()
    from pkmcal_cli.base.shipped import machine_file
    from pkmcal_cli.workflow.effects import run_effects
    from pkmcal_cli.workflow.effects_request import EffectsRequest

    options["machine"] = machine and machine_file(machine)
    raise typer.Exit(run_effects(as_request(EffectsRequest, options)))
