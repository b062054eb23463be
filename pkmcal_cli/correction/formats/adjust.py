"""What shims and screws are to change: nominal less identified value of every parameter that is `adjustable`.

The remaining error is that of the machine so adjusted, at the set values of the nominal one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.correction.commanded_machine import CommandedMachine
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format, Listing
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.units.unit_text import Unit, parse_unit

_UNKNOWN = 3  # decimals beyond the range's first digit where nobody knows how sure a value is


@dataclass(frozen=True)
class Adjustment:
    """Of a parameter: what is adjusted, by how much, standard uncertainty (nan: unknown), in its unit."""

    name: str
    label: str
    change: float
    std: float
    unit: Unit
    decimals: int

    @property
    def _tail(self) -> str:
        return "" if self.unit.text == "1" else f" {self.unit.text}"

    @property
    def change_text(self) -> str:
        """The change with its unit."""
        return f"{self.change:+.{self.decimals}f}{self._tail}"

    @property
    def std_text(self) -> str:
        """The standard uncertainty with its unit; a dash where unknown."""
        return "-" if math.isnan(self.std) else f"{self.std:.2g}{self._tail}"

    @property
    def line(self) -> str:
        """As the list tells it."""
        sure = "uncertainty unknown" if math.isnan(self.std) else f"u {self.std_text}"
        label = self.label if self.label == self.name else f"{self.label} ({self.name})"
        return f"{label}: {self.change_text} ({sure})"


def adjustments(case: ExportCase) -> list[Adjustment]:
    """In the order of the machine file."""
    return [_adjustment(case, name) for name in _adjustable(case.loaded)]


def _adjustable(loaded: LoadedMachine) -> list[str]:
    return [n for n, p in loaded.machine.parameters.items() if p.adjustable and n in loaded.model.names]


def _check(machine: CommandedMachine) -> None:
    if not _adjustable(machine.loaded):
        hint = 'mark what shims and screws set: `zl: {nominal: 0, adjustable: "rail A, left end"}`'
        raise machine.refuse("adjust", "no parameter of the machine file is `adjustable`", hint)


def _adjustment(case: ExportCase, name: str) -> Adjustment:
    parameter, k = case.loaded.machine.parameters[name], case.model.names.index(name)
    unit = parse_unit(parameter.unit or "1")
    std = _std(case, name) / unit.scale
    known = std if std > 0 else abs(parameter.range) / unit.scale * 10.0**-_UNKNOWN
    decimals = int(max(0, 1 - math.floor(math.log10(known)))) if known > 0 else 6
    change = (case.model.nominal[k] - case.values[k]) / unit.scale
    label = name if parameter.adjustable == "true" else parameter.adjustable
    return Adjustment(name, label, round(change, min(decimals, 12)) + 0.0, std, unit, min(decimals, 12))


def _std(case: ExportCase, name: str) -> float:
    if case.covariance is None or name not in case.covariance[0]:
        return math.nan
    k = case.covariance[0].index(name)
    return math.sqrt(max(float(case.covariance[1][k, k]), 0.0))


def _check_identified(case: ExportCase) -> None:
    """Whether any adjustable parameter has another value than the machine file's. Raises UsageError."""
    index = [case.model.names.index(name) for name in _adjustable(case.loaded)]
    if (case.values[index] == case.model.nominal[index]).all():
        message = "--as adjust: all `adjustable` parameters are nominal, so there is nothing to adjust"
        raise UsageError(message, hint="give `-p PARAMS.yaml` of a calibration that identifies them (`--select`)")


def _draft(case: ExportCase) -> Draft:
    _check_identified(case)
    made, values = adjustments(case), case.values.copy()
    for each in made:
        values[case.model.names.index(each.name)] += each.change * each.unit.scale

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        comments = ["nominal minus identified value: change each by this amount; u: standard uncertainty", *remarks]
        return {"": "\n".join([*(f"# {line}" for line in comments), *(each.line for each in made), ""])}

    entries = [
        {
            "parameter": each.name,
            "what": each.label,
            "change": each.change,
            "std": None if math.isnan(each.std) else each.std,
            "unit": each.unit.text,
        }
        for each in made
    ]
    rows = [(each.label, each.name, each.change_text, each.std_text) for each in made]
    shown = Listing("Change by nominal less identified value", ("what", "parameter", "change", "u"), tuple(rows))
    return Draft(commands=case.commanded, values=values, texts=texts, entries=entries, shown=shown)


ADJUST = Format(
    keyword="adjust", title="shims and screws", sources=(), suffix=".txt", draft=_draft, check=_check,
)  # fmt: skip
