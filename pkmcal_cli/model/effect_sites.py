"""Where effects can enter a compiled machine, by name of the place; the effects that are put there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import Effect, EffectParameter, Entry
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.parts import ModelParameter

_STEP = 1e-40
_FELT = 1e-12  # m, rad, ... at effects of the size of one: less is rounding
_AT_SENSORS = ("frame", "tool")  # entries whose places are sensors: other kinds of these are other instruments
NONE: Index = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True, kw_only=True)
class EffectSite:
    """Coefficients c that one entry displaces by numbers d (W,): c += matrix d, or c *= exp(matrix d) where `scales`.

    The rest is what formulas may ask for: the drive, the member (group, element), a length (m), the place (m), the
    share of gravity along the entry's directions. `part`: name of a temperature column; `weight`: pull at this site
    over that of the member; `straight`: whether the member has a direction.
    """

    part: str
    coefficients: Index = field(default_factory=lambda: NONE)  # (K,)
    matrix: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (K, W)
    scales: bool = False
    actuator: int = -1
    member: tuple[int, int] = (-1, -1)
    weight: float = 1.0
    straight: bool = True
    length: float = 1.0
    leg: int = -1  # the drive that sets the length of the member, which is `length` at its reference reading
    folds: float = 1.0  # line that a spool winds per travel of its rope
    at: Array = field(default_factory=lambda: np.zeros(3))
    down: Array = field(default_factory=lambda: np.zeros(3))
    kind: str = "linear"  # of a drive: linear, rotary, spool; of a sensor: coordinates, length, rotary
    period: float = float("nan")  # lead of its screw or period of its encoder, m or rad of travel

    @property
    def place(self) -> tuple[int, int, int]:
        """What tells the forces of effect sites apart: the drive, the member."""
        return (self.actuator, *self.member)


EffectSites = Mapping[Entry, Mapping[str, tuple[EffectSite, ...]]]
"""By entry and name of the place; a place may have several effect sites (carriages of a guide, pieces of a beam)."""
ALL = "all"
"""Name of the place of an effect that is the same everywhere."""
EACH = "each"
"""Where an effect has values of its own at all places, `each`, or at those of a group, `each:GROUP`."""
EffectGroups = Mapping[str, tuple[str, ...]]
"""Names of places that may err alike, by name of the group."""


def in_session(place: str, session: str) -> str:
    """Where an effect sits that acts in one session only: `q1[s2]`."""
    return f"{place}[{session}]"


def place_and_session(at: str) -> tuple[str, str]:
    """The place, and the session in whose rows an effect acts that sits there: "" for all."""
    place, bracket, session = at.partition("[")
    return place, session.removesuffix("]") if bracket else ""


@dataclass(frozen=True)
class PlacedEffect:
    """An effect at a place; `parameters`: full names, in the order of the effect's; `options` in SI."""

    effect: Effect
    at: str
    sites: tuple[EffectSite, ...]
    parameters: tuple[str, ...]
    options: Mapping[str, tuple[float, ...]]
    session: str = ""  # whose instance it is, where each session has its own

    @cached_property
    def name(self) -> str:
        """`KEYWORD@PLACE`."""
        return f"{self.effect.keyword}@{self.at}" + (f"[{self.session}]" if self.session else "")

    @cached_property
    def acts_in(self) -> str:
        """The session in whose rows it acts; "" for all."""
        of_place = self.at if self.effect.places == "session" else place_and_session(self.at)[1]
        return self.session or of_place

    @cached_property
    def numbers(self) -> tuple[str, ...]:
        """Names of its parameters in its formula."""
        return tuple(p.removesuffix(f"[{self.session}]").rpartition(".")[2] for p in self.parameters)

    def of_session(self, session: str) -> PlacedEffect:
        """Its instance for a session, with parameters of its own."""
        return replace(self, parameters=tuple(f"{p}[{session}]" for p in self.parameters), session=session)


