"""The compiled machine: index arrays, the systems to solve, parameters, drives and channels. It never changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import nan

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.branch import Mode, drawn_mode
from pkmcal_cli.equilibrium.kinematics import drawn_state
from pkmcal_cli.equilibrium.mobility import rank, strain_rows
from pkmcal_cli.equilibrium.system import DriveState, System, build_system
from pkmcal_cli.language.fingerprint import Fingerprint
from pkmcal_cli.mechanism.topology import GROUND, Index, Layout
from pkmcal_cli.model.effect_sites import PlacedEffect, Sockets
from pkmcal_cli.model.observed import PlacedSensor, View

_SYSTEMS = ("exact", "rigid", "released", "independent_coordinates", "inverse", "drawn_slots", "drawn_mode")
"""Cached properties that depend on the layout only."""


@dataclass(frozen=True, kw_only=True)
class ModelParameter:
    """A parameter in SI: `range` is the half-width about nominal, two standard deviations of the prior.

    `session`: the session in whose rows it holds, "" in all; `per_session`: each session of a table has its own.
    """

    name: str
    nominal: float
    range: float
    bounds: tuple[float, float]
    unit: str  # for display
    dimension: str
    identify: bool
    per_session: bool = False
    session: str = ""

    @property
    def shared_name(self) -> str:
        """The name without its session."""
        return self.name.removesuffix(f"[{self.session}]")

    def of_session(self, session: str) -> ModelParameter:
        """Its instance for a session."""
        return replace(self, name=f"{self.name}[{session}]", per_session=False, session=session)


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """A drive seen from the control: position = value of its slot at reading zero + gain * reading."""

    name: str
    gain_slot: int
    limits: tuple[float, float]
    sigma: float  # standard uncertainty of the position, m or rad of travel (a spool's: of its line); nan: none
    unit: str
    dimension: str
    force_slot: int  # constant force of a force-controlled drive where no column gives it, N or N m


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One measured quantity.

    quantity: "position" (coordinate of a point), "orientation", "drive" (reading of a drive that does not hold its
    position), "distance", "angle", "force" or "bench".
    """

    name: str
    quantity: str
    index: int  # point, rotation or drive
    component: int
    sigma: float  # SI; nan where none is declared
    unit: str
    dimension: str
    sigma_per_length: float = 0.0  # growth of sigma with distance or length
    once: float = nan  # what was measured once, on the bench, SI


