"""Thermal effects; temperatures are taken above a reference, 20 degC where nothing is said (ISO 1)."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects.effect import Effect, EffectParameter, Inputs, Option

_REFERENCE = Option(name="reference", unit="degC", text="temperature at which the effect is zero; default: 20 degC")
_EXPANSION = "um/(m*K)"
_LAG = EffectParameter(
    name="lag", unit="min", range=120, text="time constant of the lag of the part behind its sensor", possible=(0, 1000)
)


def _per_kelvin(size: float, label: str) -> tuple[EffectParameter, ...]:
    """Parameters of a shift along each axis, and of its lag."""
    axes = (
        EffectParameter(
            name=f"g{c}", unit="um/K", range=size, text=f"{label} along {c} per unit of temperature", spatial=c == "z"
        )
        for c in "xyz"
    )
    return (*axes, _LAG)


def _base(at: Inputs, a: Any, lag: Any) -> Any:
    temperature_rise = at.lagged(lag)
    return [a * at.at[k] * temperature_rise for k in range(3)]


def _shift(at: Inputs, gx: Any, gy: Any, gz: Any, lag: Any) -> Any:
    temperature_rise = at.lagged(lag)
    return [gx * temperature_rise, gy * temperature_rise, gz * temperature_rise]


STRUT = Effect(
    keyword="thermal_strut",
    title="thermal growth of struts, with lag",
    symbol="",
    source="linear thermal expansion; ISO 230-3",
    enters="length",
    parameters=(
        EffectParameter(
            name="a", unit=_EXPANSION, range=50, text="expansion coefficient (steel 11.5, aluminium 23, CFRP 0 to 2)"
        ),
        _LAG,
    ),
    formula=lambda at, a, lag: a * at.length * at.lagged(lag),
    needs=("temperature",),
    options=(_REFERENCE,),
    negative="only fibres of carbon, aramid or polyethylene shrink as they warm. If {at} is of another material, what "
    "holds or measures it grows: the base (`thermal_base`), a scale of a drive (`thermal_screw`), the instrument.",
    cause="{at} grows with temperature.",
    result="The length of {at} follows the temperature (with a lag behind its sensor, if any).",
    action="Measure the temperature of {at} and compensate, or use low-expansion members.",
)
SCREW = Effect(
    keyword="thermal_screw",
    title="thermal growth of a ballscrew or scale",
    symbol="",
    source="ISO 230-3 (thermal distortion by moving axes)",
    enters="command",
    parameters=(
        EffectParameter(name="a", unit=_EXPANSION, range=50, text="expansion coefficient"),
        EffectParameter(
            name="o",
            unit="um/K",
            range=10,
            text="zero shift due to the position of the fixed bearing",
            rotary="urad/K",
            turning=20,
        ),
        _LAG,
    ),
    formula=lambda at, a, o, lag: (a * at.travel + o) * at.lagged(lag),
    needs=("temperature",),
    options=(_REFERENCE,),
    where="linear",
    cause="The screw or scale of {at} grows with temperature.",
    result="The slope and zero of the positioning error of {at} follow the temperature.",
    action="Log the temperature of {at}; cool or preload the screw, or use a linear scale.",
)
BASE = Effect(
    keyword="thermal_base",
    title="thermal growth of the base",
    symbol="",
    source="ISO 230-3 (environmental temperature variation error)",
    enters="base",
    parameters=(
        EffectParameter(name="a", unit=_EXPANSION, range=50, text="expansion coefficient of the base about its origin"),
        _LAG,
    ),
    formula=_base,
    needs=("temperature",),
    options=(_REFERENCE,),
    places="all",
    nowhere="every part of the base is at its origin",
    negative="no base shrinks as it warms. What stands on it or measures it grows: struts (`thermal_strut`), a scale "
    "of a drive (`thermal_screw`), the instrument.",
    cause="The base grows with temperature.",
    result="All points that are fixed to the base move away from its origin.",
    action="Log the temperature of the base, wait for a steady state, or compensate.",
)
FOOT = Effect(
    keyword="thermal_foot",
    title="thermal shift of one part of the base",
    symbol="",
    source="ISO 230-3 (bending of columns by temperature gradients)",
    enters="base",
    parameters=_per_kelvin(20, "shift"),
    formula=_shift,
    needs=("temperature",),
    options=(_REFERENCE,),
    common=False,
    cause="The part of the base that carries {at} moves with temperature.",
    result="One chain of the machine shifts in proportion to the temperature.",
    action="Log temperatures on both sides of the column at {at}; shield it from heat sources.",
)
TOOL = Effect(
    keyword="thermal_tool",
    title="thermal growth of spindle and tool",
    symbol="",
    source="ISO 230-3 (spindle growth)",
    enters="tool",
    parameters=_per_kelvin(10, "growth"),
    formula=_shift,
    needs=("temperature",),
    options=(_REFERENCE,),
    common=False,
    cause="The spindle, tool or reflector holder at {at} grows with temperature.",
    result="The measured point shifts with the temperature in the platform's axes.",
    action="Log the temperature of the spindle; warm up before measuring.",
)