def instances(
    effects: Sequence[PlacedEffect], parameters: Sequence[ModelParameter], sessions: Sequence[str]
) -> tuple[tuple[PlacedEffect, ...], tuple[ModelParameter, ...]]:
    """Effects and parameters with one of each session in place of those that sessions have for themselves."""
    each = {p.name for p in parameters if p.per_session}
    placed, named = list[PlacedEffect](), list[ModelParameter]()
    for e in effects:
        placed += [e.of_session(s) for s in sessions] if each.intersection(e.parameters) else [e]
    for p in parameters:
        named += [p.of_session(s) for s in sessions] if p.per_session else [p]
    return tuple(placed), tuple(named)


@dataclass(frozen=True)
class AtSite:
    """What formulas may ask for that is the same in every row."""

    site: EffectSite

    @property
    def length(self) -> Array | float:
        """Nominal length of the member, or radius of the spool, m."""
        return self.site.length

    @property
    def folds(self) -> float:
        """Line that the spool winds per travel of its rope."""
        return self.site.folds

    @property
    def at(self) -> Array:
        """Place (3,) of a base point."""
        return self.site.at

    @property
    def down(self) -> Array:
        """Gravity along the entry's directions."""
        return self.site.down


@dataclass(frozen=True)
class _Ordinary(AtSite):
    """What formulas may ask for in an ordinary row: nothing is zero by chance; see `effects.Inputs`."""

    rows: int = 1
    travel = normalised_travel = centred_travel = reading = pull = commanded_force = np.array([0.7])
    time = normalised_time = temperature_rise = payload = spindle = np.array([0.7])
    direction = motion = np.array([1.0])

    @property
    def chord(self) -> Array:
        """A direction, of what has one."""
        return np.array([[0.48, 0.6, 0.64]]) * self.site.straight

    def lagged(self, tau: Any) -> Array:
        return np.asarray(self.temperature_rise / (1.0 + tau))

    def option(self, name: str) -> float:
        return 1.9


def _sizes(effect: Effect) -> dict[str, complex]:
    """Ordinary values of the parameters of an effect."""
    return {p.name: 0.3 + 0.1 * k for k, p in enumerate(effect.parameters)}


def _acts(effect: Effect, site: EffectSite) -> bool:
    """Whether an effect displaces an effect site at all: sag needs gravity across the guide, growth a length."""
    moved = effect.displacement(_Ordinary(site), _sizes(effect)) @ site.matrix.T
    return bool(np.abs(moved).max(initial=0.0) > _FELT)


def parameters_at(effect: Effect, sites: Sequence[EffectSite], planar: bool) -> tuple[EffectParameter, ...]:
    """The parameters of an effect that displace something at some of its effect sites: a ballbar has no rotation.

    All of them where it has no effect site, as without gravity.
    """
    used = effect.used(planar)
    return tuple(p for p in used if any(_displaces(effect, p, site) for site in sites)) if sites else used


def _displaces(effect: Effect, parameter: EffectParameter, site: EffectSite) -> bool:
    sizes = _sizes(effect)
    sizes[parameter.name] += 1j * _STEP
    by_parameter = np.imag(effect.displacement(_Ordinary(site), sizes)) / _STEP
    return bool(np.abs(by_parameter @ site.matrix.T).max(initial=0.0) > _FELT)


def places(
    sites: EffectSites, effect: Effect, sessions: tuple[str, ...] = (), groups: EffectGroups | None = None
) -> dict[str, tuple[EffectSite, ...]]:
    """Where an effect can sit and does something, by name; `all` where it can be the same at several places.

    `sessions`: those in one of which it can act; `groups`: those in which it can be the same. Of instruments, only such
    of one group have the same everywhere. No number is both an angle and a length: then drives that turn and others do
    not have the same one.
    """
    named = fitting(sites, effect, lambda site: _acts(effect, site))
    everywhere = tuple(s for sites_here in named.values() for s in sites_here)
    if effect.places == "session":
        return dict.fromkeys(sessions if everywhere else (), everywhere)
    if effect.places == "all":
        return {ALL: everywhere} if everywhere else {}
    of_sessions = (
        {in_session(at, s): members for at, members in named.items() for s in sessions} if effect.by_session else {}
    )
    if effect.common and len(named) > 1:
        alike = {g: tuple(s for m in members for s in named[m]) for g, members in _some(named, groups or {}).items()}
        every = {ALL: everywhere} if effect.enters not in _AT_SENSORS or _in_one_group(named, groups or {}) else {}
        common = every | {g: members for g, members in alike.items() if g not in named}
        named |= {name: members for name, members in common.items() if _of_one_unit(effect, members)}
    return named | of_sessions


