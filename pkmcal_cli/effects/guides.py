"""Errors of guides and of the carriages on them (ISO 230-1: straightness, squareness, angular errors)."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs, Option, legendre

_OVER = Option("over", "mm", "travel on which the shape is spread; default the limits, else the table's", True)


def _straightness(at: Inputs, *sizes: Any) -> Any:
    return sum(size * legendre(at.share, 2 + k) for k, size in enumerate(sizes))


STRAIGHT = Effect(
    "straight",
    "straightness error of a guide",
    "EYX, EZX",
    "ISO 230-1 (straightness error motion)",
    "guide",
    tuple(EffectParameter(f"n{k}", "um", 80, f"Legendre polynomial {k} over the travel") for k in range(2, 5)),
    _straightness,
    options=(_OVER,),
    common=False,
    cause="The guide {at} is not straight.",
    result="Carriages on {at} leave their line by a smooth curve.",
    action="Measure {at} with a straightedge or laser; align or compensate it.",
)
GUIDE_ANGLE = Effect(
    "guide_angle",
    "direction of a guide: parallelism, squareness",
    "EC0Y",
    "ISO 230-1 (squareness and parallelism)",
    "guide",
    (EffectParameter("g", "urad", 1000, "turn of the guide towards the direction"),),
    lambda at, g: g * at.travel,
    common=False,
    cause="The guide {at} is inclined by {size}.",
    result="Carriages on {at} leave their line in proportion to the travel.",
    action="Align {at} against the others, or identify its direction as a parameter.",
)
SAG = Effect(
    "sag",
    "sag of a guide or crossbeam",
    "EZX",
    "deflection of a beam under its own weight",
    "guide",
    (EffectParameter("c", "um", 160, "deflection in the middle"),),
    lambda at, c: c * at.down[0] * (1 - at.share**2) ** 2,
    options=(_OVER,),
    common=False,
    cause="The beam that carries {at} sags by {size} in the middle.",
    result="Carriages on {at} stand lower in the middle of the travel.",
    action="Support {at}, or compensate the sag; measure it with another payload.",
)
CARRIAGE_ANGLE = Effect(
    "carriage_angle",
    "angular error of a carriage (roll, pitch, yaw), Abbe error",
    "EAX, EBX, ECX",
    "ISO 230-1 (angular error motion)",
    "carriage",
    (
        EffectParameter("a1", "urad", 100, "turn in proportion to the travel"),
        EffectParameter("a2", "urad", 100, "turn with the second Legendre polynomial"),
    ),
    lambda at, a1, a2: a1 * at.share + a2 * legendre(at.share, 2),
    options=(_OVER,),
    common=False,
    cause="The carriage {at} turns as it travels.",
    result="Joints on {at} move by the angle times their lever.",
    action="Measure {at} with a level or autocollimator; shorten the lever or align the guide.",
)
