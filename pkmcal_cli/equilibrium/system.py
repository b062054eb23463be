"""Which coordinates are unknown and which strains act in one kind of solution, as constant maps.

The same machine is solved in several ways: all drives engaged (X = fegm(q, xi, F), Ecorchard 2010, eq. 11), redundant
drives released (fgm(q_nr, xi): the rigid pose of the non-redundant substructure, section 3.1.1), all drives released
(assembly of the reference configuration, inverse positions). Each way is a `System`: index arrays and sparse maps
between elements and unknowns, made once. Released drives are masked, not removed, so that elements stay in their
groups.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.links import LinkMap, build_links
from pkmcal_cli.equilibrium.maps import GeometryMaps, Maps, MapsBuilder, StrainMaps
from pkmcal_cli.mechanism.topology import DriveKind, Group, Index, RotationKind, Topology

if TYPE_CHECKING:
    from pkmcal_cli.equilibrium.strain_fronts import StrainFronts


class DriveState(Enum):
    """How a drive acts in a system."""

    ENGAGED = "engaged"  # holds its commanded position
    RELEASED = "released"  # free, without force
    FORCED = "forced"  # free, with a constant force


Aim = tuple[tuple[int, str], ...]


@dataclass(frozen=True, kw_only=True)
class System:
    """One way to solve a machine: n unknown coordinates and c constraints."""

    topology: Topology
    free: Index  # (n,) coordinates that are unknown
    unknown_of: Index  # (n_dof,) unknown number of each coordinate, -1 where prescribed
    groups: tuple[GroupMap, ...]
    constraints: int
    points: LinkMap
    loaded: bool
    states: tuple[DriveState, ...]

    @property
    def unknowns(self) -> int:
        """Number of unknown coordinates."""
        return len(self.free)

    @property
    def size(self) -> int:
        """Unknown coordinates plus multipliers."""
        return len(self.free) + self.constraints

    @cached_property
    def ropes(self) -> bool:
        """Whether any member pulls and never pushes."""
        return any(group.ropes is not None for group in self.groups)

    @cached_property
    def geometry_maps(self) -> GeometryMaps:
        """Constant map from rotations and offset vectors to what elements see."""
        return GeometryMaps.of(self.topology, self.groups)

    @cached_property
    def maps(self) -> Maps:
        """Constant maps between the elements' arrays and the unknowns."""
        return MapsBuilder(self.topology, self.unknown_of, self.constraints).build(self.groups)

    @cached_property
    def strain_maps(self) -> StrainMaps:
        """Constant maps between gradients of strains and the unknowns."""
        return StrainMaps.of(self.groups, self.unknowns)

    @cached_property
    def strain_fronts(self) -> StrainFronts | None:
        """The fronts in which strains count; None where the tangent is solved as one matrix."""
        from pkmcal_cli.equilibrium.strain_fronts import StrainFronts  # few commands predict

        fronts = self.maps.fronts
        return None if fronts is None else StrainFronts.of(*np.divmod(self.strain_maps.filled, self.unknowns), fronts)


def build_system(topology: Topology, states: tuple[DriveState, ...], loaded: bool, aim: Aim = ()) -> System:
    """Build the system of `topology` with its drives in the given states; loads and prestress act where `loaded`.

    `aim`: coordinates (x ... rz) that are prescribed, for inverse positions, each with its group in `topology.aims`.
    """
    free = _free_coordinates(topology, states)
    unknown_of = np.full(topology.n_dof, -1, dtype=np.intp)
    unknown_of[free] = np.arange(len(free))
    all_groups = topology.groups + topology.aims if aim else topology.groups
    row, groups = 0, []
    for group, on in zip(all_groups, _active(topology, states, aim, loaded), strict=True):
        made = _group_map(topology, group, on, unknown_of, row, loaded)
        row = made.rows.stop
        groups.append(made)
    read = slice(int(topology.points[0]), int(topology.points[-1]) + 1) if len(topology.points) else slice(0, 0)
    points = build_links(topology, read, unknown_of)
    return System(
        topology=topology,
        free=free,
        unknown_of=unknown_of,
        groups=tuple(groups),
        constraints=row,
        points=points,
        loaded=loaded,
        states=states,
    )


def _active(topology: Topology, states: tuple[DriveState, ...], aim: Aim, loaded: bool) -> list[NDArray[np.bool_]]:
    """Which strains (E, m) of each group act; those of the aims come last."""
    active = [np.ones(group.shape, dtype=bool) if loaded else ~group.springs for group in topology.groups]
    for drive, state in zip(topology.drives, states, strict=True):
        if drive.kind is DriveKind.STRAIN and state is not DriveState.ENGAGED:
            index, element, strain = drive.target
            active[index][element, strain] = False
    aims = enumerate(topology.aims) if aim else ()
    return active + [np.array([[(g, d) in aim for d in group.element.strains]]) for g, group in aims]


def _group_map(
    topology: Topology, group: Group, on: NDArray[np.bool_], unknown_of: Index, row: int, loaded: bool
) -> GroupMap:
    """One group with the strains `on` (E, m); its constraints are numbered from `row`."""
    element, strain = np.nonzero(on & group.rigid)
    links = build_links(topology, group.links, unknown_of, group)
    yields = len(group.element.patterns) > 0  # loads have strains but no stiffness
    elastic = (on & ~group.rigid & yields).astype(float)
    stressed = np.full(group.shape, float(loaded))
    ropes = group.rope & (elastic[:, 0] > 0) & loaded
    return GroupMap(
        group=group,
        map=links,
        elastic=elastic,
        stressed=stressed,
        rigid=(element, strain),
        rows=slice(row, row + len(element)),
        ropes=ropes if ropes.any() else None,
    )


def _free_coordinates(topology: Topology, states: tuple[DriveState, ...]) -> Index:
    translation = topology.translation_free.copy()
    rotating = topology.rotations.kind != RotationKind.FIXED
    for drive, state in zip(topology.drives, states, strict=True):
        if drive.kind is DriveKind.TRAVEL:
            translation[drive.target[0]] = state is not DriveState.ENGAGED
        elif drive.kind is DriveKind.ROTATION:
            rotating[drive.target[0]] = state is not DriveState.ENGAGED
    out = np.nonzero(translation)[0].tolist()
    rotating &= topology.rotations.carrier < 0
    for r in np.nonzero(rotating)[0]:
        start = int(topology.rotation_dofs[r])
        out += range(start, start + (3 if topology.rotations.kind[r] == RotationKind.FREE else 1))
    return np.array([k for k in out if k not in topology.parked], dtype=np.intp)
