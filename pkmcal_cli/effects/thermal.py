"""Thermal effects; temperatures are taken above a reference, 20 degC where nothing is said (ISO 1)."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects.base import Effect, EffectParameter, Inputs, Option

_REFERENCE = Option("reference", "degC", "temperature at which the effect is zero; default 20 degC")
_EXPANSION = "um/(m*K)"
_LAG = EffectParameter("lag", "min", 120, "time constant of the part behind its sensor", possible=(0, 1000))


def _per_kelvin(size: float, what: str) -> tuple[EffectParameter, ...]:
    """Parameters of a shift along each axis, and of its lag."""
    axes = (
        EffectParameter(f"g{c}", "um/K", size, f"{what} along {c} per temperature", spatial=c == "z") for c in "xyz"
    )
    return (*axes, _LAG)


def _base(at: Inputs, a: Any, lag: Any) -> Any:
    warmth = at.lagged(lag)
    return [a * at.at[k] * warmth for k in range(3)]


def _shift(at: Inputs, gx: Any, gy: Any, gz: Any, lag: Any) -> Any:
    warmth = at.lagged(lag)
    return [gx * warmth, gy * warmth, gz * warmth]


STRUT = Effect(
    "thermal_strut",
    "thermal growth of struts, with lag",
    "",
    "linear thermal expansion; ISO 230-3",
    "length",
    (
        EffectParameter("a", _EXPANSION, 50, "expansion coefficient (steel 11.5, aluminium 23, CFRP 0 to 2)"),
        _LAG,
    ),
    lambda at, a, lag: a * at.length * at.lagged(lag),
    needs=("temperature",),
    options=(_REFERENCE,),
    cause="{at} grows with temperature.",
    result="The length of {at} follows the temperature (behind its sensor, where there is a lag).",
    action="Measure the temperature of {at} and compensate, or use members of low expansion.",
)
SCREW = Effect(
    "thermal_screw",
    "thermal growth of a ballscrew or scale",
    "",
    "ISO 230-3 (thermal distortion by moving axes)",
    "command",
    (
        EffectParameter("a", _EXPANSION, 50, "expansion coefficient"),
        EffectParameter(
            "o", "um/K", 10, "shift of the zero, by the place of the fixed bearing", rotary="urad/K", turning=20
        ),
        _LAG,
    ),
    lambda at, a, o, lag: (a * at.travel + o) * at.lagged(lag),
    needs=("temperature",),
    options=(_REFERENCE,),
    where="linear",
    cause="The screw or scale of {at} grows with temperature.",
    result="Slope and zero of the positioning error of {at} follow the temperature.",
    action="Log the temperature of {at}; cool or preload the screw, or use a linear scale.",
)  # fmt: skip
BASE = Effect(
    "thermal_base",
    "thermal growth of the base",
    "",
    "ISO 230-3 (environmental temperature variation error)",
    "base",
    (EffectParameter("a", _EXPANSION, 50, "expansion coefficient of the base about its origin"), _LAG),
    _base,
    needs=("temperature",),
    options=(_REFERENCE,),
    places="all",
    cause="The base grows with temperature.",
    result="All points fixed to the base move away from its origin.",
    action="Log the temperature of the base, wait for a steady state, or compensate.",
)
FOOT = Effect(
    "thermal_foot",
    "thermal shift of one part of the base",
    "",
    "ISO 230-3 (bending of columns by temperature gradients)",
    "base",
    _per_kelvin(20, "shift"),
    _shift,
    needs=("temperature",),
    options=(_REFERENCE,),
    common=False,
    cause="The part of the base that carries {at} moves with temperature.",
    result="One chain of the machine is shifted in proportion to the temperature.",
    action="Log temperatures on both sides of the column at {at}; shield it from heat sources.",
)
TOOL = Effect(
    "thermal_tool",
    "thermal growth of spindle and tool",
    "",
    "ISO 230-3 (spindle growth)",
    "tool",
    _per_kelvin(10, "growth"),
    _shift,
    needs=("temperature",),
    options=(_REFERENCE,),
    common=False,
    cause="Spindle, tool or reflector holder at {at} grows with temperature.",
    result="What is measured shifts with the temperature, in the platform's axes.",
    action="Log the temperature of the spindle; warm up before measuring.",
)
