"""Errors between the platform and what the instrument sees."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.effects.effect import Effect, EffectParameter, Inputs


def _runout(at: Inputs, c: Any, s: Any) -> Any:
    cos, sin = np.cos(at.spindle), np.sin(at.spindle)
    return [c * cos - s * sin, c * sin + s * cos, 0]


OFFSET = Effect(
    keyword="tool",
    title="offset of tool or reflector",
    symbol="",
    source="tool centre point in the platform's axes",
    enters="tool",
    parameters=tuple(
        EffectParameter(name=f"t{c}", unit="um", range=1000, text=f"offset along {c}", spatial=c == "z") for c in "xyz"
    ),
    formula=lambda at, tx, ty, tz: [tx, ty, tz],
    common=False,
    measurement=True,
    cause="The point that {at} measures is not where the machine file places it on the platform.",
    result="Readings shift with the orientation of the platform.",
    action="Measure the tool offset, or rotate the tool by 180 degrees and measure again.",
)
RUNOUT = Effect(
    keyword="runout",
    title="runout of the spindle or reflector",
    symbol="",
    source="ISO 230-7 (runout)",
    enters="tool",
    parameters=(
        EffectParameter(name="c", unit="um", range=60, text="eccentricity at angle 0"),
        EffectParameter(name="s", unit="um", range=60, text="eccentricity across it"),
    ),
    formula=_runout,
    needs=("spindle",),
    common=False,
    measurement=True,
    cause="The tool or reflector at {at} runs out.",
    result="Readings circle with the angle of the spindle.",
    action="Clamp the reflector again, or always measure at the same spindle angle.",
)
