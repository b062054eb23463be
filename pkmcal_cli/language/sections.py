"""What stands in which section of a machine file, by the models: a new kind of element needs no list."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import get_args

from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.machine import Machine

GROUND = "ground"
"""The one section of points that are no things: base coordinates by name."""


@cache
def sections() -> Mapping[str, type[Entity]]:
    """Sections of named things and their models, in the order of the machine file."""
    kinds = {name: get_args(field.annotation) for name, field in Machine.model_fields.items()}
    return {n: k[1] for n, k in kinds.items() if len(k) == 2 and isinstance(k[1], type) and issubclass(k[1], Entity)}


@cache
def sections_with(field: str) -> tuple[str, ...]:
    """Sections whose things have a key: `between` joins two points, `mass` weighs."""
    return tuple(name for name, kind in sections().items() if field in kind.model_fields)


@cache
def sections_of(kind: type[Entity]) -> tuple[str, ...]:
    """Sections of things of a kind or of a more special one."""
    return tuple(name for name, other in sections().items() if issubclass(other, kind))


@cache
def driven_sections() -> Mapping[str, tuple[str, ...]]:
    """Sections of what an actuator can `drive`, `turn`, ..., by the key of the actuator."""
    out: dict[str, tuple[str, ...]] = {}
    for name, kind in sections().items():
        for key in kind.driven_by:
            out[key] = (*out.get(key, ()), name)
    return out


@cache
def nouns() -> Mapping[str, str]:
    """What a thing of a section is called."""
    return {**{name: kind.noun for name, kind in sections().items() if kind.noun}, GROUND: "ground point"}


@cache
def must_be_used() -> tuple[str, ...]:
    """Sections whose things are there for others: one that nothing uses is a mistake."""
    return (*(name for name, kind in sections().items() if kind.for_others), GROUND)
