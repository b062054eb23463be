"""Sizes of effects in several parameter files, side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from scipy.special import ndtr

from pkmcal_cli.loading.known_parameters import KnownParameters
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.units.unit_text import Unit


def letter(index: int) -> str:
    """What a file is called in the tables."""
    return chr(ord("A") + index) if index < 26 else f"F{index + 1}"


@dataclass(frozen=True)
class Effect:
    """A number of an effect: value and standard uncertainty, SI, by number of the file that has it."""

    name: str
    unit: Unit
    sizes: Mapping[int, tuple[float, float]]

    def p_value(self) -> float:
        """Of no difference between the first and the last; nan where one lacks it, or its uncertainty is not known."""
        if len(self.sizes) < 2:
            return math.nan
        (a, u), (b, v) = self.sizes[min(self.sizes)], self.sizes[max(self.sizes)]
        size = math.hypot(u, v)
        return float(2.0 * ndtr(-abs(a - b) / size)) if size > 0 else math.nan

    def remark(self, files: int, alpha: float) -> str:
        """Where it is, or whether its size has changed."""
        if len(self.sizes) < files:
            return f"only in {', '.join(letter(i) for i in self.sizes)}"
        return "other size" if self.p_value() < alpha else ""

    def json(self, files: int, alpha: float) -> dict[str, Any]:
        """The same for JSON."""
        sizes = [self.sizes.get(i) for i in range(files)]
        return {
            "name": self.name,
            "values": [None if s is None else s[0] / self.unit.scale for s in sizes],
            "stds": [None if s is None else finite(s[1] / self.unit.scale) for s in sizes],
            "unit": self.unit.text,
            "p_value": finite(self.p_value()),
            "remark": self.remark(files, alpha) or None,
        }


def effects_of(known: Sequence[KnownParameters]) -> tuple[Effect, ...]:
    """Numbers of effects but for places of instruments, which are new each time."""
    names = dict.fromkeys(n for k in known for n in k.parameters if "@" in n and not n.startswith("frame@"))
    out = []
    for name in names:
        there = {i: k.parameters[name] for i, k in enumerate(known) if name in k.parameters}
        unit = next(iter(there.values())).unit
        out.append(Effect(name, unit, {i: (p.value, p.std) for i, p in there.items()}))
    return tuple(out)

