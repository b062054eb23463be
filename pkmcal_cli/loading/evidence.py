"""What a calibration saw, as parameter files hold it: in which ranges it measured, and what it left unexplained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.units.dimensions import ANGLE, LENGTH
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.yaml_source.tree import SourceMap

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
    def reached(self) -> dict[str, tuple[float, float]]:
        """Between which coordinates the tool point was."""
        return {name.removeprefix(TOOL): ends for name, ends in self.measured.items() if name.startswith(TOOL)}

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
            named = "" if unit.text == "1" else f", unit: {unit.definition}"
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


TOOL = "tool."
"""Before the coordinates of the tool point, among what was set and logged: drives may be called x."""
_DIMENSIONS = {"position": LENGTH, "orientation": ANGLE}
_TIMES = "times_noise"


def read_evidence(tree: SourceMap, faults: FaultList) -> Evidence | None:
    """The evidence of a parameter file; None where it says nothing. What cannot be read is added to `faults`."""
    from pkmcal_cli.loading.written_sections import written_quantity, written_section  # few commands read evidence

    measured, left = (written_section(tree, faults, name) for name in (MEASURED, UNEXPLAINED))
    if measured is None:
        return None
    quantity, left = partial(written_quantity, tree, faults), left or {}
    ends = {n: [quantity(e, (MEASURED, n), end)[0] for end in ("low", "high")] for n, e in measured.items()}
    ranges = {name: (low, high) for name, (low, high) in ends.items()}
    kinds = [(kind, e) for kind, e in left.items() if kind != _TIMES]
    stds = {kind: quantity(e, (UNEXPLAINED, kind), "std", 0.0, _DIMENSIONS.get(kind))[0] for kind, e in kinds}
    times = [quantity({_TIMES: e}, (UNEXPLAINED, n), n, 0.0)[0] for n, e in left.items() if n == _TIMES]
    units = {name: str(e["unit"]) for name, e in measured.items() if isinstance(e, dict) and "unit" in e}
    return Evidence(ranges, stds, units, *times)
