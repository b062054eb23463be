"""Which coordinates are unknown and which strains act in one kind of solution, as constant maps.

The same machine is solved in several ways: all drives engaged (`exact`, `linear`), redundant drives released (the
rigid pose of the non-redundant substructure), all drives released (assembly of the drawing, inverse positions). Each
way is a `System`: index arrays and sparse maps between elements and unknowns, made once.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.links import LinkMap, build_links
from pkmcal_cli.equilibrium.maps import Maps, MapsBuilder, StrainMaps, ViewMaps
from pkmcal_cli.mechanism.topology import DriveKind, Group, Index, Layout, Turn


class DriveState(Enum):
    """How a drive acts in a system."""

    ENGAGED = "engaged"  # holds its commanded position
    RELEASED = "released"  # free, without force
    FORCED = "forced"  # free, with a constant force


@dataclass(frozen=True, kw_only=True)
class System:
    """One way to solve a machine: n unknown coordinates and c constraints."""

    layout: Layout
    free: Index  # (n,) coordinates that are unknown
    place: Index  # (n_dof,) unknown number of each coordinate, -1 where prescribed
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
    def view_maps(self) -> ViewMaps:
        """Constant map from rotations and arms to what elements see."""
        return ViewMaps.of(self.layout, self.groups)

    @cached_property
    def maps(self) -> Maps:
        """Constant maps between the elements' arrays and the unknowns."""
        return MapsBuilder(self.layout, self.place, self.constraints).build(self.groups)

    @cached_property
    def strain_maps(self) -> StrainMaps:
        """Constant maps between gradients of strains and the unknowns."""
        return StrainMaps.of(self.groups, self.unknowns)


def build_system(layout: Layout, states: tuple[DriveState, ...], loaded: bool, aim: tuple[str, ...] = ()) -> System:
    """The system of `layout` with its drives in the given states; loads and prestress act where `loaded`.

    `aim`: coordinates of the TCP (x ... rz) that are prescribed, for inverse positions.
    """
    free = _free_coordinates(layout, states)
    place = np.full(layout.n_dof, -1, dtype=np.intp)
    place[free] = np.arange(len(free))
    all_groups = layout.groups + layout.aims if aim else layout.groups
    row, groups = 0, []
    for group, on in zip(all_groups, _active(layout, states, aim), strict=True):
        made = _group_map(layout, group, on, place, row, loaded)
        row = made.rows.stop
        groups.append(made)
    read = slice(int(layout.points[0]), int(layout.points[-1]) + 1) if len(layout.points) else slice(0, 0)
    points = build_links(layout, read, None, place)
    return System(
        layout=layout,
        free=free,
        place=place,
        groups=tuple(groups),
        constraints=row,
        points=points,
        loaded=loaded,
        states=states,
    )


def _active(layout: Layout, states: tuple[DriveState, ...], aim: tuple[str, ...]) -> list[NDArray[np.bool_]]:
    """Which strains (E, m) of each group act; those of the aims come last."""
    active = [np.ones(group.shape, dtype=bool) for group in layout.groups]
    for drive, state in zip(layout.drives, states, strict=True):
        if drive.kind is DriveKind.STRAIN and state is not DriveState.ENGAGED:
            index, element, strain = drive.target
            active[index][element, strain] = False
    aims = layout.aims if aim else ()
    return active + [np.array([[d in aim for d in group.element.strains]]) for group in aims]


def _group_map(layout: Layout, group: Group, on: NDArray[np.bool_], place: Index, row: int, loaded: bool) -> GroupMap:
    """One group with the strains `on` (E, m); its constraints are numbered from `row`."""
    element, strain = np.nonzero(on & group.rigid)
    ports = group.rotation if group.element.uses_triads else None
    links = build_links(layout, group.links, ports, place)
    yields = len(group.element.patterns) > 0  # loads have strains but no stiffness
    elastic = (on & ~group.rigid & yields).astype(float)
    stressed = np.full(group.shape, float(loaded))
    return GroupMap(group, links, elastic, stressed, (element, strain), slice(row, row + len(element)))


def _free_coordinates(layout: Layout, states: tuple[DriveState, ...]) -> Index:
    travel = layout.travel_free.copy()
    turning = layout.rotations.kind != Turn.FIXED
    for drive, state in zip(layout.drives, states, strict=True):
        if drive.kind is DriveKind.TRAVEL:
            travel[drive.target[0]] = state is not DriveState.ENGAGED
        elif drive.kind is DriveKind.ROTATION:
            turning[drive.target[0]] = state is not DriveState.ENGAGED
    out = np.nonzero(travel)[0].tolist()
    for r in np.nonzero(turning)[0]:
        start = int(layout.rotation_dofs[r])
        out += range(start, start + (3 if layout.rotations.kind[r] == Turn.FREE else 1))
    return np.array([k for k in out if k not in layout.held], dtype=np.intp)
