"""Whether an output of `--json` is what its schema says."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from jsonschema import Draft7Validator

from tests.command import run


@cache
def validator(command: str) -> Draft7Validator:
    """Of what a command writes, by `pkmcal schema --output`."""
    done = run("schema", "--output", command)
    assert done.code == 0, done.err
    schema = json.loads(done.out)
    Draft7Validator.check_schema(schema)
    return Draft7Validator(schema)


def faults_of(command: str, output: Any) -> list[str]:
    """Where an output is not what the schema says."""
    return [f"{error.json_path}: {error.message[:200]}" for error in validator(command).iter_errors(output)]
