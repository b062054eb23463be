"""Errors of stiffness, weight, load and drive forces, and of joints under load."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs

_G = 9.80665  # m/s^2, standard gravity


def _oval(at: Inputs, c: Any, s: Any, zz: Any, yz: Any, zx: Any) -> Any:
    x, y, z = at.chord.T
    planar = c * (x * x - y * y) + s * 2 * x * y
    return planar + zz * (2 * z * z - x * x - y * y) / 2 + 2 * yz * y * z + 2 * zx * z * x


STIFFNESS = Effect(
    "stiffness",
    "stiffness of a member, joint or drive",
    "",
    "Ecorchard 2010, section 2.2",
    "stiffness",
    (EffectParameter("k", "1", 1.4, "logarithm of true over declared stiffness", possible=(-20, 20)),),
    lambda at, k: k,
    cause="{at} is softer or stiffer than declared: loose or worn joints, wrong section.",
    result="Forces of closure, weight and load deform the machine by another amount.",
    action="Check preload and bolts of {at}; measure with two payloads.",
)
WEIGHT = Effect(
    "self_weight",
    "self weight of parts",
    "",
    "Ecorchard 2010, section 2.2 (own weight)",
    "weight",
    (EffectParameter("w", "1", 1, "true over declared weight, less one", possible=(-0.999, 1000)),),
    lambda at, w: w,
    places="all",
    cause="The parts of the machine weigh more or less than declared.",
    result="The machine sags by another amount than the model says, smoothly over the workspace.",
    action="Weigh the parts, or check the counterbalance.",
)
TOOL_LOAD = Effect(
    "tool_load",
    "load at the tool: mass, hose and cable drag",
    "",
    "force at the tool centre point",
    "load",
    tuple(EffectParameter(f"f{c}", "N", 500, f"force along {c}", spatial=c == "z") for c in "xyz"),
    lambda at, fx, fy, fz: [fx, fy, fz],
    common=False,
    cause="A force that is not declared acts on {at}: tool, hose or cable.",
    result="The machine is deformed by its compliance times this force.",
    action="Measure once with the cable taken off, or declare the load.",
)
PAYLOAD = Effect(
    "payload",
    "weight of the payload",
    "",
    "force at the tool centre point",
    "load",
    (EffectParameter("m", "1", 2, "share of the column `payload` that acts on the machine"),),
    lambda at, m: [m * _G * at.payload * component for component in at.down],
    needs=("payload",),
    common=False,
    cause="The payload weighs on {at} and is not declared.",
    result="The machine sags with the payload.",
    action="Declare the payload's weight, or compensate by the machine's compliance.",
)
PRELOAD = Effect(
    "preload",
    "force error of a force-controlled drive, preload",
    "",
    "load sharing of redundant drives",
    "drive_force",
    (EffectParameter("f", "N", 200, "force beyond the commanded one", rotary="N*m"),),
    lambda at, f: f,
    cause="{at} pulls or pushes with another force than commanded: friction, current offset.",
    result="The machine is bent in the direction that the redundant drive can load.",
    action="Measure the force of {at}, or the motor current in both directions.",
)
OVALITY = Effect(
    "ovality",
    "ovality of joints",
    "",
    "roundness of joint bearings (second harmonic of the joint angle)",
    "length",
    (
        EffectParameter("c", "um", 10, "along x less along y"),
        EffectParameter("s", "um", 10, "along the diagonals of x and y"),
        EffectParameter("zz", "um", 10, "along z less across it", spatial=True),
        EffectParameter("yz", "um", 10, "along the diagonals of y and z", spatial=True),
        EffectParameter("zx", "um", 10, "along the diagonals of z and x", spatial=True),
    ),
    _oval,
    common=False,
    reactive=True,
    cause="The bearings at the ends of {at} are not round.",
    result="The length of {at} changes with the angle of its joints.",
    action="Replace the bearings at the ends of {at}.",
)
