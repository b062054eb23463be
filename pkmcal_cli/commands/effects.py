"""`pkmcal effects`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Json, Quiet


def effects(
    machine: Annotated[str | None, typer.Argument(metavar="[M.yaml]", help="List where each can sit on it.")] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Which physical effects can be declared, and looked for by `diagnose`?

    Example: pkmcal effects machines/scissors.yaml
    """
    from pkmcal_cli.workflow.effects import run_effects

    raise typer.Exit(run_effects(machine, as_json, quiet))
