"""Positioning errors of drives that depend on the position (ISO 230-1, 230-2), and the drift of their zeros."""

from __future__ import annotations

from itertools import islice
from typing import Any

import numpy as np

from pkmcal_cli.effects.effect import DURING, OVER, Effect, EffectParameter, Inputs, Option, legendre, legendres


def _curve(at: Inputs, *sizes: Any) -> Any:
    there = [k for k, size in enumerate(sizes) if size]  # one of many where derivatives are taken
    shapes = list(islice(legendres(at.normalised_travel), 2, 3 + max(there, default=-1)))
    return sum(sizes[k] * shapes[k] for k in there)


def _harmonics(phase: Any, c1: Any, s1: Any, c2: Any, s2: Any) -> Any:
    return c1 * np.cos(phase) + s1 * np.sin(phase) + c2 * np.cos(2 * phase) + s2 * np.sin(2 * phase)


def _wave(at: Inputs, c: Any, s: Any, c2: Any, s2: Any) -> Any:
    return _harmonics(2 * np.pi * at.travel / at.option("period"), c, s, c2, s2)


def _eccentric(at: Inputs, c1: Any, s1: Any, c2: Any, s2: Any) -> Any:
    # the angle is that of the joint, whatever the gear between it and the motor: turns of the motor are a `pitch`
    return _harmonics(at.travel, c1, s1, c2, s2) - c1 - c2


def _unwinding(at: Inputs, b: Any) -> Any:
    """A spiral: each turn changes the radius by as much, so the line is quadratic in the angle of the spool."""
    line = at.folds * at.travel
    return 0.5 * b * line**2 / at.length / at.folds


def _drifting(at: Inputs, o1: Any, o2: Any) -> Any:
    return o1 * at.normalised_time + o2 * legendre(at.normalised_time, 2)


ZERO = Effect(
    keyword="zero",
    title="zero offset of a drive",
    symbol="",
    source="ISO 230-1 (position error of the axis origin)",
    enters="command",
    parameters=(
        EffectParameter(name="o", unit="um", range=1000, text="offset of the position", rotary="urad", turning=20_000),
    ),
    formula=lambda at, o: o,
    by_session=True,
    cause="The home position or encoder zero of {at} is off by {size}.",
    result="Every position of {at} is shifted by the same amount.",
    action="Correct the zero of {at} in the control by {size}, or home it again against a reference.",
)
ZERO_DRIFT = Effect(
    keyword="zero_drift",
    title="drift of a drive's zero over time",
    symbol="ETVE",
    source="ISO 230-3 (environmental temperature variation error)",
    enters="command",
    parameters=tuple(
        EffectParameter(
            name=f"o{k}",
            unit="um",
            range=100,
            text=f"shift of the position, Legendre polynomial {k} in time",
            rotary="urad",
            turning=2000,
            order=k - 1,
        )
        for k in (1, 2)
    ),
    formula=_drifting,
    needs=("time", "temperature"),
    options=(DURING,),
    common=False,
    cause="The zero of {at} drifts: creep of its belt or rope, a slipping coupling, electronics that warm up.",
    result="The position of {at} at the same reading depends on when it was taken.",
    action="Home {at} again at intervals, log the temperature of its drive train, and let the machine warm up first.",
)
SCALE = Effect(
    keyword="scale",
    title="linear positioning error, scale",
    symbol="EXX slope",
    source="ISO 230-1, ISO 230-2 (mean linear positioning deviation)",
    enters="command",
    parameters=(EffectParameter(name="s", unit="um/m", range=400, text="positioning error per unit of travel"),),
    formula=lambda at, s: s * at.travel,
    proportional=True,
    cause="The scale of {at} (lead of the screw, radius of the spool, grating) is off by {size}.",
    result="The positioning error of {at} grows in proportion to its travel.",
    action="Correct the scale of {at} in the control, or measure it alone with a laser interferometer.",
)
PITCH_CURVE = Effect(
    keyword="pitch_curve",
    title="cumulative pitch error, positioning deviation along the travel",
    symbol="EXX",
    source="ISO 230-2",
    enters="command",
    parameters=tuple(
        EffectParameter(
            name=f"p{k}",
            unit="um",
            range=60,
            text=f"Legendre polynomial {k} of the travel",
            rotary="urad",
            turning=500,
            order=k - 2,
        )
        for k in range(2, 7)
    ),
    formula=_curve,
    options=(OVER,),
    cause="The screw or scale of {at} has an error that varies along its travel.",
    result="The positioning error of {at} is a smooth curve over its travel, the same in both directions.",
    action="Enter a compensation table for {at}, or check the screw for wear in the zone most used.",
)
PITCH = Effect(
    keyword="pitch",
    title="periodic positioning error",
    symbol="",
    source="ISO 230-1 (periodic error of a screw or encoder)",
    enters="command",
    parameters=tuple(
        EffectParameter(
            name=f"{part}{n if n > 1 else ''}",
            unit="um",
            range=40,
            text=f"{word} part{', twice per period' if n > 1 else ''}",
            rotary="urad",
            turning=400,
            order=n - 1,
        )
        for n in (1, 2)
        for part, word in (("c", "cosine"), ("s", "sine"))
    ),
    formula=_wave,
    options=(
        Option(
            name="period",
            unit="mm",
            text="lead of the screw, period of the encoder or a turn of the drum; default: that of the drive",
            rotary="deg",
            positive=True,
        ),
    ),
    common=False,
    harmonics=True,
    cause=(
        "The drive train of {at} errs {repeats}: a screw, drum or encoder that runs out does so once, "
        "a misaligned coupling or a strain-wave gear twice."
    ),
    result="The positioning error of {at} oscillates {repeats}.",
    action="Check the alignment of the end bearing, coupling and encoder of {at}; measure a short scan in fine steps.",
)
GEAR = Effect(
    keyword="gear",
    title="rotary encoder and gear error",
    symbol="",
    source="ISO 230-1 (angular positioning error)",
    enters="command",
    parameters=tuple(
        EffectParameter(
            name=f"{part}{n}",
            unit="urad",
            range=400,
            text=f"{word} of {n} time{'s' if n > 1 else ''} the angle of the joint",
            order=n - 1,
        )
        for n in (1, 2)
        for part, word in (("c", "cosine"), ("s", "sine"))
    ),
    formula=_eccentric,
    where="rotary",
    common=False,
    cause="The rotary encoder or gear of {at} is eccentric.",
    result="The angle of {at} has an error that repeats with every turn.",
    action="Centre the encoder of {at}, or average two reading heads.",
)
BUILDUP = Effect(
    keyword="buildup",
    title="line build-up on a spool",
    symbol="",
    source="geometry of wound line: a spiral, of which each turn changes the radius",
    enters="command",
    parameters=(
        EffectParameter(
            name="b", unit="um/m", range=2000, text="change of the spool's radius per line unwound, at reading 0"
        ),
    ),
    formula=_unwinding,
    where="spool",
    cause="The effective radius of the spool of {at} changes by {size} as line unwinds.",
    result="The line length is a nonlinear function of the angle of {at}.",
    action="Use the build-up law in the control, or a spool with a larger radius and less line.",
)
