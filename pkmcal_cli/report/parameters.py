"""A fit's parameters in display units: one list for tables, JSON and parameter files."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import Combination, Directions, combinations
from pkmcal_cli.calibration.intervals import Intervals
from pkmcal_cli.loading.parameter_file import exact_value
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.numbers import finite, uncertain
from pkmcal_cli.units.unit_text import Unit, parse_unit

_PARTNER = 0.3  # share of the strongest coefficient from which on a parameter counts as moving along
NOT_SELECTED = "not selected"
_WEAK = "weak: "
_FEW = 4  # names or terms that are listed one by one


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One parameter: numbers in `unit`; `std` None where undetermined; `reason` why not (well) identified."""

    name: str
    nominal: float
    value: float
    std: float | None
    range: float
    unit: str
    identified: bool
    reason: str | None
    interval: tuple[float, float] | None = None  # of 95 %

    @property
    def note(self) -> str:
        """For a file: why it was selected and is not (well) identified."""
        return self.reason or "" if self.reason != NOT_SELECTED else ""

    @property
    def spread(self) -> str:
        """The range with its unit."""
        return f"+-{self.range:.4g} {self.unit if self.unit != '1' else ''}".rstrip()

    def json(self) -> dict[str, object]:
        """As the JSON interface has it."""
        return {
            "name": self.name,
            "nominal": self.nominal,
            "value": self.value,
            "std": finite(self.std),
            "range": self.range,
            "unit": self.unit,
            "interval": None if self.interval is None else list(self.interval),
            "identified": self.identified,
            "reason": self.reason,
        }


def parameter_unit(model: Model, name: str) -> Unit:
    """Display unit of a parameter."""
    return parse_unit(model.parameters[model.names.index(name)].unit or "1")


def parameter_rows(model: Model, fit: Fit, intervals: Intervals) -> tuple[ParameterRow, ...]:
    """All parameters of the machine: those selected with their uncertainty, the others as held."""
    std = dict(zip(fit.selected, intervals.std, strict=True)) if fit.selected else {}
    ends = dict(zip(fit.selected, intervals.low_high, strict=True))
    reasons = reasons_against(fit)
    rows = []
    for k, p in enumerate(model.parameters):
        unit = parse_unit(p.unit or "1")
        selected = p.name in std
        spread = std.get(p.name, math.nan)
        reason = reasons.get(p.name) if selected else NOT_SELECTED
        known = selected and not math.isnan(spread)
        rows.append(
            ParameterRow(
                name=p.name,
                nominal=exact_value(p.nominal, unit),
                value=exact_value(float(fit.values[k]), unit),
                std=float(spread) / unit.scale if known else None,
                range=p.range / unit.scale,
                unit=unit.text,
                identified=known and not is_weak(reason),
                reason=reason,
                interval=_interval(ends.get(p.name), unit),
            )
        )
    return tuple(rows)


def _interval(ends: Array | None, unit: Unit) -> tuple[float, float] | None:
    """Both ends in a unit; None where one is not known."""
    if ends is None or not np.isfinite(ends).all():
        return None
    return float(unit.from_si(float(ends[0]))), float(unit.from_si(float(ends[1])))


def is_weak(reason: str | None) -> bool:
    """Whether a reason is that a parameter is held near its nominal value."""
    return (reason or "").startswith(_WEAK)


def reasons_against(fit: Fit) -> dict[str, str]:
    """Why a selected parameter is undetermined, weak or on its bound."""
    out: dict[str, str] = {}
    for combination in combinations(fit.found):
        if combination.kind == "null":
            for name in combination.names:
                others = [n for n in combination.names if n != name]
                out[name] = f"undetermined: not told from {_listed(others)}" if others else "no influence"
    for name, partners in _weak_partners(fit.found).items():
        if name not in out:
            told = f", hardly told from {_listed(partners)}" if partners else ""
            out[name] = f"{_WEAK}held near its nominal value{told}"
    for name in fit.at_bound:
        out.setdefault(name, "at its bound")
    return out


def _listed(names: list[str]) -> str:
    """A few names, or how many."""
    return ", ".join(names) if len(names) <= _FEW else f"{len(names)} others"


def _weak_partners(found: Directions) -> dict[str, list[str]]:
    """Parameters whose direction is mostly weak and held, with those that move along in its weakest direction."""
    vectors = found.vectors[found.weak]
    out = {}
    for k, share in enumerate((vectors**2).sum(axis=0)):
        if share > 0.5:
            main = np.abs(vectors[np.argmax(np.abs(vectors[:, k]))])
            out[found.names[k]] = [
                n for n, v in zip(found.names, main, strict=True) if v > _PARTNER * main[k] and n != found.names[k]
            ]
    return out


def combination_json(model: Model, c: Combination, fit: Fit | None = None) -> list[dict[str, object]]:
    """Motions of a null or weak combination: coefficients in ranges, and the determined sums with value and
    uncertainty, the same for all.
    """
    sums = [] if fit is None else determined_sums(model, c, fit)
    return [
        {
            "kind": c.kind,
            "parameters": {n: float(v) for n, v in zip(c.names, motion, strict=True) if v},
            "text": text,
            "hold": list(c.hold),
            "std_in_ranges": finite(c.std),
            "determined": [
                {"coefficients": coefficients, "value": value, "std": std, "unit": unit}
                for coefficients, value, std, unit in sums
            ],
        }
        for motion, text in zip(c.motions, c.told, strict=True)
    ]


def determined_sums(model: Model, c: Combination, fit: Fit) -> list[tuple[dict[str, float], float, float, str]]:
    """Coefficients, value and standard uncertainty, in the unit of the first parameter, of what is determined.

    The coefficients are those of the parameters' values in their own units.
    """
    covariance = fit.found.determined_covariance()
    where = [fit.selected.index(n) for n in c.names]
    out = []
    for row in c.determined:
        lead = c.names[int(np.argmax(np.abs(row) > 0))]
        unit = parameter_unit(model, lead)
        weights = np.zeros(len(fit.selected))
        weights[where] = row
        values = fit.values[[model.names.index(n) for n in fit.selected]]
        std = math.sqrt(max(float(weights @ covariance @ weights), 0.0))
        scales = [parameter_unit(model, n).scale / unit.scale for n in c.names]
        named = {n: float(v * k) for n, v, k in zip(c.names, row, scales, strict=True) if abs(v) > 1e-9}
        out.append((named, unit.from_si(float(weights @ values)), std / unit.scale, unit.text))
    return out


def combination_text(model: Model, c: Combination, fit: Fit | None) -> str:
    """A combination in words: what is determined, with value, and that the members are not told apart."""
    if c.kind == "weak" or fit is None or not len(c.determined):
        return c.text
    if len(c.names) > _FEW:
        return f"{c.text} ({len(c.determined)} combinations of them are determined: see --json)"
    sums = []
    for coefficients, value, std, unit in determined_sums(model, c, fit):
        terms = ", ".join(f"{n} {v:+.2f}" for n, v in coefficients.items())
        sums.append(f"{terms}: {uncertain(value, std, unit)}")
    return "; ".join(sums) + "; apart they are not seen"
