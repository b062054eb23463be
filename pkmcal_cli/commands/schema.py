"""`pkmcal schema`."""

from __future__ import annotations

from typing import Annotated

import typer

from pkmcal_cli.commands._options import Force


def schema(
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="FILE.json", help="File to write; default: stdout.")
    ] = "-",
    overlay: Annotated[bool, typer.Option("--overlay", help="Schema for files with `extends`.")] = False,
    force: Force = False,
) -> None:
    """Which keys can a machine file have? (JSON Schema for editors)

    Examples:
        pkmcal schema -o machine.schema.json
        pkmcal schema --output calibrate
    """
    import json

    from pkmcal_cli.base.outputs import write_text
    from pkmcal_cli.language.json_schema import machine_schema

    with write_text(output, (), force=force) as file:
        file.write(json.dumps(machine_schema(overlay), indent=2) + "\n")
