"""A fit's parameters in display units: one list for tables, JSON and parameter files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.eliminated_frames import FrameUncertainty
from pkmcal_cli.calibration.error_budget import COVER, ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import PARTNER, Combination, Directions, combinations
from pkmcal_cli.calibration.intervals import Intervals
from pkmcal_cli.loading.parameter_text import exact_value
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.number_format import finite, handy, to_digits, uncertain
from pkmcal_cli.units.unit_text import Unit, parse_unit

_IN_PART = 0.1  # share of the variance from which on ranges are worth a word
NOT_SELECTED = "not selected"
NO_EFFECT = "no effect on these readings"
UNTOLD = "undetermined: too few readings in its session"
_WEAK = "weak: "
_FEW = 4  # names or terms that are listed one by one
_FAR = 5.0  # ranges off nominal from which on a value is worth a word


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One parameter: numbers in `unit`; `std` None where undetermined; `reason` why not (well) identified.

    by_data, by_held: the parts of `std` that noise and held directions make, and parameters that are not identified.
    """

    name: str
    nominal: float
    value: float
    std: float | None
    by_data: float | None
    by_held: float | None
    range: float
    unit: str
    identified: bool
    reason: str | None
    interval: tuple[float, float] | None = None  # of 95 %

    @property
    def selected(self) -> bool:
        """Whether it was to be identified."""
        return self.reason != NOT_SELECTED

    @property
    def note(self) -> str:
        """For a file: why it was selected and is not (well) identified."""
        return self.reason or "" if self.selected else ""

    @property
    def far(self) -> bool:
        """Whether the value is further off nominal than anybody believed."""
        return abs(self.value - self.nominal) > _FAR * self.range

    @property
    def in_ranges(self) -> str:
        """Its name, and how far off nominal the value is."""
        return f"{self.name} ({abs(self.value - self.nominal) / self.range:.1f})"

    @property
    def spread(self) -> str:
        """The range with its unit."""
        return f"+-{to_digits(self.range, 4)} {self.unit if self.unit != '1' else ''}".rstrip()

    def json(self) -> dict[str, object]:
        """As the JSON interface has it."""
        return {
            "name": self.name,
            "nominal": self.nominal,
            "value": self.value,
            "std": finite(self.std),
            "std_by_data": finite(self.by_data),
            "std_by_held": finite(self.by_held),
            "range": self.range,
            "unit": self.unit,
            "interval": None if self.interval is None else list(self.interval),
            "identified": self.identified,
            "reason": self.reason,
        }


def parameter_unit(model: Model, name: str) -> Unit:
    """Display unit of a parameter."""
    return parse_unit(model.parameters[model.names.index(name)].unit or "1")


def parameter_rows(
    model: Model,
    fit: Fit,
    intervals: Intervals,
    budget: ErrorBudget,
    far: Mapping[str, float],
    frames: Mapping[str, FrameUncertainty],
) -> tuple[ParameterRow, ...]:
    """All parameters of the machine: those selected with their uncertainty, the others as held.

    far: offsets from nominal, in half ranges, that are worth a remark; frames: those that the fit eliminated.
    """
    estimates, reasons = _estimates(model, fit, intervals, budget, frames), reasons_against(fit, budget, far)
    untold = {n: frame for n, frame in frames.items() if math.isnan(frame.std)}
    reasons |= {n: UNTOLD if frame.felt else NO_EFFECT for n, frame in untold.items()}
    rows = []
    for k, p in enumerate(model.parameters):
        unit = parse_unit(p.unit or "1")
        selected = p.name in estimates
        spread, more, ends = estimates.get(p.name, (math.nan, 0.0, None))
        reason = reasons.get(p.name) if selected else NOT_SELECTED
        known = selected and not math.isnan(spread)
        rows.append(
            ParameterRow(
                name=p.name,
                nominal=exact_value(p.nominal, unit),
                value=exact_value(float(fit.values[k]), unit),
                std=spread / unit.scale if known else None,
                by_data=math.sqrt(max(spread**2 - more**2, 0.0)) / unit.scale if known else None,
                by_held=more / unit.scale if known else None,
                range=p.range / unit.scale,
                unit=unit.text,
                identified=known and not is_weak(reason),
                reason=reason,
                interval=_interval(ends, unit),
            )
        )
    return tuple(rows)


def _estimates(
    model: Model, fit: Fit, intervals: Intervals, budget: ErrorBudget, frames: Mapping[str, FrameUncertainty]
) -> dict[str, tuple[float, float, Array]]:
    """Of all that was to be identified: standard uncertainty, its part by what is held, ends of the interval, SI."""
    columns = (intervals.std.tolist(), budget.std_by_held.tolist(), intervals.low_high)
    each = zip(fit.selected, *columns, strict=True) if fit.selected else ()
    out = {name: (std, held, ends) for name, std, held, ends in each}
    for name, value in zip(model.names, fit.values, strict=True):
        if (frame := frames.get(name)) is not None:
            out[name] = (frame.std, frame.by_held, value + COVER * frame.std * np.array([-1.0, 1.0]))
    return out


def _interval(ends: Array | None, unit: Unit) -> tuple[float, float] | None:
    """Both ends in a unit; None where one is not known."""
    if ends is None or not np.isfinite(ends).all():
        return None
    return float(unit.from_si(float(ends[0]))), float(unit.from_si(float(ends[1])))


def is_weak(reason: str | None) -> bool:
    """Whether a reason is that a parameter is held near its nominal value."""
    return (reason or "").startswith(_WEAK)


