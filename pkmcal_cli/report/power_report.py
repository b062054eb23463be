"""How often effects are found in simulated campaigns: table and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pkmcal_cli.diagnosis.power import Rates
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import finite, handy
from pkmcal_cli.report.parameters import parameter_unit

_HEADS = ("effect", "size", "named alone", "one of several", "another name", "nothing")
_NONE = "(no effect)"


def show_rates(to: Reporter, model: Model, rates: Sequence[Rates]) -> None:
    """A table of what was found; nothing where nothing was simulated."""
    if not rates:
        return
    rows = [(_name(r), _size(model, r), *(str(n) for n in (r.named, r.in_set, r.other, r.missed))) for r in rates]
    to.say()
    most = max(r.count + r.lost for r in rates)
    to.table(f"Found in {most} simulated campaigns of each", _HEADS, rows)
    if lost := sum(r.lost for r in rates):
        to.say(f"{lost} campaigns could not be predicted or calibrated: not counted")


def rates_json(model: Model, rates: Rates) -> dict[str, Any]:
    """The same as plain values; an effect of null: campaigns without any."""
    effect = rates.effect
    unit = None if effect is None else parameter_unit(model, effect.parameter)
    return {
        "effect": effect and effect.hypothesis.effect,
        "at": effect and effect.hypothesis.at,
        "parameter": effect and effect.parameter,
        "size": None if unit is None else finite(rates.size / unit.scale),
        "unit": unit and unit.text,
        "n_campaigns": rates.count,
        "named": rates.named,
        "in_set": rates.in_set,
        "other": rates.other,
        "missed": rates.missed,
        "lost": rates.lost,
    }


def _name(rates: Rates) -> str:
    return _NONE if rates.effect is None else rates.effect.hypothesis.name


def _size(model: Model, rates: Rates) -> str:
    return "" if rates.effect is None else handy(rates.size, parameter_unit(model, rates.effect.parameter))
