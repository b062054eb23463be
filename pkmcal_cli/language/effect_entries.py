"""The section `effects`: what a machine file says of effects, `KEYWORD@PLACE: {PARAMETER: value}`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator

from pkmcal_cli.base.errors import FaultList, did_you_mean
from pkmcal_cli.effects import Effect, EffectParameter, Option, catalogue
from pkmcal_cli.effects.unexplained import UNEXPLAINED
from pkmcal_cli.language.binding import Binder, Slip
from pkmcal_cli.language.effect_numbers import EffectNumber, Entries, Turning, WrittenEntries
from pkmcal_cli.language.quantities import WrittenNumber, WrittenValue, fault
from pkmcal_cli.language.shape_entries import resolved_shape
from pkmcal_cli.language.walk import with_values
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import SMALLEST
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_NAME = re.compile(r"[a-z][a-z0-9_]*@[A-Za-z0-9][A-Za-z0-9_.:+-]*(\[[^\[\]]+\])?")


def _check_name(name: str) -> str:
    if not _NAME.fullmatch(name):
        hint = "write KEYWORD@PLACE, for example `backlash@q1`, or `zero@q1[SESSION]` in one session"
        raise fault("name", f"`{name}` is not a valid effect name", hint)
    return name


EffectName = Annotated[str, AfterValidator(_check_name)]


@dataclass(frozen=True)
class EffectResolver:
    """Resolves the entries against the catalogue; faults are added at their places."""

    units: FileUnits
    rotary: Turning  # of drives
    angular: Turning  # of sensors, which read an angle
    source: SourceMap
    faults: FaultList

    def run(self, effects: Mapping[str, WrittenEntries]) -> dict[str, Entries]:
        """Effects with SI numbers, options as intervals or values."""
        out = {}
        for name, entries in effects.items():
            keyword, _, at = name.partition("@")
            if keyword == UNEXPLAINED:
                out[name] = resolved_shape(self, name, entries)
                continue
            effect = catalogue().get(keyword)
            if effect is None:
                hint = did_you_mean(keyword, (*catalogue(), UNEXPLAINED), "list the effects with `pkmcal effects`")
                self._fault("unknown-name", f"unknown effect `{keyword}`", ("effects", name), hint, True)
                continue
            out[name] = self._resolved(effect, at, name, entries)
        return out

    def _resolved(self, effect: Effect, at: str, name: str, entries: WrittenEntries) -> Entries:
        every: tuple[EffectParameter | Option, ...] = (*effect.parameters, *effect.options)
        turning = self.angular if effect.enters == "frame" else self.rotary
        known = {p.name: unit_at(p, turning.at(at.partition("[")[0])) for p in every}
        for option in effect.options:
            if option.needed and option.name not in entries:
                message = f"`{name}` needs `{option.name}`: {option.text}"
                self._fault(
                    "effect", message, ("effects", name), f"add, for example, `{option.name}: 5 {option.unit}`", True
                )
        out: Entries = {}
        for key, entry in entries.items():
            path: Path = ("effects", name, key)
            if key not in known:
                hint = did_you_mean(key, known, f"use one of {', '.join(known)}")
                self._fault("unknown-name", f"`{effect.keyword}` has no parameter `{key}`", path, hint, True)
            else:
                out[key] = self._number(entry, known[key], path)
                spec = next(p for p in every if p.name == key)
                self._check_possible(spec, out[key], known[key], path)
        return out

    def _check_possible(self, spec: EffectParameter | Option, entry: EffectNumber, unit: Unit, path: Path) -> None:
        """Values that nothing has: a stiffness e^1000 times the declared one, a negative lag or period."""
        label, value = f"`{spec.name}` of `{path[1]}`", entry.value / unit.scale
        if isinstance(spec, Option):
            if spec.positive and not entry.value >= SMALLEST:
                self._fault(
                    "value",
                    f"{label} must be positive",
                    (*path, "value"),
                    f"write, for example, `{spec.name}: 5 {unit.text}`",
                )
        elif not spec.possible[0] <= value <= spec.possible[1]:
            low, high = (f"{limit:g}" for limit in spec.possible)
            hint = f"use {low} to {high}" + ("" if unit.text == "1" else f" {unit.text}") + f" ({spec.text})"
            self._fault("value", f"{label} cannot be {value:g}", (*path, "value"), hint)

    def _number(self, entry: EffectNumber[WrittenNumber], unit: Unit, path: Path) -> EffectNumber:
        changes: dict[str, Any] = {}
        for field in ("value", "std", "range", "bounds", "interval"):
            value = getattr(entry, field)
            if isinstance(value, WrittenValue):
                changes[field] = self._bound(value, unit, (*path, field), field != "value")
            elif isinstance(value, tuple):
                parts = [self._bound(d, unit, (*path, field), False) for d in value]
                changes[field] = tuple(parts)
                if not parts[0] < parts[1]:
                    self._fault("range", "the first limit must be below the second", path, "write [from, to]")
        if changes.get("range", 1.0) < SMALLEST:
            self._fault(
                "range", "a range must be positive", (*path, "range"), "give two standard deviations of the prior"
            )
        read: EffectNumber = with_values(entry, changes)
        return read

    def _bound(self, written: WrittenNumber, unit: Unit, path: Path, difference: bool) -> float:
        if not isinstance(written, WrittenValue):
            return float(written)
        if written.names:
            message = f"a parameter of an effect must be a number, not an expression of `{written.names[0]}`"
            self._fault("parameter", message, path, f"write, for example, `12 {unit.text}`")
            return 0.0
        bare = self.units.unit(unit.dimension)
        try:
            bare = bare.difference if difference else bare
            return Binder(self.units, {}).bind(written, (unit.dimension,), bare, unit).number({})
        except Slip as slip:
            self._fault(slip.code, slip.message, path, slip.hint)
            return 0.0

    def bound(self, written: WrittenNumber, unit: Unit, path: Path) -> float:
        """A number in SI, of the dimension of a unit; bare ones in the file's."""
        return self._bound(written, unit, path, True)

    def fault(self, code: str, message: str, path: Path, hint: str | None, at_key: bool = False) -> None:
        """A fault at a place of the file."""
        self._fault(code, message, path, hint, at_key)

    def _fault(self, code: str, message: str, path: Path, hint: str | None, at_key: bool = False) -> None:
        self.faults.add(self.source.fault(code, message, path, hint, at_key=at_key))


def unit_at(parameter: EffectParameter | Option, rotary: bool) -> Unit:
    """The display unit of a parameter or option of an effect."""
    return parse_unit(parameter.rotary if rotary and parameter.rotary is not None else parameter.unit)
