"""Faults of the measurement: frame, scale, shear, set-up, drift. The fix is on the tripod, not on the machine."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pkmcal_cli.effects.effect import DURING, FRAME_PARTS, WIDTHS, Effect, EffectParameter, Inputs, legendre

_PLACE = tuple(
    EffectParameter(name=f"t{c}", unit="um", range=1000, text=f"shift along {c}", spatial=c == "z") for c in "xyz"
)
_ROTATION_PARAMETERS = tuple(
    EffectParameter(name=f"r{c}", unit="urad", range=1000, text=f"rotation about {c}", spatial=c != "z", order=1)
    for c in "xyz"
)
_DIRECTIONS = {**{c: f"shift along {c}" for c in "xyz"}, "n": "shift of a single number"}


def _parts(**vectors: Any) -> list[Any]:
    """The numbers of the entry, those of some of its parts as given."""
    out: list[Any] = [0.0] * WIDTHS["frame"]
    for name, values in vectors.items():
        out[FRAME_PARTS[name]] = values
    return out


def _moved(at: Inputs, tx: Any, ty: Any, tz: Any, rx: Any, ry: Any, rz: Any) -> Any:
    return _parts(shift=[tx, ty, tz], turn=[rx, ry, rz], base=[tx, ty, tz])


def _drifted(at: Inputs, *sizes: Any) -> Any:
    first, second = at.normalised_time, legendre(at.normalised_time, 2)
    *shift, reading = (a * first + b * second for a, b in zip(sizes[:4], sizes[4:], strict=True))
    return _parts(shift=shift, reading=[reading])


FRAME = Effect(
    keyword="frame",
    title="pose of the measuring frame",
    symbol="",
    source="datum definition; ISO 230-10, ISO 10360",
    enters="frame",
    parameters=_PLACE + _ROTATION_PARAMETERS,
    formula=_moved,
    common=False,
    row_by_row=True,
    measurement=True,
    cause="The instrument {at} is not where the machine file places its frame.",
    result="All readings of {at} are shifted and rotated as one rigid body.",
    action="Measure the datum points again, or fit the frame of {at} (other point, plane, axis) by parameters.",
)
MEAS_SCALE = Effect(
    keyword="meas_scale",
    title="scale of the instrument, refraction",
    symbol="",
    source="ISO 230-6, refractive index of air (1 K or 3.6 hPa: about 1 um/m)",
    enters="frame",
    parameters=(EffectParameter(name="s", unit="um/m", range=100, text="scale", rotary="urad/rad"),),
    formula=lambda at, s: _parts(scale=[s]),
    measurement=True,
    cause="The length scale of {at} is off by {size}.",
    result="All readings of {at} are scaled by the same factor.",
    action="Measure a calibrated length in the same set-up; check air temperature and pressure of {at}.",
)
MEAS_ZERO = Effect(
    keyword="meas_zero",
    title="constant of an instrument that measures distances",
    symbol="",
    source="ISO 230-4 (calibrated length of the ball bar), ISO 17123-4 (zero-point correction)",
    enters="frame",
    parameters=(EffectParameter(name="o", unit="um", range=1000, text="shift of the reading"),),
    formula=lambda at, o: _parts(reading=[o]),
    where="length",
    measurement=True,
    nowhere="the zero of what touches a surface is the place of the surface, `frame`",
    cause="The constant of {at} (length of the bar, home of the wire, radii of ball and tip) is off by {size}.",
    result="Every reading of {at} is shifted by the same amount.",
    action="Measure a calibrated length with {at}, or make its `zero` a parameter of the machine file.",
)
MEAS_SHEAR = Effect(
    keyword="meas_shear",
    title="squareness error of the instrument's axes",
    symbol="",
    source="squareness of a grid plate or of the axes of an instrument",
    enters="frame",
    parameters=(
        EffectParameter(name="xy", unit="urad", range=400, text="angle between x and y"),
        EffectParameter(name="xz", unit="urad", range=400, text="angle between x and z", spatial=True),
        EffectParameter(name="yz", unit="urad", range=400, text="angle between y and z", spatial=True),
    ),
    formula=lambda at, xy, xz, yz: _parts(shear=[xy, xz, yz]),
    common=False,
    measurement=True,
    cause="The axes of {at} are not square.",
    result="Readings of {at} are sheared.",
    action="Rotate the grid plate or artefact of {at} by 90 degrees and measure again.",
)
RESETUP = Effect(
    keyword="resetup",
    title="set-up change between sessions",
    symbol="",
    source="datum definition of each session",
    enters="frame",
    parameters=tuple(replace(p, range=400 if p.unit == "um" else 600) for p in _PLACE + _ROTATION_PARAMETERS),
    formula=_moved,
    needs=("session",),
    places="session",
    where="coordinates",
    common=False,
    measurement=True,
    cause="In session {at}, the instrument or the part was in another place.",
    result="All readings of the session are shifted and rotated as one rigid body.",
    action="Measure the same datum points at the start and the end of every session.",
)  # fmt: skip
DRIFT = Effect(
    keyword="drift",
    title="drift of machine or instrument over time",
    symbol="ETVE",
    source="ISO 230-3 (environmental temperature variation error)",
    enters="frame",
    parameters=tuple(
        EffectParameter(
            name=f"{c}{k}",
            unit="um",
            range=100,
            text=f"{words}, Legendre polynomial {k} in time",
            rotary="urad" if c == "n" else None,
            spatial=c == "z",
            order=k - 1,
        )
        for k in (1, 2)
        for c, words in _DIRECTIONS.items()
    ),
    formula=_drifted,
    needs=("time", "temperature"),
    options=(DURING,),
    common=False,
    measurement=True,
    cause="The machine and the instrument {at} moved relative to each other during the measurement.",
    result="The readings depend on when they were taken.",
    action="Return to a datum pose every 20 minutes, randomise the order of the points and log temperatures.",
)
