"""Scales that are so far off that they are a mistake of the table: a sign, or a unit taken for another."""

from __future__ import annotations

from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words
from pkmcal_cli.units.unit_text import parse_unit

_NEAR = 0.005  # of a factor: a scale beside that of the mistake
_HALVES = (2.0, 0.5)  # a radius for a diameter
_OF_DRIVE, _OF_SENSOR = "scale", "meas_scale"


def mistaken_scale(model: Model, hypothesis: Hypothesis, size: float) -> str:
    """What a scale of a drive or sensor, off by `size`, looks like; "" where it looks like none of these mistakes."""
    effect, at = hypothesis.effect, hypothesis.at
    units = [a.unit for a in model.actuators if a.name == at]
    units += [c.unit for s in model.sensors if s.name == at for c in (model.channels[k] for k in s.channels)]
    if effect not in (_OF_DRIVE, _OF_SENSOR) or len(set(units)) != 1 or size == -1.0:
        return ""
    factor = 1.0 + size if effect == _OF_DRIVE else 1.0 / (1.0 + size)  # that a column is to be multiplied by
    unit = parse_unit(units[0])
    if abs(factor + 1.0) < _NEAR:
        return f" The column of {at} looks reversed in sign."
    near = [f for f in (*factors_of(unit), *_HALVES) if abs(factor / f - 1.0) < _NEAR]
    return f" The column of {at} looks {times(near[0])}{unit_words(unit, near[0])}." if near else ""
