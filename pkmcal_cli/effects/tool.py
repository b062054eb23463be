"""Errors between the platform and what the instrument sees."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs


def _runout(at: Inputs, c: Any, s: Any) -> Any:
    cos, sin = np.cos(at.spindle), np.sin(at.spindle)
    return [c * cos - s * sin, c * sin + s * cos, 0]


OFFSET = Effect(
    "tool",
    "offset of tool or reflector",
    "",
    "tool centre point in the platform's axes",
    "tool",
    tuple(EffectParameter(f"t{c}", "um", 1000, f"offset along {c}", spatial=c == "z") for c in "xyz"),
    lambda at, tx, ty, tz: [tx, ty, tz],
    common=False,
    measurement=True,
    cause="What {at} sees does not stand on the platform where the machine file says.",
    result="Readings shift with the orientation of the platform.",
    action="Measure the tool offset, or turn the tool by 180 degrees and measure again.",
)
RUNOUT = Effect(
    "runout",
    "runout of the spindle or reflector",
    "",
    "ISO 230-7 (runout)",
    "tool",
    (EffectParameter("c", "um", 60, "eccentricity at angle 0"), EffectParameter("s", "um", 60, "across it")),
    _runout,
    needs=("spindle",),
    common=False,
    measurement=True,
    cause="Tool or reflector at {at} runs out.",
    result="Readings circle with the angle of the spindle.",
    action="Clamp the reflector anew, or measure always at the same spindle angle.",
)
