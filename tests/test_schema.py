"""The JSON Schema: valid draft-07, accepts what the reader accepts, refuses the plain slips."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.json_schema import machine_schema
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.yaml_source.read import read_source
from tests.command import MACHINES, run

HERE = Path(__file__).parent
FILES = [HERE / "data" / "triglide.yaml", *sorted(MACHINES.glob("*.yaml"))]
FILES = [file for file in FILES if ".csv." not in file.name]


def data_of(file: Path) -> Any:
    return json.loads(json.dumps(read_source(str(file)).root.plain()))


@pytest.mark.parametrize("overlay", [False, True])
def test_the_schema_is_draft_07_and_plain_data(overlay: bool) -> None:
    schema = machine_schema(overlay)
    jsonschema.Draft7Validator.check_schema(schema)
    text = json.dumps(schema)
    assert "$defs" not in text and "prefixItems" not in text
    assert ('"required"' in text.replace('"required": []', "")) or overlay
    assert machine_schema(overlay) == json.loads(text)


@pytest.mark.parametrize(("options", "name"), [((), "machine"), (("--overlay",), "overlay")])
def test_the_shipped_schemas_are_those_of_the_program(options: tuple[str, ...], name: str) -> None:
    shipped = MACHINES / f"{name}.schema.json"
    assert shipped.read_text(encoding="utf-8") == run("schema", *options).out


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_the_schema_accepts_machines(file: Path) -> None:
    data = data_of(file)
    validator = jsonschema.Draft7Validator(machine_schema("extends" in data))
    assert [error.message for error in validator.iter_errors(data)] == []


@pytest.mark.parametrize("name", ["keys", "sense"])
def test_the_schema_refuses_slips(name: str) -> None:
    validator = jsonschema.Draft7Validator(machine_schema())
    assert len(list(validator.iter_errors(data_of(HERE / "bad" / f"{name}.yaml")))) > 3


def test_every_key_has_a_description() -> None:
    schema = machine_schema()
    assert set(schema["properties"]) == set(Machine.model_fields)
    missing = []
    for name, definition in {**schema["definitions"], "Machine": schema}.items():
        for form in definition.get("anyOf", [definition]):
            for key, about in form.get("properties", {}).items():
                if not about.get("description"):
                    missing.append(f"{name}.{key}")
    assert missing == []


YAML_1_1_TRUTH = {"on", "off", "yes", "no"}
"""Words that a YAML 1.1 reader takes for true and false, as it does `y` and `n`, which are names of axes here."""


def keys_in(schema: Any) -> set[str]:
    """Every key of a machine file that a schema names, at any depth."""
    if isinstance(schema, list):
        return set().union(*map(keys_in, schema))
    if not isinstance(schema, dict):
        return set()
    own = set(schema["properties"]) if isinstance(schema.get("properties"), dict) else set()
    return own.union(*map(keys_in, schema.values()))


@pytest.mark.parametrize("overlay", [False, True])
def test_no_key_is_a_truth_value_of_yaml_1_1(overlay: bool) -> None:
    keys = keys_in(machine_schema(overlay))
    keys |= {p.name for effect in catalogue().values() for p in (*effect.parameters, *effect.options)}
    assert {"guides", "guide", "surface", "between", "y", "rz", "over"} <= keys, "keys at all depths are seen"
    assert not {key.lower() for key in keys} & YAML_1_1_TRUTH
