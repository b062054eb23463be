"""Schemas for editors and programs: of the machine file, and of what commands write with `--json`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.outputs import write_text
from pkmcal_cli.language.json_schema import machine_schema
from pkmcal_cli.report.outputs.schema import all_outputs, output_schema


@dataclass(frozen=True)
class SchemaRequest:
    """The arguments of `schema`; output: the command whose output is meant."""

    file: str
    output: str | None
    overlay: bool
    force: bool


def run_schema(request: SchemaRequest) -> int:
    """Write the schema; returns the exit code. Raises UsageError and OutputError."""
    schema = _schema(request)
    with write_text(request.file, (), force=request.force) as file:
        file.write(json.dumps(schema, indent=2, ensure_ascii=False) + "\n")
    return 0


def _schema(request: SchemaRequest) -> dict[str, Any]:
    if request.output is None:
        return machine_schema(request.overlay)
    if request.overlay:
        raise UsageError("--overlay is a schema of files, --output one of a command", hint="give one of them")
    known = all_outputs()
    if request.output not in known:
        hint = did_you_mean(request.output, known, f"use one of {', '.join(known)}; a file is named with `-o`")
        raise UsageError(f"--output: no command `{request.output}` writes JSON", hint=hint)
    return output_schema(known[request.output])
