"""Errors of stiffness, weight, load and drive forces, and of joints under load."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects.effect import Effect, EffectParameter, Inputs

_G = 9.80665  # m/s^2, standard gravity


def _oval(at: Inputs, c: Any, s: Any, zz: Any, yz: Any, zx: Any) -> Any:
    x, y, z = at.chord.T
    planar = c * (x * x - y * y) + s * 2 * x * y
    return planar + zz * (2 * z * z - x * x - y * y) / 2 + 2 * yz * y * z + 2 * zx * z * x


STIFFNESS = Effect(
    keyword="stiffness",
    title="stiffness of a member, joint or drive",
    symbol="",
    source="Ecorchard 2010, section 2.2",
    enters="stiffness",
    parameters=(
        EffectParameter(
            name="k", unit="1", range=1.4, text="logarithm of true over declared stiffness", possible=(-20, 20)
        ),
    ),
    formula=lambda at, k: k,
    cause="{at} is softer or stiffer than declared: loose or worn joints, wrong section.",
    result="Closure forces, weight and load deform the machine by a different amount than modelled.",
    action="Check preload and bolts of {at}; measure with two payloads.",
)
WEIGHT = Effect(
    keyword="self_weight",
    title="self-weight of parts",
    symbol="",
    source="Ecorchard 2010, section 2.2 (own weight)",
    enters="weight",
    parameters=(
        EffectParameter(
            name="w", unit="1", range=1, text="true over declared weight, minus one", possible=(-0.999, 1000)
        ),
    ),
    formula=lambda at, w: w,
    places="all",
    weighty=True,
    nowhere="gravity does not act on the masses (`own_weight`)",
    cause="The parts of the machine weigh more or less than declared.",
    result="The machine sags by a different amount than modelled, smoothly over the workspace.",
    action="Weigh the parts, or check the counterbalance.",
)
TOOL_LOAD = Effect(
    keyword="tool_load",
    title="load at the tool: mass, hose and cable drag",
    symbol="",
    source="force at the tool centre point",
    enters="load",
    parameters=tuple(
        EffectParameter(name=f"f{c}", unit="N", range=500, text=f"force along {c}", spatial=c == "z") for c in "xyz"
    ),
    formula=lambda at, fx, fy, fz: [fx, fy, fz],
    common=False,
    cause="An undeclared force acts on {at}: tool, hose or cable.",
    result="The machine deforms by its compliance times this force.",
    action="Measure once with the cable removed, or declare the load.",
)
PAYLOAD = Effect(
    keyword="payload",
    title="weight of the payload",
    symbol="",
    source="force at the tool centre point",
    enters="load",
    parameters=(
        EffectParameter(
            name="m",
            unit="1",
            range=2,
            text="share of the column `payload` that acts on the machine",
            known=1.0,
            known_as="as weighed",
        ),
    ),
    formula=lambda at, m: [m * _G * at.payload * component for component in at.down],
    needs=("payload",),
    common=False,
    weighty=True,
    cause="The weight of the payload on {at} is not declared.",
    result="The machine sags with the payload.",
    action="Declare the payload's weight, or compensate by the machine's compliance.",
)
PRELOAD = Effect(
    keyword="preload",
    title="force error of a force-controlled drive, preload",
    symbol="",
    source="load sharing of redundant drives",
    enters="drive_force",
    parameters=(
        EffectParameter(name="f", unit="N", range=200, text="force in addition to the commanded force", rotary="N*m"),
    ),
    formula=lambda at, f: f,
    cause="{at} pulls or pushes with a force other than commanded: friction, current offset.",
    result="The machine deforms in the direction in which the redundant drive can load it.",
    action="Measure the force of {at}, or the motor current in both directions.",
)
FORCE_SCALE = Effect(
    keyword="force_scale",
    title="scale of the force of a force-controlled drive",
    symbol="",
    source="torque constant of a motor; sign and unit of the column of forces",
    enters="drive_force",
    parameters=(
        EffectParameter(name="s", unit="1", range=0.4, text="true over commanded force, minus one; -2: opposite sign"),
    ),
    formula=lambda at, s: s * at.commanded_force,
    needs=("force",),
    cause="{at} pulls or pushes in proportion to the commanded force, but not with it: torque constant, sign or unit.",
    result="The machine deforms more or less than modelled, in proportion to the commanded force of {at}.",
    action="Check sign and unit of the column `{at}.force`; measure the force of {at} at two commanded forces.",
)
OVALITY = Effect(
    keyword="ovality",
    title="ovality of joints",
    symbol="",
    source="roundness of joint bearings (second harmonic of the joint angle)",
    enters="length",
    parameters=(
        EffectParameter(name="c", unit="um", range=10, text="along x minus along y"),
        EffectParameter(name="s", unit="um", range=10, text="along the diagonals of x and y"),
        EffectParameter(name="zz", unit="um", range=10, text="along z minus across it", spatial=True),
        EffectParameter(name="yz", unit="um", range=10, text="along the diagonals of y and z", spatial=True),
        EffectParameter(name="zx", unit="um", range=10, text="along the diagonals of z and x", spatial=True),
    ),
    formula=_oval,
    common=False,
    reactive=True,
    cause="The bearings at the ends of {at} are not round.",
    result="The length of {at} changes with the angle of its joints.",
    action="Replace the bearings at the ends of {at}.",
)