def reasons_against(
    fit: Fit, budget: ErrorBudget | None = None, far: Mapping[str, float] = MappingProxyType({})
) -> dict[str, str]:
    """Why a selected parameter is undetermined, weak, in part held, on its bound, or to be looked at."""
    out: dict[str, str] = {}
    for combination in combinations(fit.directions):
        if combination.kind == "null":
            for name in combination.names:
                others = [n for n in combination.names if n != name]
                out[name] = (
                    f"undetermined: cannot be separated from {_listed(others)}"
                    if others
                    else NO_EFFECT
                )
    for name, partners in _weak_partners(fit.directions).items():
        if name not in out:
            partner_text = f", hardly separable from {_listed(partners)}" if partners else ""
            out[name] = f"{_WEAK}held near nominal{partner_text}"
    for name in fit.at_bound:
        out.setdefault(name, "at its bound")
    shares = {} if budget is None else dict(zip(budget.names, budget.share_of_ranges, strict=True))
    for name, share in shares.items():
        if share > _IN_PART:
            part = "mostly" if share > 0.5 else "in part"
            known_by = "the ranges" if budget is None else budget.known_by
            out.setdefault(name, f"uncertainty {part} from {known_by} ({share:.0%} of the variance)")
    for name, offset in far.items():
        out[name] = "; ".join([*filter(None, [out.get(name)]), f"{abs(offset) / 2:.1f} ranges from nominal"])
    return out


def _listed(names: list[str]) -> str:
    """A few names, or how many."""
    return ", ".join(names) if len(names) <= _FEW else f"{len(names)} others"


def _weak_partners(directions: Directions) -> dict[str, list[str]]:
    """Parameters whose direction is mostly weak and held, with those that move along in its weakest direction."""
    vectors, parts = directions.vectors[directions.weak], directions.parts()[directions.weak]
    out = {}
    for k, share in enumerate((vectors**2).sum(axis=0)):
        if share > 0.5:
            main = int(np.argmax(np.abs(vectors[:, k])))
            sizes = np.abs(vectors[main]) / np.abs(vectors[main, k]), parts[main] / parts[main, k]
            moved = np.maximum(*sizes) > PARTNER  # in ranges, or in what the readings see
            out[directions.names[k]] = [n for j, n in enumerate(directions.names) if moved[j] and j != k]
    return out


def combination_json(
    model: Model, c: Combination, fit: Fit | None = None, covariance: Array | None = None
) -> list[dict[str, object]]:
    """Motions of a null or weak combination: coefficients in ranges, and its determined sums."""
    sums = [] if fit is None else determined_sums(model, c, fit, covariance)
    scale = parameter_unit(model, c.hold[0]).scale if c.kind == "weak" else 1.0
    return [
        {
            "kind": c.kind,
            "parameters": {n: float(v) for n, v in zip(c.names, motion, strict=True) if v},
            "text": text,
            "hold": list(c.hold),
            "std_in_ranges": finite(c.std),
            "std_by_data_alone": finite(c.by_data / scale),
            "std_with_range": finite(c.with_range / scale),
            "determined": [
                {"coefficients": coefficients, "value": value, "std": std, "unit": unit}
                for coefficients, value, std, unit in sums
            ],
        }
        for motion, text in zip(c.motions, c.texts, strict=True)
    ]


def determined_sums(
    model: Model, c: Combination, fit: Fit, covariance: Array | None = None
) -> list[tuple[dict[str, float], float, float, str]]:
    """Coefficients, value and standard uncertainty, in the unit of the first parameter, of what is determined.

    The coefficients are those of the parameters' values in their own units; covariance (p, p): of the selected ones,
    default that of the fit alone.
    """
    covariance = fit.directions.determined_covariance() if covariance is None else covariance
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


def combination_text(model: Model, c: Combination, fit: Fit | None = None, covariance: Array | None = None) -> str:
    """A combination in words: what is determined, and that the members cannot be separated.

    Sums are offsets from nominal: of large lengths, coefficients of three digits would not give the sum that is stated.
    """
    if c.kind == "weak":
        first_unit, name = parameter_unit(model, c.hold[0]), c.hold[0]
        data, both = handy(c.by_data, first_unit), handy(c.with_range, first_unit)
        return f"{c.text} (uncertainty of this combination, in {name}: {data} by the data alone, {both} with the range)"
    if fit is None or not len(c.determined):
        return c.text
    fix = f"The data cannot separate these parameters. Fix {hold_text(c)}."
    if len(c.names) > _FEW:
        return f"{', '.join(c.names)}; determined: {len(c.determined)} combinations of them (see --json). {fix}"
    sums = []
    for coefficients, value, std, unit in determined_sums(model, c, fit, covariance):
        off = value - sum(v * _nominal(model, n) for n, v in coefficients.items())
        terms = ", ".join(f"{n} {v:+.3g}" for n, v in coefficients.items())
        sums.append(f"{terms}: {uncertain(off, std, unit)} from nominal")
    return f"{', '.join(c.names)}; determined: {'; '.join(sums)}. {fix}"


def _nominal(model: Model, name: str) -> float:
    """Of a parameter, in its unit."""
    return parameter_unit(model, name).from_si(float(model.nominal[model.names.index(name)]))


def hold_text(c: Combination) -> str:
    """How many of its members to hold, and how: "one of them, e.g. `--select auto,-a`"."""
    return f"{'one' if len(c.hold) == 1 else len(c.hold)} of them, e.g. `{without(c.hold)}`"


def without(names: Sequence[str]) -> str:
    """The option that holds some parameters."""
    return f"--select auto,{','.join(f'-{n}' for n in names)}"
