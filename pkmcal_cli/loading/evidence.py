"""What a calibration saw, as parameter files hold it: in which ranges it measured, and what it left unexplained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pkmcal_cli.units.unit_text import UnitError, parse_unit

if TYPE_CHECKING:
    from pkmcal_cli.yaml_source.tree import SourceNode

MEASURED, UNEXPLAINED = "measured", "unexplained"
"""Sections of a parameter file."""


@dataclass(frozen=True)
class Evidence:
    """Ranges (low, high) of what was set and logged, by the column's name; what residuals have beyond noise, by kind.

    SI. unexplained: standard deviation of one coordinate or reading, "position", "orientation" ...; units: in which a
    file shows the ranges; times_noise: residuals over noise, 1 where they agree.
    """

    measured: Mapping[str, tuple[float, float]]
    unexplained: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    times_noise: float = 1.0

    @property
    def missing(self) -> bool:
        """Whether more was left than chance explains."""
        return self.times_noise > 1.0

    @property
    def of_tool(self) -> tuple[float, float]:
        """What is unexplained of a coordinate of the tool point, m, and of its orientation, rad.

        Where no positions were measured, the largest of what lengths were.
        """
        left = dict(self.unexplained)
        turning = left.pop("orientation", 0.0)
        return left.get("position", max(left.values(), default=0.0)), turning

    def lines(self) -> list[str]:
        """As sections of a parameter file."""
        out = [f"{MEASURED}: # ranges of what was set and logged; `correct` reports what is outside"]
        for name, ends in self.measured.items():
            unit = parse_unit(self.units.get(name) or "1")
            low, high = (float(f"{unit.from_si(v):.9g}") for v in ends)
            named = "" if unit.text == "1" else f", unit: {unit.text}"
            out.append(f"  {name}: {{low: {low!r}, high: {high!r}{named}}}")
        if self.unexplained:
            out.append(
                f"{UNEXPLAINED}: # left beyond noise, of one coordinate; times_noise 1: no more than chance leaves"
            )
            out.append(f"  times_noise: {self.times_noise:.4g}")
            for kind, value in self.unexplained.items():
                unit = parse_unit(_SHOWN.get(kind, "um"))
                out.append(f"  {kind}: {{std: {float(f'{unit.from_si(value):.4g}')!r}, unit: {unit.text}}}")
        return out


_SHOWN = {"orientation": "urad"}


def read_evidence(root: SourceNode) -> Evidence | None:
    """The evidence of a parameter file; None where it says nothing. What cannot be read is not there."""
    measured, left = root.child(MEASURED), root.child(UNEXPLAINED)
    if measured is None:
        return None
    ranges, units = dict[str, tuple[float, float]](), dict[str, str]()
    for name, entry in _map(measured).items():
        low, high = (_number(entry, end) for end in ("low", "high"))
        if low is not None and high is not None:
            ranges[name] = (low, high)
            units |= {name: str(entry["unit"])} if isinstance(entry, dict) and "unit" in entry else {}
    plain = {} if left is None else _map(left)
    stds = {kind: _number(entry, "std") for kind, entry in plain.items() if isinstance(entry, dict)}
    times = plain.get("times_noise", 1.0)
    return Evidence(
        ranges,
        {kind: value for kind, value in stds.items() if value is not None},
        units,
        times_noise=float(times) if isinstance(times, int | float) else 1.0,
    )


def _map(node: SourceNode) -> dict[str, object]:
    plain = node.plain()
    return {str(k): v for k, v in plain.items()} if isinstance(plain, dict) else {}


def _number(entry: object, key: str) -> float | None:
    """A number of an entry in SI."""
    if not isinstance(entry, dict) or isinstance(entry.get(key), bool) or not isinstance(entry.get(key), int | float):
        return None
    try:
        return float(parse_unit(str(entry.get("unit", "1"))).to_si(float(entry[key])))
    except UnitError:
        return None
