"""The fingerprint of a machine: what it is made of without its numbers, so that values are not taken for another one.

Every thing has a hash of its kind, of what it joins, of which numbers it states and on which parameters they depend;
not of the numbers, units, columns or notes, nor of limits, which change no prediction. A file, the same one written out
or flattened, and one with other values have one fingerprint.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal_cli.effects import catalogue
from pkmcal_cli.effects.unexplained import UNEXPLAINED
from pkmcal_cli.language.effect_numbers import Entries
from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.language.sections import nouns, sections
from pkmcal_cli.language.sensing import Sensor
from pkmcal_cli.language.walk import quantities

_PLACES = ("ground", "frames")
"""Sections of which only those count that depend on parameters: the others are numbers, or are named by what joins."""

_LEFT_OUT = {
    "limits", "sigma", "sigma_is", "sigma_per_length", "correlation", "period", "column", "unit", "reads", "reading",
}  # fmt: skip
_COMMAND = {"control", "redundant", "force"}
"""Of an actuator: how it is commanded, not what the machine is; values found under one control hold under another."""
_LIMITS = {"ropes": "t_min", "actuators": "force_limit"}
"""What is only watched, by section; whether it is stated counted once, in files that are still about."""
_AXES = {"along", "axis", "axes"}
_POINTS = {"between", "at", "to"}
_SETS = {"fixed"}
_WOUND = "winds"
"""Ropes by their weights, which are numbers."""
_OFFSETS = "points"
"""Of a body, which has them even where all are numbers."""
_DIGITS = 8
_LISTED = 3
_OF = "of"
_APART = ("parameters", "frames", "sensors")
"""Sections that are not taken whole: values; places; instruments, of which few count."""


def _whole() -> list[str]:
    return [name for name in sections() if name not in _APART]


@dataclass(frozen=True)
class Fingerprint:
    """`of`: name of the machine's file; `entries`: a hash by section and name; `with_limits`: of things that state one,
    as files were written when limits counted."""

    of: str = ""
    entries: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    with_limits: Mapping[tuple[str, str], str] = field(default_factory=dict, compare=False)

    def line(self) -> str:
        """One line of YAML (and JSON)."""
        shown = "".join(c if c.isprintable() else "?" for c in self.of)
        return json.dumps({_OF: shown, **self.entries}, ensure_ascii=False)

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects that the machine file declares."""
        return tuple(self.entries.get("effects", {}))

    def difference(self, other: Fingerprint) -> str | None:
        """What this machine has, lacks and has otherwise than the other, in words; None where they are alike."""
        entries, others = dict(self._flat()), dict(other._flat())
        parts = (
            ("additional: {}", [k for k in entries if k not in others]),
            ("missing: {}", [k for k in others if k not in entries]),
            ("changed: {}", [k for k in entries if others.get(k) not in (None, entries[k], self.with_limits.get(k))]),
        )
        return "; ".join(words.format(_listed(keys)) for words, keys in parts if keys) or None

    def _flat(self) -> Iterator[tuple[tuple[str, str], str]]:
        for section, entries in self.entries.items():
            for name, digits in entries.items():
                yield (section, name), digits


def _listed(keys: list[tuple[str, str]]) -> str:
    kinds = {**nouns(), "effects": "effect"}
    shown = [f"{kinds.get(section, 'key')} `{name}`" for section, name in keys[:_LISTED]]
    more = f" and {len(keys) - _LISTED} more" if len(keys) > _LISTED else ""
    return ", ".join(shown) + more


def fingerprint_of(machine: Machine) -> Fingerprint:
    """The fingerprint of a machine as read: merged, expanded, resolved."""
    owners = {point: f"{body}.{point}" for body, about in machine.bodies.items() for point in about.points}
    sections = {
        "machine": {"space": machine.space, "gravity": _form(machine.gravity)},
        "parameters": {name: p.per or "" for name, p in machine.parameters.items()},
        **{section: _forms(getattr(machine, section), owners) for section in _whole()},
        "actuators": {name: _drive(drive) for name, drive in machine.actuators.items()},
        **{section: _forms(_dependent(getattr(machine, section)), owners) for section in _PLACES},
        "sensors": _forms(_own_sensors(machine), owners),
        "effects": {name: _effect(name, entries, machine) for name, entries in machine.effects.items()},
    }
    with_limits = {
        (section, name): _hash(form)
        for section, limit in _LIMITS.items()
        for name, form in sections[section].items()
        if limit in form
    }
    hashes = {
        section: {name: _hash(_without(form, _LIMITS.get(section))) for name, form in forms.items()}
        for section, forms in sections.items()
    }
    name = machine.files[0][0] if machine.files else ""
    return Fingerprint(name, {section: digests for section, digests in hashes.items() if digests}, with_limits)


