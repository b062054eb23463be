"""`pkmcal schema`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands import _completion
from pkmcal_cli.commands._options import Force, as_request


def schema(
    file: Annotated[str, typer.Option("-o", metavar="FILE.json", help="File to write; default: stdout.")] = "-",
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            metavar="COMMAND",
            help="Schema of what this command writes with --json.",
            autocompletion=_completion.commands,
        ),
    ] = None,
    overlay: Annotated[bool, typer.Option("--overlay", help="Schema for files with `extends`.")] = False,
    force: Force = False,
) -> None:
    """Which keys can a machine file have, and which has an output? (JSON Schema, for editors and programs)

    Examples:
        pkmcal schema -o machine.schema.json
        pkmcal schema --output calibrate
    """
    options = locals()
    from pkmcal_cli.workflow.schema import SchemaRequest, run_schema

    raise typer.Exit(run_schema(as_request(SchemaRequest, options)))
