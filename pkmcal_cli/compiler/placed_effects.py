"""Effects put into their effect sites, with their parameters: those that a machine declares, and any others."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Final

from pkmcal_cli.base.errors import Fault, FaultList, did_you_mean
from pkmcal_cli.effects import ABSENT, KINDS, Effect, catalogue
from pkmcal_cli.effects.unexplained import ENTRIES as SHAPE_ENTRIES
from pkmcal_cli.effects.unexplained import UNEXPLAINED, Unexplained, place_and_axis, unexplained
from pkmcal_cli.language.channels import kind_of_sensor
from pkmcal_cli.language.effect_entries import unit_at
from pkmcal_cli.language.effect_numbers import EffectNumber, Entries
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.shape_entries import shape_of
from pkmcal_cli.model.effect_sites import (
    ALL,
    EACH,
    EffectSite,
    EffectSites,
    PlacedEffect,
    fitting,
    group_of_all,
    parameters_at,
    place_and_session,
    places,
)
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import ModelParameter
from pkmcal_cli.units.file_units import UNITS

_FRAME: Final = "frame"
_KNOWN = 1e-6  # standard uncertainty of a weight that is exact
_AWAY = 20.0  # sizes of the machine: how far away an instrument may stand
Placed = tuple[tuple[PlacedEffect, ...], tuple[ModelParameter, ...]]


def declared_effects(machine: Machine, model: Model) -> Placed:
    """The effects of a machine file, and poses of frames that are fitted. Raises BadInput with places that are none.

    The frame of an instrument may stand some sizes of the machine away.
    """
    sites = model.sites
    effects: list[PlacedEffect] = []
    parameters: list[ModelParameter] = []
    faults = FaultList()
    for name, entries in machine.effects.items():
        keyword, _, at = name.partition("@")
        if keyword == UNEXPLAINED:
            shape = _placed_shape(machine, sites, at, entries)
            if isinstance(shape, Fault):
                faults.add(shape)
                continue
            effects.append(shape)
            parameters += weights_of(shape)
            continue
        effect = catalogue()[keyword]
        known = _places_for(machine, model, effect, at)
        if at not in known:
            faults.add(_no_place(machine, sites, effect, at, known))
            continue
        placed, own_parameters = placed_effect(effect, at, known[at], machine.space == "planar", entries, model.length)
        for fault in _idle_numbers(machine, placed, entries):
            faults.add(fault)
        effects.append(placed)
        parameters += own_parameters
    faults.raise_if_any()
    for name, sensor in machine.sensors.items():
        if sensor.frame not in (None, "machine") and f"{_FRAME}@{name}" not in machine.effects:
            placed, own_parameters = _fitted_frame(name, sites[_FRAME][name], machine.space == "planar", model.length)
            effects.append(placed)
            parameters += [replace(p, per_session=sensor.frame != "fitted") for p in own_parameters]
    return tuple(effects), tuple(parameters)


def _placed_shape(machine: Machine, sites: EffectSites, at: str, entries: Entries) -> PlacedEffect | Fault:
    """A displacement without a name where the file puts it, or why it cannot be there."""
    place, axis = place_and_axis(at)
    known = {name: entry for entry in SHAPE_ENTRIES for name in sites.get(entry, {})}
    if place not in known or (axis == "time" and known[place] != "command"):
        message = f"`{UNEXPLAINED}` cannot be placed at `{at}`"
        hint = did_you_mean(place, known, f"use one of {', '.join(known)}")
        return machine.source.fault("unknown-name", message, ("effects", f"{UNEXPLAINED}@{at}"), hint, at_key=True)
    return placed_shape(unexplained(known[place], shape_of(entries), axis), at, sites[known[place]][place])


def placed_shape(effect: Unexplained, at: str, sites: tuple[EffectSite, ...]) -> PlacedEffect:
    """A displacement without a name at a place."""
    return PlacedEffect(effect, at, sites, tuple(f"{UNEXPLAINED}@{at}.{p.name}" for p in effect.parameters), {})


def weights_of(placed: PlacedEffect) -> tuple[ModelParameter, ...]:
    """The weights of a shape: as they are known, held, or of unit variance."""
    assert isinstance(placed.effect, Unexplained)
    shape = placed.effect.shape
    return tuple(
        ModelParameter(
            name=name,
            nominal=float(weight),
            range=2.0 * max(float(std), _KNOWN),
            bounds=(-math.inf, math.inf),
            unit="",
            dimension="number",
            identify=False,
            kind=UNEXPLAINED,
            stated=shape.values is not None,
        )
        for name, weight, std in zip(placed.parameters, shape.weights, shape.known_std, strict=True)
    )


def _places_for(machine: Machine, model: Model, effect: Effect, at: str) -> Mapping[str, tuple[EffectSite, ...]]:
    """Places where a file may declare an effect, by name; one that acts by gravity also without."""
    session = at if effect.places == "session" else place_and_session(at)[1]
    if not weightless(machine, effect):
        known = places(model.sites, effect, (session,) if session else (), model.effect_groups)
        return known | group_of_all(known, machine.groups, at)
    return dict.fromkeys((ALL,) if effect.places == "all" else fitting(model.sites, effect), ())


def weightless(machine: Machine, effect: Effect) -> bool:
    """Whether an effect acts by a gravity that the machine has not."""
    acts = machine.has_gravity and (machine.own_weight or effect.enters != "weight")
    return effect.weighty and not acts


def absence(machine: Machine, sites: EffectSites, effect: Effect) -> str:
    """Why an effect has no place on a machine."""
    if effect.weighty and not machine.has_gravity:
        return "no gravity"
    if weightless(machine, effect):
        return effect.nowhere
    if not sites.get(effect.enters):
        return ABSENT[effect.enters]
    return effect.nowhere if fitting(sites, effect) else KINDS[effect.where]


def _no_place(machine: Machine, sites: EffectSites, effect: Effect, at: str, known: Collection[str]) -> Fault:
    """Why an effect cannot be where the machine file puts it."""
    message = f"`{effect.keyword}` cannot be placed at `{at}`"
    listed = f"use one of {', '.join(list(known)[:12])}" if known else "delete it: this machine has no place for it"
    hint = _one_by_one(effect, at, known) or did_you_mean(at, known, listed)
    if effect.enters == _FRAME and at in machine.sensors:
        kind = kind_of_sensor(machine.sensors[at])
        message += f": {kind.unmoved.get(effect.keyword, 'nothing that it reads depends on it')}"
        others = [e.keyword for e in catalogue().values() if e.enters == _FRAME and at in places(sites, e)]
        hint = f"delete it; effects at `{at}`: {', '.join(others)}" if others else "delete it"
    return machine.source.fault("unknown-name", message, ("effects", f"{effect.keyword}@{at}"), hint, at_key=True)


def _one_by_one(effect: Effect, at: str, known: Collection[str]) -> str:
    """How an effect is written that `diagnose` calls one at each of several places; "" where it is not."""
    word, _, group = at.partition(":")
    single = [name for name in known if name != ALL and "[" not in name]
    if word != EACH or not single:
        return ""
    where = f"at each place of {group}" if group else "at each place"
    return f"write it {where} by itself, `{effect.keyword}@{single[0]}` and so on, or with one value at `{ALL}`"


def _idle_numbers(machine: Machine, placed: PlacedEffect, entries: Mapping[str, EffectNumber]) -> Iterator[Fault]:
    """Numbers of an effect that nothing at its place depends on."""
    constants = {option.name for option in placed.effect.options}
    for key in entries:
        if key not in constants and key not in placed.numbers:
            message = f"nothing at `{placed.at}` depends on `{key}` of `{placed.effect.keyword}`"
            hint = f"delete it; parameters there: {', '.join(placed.numbers)}"
            yield machine.source.fault("unknown-name", message, ("effects", placed.name, key), hint, at_key=True)


def _fitted_frame(
    name: str, sites: tuple[EffectSite, ...], planar: bool, length: float
) -> tuple[PlacedEffect, tuple[ModelParameter, ...]]:
    """The pose of an instrument that may stand anywhere."""
    placed, parameters = placed_effect(catalogue()[_FRAME], name, sites, planar)
    away = {"length": (_AWAY * length, "mm"), "angle": (math.pi, "deg")}
    return placed, tuple(replace(p, range=away[p.dimension][0], unit=away[p.dimension][1]) for p in parameters)


def placed_effect(
    effect: Effect,
    at: str,
    sites: tuple[EffectSite, ...],
    planar: bool,
    entries: Mapping[str, EffectNumber] | None = None,
    size: float = 0.0,
) -> tuple[PlacedEffect, tuple[ModelParameter, ...]]:
    """An effect at a place and its parameters: values and ranges of the entries, else null and the plausible range.

    The latter is that of a machine of 1 m; lengths grow with the size of larger ones, m.
    """
    entries = entries or {}
    rotary = any(s.kind == "rotary" for s in sites)
    parameters = []
    for spec in parameters_at(effect, sites, planar):
        unit, entry = unit_at(spec, rotary), entries.get(spec.name, EffectNumber())
        grown = max(size, 1.0) if unit.dimension == UNITS["m"].dimension else 1.0
        spread = spec.range_in(rotary) * unit.scale * grown if entry.range is None else entry.range
        low, high = spec.possible
        bounds = entry.bounds or (low * unit.scale, high * unit.scale)
        name = f"{effect.keyword}@{at}.{spec.name}"
        text = "" if unit.text == "1" else unit.text
        known = spec.known is not None and entry.identify is not True
        parameters.append(
            ModelParameter(
                name=name,
                nominal=entry.value,
                range=spread,
                bounds=bounds,
                unit=text,
                dimension=unit.dimension.name,
                identify=not known if entry.identify is None else entry.identify,
                kind=effect.keyword,
                fixed=known and entry.range is None,
                stated=entry.range is not None,
            )
        )
    options = _constants(effect, entries)
    return PlacedEffect(effect, at, sites, tuple(p.name for p in parameters), options), tuple(parameters)


def _constants(effect: Effect, entries: Mapping[str, EffectNumber]) -> dict[str, tuple[float, ...]]:
    """The constants of an effect that its entries state, SI."""
    return {
        option.name: entries[option.name].interval or (entries[option.name].value,)
        for option in effect.options
        if option.name in entries
    }


def possible_effects(model: Model, sessions: tuple[str, ...] = ()) -> list[tuple[Effect, str, tuple[EffectSite, ...]]]:
    """Every effect of the catalogue at every place of a receptive model: (effect, place, effect sites)."""
    return [
        (effect, at, sites)
        for effect in catalogue().values()
        for at, sites in places(model.sites, effect, sessions, model.effect_groups).items()
    ]
