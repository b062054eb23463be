"""Errors of guides and of the carriages on them (ISO 230-1: straightness, squareness, angular errors)."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs, Option, legendre

_OVER = Option(
    name="over",
    unit="mm",
    text="travel on which the shape is spread; default the limits, else the table's",
    interval=True,
)


def _straightness(at: Inputs, *sizes: Any) -> Any:
    return sum(size * legendre(at.share, 2 + k) for k, size in enumerate(sizes))


STRAIGHT = Effect(
    keyword="straight",
    title="straightness error of a guide",
    symbol="EYX, EZX",
    source="ISO 230-1 (straightness error motion)",
    port="guide",
    parameters=tuple(
        EffectParameter(name=f"n{k}", unit="um", range=80, text=f"Legendre polynomial {k} over the travel")
        for k in range(2, 5)
    ),
    formula=_straightness,
    options=(_OVER,),
    common=False,
    cause="The guide {at} is not straight.",
    result="Carriages on {at} leave their line by a smooth curve.",
    action="Measure {at} with a straightedge or laser; align or compensate it.",
)
GUIDE_ANGLE = Effect(
    keyword="guide_angle",
    title="direction of a guide: parallelism, squareness",
    symbol="EC0Y",
    source="ISO 230-1 (squareness and parallelism)",
    port="guide",
    parameters=(EffectParameter(name="g", unit="urad", range=1000, text="turn of the guide towards the direction"),),
    formula=lambda at, g: g * at.travel,
    common=False,
    cause="The guide {at} is inclined by {size}.",
    result="Carriages on {at} leave their line in proportion to the travel.",
    action="Align {at} against the others, or identify its direction as a parameter.",
)
SAG = Effect(
    keyword="sag",
    title="sag of a guide or crossbeam",
    symbol="EZX",
    source="deflection of a beam under its own weight",
    port="guide",
    parameters=(EffectParameter(name="c", unit="um", range=160, text="deflection in the middle"),),
    formula=lambda at, c: c * at.down[0] * (1 - at.share**2) ** 2,
    options=(_OVER,),
    common=False,
    cause="The beam that carries {at} sags by {size} in the middle.",
    result="Carriages on {at} stand lower in the middle of the travel.",
    action="Support {at}, or compensate the sag; measure it with another payload.",
)
CARRIAGE_ANGLE = Effect(
    keyword="carriage_angle",
    title="angular error of a carriage (roll, pitch, yaw), Abbe error",
    symbol="EAX, EBX, ECX",
    source="ISO 230-1 (angular error motion)",
    port="carriage",
    parameters=(
        EffectParameter(name="a1", unit="urad", range=100, text="turn in proportion to the travel"),
        EffectParameter(name="a2", unit="urad", range=100, text="turn with the second Legendre polynomial"),
    ),
    formula=lambda at, a1, a2: a1 * at.share + a2 * legendre(at.share, 2),
    options=(_OVER,),
    common=False,
    cause="The carriage {at} turns as it travels.",
    result="Joints on {at} move by the angle times their lever.",
    action="Measure {at} with a level or autocollimator; shorten the lever or align the guide.",
)
