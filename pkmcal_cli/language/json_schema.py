"""The JSON Schema of the machine file (draft-07 forms), for editors and for `pkmcal schema`."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from pkmcal_cli.effects import catalogue
from pkmcal_cli.effects.unexplained import UNEXPLAINED
from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.sensors import sensor_kinds

DRAFT = "http://json-schema.org/draft-07/schema#"

_NAMES = {"pattern": "^[A-Za-z{][A-Za-z0-9_{}]*$"}
_EACH = {
    "description": "Repeats the entry for every value, with {i} in its name: {i: [1, 2, 3]}",
    "type": "object",
    "minProperties": 1,
    "additionalProperties": {
        "type": "array", "minItems": 1, "items": {"type": ["string", "number"]},
    },
}  # fmt: skip
_NULL = {"type": "null"}

Schema = dict[str, Any]


class _Generator(GenerateJsonSchema):
    """Defaults as they would stand in the file."""

    def encode_default(self, dft: Any) -> Any:
        return _as_written(dft)


def _as_written(value: Any) -> Any:
    if isinstance(value, Quantity):
        number = value.number({})
        return int(number) if number.is_integer() else number
    if isinstance(value, Entity):
        return {n: _as_written(v) for n, v in value.__dict__.items() if v is not None}
    if isinstance(value, tuple):
        return [_as_written(each) for each in value]
    return value


def machine_schema(overlay: bool = False) -> Schema:
    """The schema of a machine file as plain data, draft-07.

    With `overlay` the one for files with `extends`: nothing is required, `null` deletes.
    """
    raw = Machine.model_json_schema(schema_generator=_Generator)
    raw["description"] = "A machine file of pkmcal: YAML 1.2, numbers in the file's units"
    raw["definitions"] = raw.pop("$defs")
    made: Schema = _draft07(raw)
    for name in _entries(made):
        _allow_each(made["definitions"][name])
    _name_effects(made)
    _name_sensors(made)
    if overlay:
        _relaxed(made)
    return {"$schema": DRAFT, "title": "pkmcal machine file", **made}


def _name_effects(schema: Schema) -> None:
    """Effects are named by the catalogue; their constants may be intervals."""
    keywords = "|".join((*catalogue(), UNEXPLAINED))
    schema["properties"]["effects"]["propertyNames"] = {"pattern": f"^({keywords})@.+$"}
    forms = schema["definitions"]["EffectNumber"]["anyOf"]
    forms += [deepcopy(forms[1]["properties"][name]) for name in ("interval", "numbers", "matrix")]


def _name_sensors(schema: Schema) -> None:
    """Sensors have kinds."""
    schema["definitions"]["Sensor"]["properties"]["kind"]["enum"] = list(sensor_kinds())


def _draft07(node: Any) -> Any:
    """The same in draft-07 words, without titles, nulls and defaults that mean "not given"."""
    if isinstance(node, list):
        return [_draft07(item) for item in node]
    if not isinstance(node, dict):
        return node
    made: Schema = {key: _draft07_value(key, value) for key, value in node.items()}
    if isinstance(made.get("title"), str):
        del made["title"]
    if "default" in made and made["default"] in (None, "", [], {}, 0.0):
        del made["default"]
    if "prefixItems" in made:
        items = made.pop("prefixItems")
        made["items"] = items[0] if all(item == items[0] for item in items) else items
    return _without_null(made)


def _draft07_value(key: str, value: Any) -> Any:
    if key in ("properties", "definitions") and isinstance(value, dict):
        return {name: _draft07(child) for name, child in value.items()}
    if key == "$ref":
        return str(value).replace("#/$defs/", "#/definitions/")
    if key == "description":
        return " ".join(str(value).split())
    return _draft07(value)


def _without_null(made: Schema) -> Schema:
    """`X | null` as X; a reference with further keys as allOf, as draft-07 has it."""
    choices = made.get("anyOf")
    if isinstance(choices, list) and _NULL in choices:
        remaining = [choice for choice in choices if choice != _NULL]
        del made["anyOf"]
        made = {**remaining[0], **made} if len(remaining) == 1 else {"anyOf": remaining, **made}
    if "$ref" in made and len(made) > 1:
        made = {"allOf": [{"$ref": made.pop("$ref")}], **made}
    return made


def _entries(schema: Schema) -> list[str]:
    """The definitions that are entries of maps; names and points of maps are adapted here."""
    sections: list[str] = []
    stack: list[Any] = [schema]
    while stack:
        node = stack.pop()
        if isinstance(node, list):
            stack += node
        elif isinstance(node, dict):
            stack += node.values()
            entry = node.get("additionalProperties")
            if not isinstance(entry, dict) or node.get("type") != "object":
                continue
            reference = entry.get("$ref", "")
            if reference:
                sections.append(reference.rsplit("/", 1)[1])
            elif entry.get("type") == "array" and "minProperties" not in node:
                each = {"each": deepcopy(_EACH), "at": deepcopy(entry)}
                both = {"type": "object", "properties": each, "required": ["each", "at"]}
                node["additionalProperties"] = {"anyOf": [entry, both]}
            else:
                continue
            node["propertyNames"] = _NAMES
    return sorted(set(sections))


def _allow_each(definition: Schema) -> None:
    """Entries of maps may be repeated."""
    forms = definition.get("anyOf", [definition])
    for form in forms:
        if "properties" in form:
            form["properties"] = {**form["properties"], "each": deepcopy(_EACH)}


def _relaxed(node: Any) -> None:
    """Nothing is required; every key and entry may be null."""
    if isinstance(node, list):
        for item in node:
            _relaxed(item)
    if not isinstance(node, dict):
        return
    for child in node.values():
        _relaxed(child)
    if isinstance(node.get("required"), list):
        del node["required"]
    properties = node.get("properties")
    if isinstance(properties, dict):
        node["properties"] = {name: {"anyOf": [p, _NULL]} for name, p in properties.items()}
    entry = node.get("additionalProperties")
    if isinstance(entry, dict):
        node["additionalProperties"] = {"anyOf": [entry, _NULL]}
