"""Errors of guides and of the carriages on them (ISO 230-1: straightness, squareness, angular errors).

A straightness deviation is the distance from a reference straight line that is fitted to the trajectory (ISO 230-1).
So where that line is belongs to no straightness error: its position across the guide, the mean, is free with the shape,
and its direction is an effect of its own, a rotation about the middle of the same travel.
"""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects.effect import OVER, Effect, EffectParameter, Inputs, legendre


def _straightness(at: Inputs, n2: Any, n3: Any, n4: Any, n0: Any) -> Any:
    u = at.normalised_travel
    return n0 + n2 * legendre(u, 2) + n3 * legendre(u, 3) + n4 * legendre(u, 4)


STRAIGHT = Effect(
    keyword="straight",
    title="straightness error of a guide",
    symbol="EYX, EZX",
    source="ISO 230-1 (straightness error motion, reference straight line)",
    enters="guide",
    parameters=(
        *(
            EffectParameter(
                name=f"n{k}", unit="um", range=80, text=f"Legendre polynomial {k} over the travel", order=k - 2
            )
            for k in range(2, 5)
        ),
        EffectParameter(name="n0", unit="um", range=80, text="position of the reference line, no error", free=True),
    ),
    formula=_straightness,
    options=(OVER,),
    common=False,
    any_curve=True,
    cause="The guide {at} is not straight.",
    result="Carriages on {at} deviate from a straight line by a smooth curve.",
    action="Measure {at} with a straightedge or laser; align it or compensate for it.",
)
GUIDE_ANGLE = Effect(
    keyword="guide_angle",
    title="direction of a guide: parallelism, squareness",
    symbol="EC0Y",
    source="ISO 230-1 (squareness and parallelism)",
    enters="guide",
    parameters=(EffectParameter(name="g", unit="urad", range=1000, text="rotation about the middle of the travel"),),
    formula=lambda at, g: g * at.centred_travel,
    options=(OVER,),
    common=False,
    proportional=True,
    cause="The guide {at} is inclined by {size}.",
    result="Carriages on {at} deviate from their line in proportion to the distance from the middle of the travel.",
    action="Align {at} against the others, or identify its direction as a parameter.",
)
SAG = Effect(
    keyword="sag",
    title="sag of a guide or crossbeam",
    symbol="EZX",
    source="deflection of a beam under its own weight",
    enters="guide",
    parameters=(EffectParameter(name="c", unit="um", range=160, text="deflection in the middle"),),
    formula=lambda at, c: c * at.down[0] * (1 - at.normalised_travel**2) ** 2,
    options=(OVER,),
    common=False,
    weighty=True,
    nowhere="gravity has no component across a guide",
    cause="The beam that carries {at} sags by {size} in the middle.",
    result="Carriages on {at} are lower in the middle of the travel.",
    action="Support {at}, or compensate for the sag; measure with another payload.",
)
CARRIAGE_ANGLE = Effect(
    keyword="carriage_angle",
    title="angular error of a carriage (roll, pitch, yaw), Abbe error",
    symbol="EAX, EBX, ECX",
    source="ISO 230-1 (angular error motion)",
    enters="carriage",
    parameters=(
        EffectParameter(name="a1", unit="urad", range=100, text="rotation in proportion to the travel"),
        EffectParameter(
            name="a2", unit="urad", range=100, text="rotation with the second Legendre polynomial", order=1
        ),
    ),
    formula=lambda at, a1, a2: a1 * at.normalised_travel + a2 * legendre(at.normalised_travel, 2),
    options=(OVER,),
    common=False,
    cause="The carriage {at} rotates as it travels.",
    result="Joints on {at} move by the angle times their lever arm.",
    action="Measure {at} with a level or autocollimator; shorten the lever arm or align the guide.",
)
