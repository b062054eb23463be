"""Targets outside of what the calibration measured: which values, as they were understood, and how far."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.correction.assessment import Assessment
from pkmcal_cli.loading.evidence import Evidence
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.units.unit_text import Unit, parse_unit

_FAR = 10.0  # measured spans beyond what was measured: no extrapolation that is meant, rather a slip of the unit
_LEAST = 0.01  # of the measured values: a span that counts, as rooms that hold their temperature have hardly any


@dataclass(frozen=True, kw_only=True)
class BeyondMeasured:
    """One column whose values are outside of the measured ones in some targets, by their places; SI.

    farthest: the value that is farthest outside; set_by_user: of circumstances, as set values are computed.
    """

    name: str
    farthest: float
    measured: tuple[float, float]
    unit: Unit
    places: tuple[str, ...]
    set_by_user: bool

    @property
    def far(self) -> bool:
        """Whether it is so far outside that its unit is in doubt."""
        low, high = self.measured
        span = max(high - low, _LEAST * max(abs(low), abs(high)))
        return self.set_by_user and span > 0 and _outside(self.measured, self.farthest) >= _FAR * span

    def show(self, to: Reporter, total: int) -> None:
        """Which targets, the value and what was measured."""
        low, high = (f"{self.unit.from_si(end):.6g}" for end in self.measured)
        value, unit = self.unit.format(self.farthest), "" if self.unit.text == "1" else f" {self.unit.text}"
        where = f"{len(self.places)} of {count(total, 'target')}, first {self.places[0]}"
        message = f"warning: outside the measured range of {self.name}: {where}"
        to.warn(f"{message}; farthest {value}, measured {low} to {high}{unit}")
        if self.far:
            message = f"warning: `{self.name}` is understood as {value}, far outside of all that was measured"
            to.warn(f"{message}: look at its unit")

    def json(self) -> dict[str, Any]:
        """Value and range."""
        low, high = (finite(self.unit.from_si(end)) for end in self.measured)
        value = finite(self.unit.from_si(self.farthest))
        return {"value": value, "low": low, "high": high, "unit": self.unit.text, "far": self.far}


def beyond_measured(
    model: Model, result: Assessment, evidence: Evidence, place: Callable[[int], str]
) -> Sequence[BeyondMeasured]:
    """Columns with values outside, in the order of the targets that show them; place: of the k-th with set values."""
    rows, units = result.correction.rows, {a.name: a.unit for a in model.actuators}
    columns = {a.name: rows.readings[:, k] for k, a in enumerate(model.actuators)} | dict(rows.columns)
    lines: dict[str, list[tuple[int, int]]] = {}
    for number, row in enumerate(result.correction.good):
        for name in result.outside[row]:
            lines.setdefault(name, []).append((number, int(row)))
    out = []
    for name, at in lines.items():
        measured = evidence.measured[name]
        out.append(
            BeyondMeasured(
                name=name, measured=measured, places=tuple(place(number) for number, _ in at),
                farthest=max((float(columns[name][row]) for _, row in at), key=partial(_outside, measured)),
                unit=parse_unit(evidence.units.get(name) or units.get(name) or "1"), set_by_user=name not in units,
            )
        )  # fmt: skip
    return out


def _outside(measured: tuple[float, float], value: float) -> float:
    """How far a value is outside of a range."""
    return max(measured[0] - value, value - measured[1])
