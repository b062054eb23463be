"""What the sign of an effect says, where that is not what its name says: a drive with play stays behind."""

from __future__ import annotations

from pkmcal_cli.model.effect_sites import ALL
from pkmcal_cli.model.model import Model

_SURE = 2.0  # standard uncertainties from which on a sign is one


def sign_text(model: Model, parameter: str, value: float, std: float | None) -> str:
    """What the value of a parameter, SI, says by its sign; "" where that is as its effect's name says, or not sure.

    Sides are those of readings: of a drive whose readings count against its travel, play has the other sign. Friction
    is told along the travel.
    """
    placed = next((e for e in model.effects if parameter in e.parameters), None)
    if placed is None or not placed.effect.negative or std is None or not abs(value) > _SURE * std:
        return ""
    drives = [model.actuators[s.actuator] for s in placed.sites if s.actuator >= 0]
    gains = model.reference_coefficients[0, [a.gain_coefficient for a in drives]]
    against = placed.effect.enters == "command" and bool(len(gains)) and bool((gains < 0).all())
    at = f"every {'drive' if drives else 'member'}" if placed.at == ALL else placed.at
    sign = f"{placed.name} is {'negative' if value < 0 else 'positive'}"
    if (value < 0) != against:
        return f"{sign}: {placed.effect.negative.format(at=at)}"
    return f"{sign}: it is play, as readings of {at} count against its travel." if against else ""
