"""The section `effects`: what a machine file says of effects, `KEYWORD@PLACE: {PARAMETER: value}`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BeforeValidator, Field

from pkmcal_cli.base.errors import FaultList, did_you_mean
from pkmcal_cli.effects import Effect, EffectParameter, Option, catalogue
from pkmcal_cli.language.binding import Binder, Slip
from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.parts import ParameterValue
from pkmcal_cli.language.quantities import Draft, fault
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import SMALLEST
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_NAME = re.compile(r"[a-z][a-z0-9_]*@[A-Za-z0-9][A-Za-z0-9_.:+-]*")


def _check_name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise fault("name", f"`{name}` is no name of an effect", "KEYWORD@PLACE, for example backlash@q1")
    return name


EffectName = Annotated[str, AfterValidator(_check_name)]


class EffectNumber(Entity):
    """A parameter of an effect, or a constant of it: a value, or an interval [from, to]."""

    shorthand: ClassVar[str | None] = "value"

    value: ParameterValue = Field(default=0.0, description="Estimate; 0 is no effect")
    std: ParameterValue | None = Field(default=None, description="Standard uncertainty of the estimate, for people")
    range: ParameterValue | None = Field(default=None, description="Half-width, 2 std of the prior; default plausible")
    bounds: tuple[ParameterValue, ParameterValue] | None = Field(default=None, description="[min, max] of a fit")
    interval: tuple[ParameterValue, ParameterValue] | None = Field(default=None, description="[from, to]")
    identify: bool = Field(default=True, description="false: a fit leaves it alone unless selected")
    note: str | None = Field(default=None, description="A remark for people")


def _expanded(raw: Any) -> Any:
    """A list as an interval."""
    return {"interval": tuple(raw)} if isinstance(raw, list | tuple) else raw


Entries = dict[str, Annotated[EffectNumber, BeforeValidator(_expanded)]]


@dataclass(frozen=True)
class EffectResolver:
    """Resolves the entries against the catalogue; faults are added at their places."""

    units: FileUnits
    rotary: frozenset[str]  # names of drives that turn
    source: SourceMap
    faults: FaultList

    def run(self, effects: dict[str, Entries]) -> dict[str, Entries]:
        """Effects with SI numbers, options as intervals or values."""
        out = {}
        for name, entries in effects.items():
            keyword, _, at = name.partition("@")
            effect = catalogue().get(keyword)
            if effect is None:
                hint = did_you_mean(keyword, catalogue(), "`pkmcal effects` lists them")
                self._fault("unknown-name", f"unknown effect `{keyword}`", ("effects", name), hint, True)
                continue
            out[name] = self._resolved(effect, at, name, entries)
        return out

    def _resolved(self, effect: Effect, at: str, name: str, entries: Entries) -> Entries:
        every: tuple[EffectParameter | Option, ...] = (*effect.parameters, *effect.options)
        known = {p.name: unit_at(p, at in self.rotary) for p in every}
        for option in effect.options:
            if option.needed and option.name not in entries:
                what = f"`{name}` needs `{option.name}`: {option.text}"
                self._fault("effect", what, ("effects", name), f"{option.name}: 5 {option.unit}", True)
        out: Entries = {}
        for key, entry in entries.items():
            path: Path = ("effects", name, key)
            if key not in known:
                hint = did_you_mean(key, known, f"it has {', '.join(known)}")
                self._fault("unknown-name", f"`{effect.keyword}` has no parameter `{key}`", path, hint, True)
            else:
                out[key] = self._number(entry, known[key], path)
                spec = next(p for p in every if p.name == key)
                self._check_possible(spec, out[key], known[key], path)
        return out

    def _check_possible(self, spec: EffectParameter | Option, entry: EffectNumber, unit: Unit, path: Path) -> None:
        """Values that nothing has: a stiffness e^1000 times the declared one, a negative lag or period."""
        what, value = f"`{spec.name}` of `{path[1]}`", entry.value / unit.scale
        if isinstance(spec, Option):
            if spec.positive and not entry.value >= SMALLEST:
                self._fault("value", f"{what} must be positive", (*path, "value"), f"{spec.name}: 5 {unit.text}")
        elif not spec.possible[0] <= value <= spec.possible[1]:
            low, high = (f"{limit:g}" for limit in spec.possible)
            hint = f"{spec.text}: from {low} to {high}" + ("" if unit.text == "1" else f" {unit.text}")
            self._fault("value", f"{what} cannot be {value:g}", (*path, "value"), hint)

    def _number(self, entry: EffectNumber, unit: Unit, path: Path) -> EffectNumber:
        changes: dict[str, Any] = {}
        for field in ("value", "std", "range", "bounds", "interval"):
            given = getattr(entry, field)
            if isinstance(given, Draft):
                changes[field] = self._bound(given, unit, (*path, field), field != "value")
            elif isinstance(given, tuple):
                parts = [self._bound(d, unit, (*path, field), False) for d in given]
                changes[field] = tuple(parts)
                if not parts[0] < parts[1]:
                    self._fault("range", "the first of two limits must be below the second", path, "[from, to]")
        if changes.get("range", 1.0) < SMALLEST:
            self._fault("range", "a range must be positive", (*path, "range"), "two standard deviations of the prior")
        return entry.model_copy(update=changes)

    def _bound(self, draft: Draft | float, unit: Unit, path: Path, difference: bool) -> float:
        if not isinstance(draft, Draft):
            return float(draft)
        if draft.names:
            what = f"an effect's parameter is a number, not an expression of `{draft.names[0]}`"
            self._fault("parameter", what, path, f"for example 12 {unit.text}")
            return 0.0
        bare = self.units.unit(unit.dimension)
        try:
            bound = Binder(self.units, {}).bind(draft, (unit.dimension,), bare.difference if difference else bare)
            return bound.number({})
        except Slip as slip:
            self._fault(slip.code, slip.what, path, slip.hint)
            return 0.0

    def _fault(self, code: str, what: str, path: Path, hint: str | None, at_key: bool = False) -> None:
        self.faults.add(self.source.fault(code, what, path, hint, at_key=at_key))


def unit_at(parameter: EffectParameter | Option, rotary: bool) -> Unit:
    """The display unit of a parameter or option of an effect."""
    return parse_unit(parameter.rotary if rotary and parameter.rotary is not None else parameter.unit)
