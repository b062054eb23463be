"""Positioning errors of drives that depend on the position only (ISO 230-1, 230-2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs, Option, legendre

_OVER = Option(
    name="over",
    unit="mm",
    text="travel on which the shape is spread; default the limits, else the table's",
    interval=True,
    rotary="deg",
)


def _curve(at: Inputs, *sizes: Any) -> Any:
    return sum(size * legendre(at.share, 2 + k) for k, size in enumerate(sizes))


def _wave(at: Inputs, c: Any, s: Any) -> Any:
    phase = 2 * np.pi * at.travel / at.option("period")
    return c * np.cos(phase) + s * np.sin(phase)


def _turns(at: Inputs, c1: Any, s1: Any, c2: Any, s2: Any) -> Any:
    angle, arm = at.reading, at.length
    first = c1 * (np.cos(angle) - 1) + s1 * np.sin(angle)
    return arm * (first + c2 * (np.cos(2 * angle) - 1) + s2 * np.sin(2 * angle))


def _unwinding(at: Inputs, b: Any) -> Any:
    return 0.5 * b * at.travel**2 / at.length


ZERO = Effect(
    keyword="zero",
    title="zero offset of a drive",
    symbol="",
    source="ISO 230-1 (position error of the axis origin)",
    port="command",
    parameters=(
        EffectParameter(name="o", unit="um", range=1000, text="offset of the position", rotary="urad", turning=20_000),
    ),
    formula=lambda at, o: o,
    cause="The home position or encoder zero of {at} is off by {size}.",
    result="Every position of {at} is shifted by the same amount.",
    action="Correct the zero of {at} in the control by {size}, or home it again against a reference.",
)
SCALE = Effect(
    keyword="scale",
    title="linear positioning error, scale",
    symbol="EXX slope",
    source="ISO 230-1, ISO 230-2 (mean linear positioning deviation)",
    port="command",
    parameters=(EffectParameter(name="s", unit="um/m", range=400, text="positioning error per travel"),),
    formula=lambda at, s: s * at.travel,
    cause="The scale of {at} (lead of the screw, radius of the spool, grating) is off by {size}.",
    result="The positioning error of {at} grows in proportion to its travel.",
    action="Correct the scale of {at} in the control, or measure it alone with a laser interferometer.",
)
PITCH_CURVE = Effect(
    keyword="pitch_curve",
    title="cumulative pitch error, positioning deviation along the travel",
    symbol="EXX",
    source="ISO 230-2",
    port="command",
    parameters=tuple(
        EffectParameter(
            name=f"p{k}", unit="um", range=60, text=f"Legendre polynomial {k} of the travel", rotary="urad", turning=500
        )
        for k in range(2, 7)
    ),
    formula=_curve,
    options=(_OVER,),
    cause="The screw or scale of {at} has an error that varies along its travel.",
    result="A smooth curve of positioning errors over the travel of {at}, the same in both directions.",
    action="Enter a compensation table for {at}, or check the screw for wear in the zone most used.",
)
PITCH = Effect(
    keyword="pitch",
    title="periodic positioning error",
    symbol="",
    source="ISO 230-1 (periodic error of a screw or encoder)",
    port="command",
    parameters=(
        EffectParameter(name="c", unit="um", range=40, text="cosine part", rotary="urad", turning=400),
        EffectParameter(name="s", unit="um", range=40, text="sine part", rotary="urad", turning=400),
    ),
    formula=_wave,
    options=(
        Option(
            name="period",
            unit="mm",
            text="lead of screw or period of encoder; default the drive's",
            rotary="deg",
            positive=True,
        ),
    ),
    common=False,
    cause="The screw, its coupling or the encoder of {at} runs out once in every period.",
    result="The positioning error of {at} oscillates with the period.",
    action="Check the alignment of the end bearing, coupling and encoder of {at}; measure a short fine scan.",
)
GEAR = Effect(
    keyword="gear",
    title="rotary encoder and gear error",
    symbol="",
    source="ISO 230-1 (angular positioning error)",
    port="command",
    parameters=tuple(
        EffectParameter(
            name=f"{part}{n}", unit="urad", range=400, text=f"{word} of {n} time{'s' if n > 1 else ''} the angle"
        )
        for n in (1, 2)
        for part, word in (("c", "cosine"), ("s", "sine"))
    ),
    formula=_turns,
    where="rotary",
    common=False,
    cause="The rotary encoder or gear of {at} sits off its centre.",
    result="The angle of {at} has an error that repeats with every turn.",
    action="Centre the encoder of {at}, or average two reading heads.",
)
BUILDUP = Effect(
    keyword="buildup",
    title="build-up of line on a spool",
    symbol="",
    source="geometry of wound rope: each layer changes the radius",
    port="command",
    parameters=(
        EffectParameter(
            name="b", unit="um/m", range=2000, text="change of the spool's radius per length of unwound line"
        ),
    ),
    formula=_unwinding,
    where="spool",
    cause="The effective radius of the spool of {at} changes by {size} as line leaves it.",
    result="The length of line is a curved function of the angle of {at}.",
    action="Use the law with build-up in the control, or a spool of larger radius and less line.",
)
