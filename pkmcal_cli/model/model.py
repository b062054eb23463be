"""The compiled machine: index arrays, the systems to solve, parameters, drives and channels. It never changes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.branch import Mode, reference_mode
from pkmcal_cli.equilibrium.kinematics import reference_state
from pkmcal_cli.equilibrium.readings import ObservedQuantity
from pkmcal_cli.equilibrium.system import DriveState, System, build_system
from pkmcal_cli.language.fingerprint import Fingerprint
from pkmcal_cli.mechanism.topology import Drive, Topology
from pkmcal_cli.model.base import Base
from pkmcal_cli.model.effect_sites import EffectGroups, EffectSites, PlacedEffect, instances
from pkmcal_cli.model.freedoms import LEAST_MISFIT, ClosedPoses, Freedoms
from pkmcal_cli.model.held_points import HeldPoints
from pkmcal_cli.model.observed import PlacedSensor
from pkmcal_cli.model.parts import Actuator, Channel, LeastTension, ModelParameter
from pkmcal_cli.model.tool_motion import DIRECTIONS, AimedPoint, ToolMotion
from pkmcal_cli.model.workspace import Workspace
from pkmcal_cli.units.measurands import Measurand

_SYSTEMS = ("exact", "rigid", "released")  # cached properties that depend on the topology only,
_AT_NOMINAL = ("held_points", "reference_coefficients", "reference_mode")  # besides on nominal values, but on no effect
_AT_REST = (*_AT_NOMINAL, "overdetermined", "freedoms", "starts", "explained_misfit")  # not moved by null effects
_DOUBT = 3.0  # of the misfit that is expected


@dataclass(frozen=True, kw_only=True)
class Model:
    """What `predict` works on."""

    name: str
    topology: Topology
    parameters: tuple[ModelParameter, ...]
    actuators: tuple[Actuator, ...]
    channels: tuple[Channel, ...]
    length: float  # size of the machine, m
    reference_readings: Array  # (A,) readings of the drives at the assembled reference configuration
    tool: AimedPoint  # at which poses are given
    measured: AimedPoint  # at which the first `tcp` sensor measures poses; the tool point where there is none
    observed: tuple[ObservedQuantity, ...]  # what sensors and channels observe of the structure
    direct: tuple[tuple[int, int], ...]  # (channel, index in `observed`): channels that are observed quantities
    sensors: tuple[PlacedSensor, ...] = ()
    base: Base = field(default_factory=Base)
    workspace: Workspace | None = None
    datum: tuple[str, ...] = ()  # parameters that define the base frame where nothing else does
    correlated: tuple[tuple[int, int, float], ...] = ()  # channels whose noise is correlated, and how much
    least_tensions: tuple[LeastTension, ...] = ()
    sites: EffectSites = field(default_factory=dict)  # empty unless compiled to take effects
    effect_groups: EffectGroups = field(default_factory=dict)  # names of places of these, by name of the group
    effects: tuple[PlacedEffect, ...] = ()
    fitted_frames: frozenset[str] = frozenset()  # sensors that stand anywhere
    fingerprint: Fingerprint = field(default_factory=Fingerprint)  # of the machine that was read
    mark: bytes = field(init=False, compare=False, repr=False, default_factory=partial(os.urandom, 16))  # of copies too

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameter names, the order of every parameter vector."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def drive_names(self) -> tuple[str, ...]:
        """Names of the drives, the order of every column of readings."""
        return tuple(a.name for a in self.actuators)

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
        return np.abs(self.topology.coefficients.constants[[a.gain_coefficient for a in self.actuators]])

    def measuring(self, measurand: Measurand) -> list[int]:
        """Channels that measure it."""
        return [k for k, c in enumerate(self.channels) if c.measurand is measurand]

    def by_name(self, values: Array) -> Mapping[str, float]:
        """Values (P,) as a mapping; by the shared name of what each session has for itself, the nominal value.

        So the machine at rest, of no session: the reference configuration, what drives are set to.
        """
        return {**dict(zip(self.names, np.asarray(values).tolist(), strict=True)), **self._at_rest}

    @cached_property
    def _at_rest(self) -> Mapping[str, float]:
        """Nominal values, by shared name, of what each session has for itself."""
        return {p.shared_name: p.nominal for p in self.parameters if p.session}

    @cached_property
    def shared(self) -> Mapping[str, tuple[str, str]]:
        """By the name of each parameter the one that its sessions share, and the session."""
        return {p.name: (p.shared_name, p.session) for p in self.parameters}

    @cached_property
    def sessions(self) -> tuple[str, ...]:
        """Sessions that have parameters of their own."""
        return tuple(dict.fromkeys(p.session for p in self.parameters if p.session))

    def for_sessions(self, names: tuple[str, ...]) -> Model:
        """The model with an instance for each session of parameters and effects that have one; as it is for none."""
        if not names or not any(p.per_session for p in self.parameters):
            return self
        effects, parameters = instances(self.effects, self.parameters, names)
        return self._with(_AT_NOMINAL, effects=effects, parameters=parameters)

    def with_effects(self, effects: tuple[PlacedEffect, ...], parameters: tuple[ModelParameter, ...]) -> Model:
        """The model with further effects and their parameters."""
        return self._with(_AT_REST, effects=self.effects + effects, parameters=self.parameters + parameters)

    def with_options(self, effects: tuple[PlacedEffect, ...]) -> Model:
        """The model with other constants of its effects, or without effects."""
        return self._with(_AT_REST, effects=effects)

    def with_channels(self, channels: tuple[Channel, ...], observed: tuple[ObservedQuantity, ...]) -> Model:
        """The model with observed quantities as its channels, one each, and no sensors."""
        direct = tuple((k, k) for k in range(len(channels)))
        return self._with(_AT_REST, channels=channels, observed=observed, direct=direct, sensors=(), correlated=())

    def with_nominal(self, values: Array) -> Model:
        """The model with other nominal values (P,)."""
        parameters = tuple(replace(p, nominal=float(v)) for p, v in zip(self.parameters, values, strict=True))
        return self._with(parameters=parameters)

    def with_ranges(self, ranges: Array) -> Model:
        """The model with other ranges (P,)."""
        parameters = tuple(replace(p, range=float(r)) for p, r in zip(self.parameters, ranges, strict=True))
        return self._with(_AT_NOMINAL, parameters=parameters)

    def with_taut_ropes(self) -> Model:
        """The model whose ropes push too."""
        groups = tuple(replace(g, rope=np.zeros_like(g.rope)) for g in self.topology.groups)
        made = replace(self, topology=replace(self.topology, groups=groups))
        kept = (*_SYSTEMS, *_AT_NOMINAL)
        made.__dict__.update({n: self.__dict__[n] for n in kept if n in self.__dict__ and n != "exact"})
        return made

    def _with(self, same: tuple[str, ...] = (), **changes: Any) -> Model:
        """The model with other fields, on which its systems do not depend; `same`: what else has been computed."""
        made = replace(self, **changes)
        made.__dict__.update({name: self.__dict__[name] for name in (*_SYSTEMS, *same) if name in self.__dict__})
        return made

    @cached_property
    def exact(self) -> System:
        """All drives hold position or force; loads act."""
        forced = [d.force_controlled for d in self.topology.drives]
        states = tuple(DriveState.FORCED if f else DriveState.ENGAGED for f in forced)
        return build_system(self.topology, states, loaded=True)

    @cached_property
    def rigid(self) -> System:
        """Redundant drives released, no loads: the non-redundant substructure (Ecorchard 2010, section 3.1.1)."""
        free = [d.force_controlled or d.redundant for d in self.topology.drives]
        states = tuple(DriveState.RELEASED if f else DriveState.ENGAGED for f in free)
        return build_system(self.topology, states, loaded=False)

    @cached_property
    def released(self) -> System:
        """All drives released, no loads: the mechanism's own freedom."""
        return build_system(self.topology, (DriveState.RELEASED,) * len(self.topology.drives), loaded=False)

    @property
    def tool_motion(self) -> ToolMotion:
        """How the mechanism's freedoms move the tool point."""
        return self.motion_of(self.tool)

    def motion_of(self, aimed: AimedPoint) -> ToolMotion:
        """How the mechanism's freedoms move a point."""
        return self.held_points.motion(aimed)

    @property
    def independent_coordinates(self) -> tuple[str, ...]:
        """Coordinates of the tool point that usually say where it is, in the order x ... rz."""
        return self.tool_motion.sets[0]

    @property
    def inverse(self) -> System:
        """All drives released, the tool point held at its independent coordinates: inverse positions."""
        return self.holding(self.independent_coordinates, self.tool)

    def holding(self, coordinates: tuple[str, ...], aimed: AimedPoint) -> System:
        """All drives released, a point held at some of its coordinates."""
        return self.held_points.system(aimed, coordinates)

    @cached_property
    def held_points(self) -> HeldPoints:
        """What has been made of points that are held."""
        return HeldPoints(self.topology, self.reference_coefficients, self.length)

    @property
    def held_drives(self) -> tuple[Drive, ...]:
        """Drives that hold a position."""
        return tuple(d for d in self.topology.drives if not d.force_controlled)

    @property
    def redundant_drives(self) -> tuple[Drive, ...]:
        """Those of them that are outside the substructure."""
        return tuple(d for d in self.held_drives if d.redundant)

    @property
    def posed(self) -> AimedPoint:
        """A point whose pose says where the mechanism is, if there is one: results do not depend on the tool point."""
        points = (self.measured, self.tool)
        shown = (p for p in points if self.motion_of(p).shown == self.motion_of(p).freedoms)
        return next(shown, self.tool)

    @cached_property
    def overdetermined(self) -> bool:
        """Whether the drives' positions determine the pose more than once, and a point's pose says where that is."""
        more = self.redundant_drives and len(self.held_drives) > self.motion_of(self.posed).freedoms > 0
        return bool(more) and self.held_points.completing(self.posed) is not None

    @cached_property
    def freedoms(self) -> Freedoms:
        """The mechanism with its drives released, a point held at its independent coordinates."""
        topology, posed, added = self.topology, self.posed, self.held_points.completing(self.posed) or ()
        names, groups = self.held_points.motion(posed, added).sets[0], [topology.aims[g] for g in posed.aims]
        held = {name: group.rest.start + k for group in groups for k, name in enumerate(group.element.strains)}
        drives = np.array([a for a, d in enumerate(topology.drives) if not (d.force_controlled or a in added)], int)
        commanded = np.array([topology.drives[a].coefficient for a in drives], dtype=np.intp)
        unit = np.array([self.length if name in ("x", "y", "z") else 1.0 for name in names])
        lengths = [topology.moves_length(topology.drives[a]) for a in drives]
        return Freedoms(
            system=self.held_points.system(posed, names, added),
            length=self.length,
            held=np.array([held[name] for name in names], dtype=np.intp),
            unit=unit,
            drives=drives,
            coordinates=names,
            gains=np.array([self.actuators[a].gain_coefficient for a in drives], dtype=np.intp),
            size=np.where(lengths, self.length, 1.0),
            period=np.where(lengths, np.inf, 2 * np.pi),
            home=posed.reference[[DIRECTIONS.index(n) for n in names]] / unit,
            commanded=commanded,
            reference=self.reference_coefficients[0, commanded],
        )

    @cached_property
    def starts(self) -> ClosedPoses:
        """Poses all over the workspace from which common poses are looked for; nominal geometry."""
        state = reference_state(self.topology, self.reference_coefficients, 1, self.freedoms.system.constraints)
        return self.freedoms.spread(self.reference_coefficients, state)

    @property
    def expected_misfit(self) -> float:
        """Misfit of the drives, in sizes of the machine, that is no doubt: what ranges and noise explain, or little."""
        return max(self.explained_misfit, LEAST_MISFIT)

    def in_doubt(self, misfit: Array) -> NDArray[np.bool_]:
        """Which misfits (N,) are beyond `expected_misfit`; what ranges explain is computed only where one is large."""
        large = misfit > LEAST_MISFIT
        return np.asarray(misfit > self.expected_misfit if large.any() else large)

    @cached_property
    def explained_misfit(self) -> float:
        """What ranges and noise explain of the drives' misfit, in sizes of the machine."""
        names = list(dict.fromkeys(p.shared_name for p in self.parameters))
        ranges = {p.shared_name: p.range for p in self.parameters}
        by_parameter = self.topology.coefficients.jacobian(self.by_name(self.nominal), names)
        sigma = np.nan_to_num([self.actuators[a].sigma for a in self.freedoms.drives]) / self.freedoms.size
        expected = self.freedoms.expected_misfit(
            self.reference_coefficients,
            self.starts.state.take(np.zeros(1, dtype=np.intp)),
            by_parameter * np.array([ranges[n] for n in names]),
            sigma,
        )
        return _DOUBT * expected

    @cached_property
    def reference_coefficients(self) -> Array:
        """Coefficients (1, S) at nominal parameters, drives in the reference configuration; not to be written to."""
        coefficients = self.topology.coefficients.values(self.by_name(self.nominal))[None]
        for a, (drive, actuator) in enumerate(zip(self.topology.drives, self.actuators, strict=True)):
            gain = coefficients[:, actuator.gain_coefficient]
            coefficients[:, drive.coefficient] += gain * self.reference_readings[a]
        coefficients.flags.writeable = False
        return coefficients

    @cached_property
    def reference_mode(self) -> Mode | None:
        """Assembly mode of the substructure at the reference configuration."""
        state = reference_state(self.topology, self.reference_coefficients, 1, self.rigid.constraints)
        return reference_mode(self.rigid, self.reference_coefficients, state, self.length)