@dataclass(frozen=True, kw_only=True)
class Model:
    """What `predict` works on."""

    name: str
    layout: Layout
    parameters: tuple[ModelParameter, ...]
    actuators: tuple[Actuator, ...]
    channels: tuple[Channel, ...]
    length: float  # size of the machine, m
    drawn_readings: Array  # (A,) readings of the drives at the assembled drawing
    tcp: tuple[int, int]  # point and rotation (-1: none) at which poses are given
    tcp_drawn: Array  # (6,) coordinates there at the assembled drawing
    views: tuple[View, ...]  # what sensors and channels see of the structure
    direct: tuple[tuple[int, int], ...]  # (channel, view): channels that are views as they are
    sensors: tuple[PlacedSensor, ...] = ()
    base: Index = field(default_factory=lambda: np.zeros((0, 3), dtype=np.intp))  # (B, 3) slots of places of the base
    base_turns: Index = field(default_factory=lambda: np.zeros((0, 3), dtype=np.intp))  # (F, 3) of its frames' turns
    datum: tuple[str, ...] = ()  # parameters that define the base frame where nothing else does
    correlated: tuple[tuple[int, int, float], ...] = ()  # channels whose noise is correlated, and how much
    sockets: Sockets = field(default_factory=dict)  # empty unless compiled to take effects
    effects: tuple[PlacedEffect, ...] = ()
    fitted_frames: frozenset[str] = frozenset()  # sensors that stand anywhere
    fingerprint: Fingerprint = field(default_factory=Fingerprint)  # of the machine that was read

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameter names, the order of every parameter vector."""
        return tuple(p.name for p in self.parameters)

    @property
    def nominal(self) -> Array:
        """Nominal values (P,), SI."""
        return np.array([p.nominal for p in self.parameters])

    @property
    def ranges(self) -> Array:
        """Half-widths (P,), SI."""
        return np.array([p.range for p in self.parameters])

    @property
    def gains(self) -> Array:
        """Travel per reading of each drive (A,), without sign, at nominal parameters."""
        return np.abs(self.layout.slots.constants[[a.gain_slot for a in self.actuators]])

    def by_name(self, values: Array) -> Mapping[str, float]:
        """Values (P,) as a mapping; those of the first session also by their shared names."""
        return self.by_session(values)[0]

    def by_session(self, values: Array) -> tuple[Mapping[str, float], ...]:
        """Values (P,) as mappings, one for each of `sessions` (one where there is none)."""
        every = dict(zip(self.names, (float(v) for v in values), strict=True))
        found = []
        for session in self.sessions or ("",):
            mine = {p.shared_name: every[p.name] for p in self.parameters if p.session and p.session == session}
            found.append({**every, **mine})
        return tuple(found)

    @cached_property
    def sessions(self) -> tuple[str, ...]:
        """Sessions that have parameters of their own."""
        return tuple(dict.fromkeys(p.session for p in self.parameters if p.session))

    def for_sessions(self, names: tuple[str, ...]) -> Model:
        """The model with an instance for each session of parameters and effects that have one; as it is for one."""
        each = [p.name for p in self.parameters if p.per_session]
        if len(names) < 2 or not each:
            return self
        parameters: list[ModelParameter] = []
        for p in self.parameters:
            parameters += [p.of_session(s) for s in names] if p.per_session else [p]
        effects: list[PlacedEffect] = []
        for e in self.effects:
            effects += [e.of_session(s) for s in names] if set(e.parameters) & set(each) else [e]
        return self._with(tuple(effects), tuple(parameters))

    def with_effects(self, effects: tuple[PlacedEffect, ...], parameters: tuple[ModelParameter, ...]) -> Model:
        """The model with further effects and their parameters."""
        return self._with(self.effects + effects, self.parameters + parameters)

    def with_options(self, effects: tuple[PlacedEffect, ...]) -> Model:
        """The model with other constants of its effects."""
        return self._with(effects, self.parameters)

    def with_nominal(self, values: Array) -> Model:
        """The model with other nominal values (P,)."""
        parameters = tuple(replace(p, nominal=float(v)) for p, v in zip(self.parameters, values, strict=True))
        return self._with(self.effects, parameters)

    def _with(self, effects: tuple[PlacedEffect, ...], parameters: tuple[ModelParameter, ...]) -> Model:
        made = replace(self, effects=effects, parameters=parameters)
        made.__dict__.update({name: self.__dict__[name] for name in _SYSTEMS if name in self.__dict__})
        return made

    @cached_property
    def exact(self) -> System:
        """All drives hold position or force; loads act."""
        forced = [d.force_controlled for d in self.layout.drives]
        states = tuple(DriveState.FORCED if f else DriveState.ENGAGED for f in forced)
        return build_system(self.layout, states, loaded=True)

    @cached_property
    def rigid(self) -> System:
        """Redundant drives released, no loads: the non-redundant substructure (Ecorchard 2010, section 3.1.1)."""
        free = [d.force_controlled or d.redundant for d in self.layout.drives]
        states = tuple(DriveState.RELEASED if f else DriveState.ENGAGED for f in free)
        return build_system(self.layout, states, loaded=False)

    @cached_property
    def released(self) -> System:
        """All drives released, no loads: the mechanism's own freedom."""
        return build_system(self.layout, (DriveState.RELEASED,) * len(self.layout.drives), loaded=False)

    @cached_property
    def independent_coordinates(self) -> tuple[str, ...]:
        """TCP coordinates that the mechanism moves independently, in the order x ... rz."""
        chosen: tuple[str, ...] = ()
        best = 0
        for direction in ("", *(d for group in self.layout.aims for d in group.element.strains)):
            aim = (*chosen, direction) if direction else ()
            system = self._aimed(aim)
            state = drawn_state(self.layout, self.drawn_slots, 1, system.constraints)
            now = rank(strain_rows(system, self.drawn_slots, state, self.length).jacobian)
            if direction and now > best:
                chosen = aim
            best = max(best, now)
        return chosen

    @cached_property
    def inverse(self) -> System:
        """All drives released, the TCP held at its independent coordinates: inverse positions."""
        return self._aimed(self.independent_coordinates)

    def _aimed(self, aim: tuple[str, ...]) -> System:
        return build_system(self.layout, (DriveState.RELEASED,) * len(self.layout.drives), False, aim)

    @cached_property
    def drawn_slots(self) -> Array:
        """Slots (1, S) at nominal parameters with every drive at the assembled drawing; not to be written to."""
        slots = self.layout.slots.values(self.by_name(self.nominal))[None]
        for a, (drive, actuator) in enumerate(zip(self.layout.drives, self.actuators, strict=True)):
            slots[:, drive.slot] += slots[:, actuator.gain_slot] * self.drawn_readings[a]
        slots.flags.writeable = False
        return slots

    @cached_property
    def drawn_mode(self) -> Mode | None:
        """Assembly mode of the substructure at the drawing."""
        state = drawn_state(self.layout, self.drawn_slots, 1, self.rigid.constraints)
        return drawn_mode(self.rigid, self.drawn_slots, state, self.length)


def tcp_model(model: Model) -> Model:
    """The model with all coordinates of the TCP as channels, whatever its sensors read."""
    point, rotation = model.tcp
    axes = 2 if model.layout.planar else 3
    channels = [
        Channel(name=c, quantity="position", index=point, component=k, sigma=np.nan, unit="m", dimension="length")
        for k, c in enumerate("xyz"[:axes])
    ]
    if rotation != GROUND:
        turns = [2] if model.layout.planar else [0, 1, 2]
        channels += [
            Channel(
                name=f"r{'xyz'[k]}",
                quantity="orientation",
                index=rotation,
                component=k,
                sigma=np.nan,
                unit="rad",
                dimension="angle",
            )
            for k in turns
        ]
    views = tuple(View(c.quantity, c.index, c.component) for c in channels)  # type: ignore[arg-type]
    direct = tuple((k, k) for k in range(len(channels)))
    return replace(model, channels=tuple(channels), views=views, direct=direct, sensors=(), correlated=())
