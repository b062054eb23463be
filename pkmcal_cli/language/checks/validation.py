"""From plain data to models: pydantic's errors as faults at places, the rest salvaged.

Entries with a fault are quarantined, so that the names and units of all others are still checked
in the same run.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from pkmcal_cli.base.errors import FaultList, did_you_mean
from pkmcal_cli.base.plural import listed
from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.machine import Machine, WrittenMachine
from pkmcal_cli.language.quantities import hint_of, kind_of
from pkmcal_cli.yaml_source.tree import Path, SourceMap, cut_by_comma

_ROUNDS = 8
_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_BRACES = re.compile(r"\{[^{}]*\}")
_TWO = "write a list, for example `between: [p, q]` or `limits: [low, high]`"
_PAIR = "write two points; only a rope runs over more"
_RANGE = "write half its width, one number; limits for a fit are `bounds: [min, max]`"
_PIECES = "use fewer pieces: the time to load the machine grows with their third power"
_MAP = "write `name: {...}`"
_DECISIVE = ("moves", "drives", "turns", "winds", "unit", "radius", "reads", "nominal")
"""Keys on which the meaning of their siblings hangs."""


@dataclass
class Quarantine:
    """What was quarantined because of faults: plain data by path."""

    data: dict[Path, Any] = field(default_factory=dict)

    def touches(self, path: Path) -> bool:
        """Whether something at or under this path was quarantined."""
        return any(each[: len(path)] == path for each in self.data)

    def names(self, section: str) -> list[str]:
        """Names of the entries of a section that were quarantined."""
        return [str(path[1]) for path in self.data if len(path) == 2 and path[0] == section]

    def makes(self, name: str) -> bool:
        """Whether an entry whose name has `{i}` in it, but no `each`, would have made this one."""
        names = [str(part) for path in self.data for part in path[1:] if "{" in str(part)]
        return any(re.fullmatch(r"\w+".join(map(re.escape, _BRACES.split(each))), name) for each in names)

    def words(self) -> frozenset[str]:
        """All words in what was quarantined, and its names."""
        words: set[str] = set()
        stack: list[Any] = [*self.data.values(), *(part for path in self.data for part in path)]
        while stack:
            item = stack.pop()
            if isinstance(item, str):
                words.update(_WORD.findall(item))
            elif isinstance(item, dict):
                stack += [*item, *item.values()]
            elif isinstance(item, tuple | list):
                stack += item
        return frozenset(words)

    def take(self, data: dict[str, Any], path: Path) -> None:
        """Takes what stands at a path out of the plain data."""
        at: Any = data
        for part in path[:-1]:
            at = at.get(part) if isinstance(at, dict) else None
        if path and isinstance(at, dict) and path[-1] in at:
            self.data[path] = at.pop(path[-1])


def validated(source: SourceMap, faults: FaultList) -> tuple[WrittenMachine | None, Quarantine]:
    """The machine as written, of the tree's plain data, and what was quarantined.

    Adds a fault for everything that does not fit; no machine where nothing can be said further.
    """
    data = source.root.plain()
    for name, stated in Machine.model_fields.items():
        if name in data and data[name] is None and not stated.is_required():
            del data[name]  # a heading with nothing below it
    quarantined = Quarantine()
    space = data.get("space")
    context = {"space": space if isinstance(space, str) else None}  # what it should be is told by its own field
    for _ in range(_ROUNDS):
        try:
            return Machine.model_validate(data, context=context), quarantined
        except ValidationError as error:
            paths = _report(error, source, faults, quarantined)
        if ("space",) in paths:
            return None, quarantined
        for path in paths:
            quarantined.take(data, path)
    return None, quarantined


def _report(error: ValidationError, source: SourceMap, faults: FaultList, quarantined: Quarantine) -> list[Path]:
    """Adds pydantic's errors as faults; the paths that must be quarantined to go on."""
    paths: list[Path] = []
    for error_ in error.errors(include_url=False):
        loc, kind = error_["loc"], error_["type"]
        if kind == "missing" and quarantined.touches(loc):
            paths.append(loc[:2])
            continue
        path = _known_path(source, loc)
        _add(error_, path, source, faults)
        paths.append(("space",) if loc == ("space",) else _to_take(path, kind))
    return list(dict.fromkeys(paths))


def _to_take(path: Path, kind: str) -> Path:
    """What goes out for a fault at a path: the key, or the entry where others hang on the key."""
    if kind == "extra_forbidden":
        return path
    if kind == "missing" or (len(path) > 2 and path[2] in _DECISIVE):
        return path[:2]
    keys = [i for i, part in enumerate(path) if isinstance(part, str)]
    first_index = next((i for i, part in enumerate(path) if isinstance(part, int)), len(path))
    return path[: max((i for i in keys if i < first_index), default=0) + 1]


def _known_path(source: SourceMap, loc: tuple[str | int, ...]) -> Path:
    """Pydantic's location without the parts that the file does not have."""
    node, path = source.root, []
    for part in loc:
        child = node.child(part)
        if child is not None:
            node = child
            path.append(part)
    return tuple(path)