def read_fingerprint(plain: Any) -> Fingerprint:
    """The fingerprint of a file's plain value. Raises ValueError where it is none."""
    if not isinstance(plain, dict) or not isinstance(plain.get(_OF, ""), str):
        raise ValueError("no map")
    sections = {section: entries for section, entries in plain.items() if section != _OF}
    for section, entries in sections.items():
        if not isinstance(entries, dict) or not all(isinstance(v, str) for v in entries.values()):
            raise ValueError("no hashes by name")
        if not all(text.isprintable() for text in (section, *entries)):
            raise ValueError("no names")
    return Fingerprint(plain.get(_OF, ""), sections)


def _hash(form: Any) -> str:
    return hashlib.sha256(json.dumps(form, sort_keys=True).encode()).hexdigest()[:_DIGITS]


def _without(form: Any, key: str | None) -> Any:
    return {k: part for k, part in form.items() if k != key} if isinstance(form, dict) else form


def _forms(entries: Mapping[str, Any], owners: Mapping[str, str]) -> dict[str, Any]:
    return {name: _form(entry, owners) for name, entry in entries.items()}


def _drive(actuator: Entity) -> Any:
    """Of an actuator, whatever its control."""
    return {key: form for key, form in _form(actuator).items() if key not in _COMMAND}


def _form(value: Any, owners: Mapping[str, str] | None = None, key: str = "") -> Any:
    """What of a value counts: texts, names of parameters, and that a number is there ([]); None for nothing."""
    if isinstance(value, Quantity):
        return sorted(value.names)
    if isinstance(value, str):
        if key in _AXES:  # a letter for a vector of numbers
            return []
        return (owners or {}).get(value, value) if key in _POINTS else value
    if isinstance(value, Entity):
        forms = {name: _form(child, owners, name) for name, child in value.__dict__.items() if name not in _LEFT_OUT}
        return {name: form for name, form in forms.items() if form is not None}
    if isinstance(value, dict):
        if key == _WOUND:
            return next(iter(value)) if len(value) == 1 else sorted(value)
        forms = {name: form for name, child in value.items() if (form := _form(child, owners))}
        return forms if forms or key == _OFFSETS else None
    if isinstance(value, tuple) and value:
        parts = [_form(part, owners, key) for part in value]
        if key in _SETS:
            return sorted(parts)
        return parts if any(parts) else []
    return None


def _dependent(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Those that depend on parameters."""
    return {name: entry for name, entry in entries.items() if _names(entry)}


def _names(value: Any) -> set[str]:
    """Parameters that are used in a part of a machine."""
    return {name for _, quantity in quantities(value) for name in quantity.names}


def _own_sensors(machine: Machine) -> dict[str, Sensor]:
    """Sensors that bring parameters: their own, or the place of their frame. Others say nothing of the machine."""
    elsewhere = set().union(*(_names(getattr(machine, s)) for s in (*_whole(), *_PLACES, "gravity")))
    return {
        name: sensor
        for name, sensor in machine.sensors.items()
        if sensor.frame not in (None, "machine") or _names(sensor) - elsewhere
    }


_SHAPE = ("knots", "spread", "width")  # what the weights of a shape without a name mean


def _effect(name: str, entries: Entries, machine: Machine) -> Any:
    """An effect's parameters; its constants too, since they say what the parameters mean."""
    if name.startswith(f"{UNEXPLAINED}@"):
        return {key: [f"{v:.6g}" for v in entries[key].numbers or (entries[key].value,)] for key in _SHAPE}
    effect = catalogue()[name.partition("@")[0]]
    constants = {o.name: entries[o.name] for o in effect.options if o.name in entries}
    return {
        "parameters": [p.name for p in effect.used(machine.space == "planar")],
        **{key: [f"{v:.6g}" for v in entry.interval or (entry.value,)] for key, entry in constants.items()},
    }
