"""JSON Schemas of outputs (draft 7), made from their keys."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pkmcal_cli.base.families import members
from pkmcal_cli.report import outputs
from pkmcal_cli.report.outputs.keys import COMMON, TYPES, Key, Output, keys_of, steps_of


def all_outputs() -> dict[str, Output]:
    """By command."""
    return members(outputs.__name__, outputs.__path__, Output)


def output_schema(output: Output) -> dict[str, Any]:
    """The schema of what a command writes with `--json`."""
    keys = [key for part in output.parts for key in part]
    stated = {key.marked for key in keys}
    root = _Node()
    for key in (*(k for k in keys_of(COMMON) if k.marked not in stated), *keys):
        root.add(key)
    built = root.schema()
    built["properties"]["schema"] = {"const": output.schema, "description": "which output this is"}
    title = f"pkmcal {output.keyword} --json"
    return {"$schema": "http://json-schema.org/draft-07/schema#", "$id": output.schema, "title": title, **built}


class _Node:
    """A place in the output: a map of keys, a map of names, or a value; in so many lists."""

    def __init__(self) -> None:
        self.children: dict[str, _Node] = {}
        self.absent, self.null, self.lists = False, False, 0
        self.kind, self.meaning = "", ""

    def add(self, key: Key) -> None:
        """Take a key, with the places on its way."""
        node = self
        for name, absent, null, lists in steps_of(key.marked):
            node = node.children.setdefault(name, _Node())
            node.absent, node.null, node.lists = node.absent or absent, node.null or null, max(node.lists, lists)
        node.kind, node.meaning = key.kind, key.meaning

    def schema(self) -> dict[str, Any]:
        """Of the value; null where it may be, a list where it is in one."""
        out = self._value()
        for _ in range(self.lists):
            out = {"type": "array", "items": out}
        out = _or_null(out) if self.null else out
        return {**out, "description": self.meaning} if self.meaning else out

    def _value(self) -> dict[str, Any]:
        if not self.children:
            return _leaf(self.kind)
        named = {n: c for n, c in self.children.items() if not _is_placeholder(n)}
        free = [c for n, c in self.children.items() if _is_placeholder(n)]
        return {
            "type": "object",
            "properties": {name: child.schema() for name, child in named.items()},
            "required": sorted(name for name, child in named.items() if not child.absent),
            "additionalProperties": _any_of(child.schema() for child in free) if free else False,
        }


def _is_placeholder(name: str) -> bool:
    """Whether a word stands for any name."""
    return name.isalpha() and name.isupper()


def _any_of(schemas: Iterable[dict[str, Any]]) -> dict[str, Any]:
    several = list(schemas)
    return several[0] if len(several) == 1 else {"anyOf": several}


def _leaf(kind: str) -> dict[str, Any]:
    plain = kind.removesuffix("?")
    if plain == "any":
        return {}
    out: dict[str, Any] = {"type": TYPES[plain]} if plain in TYPES else {"enum": plain.split("|")}
    return _or_null(out) if kind.endswith("?") else out


def _or_null(schema: dict[str, Any]) -> dict[str, Any]:
    if "type" in schema:
        return {**schema, "type": [schema["type"], "null"]}
    return {**schema, "enum": [*schema["enum"], None]} if "enum" in schema else schema
