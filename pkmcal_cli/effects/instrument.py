"""Faults of the measurement: frame, scale, shear, set-up, drift. The fix is on the tripod, not on the machine."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs, Option, legendre

_PLACE = tuple(
    EffectParameter(name=f"t{c}", unit="um", range=1000, text=f"shift along {c}", spatial=c == "z") for c in "xyz"
)
_TURN = tuple(
    EffectParameter(name=f"r{c}", unit="urad", range=1000, text=f"turn about {c}", spatial=c != "z") for c in "xyz"
)
_DURING = Option(name="during", unit="s", text="time on which the shape is spread; default the table's", interval=True)


def _moved(at: Inputs, tx: Any, ty: Any, tz: Any, rx: Any, ry: Any, rz: Any) -> Any:
    return [tx, ty, tz, rx, ry, rz, 0, 0, 0, 0]


def _drifted(at: Inputs, *sizes: Any) -> Any:
    first, second = at.moment, legendre(at.moment, 2)
    return [*(a * first + b * second for a, b in zip(sizes[:3], sizes[3:], strict=True)), *[0] * 7]


FRAME = Effect(
    keyword="frame",
    title="pose of the measuring frame",
    symbol="",
    source="datum definition; ISO 230-10, ISO 10360",
    port="frame",
    parameters=_PLACE + _TURN,
    formula=_moved,
    common=False,
    measurement=True,
    cause="The instrument {at} does not stand where the machine's frame says.",
    result="All readings of {at} are shifted and turned like one rigid body.",
    action="Measure the datum points again, or let the frame of {at} be fitted.",
)
MEAS_SCALE = Effect(
    keyword="meas_scale",
    title="scale of the instrument, refraction",
    symbol="",
    source="ISO 230-6, refractive index of air (1 K or 3.6 hPa: about 1 um/m)",
    port="frame",
    parameters=(EffectParameter(name="s", unit="um/m", range=100, text="scale"),),
    formula=lambda at, s: [0, 0, 0, 0, 0, 0, s, 0, 0, 0],
    common=False,
    measurement=True,
    cause="{at} measures lengths in a scale that is off by {size}.",
    result="All readings of {at} are stretched alike.",
    action="Measure a calibrated length in the same set-up; check air temperature and pressure of {at}.",
)
MEAS_SHEAR = Effect(
    keyword="meas_shear",
    title="axes of the instrument not square",
    symbol="",
    source="squareness of a grid plate or of the axes of an instrument",
    port="frame",
    parameters=(
        EffectParameter(name="xy", unit="urad", range=400, text="angle between x and y"),
        EffectParameter(name="xz", unit="urad", range=400, text="angle between x and z", spatial=True),
        EffectParameter(name="yz", unit="urad", range=400, text="angle between y and z", spatial=True),
    ),
    formula=lambda at, xy, xz, yz: [0, 0, 0, 0, 0, 0, 0, xy, xz, yz],
    common=False,
    measurement=True,
    cause="The axes of {at} are not square.",
    result="Readings of {at} are sheared.",
    action="Turn the grid plate or artefact of {at} by 90 degrees and measure again.",
)
RESETUP = Effect(
    keyword="resetup",
    title="set-up change between sessions",
    symbol="",
    source="datum definition of each session",
    port="frame",
    parameters=tuple(replace(p, range=400 if p.unit == "um" else 600) for p in _PLACE + _TURN),
    formula=_moved,
    needs=("session",),
    places="session",
    common=False,
    measurement=True,
    cause="In session {at} the instrument or the part stood elsewhere.",
    result="All readings of the session are shifted and turned like one rigid body.",
    action="Measure the same datum points at the start and the end of every session.",
)  # fmt: skip
DRIFT = Effect(
    keyword="drift",
    title="drift of machine or instrument in time",
    symbol="ETVE",
    source="ISO 230-3 (environmental temperature variation error)",
    port="frame",
    parameters=tuple(
        EffectParameter(
            name=f"{c}{k}",
            unit="um",
            range=100,
            text=f"shift along {c}, Legendre polynomial {k} in time",
            spatial=c == "z",
        )
        for k in (1, 2)
        for c in "xyz"
    ),
    formula=_drifted,
    needs=("time", "temperature"),
    options=(_DURING,),
    common=False,
    measurement=True,
    cause="Machine and instrument {at} moved against each other during the measurement.",
    result="The readings depend on when they were taken.",
    action="Return to a datum pose every 20 minutes, randomise the order of points, log temperatures.",
)
