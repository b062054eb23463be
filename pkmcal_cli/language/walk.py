"""Walking a machine: all its values as written with their paths, and the same machine with them replaced."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.quantities import Quantity, WrittenValue
from pkmcal_cli.yaml_source.tree import Path

T = TypeVar("T")


def written_values(value: Any, path: Path = ()) -> Iterator[tuple[Path, WrittenValue]]:
    """Every value as written in a model, tuple or map, with its path in the file."""
    return _of_kind(WrittenValue, value, path)


def quantities(value: Any, path: Path = ()) -> Iterator[tuple[Path, Quantity]]:
    """Every bound quantity in a model, tuple or map, with its path in the file."""
    return _of_kind(Quantity, value, path)


def _of_kind(kind: type[T], value: Any, path: Path) -> Iterator[tuple[Path, T]]:
    """Every value of a kind, in the order of the file; most of what a machine holds is nothing, or a plain text."""
    if isinstance(value, kind):
        yield path, value
        return
    for name, child in _children(value):
        if child is not None and not isinstance(child, str):
            yield from _of_kind(kind, child, (*path, name))


def _children(value: Any) -> Iterable[tuple[str | int, Any]]:
    if isinstance(value, dict):
        return value.items()
    if isinstance(value, tuple):
        return enumerate(value)
    return value.__dict__.items() if isinstance(value, Entity) else ()


def replaced(value: Any, make: Callable[[Path, WrittenValue], Any], path: Path = ()) -> Any:
    """The same with every value as written replaced by what `make` gives for it."""
    if value is None or isinstance(value, str):  # most of what a machine holds
        return value
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
