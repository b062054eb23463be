"""Effects put into their sockets, with their parameters: those that a machine declares, and any others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from pkmcal_cli.base.errors import BadInput, did_you_mean
from pkmcal_cli.effects import Effect, catalogue
from pkmcal_cli.language.effect_entries import EffectNumber, unit_at
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.effect_sites import PlacedEffect, Socket, Sockets, places
from pkmcal_cli.model.model import Model, ModelParameter

_FRAME: Final = "frame"
_AWAY = 20.0  # sizes of the machine: how far away an instrument may stand
Placed = tuple[tuple[PlacedEffect, ...], tuple[ModelParameter, ...]]


def declared_effects(machine: Machine, sockets: Sockets, length: float) -> Placed:
    """The effects of a machine file, and poses of frames that are fitted. Raises BadInput with places that are none.

    `length`: size of the machine, m; the frame of an instrument may stand some sizes away.
    """
    effects: list[PlacedEffect] = []
    parameters: list[ModelParameter] = []
    faults = []
    for name, entries in machine.effects.items():
        keyword, _, at = name.partition("@")
        effect = catalogue()[keyword]
        known = places(sockets, effect, (at,))
        if at not in known:
            listed = f"it can sit at {', '.join(list(known)[:12])}" if known else "this machine has no place for it"
            what = f"`{keyword}` cannot sit at `{at}`"
            hint = did_you_mean(at, known, listed)
            faults.append(machine.source.fault("unknown-name", what, ("effects", name), hint, at_key=True))
            continue
        placed, mine = placed_effect(effect, at, known[at], machine.space == "planar", entries)
        effects.append(placed)
        parameters += mine
    if faults:
        raise BadInput(faults)
    for name, sensor in machine.sensors.items():
        if sensor.frame not in (None, "machine") and f"{_FRAME}@{name}" not in machine.effects:
            placed, mine = _fitted_frame(name, sockets[_FRAME][name], machine.space == "planar", length)
            effects.append(placed)
            level = not any(c in ("x", "y", "z") for c in sensor.reads)  # it does not see where it stands
            mine = tuple(replace(p, identify=not (level and p.dimension == "length")) for p in mine)
            parameters += [replace(p, per_session=sensor.frame != "fitted") for p in mine]
    return tuple(effects), tuple(parameters)


def _fitted_frame(
    name: str, sockets: tuple[Socket, ...], planar: bool, length: float
) -> tuple[PlacedEffect, tuple[ModelParameter, ...]]:
    """The pose of an instrument that may stand anywhere."""
    placed, parameters = placed_effect(catalogue()[_FRAME], name, sockets, planar)
    away = {"length": (_AWAY * length, "mm"), "angle": (math.pi, "deg")}
    return placed, tuple(replace(p, range=away[p.dimension][0], unit=away[p.dimension][1]) for p in parameters)


def placed_effect(
    effect: Effect,
    at: str,
    sockets: tuple[Socket, ...],
    planar: bool,
    entries: Mapping[str, EffectNumber] | None = None,
) -> tuple[PlacedEffect, tuple[ModelParameter, ...]]:
    """An effect at a place and its parameters: values and ranges of the entries, else null and the plausible range."""
    entries = entries or {}
    rotary = any(s.kind == "rotary" for s in sockets)
    parameters = []
    for spec in effect.used(planar):
        unit, entry = unit_at(spec, rotary), entries.get(spec.name, EffectNumber())
        spread = spec.range_in(rotary) * unit.scale if entry.range is None else entry.range
        low, high = spec.possible
        bounds = entry.bounds or (low * unit.scale, high * unit.scale)
        name = f"{effect.keyword}@{at}.{spec.name}"
        dimension = unit.dimension.name
        text = "" if unit.text == "1" else unit.text
        parameters.append(
            ModelParameter(
                name=name,
                nominal=entry.value,
                range=spread,
                bounds=bounds,
                unit=text,
                dimension=dimension,
                identify=entry.identify,
            )
        )
    options = {
        option.name: entries[option.name].interval or (entries[option.name].value,)
        for option in effect.options
        if option.name in entries
    }
    return PlacedEffect(effect, at, sockets, tuple(p.name for p in parameters), options), tuple(parameters)


def possible_effects(model: Model, sessions: tuple[str, ...] = ()) -> list[tuple[Effect, str, tuple[Socket, ...]]]:
    """Every effect of the catalogue at every place of a receptive model: (effect, place, sockets)."""
    return [
        (effect, at, sockets)
        for effect in catalogue().values()
        for at, sockets in places(model.sockets, effect, sessions).items()
    ]
