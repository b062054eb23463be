"""Limits that a result must keep, `--fail-above "heldout 20 um"`: what they are held against, and whether they hold.

A limit that cannot be judged (nothing was held out, a parameter is undetermined) is missed, never kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import Fault, Location, UsageError, did_you_mean
from pkmcal_cli.calibration.errors_before_after import kinds_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.units.dimensions import LENGTH, NUMBER, Dimension
from pkmcal_cli.units.file_units import DIMENSIONS
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.workflow.amounts import amount, require_unit, small_amount

OPTION, MAX_RMS = "--fail-above", "--max-rms"
KINDS = ("heldout", "fitted", "chi2", "std:NAME", "change")
_EXAMPLE = 'give a kind and a value, such as "heldout 20 um", "fitted 20 um", "chi2 4", "std:l1 5 um" or "change 50 um"'

_REMEDIES = {
    "heldout": "hold rows out (`--holdout 5`), or limit the error of the fitted ones: `fitted` instead of `heldout`",
    "std": "measure what determines the parameter (`pkmcal plan --aim`), or select it (`--select`)",
}
"""Where a figure is not known."""


@dataclass(frozen=True)
class Figure:
    """What a limit is held against: words and value, SI, inf where nobody knows it; `kind` of error, "" for others."""

    label: str
    value: float
    unit: Unit
    kind: str = ""


Figures = Mapping[str, Sequence[Figure] | str]
"""By what limits name (`heldout`, `fitted`, `chi2`, `std:l1`, `change`): figures, or why there are none."""


@dataclass(frozen=True, kw_only=True)
class Gate:
    """A limit, SI: on `figure` (a key of Figures), of one `kind` of error where it names one ("fitted:length 1 mm")."""

    text: str
    figure: str
    kind: str
    limit: float
    unit: Unit
    option: str = OPTION
    otherwise: str = ""  # what it is held against where the figure is not available

    def judged(self, figures: Figures) -> Judged:
        """Whether the result keeps it."""
        known = figures.get(self.figure, "not known")
        if isinstance(known, str) and self.otherwise:
            known = figures.get(self.otherwise, known)
        if isinstance(known, str):
            return Judged(self, Figure(f"{self.figure} ({known})", math.inf, self.unit))
        return Judged(self, self._matching(known) or Figure(self.text, math.inf, self.unit))

    def _matching(self, known: Sequence[Figure]) -> Figure | None:
        """The first figure of its kind, or of its dimension."""
        if self.kind:
            return next((f for f in known if f.kind == self.kind), None)
        return next((f for f in known if f.unit.dimension == self.unit.dimension), None)


@dataclass(frozen=True)
class Judged:
    """A limit and what it is held against."""

    gate: Gate
    figure: Figure

    @property
    def kept(self) -> bool:
        """Whether the figure is not above the limit."""
        return self.figure.value <= self.gate.limit

    def fault(self, where: Location | None = None) -> Fault:
        """That it is missed, and where."""
        gate, figure = self.gate, self.figure
        limit = gate.unit.format(gate.limit)
        if math.isfinite(figure.value):
            value = gate.unit.format(figure.value, 4)
            return Fault("above", f"{figure.label}: {value}, above the limit of {limit} ({gate.option})", where)
        remedy, option = _REMEDIES.get(gate.figure.partition(":")[0]), gate.option
        return Fault("above", f"{figure.label}: unknown, so the limit of {limit} is missed ({option})", where, remedy)

    def json(self) -> dict[str, Any]:
        """As the JSON interface has it."""
        unit = self.gate.unit
        return {
            "gate": self.gate.text,
            "what": self.figure.label,
            "value": finite(self.figure.value / unit.scale),
            "limit": unit.from_si(self.gate.limit),
            "unit": unit.text,
            "kept": self.kept,
        }


def gates(texts: Sequence[str], max_rms: str | None = None) -> tuple[Gate, ...]:
    """Limits of the command line; `max_rms`: of held-out rows, or else of fitted ones. Raises UsageError."""
    return (*map(_gate, texts), *([] if max_rms is None else [_largest_rms(max_rms)]))


def _gate(text: str) -> Gate:
    figure, _, value = text.strip().partition(" ")
    name, _, part = figure.partition(":")
    known = [k.partition(":")[0] for k in KINDS]
    if name not in known:
        raise UsageError(f"{OPTION}: `{name}` is not a kind of limit", hint=did_you_mean(name, known, _EXAMPLE))
    if not value.strip() or (name == "std" and not part) or (part and name in ("chi2", "change")):
        raise UsageError(f"{OPTION}: `{text}` is not a limit", hint=_EXAMPLE)
    limit, unit = _limit(OPTION, value)
    if name != "std" and (unit.dimension == NUMBER) != (name == "chi2"):
        lacking = "has no unit" if unit.dimension == NUMBER else "is not a number"
        raise UsageError(f"{OPTION}: `{text}`: `{value.strip()}` {lacking}", hint=_EXAMPLE)
    target = {"figure": figure, "kind": ""} if name == "std" else {"figure": name, "kind": part}
    return Gate(text=text, limit=limit, unit=unit, **target)


def _largest_rms(text: str) -> Gate:
    limit, unit = _limit(MAX_RMS, text)
    if unit.dimension != LENGTH:
        raise UsageError(f"{MAX_RMS}: `{text}` is not a length", hint='give a length such as "20 um"')
    return Gate(
        text=text, figure="heldout", kind="position", limit=limit, unit=unit, option=MAX_RMS, otherwise="fitted"
    )


def _limit(option: str, text: str) -> tuple[float, Unit]:
    limit, unit = amount(option, text)
    if limit < 0:
        raise UsageError(f"{option}: `{text}` is negative", hint="give a limit of at least 0")
    return limit, unit


def check_gates(limits: Iterable[Gate], model: Model, kinds: Mapping[str, Dimension]) -> None:
    """Whether a result can have what limits name: parameters, `kinds` of error by dimension. Raises UsageError."""
    parameters = {p.name: parse_unit(p.unit or "1") for p in model.parameters}
    for gate in limits:
        name = gate.figure.partition(":")[2]
        if name and name not in parameters:
            hint = did_you_mean(name, parameters, "`check` lists all")
            raise UsageError(f"{gate.option}: no parameter `{name}`", hint=hint)
        if name:
            checked_parameter(gate, name, parameters[name])
        if gate.figure in ("heldout", "fitted"):
            checked_error(gate, kinds)


def checked_parameter(gate: Gate, name: str, unit: Unit) -> None:
    """Whether a limit has a unit of the parameter that it names. Raises UsageError."""
    if unit.dimension != gate.unit.dimension:
        require_unit(gate.option, gate.text, gate.unit, unit)
        message = f"{gate.option}: `{gate.text}`: `{name}` is not measured in {gate.unit.text}"
        raise UsageError(message, hint=f"give a {unit.dimension.name} with its unit")


def checked_error(gate: Gate, kinds: Mapping[str, Dimension]) -> None:
    """Whether an error that a limit names is measured. Raises UsageError."""
    fitting = [kind for kind, dimension in kinds.items() if dimension == gate.unit.dimension]
    if gate.kind and gate.kind not in fitting:
        lacking = gate.kind in ("position", "orientation") and gate.kind not in kinds
        message = f"no {gate.kind}s were measured" if lacking else f"no error `{gate.kind}` in {gate.unit.text}"
        raise UsageError(f"{gate.option}: {message}", hint=_instead(gate, kinds))
    if not fitting:
        raise UsageError(f"{gate.option}: nothing is measured in {gate.unit.text}", hint=_instead(gate, kinds))


def _instead(gate: Gate, kinds: Mapping[str, Dimension]) -> str:
    """Limits of what is measured."""
    some = [f'"{gate.figure} {small_amount(d)}" ({kind})' for kind, d in kinds.items() if d != NUMBER]
    return f"give `{OPTION}` as {' or '.join(some)}" if some else f"leave out `{gate.option}`"


def measured_kinds(problem: Problem) -> dict[str, Dimension]:
    """Kinds of error that a table measures, by dimension."""
    dimensions = {d.name: d for d in DIMENSIONS.values()}
    return {
        kind: dimensions.get(problem.model.channels[columns[0]].dimension, NUMBER)
        for kind, columns in kinds_of(problem.model).items()
        if problem.measured[:, columns].any()
    }


def missed_limits(judged: Iterable[Judged], loaded: LoadedMachine, table: str) -> list[Fault]:
    """Limits that are missed: at the parameter that they name, else in a table."""
    source = loaded.machine.source

    def location(name: str) -> Location | None:
        return source.fault("", "", ("parameters", name), at_key=True).where if name else Location(table)

    return [each.fault(location(each.gate.figure.partition(":")[2])) for each in judged if not each.kept]
