"""Displacements without a name in words, as JSON, and as entries of a machine file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.scoring import NamelessShape
from pkmcal_cli.diagnosis.shape_findings import ShapeFinding, known_shape
from pkmcal_cli.effects import catalogue
from pkmcal_cli.effects.unexplained import place_and_axis
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.number_format import finite, readable
from pkmcal_cli.report.sentences import cause_effect_action, listed
from pkmcal_cli.units.file_units import ANGLE, LENGTH, TIME, FileUnits
from pkmcal_cli.units.unit_text import Unit, parse_unit

_MOST = 4  # parameters, and names, that are listed
_DIGITS = 7  # of numbers in a machine file
_STEPS = 3  # points of a scan, for each width of the shape


class ShapeText:
    """One displacement without a name in the units of a machine file. `errors`: unit of the readings' errors."""

    def __init__(self, machine: Machine, model: Model, finding: ShapeFinding, errors: Unit) -> None:
        self.model, self.finding, self.errors = model, finding, errors
        self.along, self.deviation = shape_file_units(machine.file_units, finding.hypothesis.at, finding.rotary)

    @property
    def _place(self) -> str:
        return place_and_axis(self.finding.hypothesis.at)[0]

    @property
    def _over(self) -> str:
        return "time" if place_and_axis(self.finding.hypothesis.at)[1] == "time" else "its travel"

    def height(self) -> str:
        """From its lowest place to its highest, whatever its level, with its 95 % interval."""
        height, std = self.finding.height
        return f"{readable(height, self.deviation)} +- {readable(2 * std, self.deviation, like=height)}"

    def size(self) -> str:
        """The same, and where that is."""
        high, low = (self.along.format(self.finding.shape.knots[k], 4) for k in self.finding.extremes)
        line = " off a straight line" if self.finding.guided else ""
        return f"{self.height()}{line} from {low} (lowest) to {high} (highest)"

    def sentence(self) -> str:
        """What it is, how far it helps, what it hides, what would give it a name."""
        finding = self.finding
        lines = [f"{self._cause()} {self.size()} (95 %). Effect: {self._gain()}"]
        if len(finding.places) > 1:
            others = [f"{at} ({100 * weight:.0f} %)" for at, weight in finding.places]
            lines.append(f"It may be at any of: {listed(others, _MOST)}.")
        if hidden := self._hidden():
            lines.append(f"Beside it, parameters are those of best fit; it may hide {hidden} (standard uncertainty).")
        lines.append(f"Action: {self._action()}")
        return " ".join(lines)

    def _cause(self) -> str:
        name = self.finding.hypothesis.name
        if self.finding.named is None:
            lead = f"{name}: Cause: unknown. {self._place} deviates over {self._over} by a curve"
            return f"{lead} that no effect of the catalogue has:"
        cause, _, _ = self._words(self.finding.named)
        lead = f"{self.finding.named.name}, with a shape of its own ({name}): Cause: {cause} Over {self._over}"
        return f"{lead} {self._place} deviates by a curve of which the catalogue's is most but not all:"

    def _words(self, named: Hypothesis) -> tuple[str, str, str]:
        """Cause, result and action of the effect whose shape it is."""
        size = readable(self.finding.height[0], self.deviation)
        return cause_effect_action(catalogue()[named.effect], named.at, size)

    def _gain(self) -> str:
        held = self.finding.held_out
        before, after = (readable(x, self.errors) for x in (held.without, held.with_it))
        return f"held-out rms: {before} without it, {after} with it ({held.scheme})."

    def _hidden(self) -> str:
        """What it may hide in parameters."""
        most = sorted(self.finding.hidden.items(), key=lambda item: -item[1])
        parts = [f"{readable(std, self._unit(name))} in {name}" for name, std in most]
        return listed(parts, _MOST)

    def _unit(self, parameter: str) -> Unit:
        return parse_unit(self.model.parameters[self.model.names.index(parameter)].unit or "1")

    def _action(self) -> str:
        """What would give it a name."""
        by_need: dict[str, list[str]] = {}
        for keyword, needs in self.finding.names:
            by_need.setdefault(needs, []).append(keyword)
        asked = [f"{needs} (shows {listed(sorted(keywords), _MOST)})" for needs, keywords in by_need.items()]
        log = f" Add to the table: {'; '.join(asked)}." if asked else ""
        if self.finding.named is not None:
            return f"{self._words(self.finding.named)[2]}{log}"
        if self._over == "time":
            return f"Log temperatures of more parts, and home {self._place} again at intervals.{log}"
        step = self.along.format(self.finding.shape.width / _STEPS, 2)
        scan = f"Scan {self._place} alone in steps of {step}, in both directions, with an independent instrument"
        return f"{scan}; compensate only where it was measured.{log}"

    def json(self) -> dict[str, Any]:
        """All of it; docs/json.md says what the keys are."""
        finding, along, deviation = self.finding, self.along, self.deviation
        held = finding.held_out
        return {
            "name": finding.hypothesis.name,
            "at": finding.hypothesis.at,
            "knots": [along.from_si(x) for x in finding.shape.knots],
            "knots_unit": along.text,
            "values": [finite(v / deviation.scale) for v in finding.curve],
            "std": [finite(s / deviation.scale) for s in finding.std],
            "height": finite(finding.height[0] / deviation.scale),
            "height_std": finite(finding.height[1] / deviation.scale),
            "unit": deviation.text,
            "spread": finding.shape.spread / deviation.scale,
            "width": finding.shape.width / along.scale,
            "evidence": finite(finding.evidence),
            "effect": None if finding.named is None else finding.named.name,
            "places": [{"at": at, "weight": weight} for at, weight in finding.places],
            "heldout_rms": finite(held.with_it / self.errors.scale),
            "heldout_rms_without": finite(held.without / self.errors.scale),
            "heldout_unit": self.errors.text,
            "hidden": {name: finite(std / self._unit(name).scale) for name, std in finding.hidden.items()},
            "would_name_it": [{"effect": keyword, "needs": needs} for keyword, needs in finding.names],
        }


