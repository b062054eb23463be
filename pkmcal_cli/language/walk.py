"""Walking a machine: all its values as written with their paths, and the same machine with them replaced."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.quantities import Quantity, WrittenValue
from pkmcal_cli.yaml_source.tree import Path


def written_values(value: Any, path: Path = ()) -> Iterator[tuple[Path, WrittenValue]]:
    """Every value as written in a model, tuple or map, with its path in the file."""
    if isinstance(value, WrittenValue):
        yield path, value
    elif isinstance(value, Entity):
        for name, child in value.__dict__.items():
            yield from written_values(child, (*path, name))
    elif isinstance(value, dict):
        for name, child in value.items():
            yield from written_values(child, (*path, name))
    elif isinstance(value, tuple):
        for index, child in enumerate(value):
            yield from written_values(child, (*path, index))


def quantities(value: Any, path: Path = ()) -> Iterator[tuple[Path, Quantity]]:
    """Every bound quantity in a model, tuple or map, with its path in the file."""
    if isinstance(value, Quantity):
        yield path, value
    elif isinstance(value, Entity):
        for name, child in value.__dict__.items():
            yield from quantities(child, (*path, name))
    elif isinstance(value, dict):
        for name, child in value.items():
            yield from quantities(child, (*path, name))
    elif isinstance(value, tuple):
        for index, child in enumerate(value):
            yield from quantities(child, (*path, index))


def replaced(value: Any, make: Callable[[Path, WrittenValue], Any], path: Path = ()) -> Any:
    """The same with every value as written replaced by what `make` gives for it."""
    if isinstance(value, WrittenValue):
        return make(path, value)
    if isinstance(value, Entity):
        new = {n: replaced(c, make, (*path, n)) for n, c in value.__dict__.items()}
        changed = {n: c for n, c in new.items() if c is not value.__dict__[n]}
        return value.model_copy(update=changed) if changed else value
    if isinstance(value, dict):
        made = {n: replaced(c, make, (*path, n)) for n, c in value.items()}
        return made if any(made[n] is not value[n] for n in made) else value
    if isinstance(value, tuple):
        parts = tuple(replaced(c, make, (*path, i)) for i, c in enumerate(value))
        return parts if any(a is not b for a, b in zip(parts, value, strict=True)) else value
    return value


def with_values(entity: Entity, values: Mapping[str, Any]) -> Any:
    """The same entity with some of its fields replaced, as they are at the next stage of reading."""
    return entity.model_copy(update=dict(values))