def _of_one_unit(effect: Effect, sites: Sequence[EffectSite]) -> bool:
    """Whether an effect has numbers of the same units at all effect sites."""
    return not effect.turns_units or len({site.kind == "rotary" for site in sites}) < 2


def together(
    sites: EffectSites, effect: Effect, groups: EffectGroups, sessions: tuple[str, ...] = ()
) -> dict[str, tuple[str, ...]]:
    """Places at which an effect may have values of its own together, by name: of groups, all of them, of sessions."""
    if effect.places in ("session", "all") or (effect.enters in _AT_SENSORS and not effect.common):
        return {}
    named = fitting(sites, effect, lambda site: _acts(effect, site))
    by_group = {f"{EACH}:{g}": members for g, members in _some(named, groups).items()}
    alike = _in_one_group(named, groups)
    of_sessions = _anew(tuple(named), sessions) if effect.by_session and EACH not in sessions else {}
    return ({EACH: tuple(named)} if len(named) > 1 and alike else {}) | by_group | of_sessions


def group_of_all(
    named: Mapping[str, tuple[EffectSite, ...]], groups: EffectGroups, at: str
) -> dict[str, tuple[EffectSite, ...]]:
    """The group of a name, where an effect is the same at all of its places and these are all in it: like `all`."""
    members = set(groups.get(at, ()))
    places_ = {n.partition(".")[0] for n in named if n != ALL and "[" not in n and n not in groups}
    return {at: named[ALL]} if ALL in named and members and places_ <= members else {}


def _in_one_group(named: Iterable[str], groups: EffectGroups) -> bool:
    """Whether all places are those of one group: what is not alike does not err alike."""
    parts = {n.partition(".")[0] for n in named}
    return any(parts <= set(members) for members in groups.values())


def _anew(named: tuple[str, ...], sessions: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Places, alike or not, that are set anew together in one session; one of them, or all, in every later session.

    A machine that was switched off is homed as a whole.
    """
    later = sessions[1:]  # the first is the datum
    every = {in_session(EACH, s): tuple(in_session(n, s) for n in named) for s in sessions}
    each = {in_session(n, EACH): tuple(in_session(n, s) for s in later) for n in named}
    both = {in_session(EACH, EACH): tuple(in_session(n, s) for n in named for s in later)}
    return (every if len(named) > 1 else {}) | (each if later else {}) | (both if later and len(named) > 1 else {})


def _some(named: Mapping[str, object], groups: EffectGroups) -> dict[str, tuple[str, ...]]:
    """The places in each group, `left.x` with `left`: several, and not all; those of one group are in no other."""
    parts = {g: tuple(n for n in named if n.partition(".")[0] in members) for g, members in groups.items()}
    parts = {g: inside for g, inside in parts.items() if 1 < len(inside) < len(named)}
    return {g: inside for g, inside in parts.items() if inside not in [parts[o] for o in parts][: [*parts].index(g)]}


def fitting(
    sites: EffectSites, effect: Effect, accepts: Callable[[EffectSite], bool] = lambda site: True
) -> dict[str, tuple[EffectSite, ...]]:
    """Effect sites of an effect's kind, by name of the place; those that `accepts` says."""
    return {
        name: kept
        for name, every in sites.get(effect.enters, {}).items()
        if (kept := tuple(s for s in every if effect.where in ("any", s.kind) and accepts(s)))
    }
