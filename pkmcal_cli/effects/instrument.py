"""Faults of the measurement: frame, scale, shear, set-up, drift. The fix is on the tripod, not on the machine."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs, Option, legendre

_PLACE = tuple(EffectParameter(f"t{c}", "um", 1000, f"shift along {c}", spatial=c == "z") for c in "xyz")
_TURN = tuple(EffectParameter(f"r{c}", "urad", 1000, f"turn about {c}", spatial=c != "z") for c in "xyz")
_DURING = Option("during", "s", "time on which the shape is spread; default the table's", True)


def _moved(at: Inputs, tx: Any, ty: Any, tz: Any, rx: Any, ry: Any, rz: Any) -> Any:
    return [tx, ty, tz, rx, ry, rz, 0, 0, 0, 0]


def _drifted(at: Inputs, *sizes: Any) -> Any:
    first, second = at.moment, legendre(at.moment, 2)
    return [*(a * first + b * second for a, b in zip(sizes[:3], sizes[3:], strict=True)), *[0] * 7]


FRAME = Effect(
    "frame",
    "pose of the measuring frame",
    "",
    "datum definition; ISO 230-10, ISO 10360",
    "frame",
    _PLACE + _TURN,
    _moved,
    common=False,
    measurement=True,
    cause="The instrument {at} does not stand where the machine's frame says.",
    result="All readings of {at} are shifted and turned like one rigid body.",
    action="Measure the datum points again, or let the frame of {at} be fitted.",
)
MEAS_SCALE = Effect(
    "meas_scale",
    "scale of the instrument, refraction",
    "",
    "ISO 230-6, refractive index of air (1 K or 3.6 hPa: about 1 um/m)",
    "frame",
    (EffectParameter("s", "um/m", 100, "scale"),),
    lambda at, s: [0, 0, 0, 0, 0, 0, s, 0, 0, 0],
    common=False,
    measurement=True,
    cause="{at} measures lengths in a scale that is off by {size}.",
    result="All readings of {at} are stretched alike.",
    action="Measure a calibrated length in the same set-up; check air temperature and pressure of {at}.",
)
MEAS_SHEAR = Effect(
    "meas_shear",
    "axes of the instrument not square",
    "",
    "squareness of a grid plate or of the axes of an instrument",
    "frame",
    (
        EffectParameter("xy", "urad", 400, "angle between x and y"),
        EffectParameter("xz", "urad", 400, "angle between x and z", spatial=True),
        EffectParameter("yz", "urad", 400, "angle between y and z", spatial=True),
    ),
    lambda at, xy, xz, yz: [0, 0, 0, 0, 0, 0, 0, xy, xz, yz],
    common=False,
    measurement=True,
    cause="The axes of {at} are not square.",
    result="Readings of {at} are sheared.",
    action="Turn the grid plate or artefact of {at} by 90 degrees and measure again.",
)
RESETUP = Effect(
    "resetup",
    "set-up change between sessions",
    "",
    "datum definition of each session",
    "frame",
    tuple(replace(p, range=400 if p.unit == "um" else 600) for p in _PLACE + _TURN),
    _moved,
    needs=("session",),
    places="session",
    common=False,
    measurement=True,
    cause="In session {at} the instrument or the part stood elsewhere.",
    result="All readings of the session are shifted and turned like one rigid body.",
    action="Measure the same datum points at the start and the end of every session.",
)  # fmt: skip
DRIFT = Effect(
    "drift",
    "drift of machine or instrument in time",
    "ETVE",
    "ISO 230-3 (environmental temperature variation error)",
    "frame",
    tuple(
        EffectParameter(f"{c}{k}", "um", 100, f"shift along {c}, Legendre polynomial {k} in time", spatial=c == "z")
        for k in (1, 2)
        for c in "xyz"
    ),
    _drifted,
    needs=("time", "temperature"),
    options=(_DURING,),
    common=False,
    measurement=True,
    cause="Machine and instrument {at} moved against each other during the measurement.",
    result="The readings depend on when they were taken.",
    action="Return to a datum pose every 20 minutes, randomise the order of points, log temperatures.",
)