def shape_file_units(units: FileUnits, at: str, rotary: bool) -> tuple[Unit, Unit]:
    """The file's units of the axis of a shape, and of its values."""
    _, axis = place_and_axis(at)
    deviation = units.unit(ANGLE if rotary else LENGTH)
    return units.unit(TIME) if axis == "time" else deviation, deviation


def shape_lines(machine: Machine, model: Model, shape: NamelessShape, fit: Fit, budget: ErrorBudget) -> list[str]:
    """Entries of a machine file, bare numbers in its units, as it came out of a fit."""
    names = shape.placed.parameters
    columns = [fit.selected.index(n) for n in names]
    weights = fit.values[[model.names.index(n) for n in names]]
    known = known_shape(shape, weights, budget.covariance[np.ix_(columns, columns)])
    assert known.values is not None and known.covariance is not None
    rotary = shape.placed.sites[0].kind == "rotary"
    along, deviation = shape_file_units(machine.file_units, shape.placed.at, rotary)
    square = machine.file_units.unit((ANGLE if rotary else LENGTH) ** 2).scale
    rows = [f"[{_numbers(row / square)}]" for row in known.covariance]
    return [
        f"    knots: [{enclosing([along.from_si(x) for x in known.knots])}]",
        f"    values: [{_numbers(known.values / deviation.scale)}]",
        f"    spread: {known.spread / deviation.scale:.6g}",
        f"    width: {known.width / along.scale:.6g}",
        "    cov:",
        *(f"      - {row}" for row in rows),
    ]


def enclosing(knots: Sequence[float]) -> str:
    """Knots (K,) as they are written, the ends rounded outwards: no row of the table that they span is outside."""
    first, *inner, last = knots
    return ", ".join((_outwards(first, math.floor), _numbers(inner), _outwards(last, math.ceil)))


def _outwards(value: float, rounded: Callable[[float], int]) -> str:
    decimals = _DIGITS - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    return f"{rounded(value * 10.0**decimals) / 10.0**decimals:.{_DIGITS}g}"


def _numbers(values: Array | Sequence[float]) -> str:
    return ", ".join(f"{v:.{_DIGITS}g}" for v in values)
