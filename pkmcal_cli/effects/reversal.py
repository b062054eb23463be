"""Errors that depend on the direction of motion or of force: backlash, wind-up, friction, clearance."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.effects.effect import OVER, Effect, EffectParameter, Inputs, Option

_SMOOTH = Option(
    name="smooth", unit="N", text="force over which the sign of a reaction is smoothed; default: 10 N", positive=True
)


def _lost(at: Inputs, c: Any) -> Any:
    return 0.5 * c * np.tanh(at.pull / at.option("smooth"))


def _wound(at: Inputs, w: Any) -> Any:
    smooth = at.option("smooth")
    return -w * at.direction * (np.sqrt(at.pull**2 + smooth**2) - smooth)


BACKLASH = Effect(
    keyword="backlash",
    title="reversal error, backlash",
    symbol="B",
    source="ISO 230-2 (reversal error), ISO 230-4",
    enters="command",
    parameters=(
        EffectParameter(
            name="b",
            unit="um",
            range=60,
            text="difference between the two directions of approach",
            rotary="urad",
            turning=1000,
        ),
    ),
    formula=lambda at, b: -0.5 * b * at.direction,
    needs=("direction",),
    negative="{at} comes to rest ahead in its direction of motion, where play leaves a drive behind. The control "
    "compensates for more play than there is, or the directions of approach are stated the other way round.",
    cause="The nut, end bearing, belt or gear of {at} has play.",
    result="Positions of {at} approached from opposite sides differ by {size}.",
    action="Check nut, end bearing, belt or gear of {at}; until then compensate for {size} of reversal.",
)
UNEQUAL_BACKLASH = Effect(
    keyword="unequal_backlash",
    title="reversal error that varies along the travel",
    symbol="B",
    source="ISO 230-2 (reversal error at each position)",
    enters="command",
    parameters=(
        EffectParameter(
            name="b1",
            unit="um",
            range=80,
            text="change of the reversal error from the middle to the end",
            rotary="urad",
            turning=1000,
        ),
    ),
    formula=lambda at, b1: -0.5 * b1 * at.normalised_travel * at.direction,
    needs=("direction",),
    options=(OVER,),
    cause="The play of {at} changes along its travel: wear, or wind-up of a long screw or belt.",
    result="The forward and backward curves of {at} are not parallel.",
    action="Measure the reversal error of {at} at both ends of the travel; replace the worn screw or belt.",
)
WINDUP = Effect(
    keyword="windup",
    title="wind-up under friction that grows with the load",
    symbol="",
    source="friction and elasticity of the drive train between encoder and carriage",
    enters="command",
    parameters=(
        EffectParameter(
            name="w",
            unit="um/kN",
            range=20,
            text="lost motion per unit of drive force",
            rotary="urad/(kN*m)",
            turning=2000,
        ),
    ),
    formula=_wound,
    needs=("direction",),
    options=(_SMOOTH,),
    reactive=True,
    cause="The drive train of {at} winds up against friction that grows with the load.",
    result="The reversal error of {at} grows with the force that it carries.",
    action="Check lubrication and alignment of {at}; measure with another payload (wind-up changes, play does not).",
)
FRICTION = Effect(
    keyword="friction",
    title="friction of a force-controlled drive",
    symbol="",
    source="Coulomb friction of motor, gear and guide, which a commanded force or motor current does not know of",
    enters="drive_force",
    parameters=(
        EffectParameter(
            name="f",
            unit="N",
            range=100,
            text="part of the commanded force that friction takes, against the last motion",
            rotary="N*m",
        ),
    ),
    formula=lambda at, f: -f * at.motion,
    needs=("direction",),
    negative="{at} is helped along its last motion, where friction is against it. The control compensates for more "
    "friction than there is, or the directions of approach are stated the other way round.",
    cause="Friction of {at} takes {size} of the commanded force, against its last motion.",
    result="The machine deforms differently where {at} came from the other side, by its compliance times twice this "
    "force.",
    action="Measure the force of {at} beyond motor and gear, or its motor current in both directions; approach every "
    "pose from the same side.",
)
CLEARANCE = Effect(
    keyword="clearance",
    title="lost motion from joint clearance",
    symbol="",
    source="clearance of the joints at the ends of a member",
    enters="length",
    parameters=(
        EffectParameter(name="c", unit="um", range=60, text="clearance of the member's joints along the member"),
    ),
    formula=_lost,
    options=(_SMOOTH,),
    reactive=True,
    cause="The joints of {at} have a clearance of {size}.",
    result="The length of {at} jumps where its force changes between pull and push.",
    action="Preload or replace the bearings at the ends of {at}.",
)