def _add(details: Mapping[str, Any], path: Path, source: SourceMap, faults: FaultList) -> None:
    """One error of pydantic as a fault."""
    kind, loc, context = details["type"], details["loc"], details.get("ctx", {})
    if kind == "pkmcal":
        at_key = loc[-1] == "[key]"
        is_span = loc[-1] == "range" and isinstance(details["input"], list | tuple)
        hint = _RANGE if is_span else context["hint"] or None
        faults.add(source.fault(context["code"], context["message"], path, hint, context["offset"], at_key=at_key))
    elif kind == "extra_forbidden":
        owner, key = _owner(loc[:-1]), str(loc[-1])
        names = list(owner.model_fields) if owner is not None else []
        message = f"unknown key `{key}`{_of(loc[:-1])}"
        new = owner.renamed.get(key) if owner is not None else None
        known = _of_entries(key) or _list_of(names)
        hint = f"`{key}` is now called `{new}`" if new else did_you_mean(key, names, known)
        around = source.node(path[:-1]).value
        hint = (cut_by_comma(around, key) if isinstance(around, dict) else None) or hint
        faults.add(source.fault("unknown-key", message, path, hint, at_key=True))
    elif kind == "missing" and isinstance(loc[-1], int):
        message = f"expected 2 entries{_of(loc[:-1])}, found {len(details['input'])}"
        faults.add(source.fault("value", message, path, _TWO))
    elif kind == "missing":
        owner = _owner(loc[:-1])
        message = f"missing key `{loc[-1]}`{_of(loc[:-1])}"
        about = owner.model_fields.get(str(loc[-1])) if owner is not None else None
        hint = f"add `{loc[-1]}` ({about.description})" if about and about.description else None
        faults.add(source.fault("missing-key", message, path, hint, at_key=bool(path)))
    else:
        message, hint = _plain_words(details)
        faults.add(source.fault("type" if "type" in kind else "value", message, path, hint))


def _plain_words(details: Mapping[str, Any]) -> tuple[str, str | None]:
    """Pydantic's own error in words of the file."""
    kind, raw, context = details["type"], details.get("input"), details.get("ctx", {})
    shown = kind_of(raw)
    if kind == "literal_error":
        words = [w.strip().strip("'") for w in context["expected"].replace(" or ", ",").split(",")]
        return f"{shown} is not allowed here", did_you_mean(str(raw), words, _list_of(words))
    if kind == "bool_type":
        return f"expected true or false, found {shown}", "write `true` or `false`"
    if kind == "string_type":
        return f"expected a name or text, found {shown}", hint_of(raw)
    if kind == "int_type":
        return f"expected an integer, found {shown}", "write, for example, 1"
    if kind in ("dict_type", "model_type", "model_attributes_type"):
        return f"expected a map (`name: ...`), found {shown}", _MAP
    if kind == "tuple_type":
        return f"expected a list, found {shown}", _TWO
    if kind == "too_long":
        hint = _PAIR if details["loc"][-1] == "between" else _TWO
        return f"expected {context['max_length']} entries, found {context['actual_length']}", hint
    if kind == "too_short":
        least, actual = context["min_length"], context["actual_length"]
        return f"expected at least {least} entries, found {actual}", _TWO
    if kind in ("greater_than_equal", "less_than_equal"):
        return f"{shown} is out of range; expected a value {details['msg'].removeprefix('Input should be ')}", (
            _PIECES if details["loc"][-1] == "pieces" and kind == "less_than_equal" else None
        )
    return str(details["msg"]), None


def _of_entries(key: str) -> str:
    """Where a key belongs that is none of a place: entries of which sections have it; "" for none."""
    entries = {name: _owner((name, "")) for name in Machine.model_fields}
    having = [f"`{name}`" for name, entry in entries.items() if entry is not None and key in entry.model_fields]
    return f"`{key}` is a key of the entries of {listed(having)}" if having else ""


def _list_of(names: list[str]) -> str:
    return "use one of " + ", ".join(f"`{name}`" for name in names)


def _of(loc: tuple[str | int, ...]) -> str:
    """ " in bars.rod1" """
    parts = [str(part) for part in loc]
    return f" in {'.'.join(parts)}" if parts else ""


def _owner(loc: tuple[str | int, ...]) -> type[Entity] | None:
    """The model that a location leads to."""
    kind: Any = Machine
    for part in loc:
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            about = kind.model_fields.get(str(part))
            kind = about.annotation if about is not None else None
        else:
            kind = next(iter(get_args(kind)[::-1]), None)
        kind = _model_in(kind)
    return kind if isinstance(kind, type) and issubclass(kind, Entity) else None


def _model_in(kind: Any) -> Any:
    """X of `X | None`."""
    args = [a for a in get_args(kind) if a is not type(None)]
    models = [a for a in args if isinstance(a, type) and issubclass(a, BaseModel)]
    origin = getattr(kind, "__origin__", None)
    return models[0] if models and origin not in (dict, tuple) else kind
