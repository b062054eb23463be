"""Entries of `unexplained@PLACE`: a shape by its values at knots, their covariance, its spread and width."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.effects.unexplained import FreeShape, place_and_axis
from pkmcal_cli.language.effect_numbers import EffectNumber, Entries, Turning, WrittenEntries
from pkmcal_cli.language.quantities import WrittenNumber
from pkmcal_cli.language.walk import with_values
from pkmcal_cli.units.limits import SMALLEST
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path

_MOST = 200
_NEEDED = ("knots", "values", "spread", "width")
_ASYMMETRY, _NEGATIVE = 1e-6, -1e-6  # of the largest entry of a covariance, by which it is none


class Resolver(Protocol):
    """What binds numbers to the file's units, and collects faults."""

    @property
    def rotary(self) -> Turning: ...  # which drives turn
    def bound(self, written: WrittenNumber, unit: Unit, path: Path) -> float: ...
    def fault(self, code: str, message: str, path: Path, hint: str | None, at_key: bool = False) -> None: ...


def shape_units(at: str, rotary: bool) -> tuple[Unit, Unit, Unit]:
    """Units of the axis, of a deviation and of its square at a place, for hints and for what they measure."""
    _, axis = place_and_axis(at)
    along = "s" if axis == "time" else "deg" if rotary else "mm"
    return parse_unit(along), parse_unit("urad" if rotary else "um"), parse_unit("rad^2" if rotary else "um^2")


def resolved_shape(resolver: Resolver, name: str, entries: WrittenEntries) -> Entries:
    """The entries in SI; faults are added at their places."""
    at = name.partition("@")[2]
    turns = resolver.rotary.turns.get(place_and_axis(at)[0], False)  # not so a guide, whatever drives do
    along, deviation, square = shape_units(at, turns)
    units = {"knots": along, "width": along, "values": deviation, "spread": deviation, "cov": square}
    out: Entries = {}
    for key, entry in entries.items():
        path: Path = ("effects", name, key)
        if key not in units:
            hint = did_you_mean(key, units, f"use one of {', '.join(units)}")
            resolver.fault("unknown-name", f"`unexplained` has no entry `{key}`", path, hint, True)
        elif (made := _in_si(resolver, key, entry, units[key], path)) is not None:
            out[key] = made
    missing = [key for key in _NEEDED if key not in entries]
    if missing:
        message = f"`{name}` needs {', '.join(f'`{key}`' for key in missing)}"
        resolver.fault("effect", message, ("effects", name), "`pkmcal improve` writes such entries", True)
    if len(out) == len(entries) and not missing:
        _check(resolver, name, out)
    return out


def _in_si(
    resolver: Resolver, key: str, entry: EffectNumber[WrittenNumber], unit: Unit, path: Path
) -> EffectNumber | None:
    """One entry with SI numbers; None, with a fault, where it has another form than its key asks for."""
    values = entry.interval or entry.numbers
    if key == "cov":
        rows = entry.matrix
        if rows is None:
            resolver.fault("value", "`cov` must be a list of rows", path, "write [[4, 1], [1, 4]], a row for each knot")
            return None
        return _with(
            entry,
            matrix=tuple(
                tuple(resolver.bound(x, unit, (*path, i, j)) for j, x in enumerate(r)) for i, r in enumerate(rows)
            ),
        )
    if key in ("knots", "values"):
        if values is None:
            resolver.fault(
                "value", f"`{key}` must be a list of numbers", path, f"write, for example, {key}: [0, 10, 20]"
            )
            return None
        return _with(
            entry, interval=None, numbers=tuple(resolver.bound(x, unit, (*path, i)) for i, x in enumerate(values))
        )
    value = resolver.bound(entry.value, unit, path)
    if values is not None or entry.matrix is not None or not value >= SMALLEST:
        resolver.fault(
            "value", f"`{key}` must be a positive number", path, f"write, for example, {key}: 20 {unit.text}"
        )
        return None
    return _with(entry, value=value)


def _with(entry: EffectNumber[WrittenNumber], **numbers: Any) -> EffectNumber:
    """The entry as it is at the next stage of reading."""
    made: EffectNumber = with_values(entry, numbers)
    return made


def _check(resolver: Resolver, name: str, entries: Entries) -> None:
    """Whether lists fit each other."""
    import numpy as np  # imported late: reading a machine file without shapes does not need it

    knots, values = (np.array(entries[key].numbers) for key in ("knots", "values"))
    path: Path = ("effects", name)
    if not 3 <= len(knots) <= _MOST:
        hint = "give the places at which the shape is known"
        resolver.fault("value", f"`knots` must have 3 to {_MOST} places, not {len(knots)}", (*path, "knots"), hint)
    elif not (np.diff(knots) > 0).all():
        resolver.fault("value", "`knots` must rise", (*path, "knots"), "sort them, with their values")
    if len(values) != len(knots):
        message = f"`values` has {len(values)} numbers for {len(knots)} knots"
        resolver.fault("value", message, (*path, "values"), "give one value at each knot")
    if "cov" not in entries:
        return
    rows = entries["cov"].matrix
    assert rows is not None
    if len(rows) != len(knots) or any(len(row) != len(knots) for row in rows):
        message = f"`cov` must have {len(knots)} rows of {len(knots)} numbers"
        resolver.fault("value", message, (*path, "cov"), "give the covariance of the values at the knots, or delete it")
        return
    matrix = np.array(rows)
    size = float(np.abs(matrix).max())
    skew = float(np.abs(matrix - matrix.T).max())
    if skew > _ASYMMETRY * size or float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T)).min()) < _NEGATIVE * size:
        message = "`cov` is no covariance: it must be symmetric, with no negative variance in any direction"
        resolver.fault("value", message, (*path, "cov"), "copy it from where it was computed, or delete it")


def shape_of(entries: Mapping[str, EffectNumber]) -> FreeShape:
    """The shape of entries in SI."""
    import numpy as np

    knots, values = entries["knots"].numbers, entries["values"].numbers
    assert knots is not None and values is not None
    matrix = entries["cov"].matrix if "cov" in entries else None
    return FreeShape(
        knots=knots,
        spread=entries["spread"].value,
        width=entries["width"].value,
        values=np.array(values),
        covariance=None if matrix is None else np.array(matrix),
    )
