"""What a column looks like whose unit was taken for another."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pkmcal_cli.units.unit_text import UNITS, Unit

_PREFIXES = (1e3, 1e-3)


@lru_cache
def factors_of(unit: Unit) -> tuple[float, ...]:
    """By what a column may be too small if its unit is mistaken: units of its dimension for each other, prefixes."""
    others = [u.scale / unit.scale for u in UNITS.values() if u.dimension == unit.dimension and u.text != "1"]
    others += _PREFIXES
    ratios = {float(f"{r:.12g}") for o in others for r in (o, 1 / o)}
    return tuple(sorted(ratios - {1.0}, key=lambda r: (abs(np.log(r)), r)))


def times(factor: float) -> str:
    """The words "1000 times too large" for what must be multiplied by 0.001."""
    return f"{1 / factor:.4g} times too large" if factor < 1 else f"{factor:.4g} times too small"


def unit_words(unit: Unit, factor: float) -> str:
    """The words " (is it in `m`, not `mm`, or in `mm`, not `um`?)" where units of the table fit."""
    others = [u for u in UNITS.values() if u.dimension == unit.dimension and unit.text != "1"]
    real = [u.text for u in others if np.isclose(u.scale, unit.scale * factor, rtol=1e-9)][:1]
    taken = [u.text for u in others if np.isclose(u.scale * factor, unit.scale, rtol=1e-9)][:1]
    words = [f"in `{name}`, not `{unit.text}`" for name in real] + [f"in `{unit.text}`, not `{name}`" for name in taken]
    return f" (is it {', or '.join(words)}?)" if words else ""
