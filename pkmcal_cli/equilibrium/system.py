"""Which coordinates are unknown and which strains act in one kind of solution, as scatter indices.

The same machine is solved in several ways: all drives engaged (`exact`, `linear`), redundant drives released (the
rigid pose of the non-redundant substructure), all drives released (assembly of the drawing, inverse positions). Each
way is a `System`: index arrays that map element gradients and tangents to the unknowns, made once.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ..layout import DriveKind, Group, Index, Layout, Turn
from ..rotation import Array


class DriveState(Enum):
    """How a drive acts in a system."""

    ENGAGED = "engaged"  # holds its commanded position
    RELEASED = "released"  # free, without force
    FORCED = "forced"  # free, with a constant force


Layers = tuple[tuple[Index, Index], ...]  # (source, target): no target twice within a layer


@dataclass(frozen=True)
class LinkMap:
    """Local unknowns of the E links of a group and how the inputs (delta, theta_i, theta_j) depend on them."""

    links: slice
    template: Array  # (E, L, I) constant part of the transposed input Jacobian
    along: tuple[Index, Index, Index, Array]  # link, column, arm, axis (F, 3): travels
    about: tuple[Index, Index, Index]  # link, first column, arm: rotations with three unknowns
    axial: tuple[Index, Index, Index, Array]  # link, column, arm, axis (F, 3): rotations about a fixed axis
    along_about: tuple[Index, Index, Index]  # travel fill, link, first column: arms with both, three unknowns
    along_axial: tuple[Index, Index, Index, Array]  # travel fill, link, column, axis
    unknowns: Index  # (E, L) global unknowns, -1 padded
    gradient: Layers  # local (E * L) to global (n)
    tangent: Layers  # local (E * L * L) to global (size * size), size = n + constraints


@dataclass(frozen=True)
class GroupMap:
    """A group of elements in a system."""

    group: Group
    map: LinkMap
    elastic: Array  # (E, m) 1 where the strain acts through its stiffness
    stressed: Array  # (E, m) 1 where the prestress acts
    rigid: tuple[Index, Index]  # element and strain of each constraint
    rows: slice  # global constraint numbers


@dataclass(frozen=True)
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


def build_system(
    layout: Layout, states: tuple[DriveState, ...], loaded: bool, aim: tuple[str, ...] = ()
) -> System:
    """The system of `layout` with its drives in the given states; loads and prestress act where `loaded`.

    `aim`: coordinates of the TCP (x ... rz) that are prescribed, for inverse positions.
    """
    free = _free_coordinates(layout, states)
    place = np.full(layout.n_dof, -1, dtype=np.intp)
    place[free] = np.arange(len(free))
    active = [np.ones(group.shape, dtype=bool) for group in layout.groups]
    for drive, state in zip(layout.drives, states, strict=True):
        if drive.kind is DriveKind.STRAIN and state is not DriveState.ENGAGED:
            g, e, m = drive.target
            active[g][e, m] = False
    all_groups = layout.groups
    if aim:
        all_groups = layout.groups + layout.aims
        active += [np.array([[d in aim for d in group.element.strains]]) for group in layout.aims]
    total = sum(int((a & group.rigid).sum()) for a, group in zip(active, all_groups, strict=True))
    size, row, groups = len(free) + total, 0, []
    for group, on in zip(all_groups, active, strict=True):
        e, m = np.nonzero(on & group.rigid)
        links = build_links(
            layout, group.links, group.rotation if group.element.uses_triads else None, place, size
        )
        yields = len(group.element.patterns) > 0  # loads have strains but no stiffness
        elastic = (on & ~group.rigid & yields).astype(float)
        stressed = np.ones(group.shape) if loaded else np.zeros(group.shape)
        groups.append(GroupMap(group, links, elastic, stressed, (e, m), slice(row, row + len(e))))
        row += len(e)
    points = build_links(
        layout,
        slice(int(layout.points[0]), int(layout.points[-1]) + 1) if len(layout.points) else slice(0, 0),
        None,
        place,
        size,
    )
    return System(layout, free, place, tuple(groups), total, points, loaded, states)


def _free_coordinates(layout: Layout, states: tuple[DriveState, ...]) -> Index:
    travel = layout.travel_free.copy()
    turning = layout.rotations.kind != Turn.FIXED
    for drive, state in zip(layout.drives, states, strict=True):
        if drive.kind is DriveKind.TRAVEL:
            travel[drive.target[0]] = state is not DriveState.ENGAGED
        elif drive.kind is DriveKind.ROTATION:
            turning[drive.target[0]] = state is not DriveState.ENGAGED
    out = list(np.nonzero(travel)[0])
    for r in np.nonzero(turning)[0]:
        start = layout.rotation_dofs[r]
        out += list(range(start, start + (3 if layout.rotations.kind[r] == Turn.FREE else 1)))
    return np.array([k for k in out if k not in layout.held], dtype=np.intp)


class _Fills:
    """Index lists collected link by link."""

    def __init__(self) -> None:
        self.along: list[tuple[int, int, int, Array]] = []
        self.about: list[tuple[int, int, int]] = []
        self.axial: list[tuple[int, int, int, Array]] = []
        self.along_about: list[tuple[int, int, int]] = []
        self.along_axial: list[tuple[int, int, int, Array]] = []
        self.local: list[list[int]] = []


def build_links(layout: Layout, links: slice, ports: Index | None, place: Index, size: int) -> LinkMap:
    """Scatter maps of a range of links; `ports` (2, E): rotations of the end triads, None where they do not matter."""
    fills = _Fills()
    for e, link in enumerate(range(links.start, links.stop)):
        _collect(layout, fills, e, link, [] if ports is None else [int(r) for r in ports[:, e]], place)
    inputs = layout.inputs[: 2 if layout.planar else 3] if ports is None else layout.inputs
    width = max((len(local) for local in fills.local), default=0)
    unknowns = np.full((len(fills.local), width), -1, dtype=np.intp)
    for e, local in enumerate(fills.local):
        unknowns[e, : len(local)] = place[local]
    template = np.zeros((len(fills.local), width, 9))
    if ports is not None:
        _port_columns(layout, fills.local, ports, template)
    return LinkMap(
        links,
        np.ascontiguousarray(template[:, :, inputs]),
        _stack(fills.along, 3, True),
        _stack(fills.about, 3, False),
        _stack(fills.axial, 3, True),
        _stack(fills.along_about, 3, False),
        _stack(fills.along_axial, 3, True),
        unknowns,
        _layers(unknowns.ravel()),
        _layers(_pairs(unknowns, size)),
    )


def _collect(layout: Layout, fills: _Fills, e: int, link: int, ports: list[int], place: Index) -> None:
    """Local unknowns of one link and the arms by which they move it."""
    arms, rotations = layout.arms, layout.rotations
    first, local = layout.rotation_dofs, []
    mine = np.nonzero(arms.link == link)[0]
    for r in [int(arms.rotation[a]) for a in mine] + ports:
        width = (0, 3, 1)[rotations.kind[r]]
        if width and first[r] not in local and (place[first[r] : first[r] + width] >= 0).any():
            local += list(range(first[r], first[r] + width))
    for a in mine:
        r = int(arms.rotation[a])
        turns = first[r] in local
        if turns and rotations.kind[r] == Turn.FREE:
            fills.about.append((e, local.index(first[r]), int(a)))
        elif turns:
            fills.axial.append((e, local.index(first[r]), int(a), rotations.axis[r]))
        axes = arms.travel[:, 3 * a : 3 * a + 3]
        for t in np.nonzero((axes != 0).any(1) & (place[: len(axes)] >= 0))[0]:
            local.append(int(t))
            if turns and rotations.kind[r] == Turn.FREE:
                fills.along_about.append((len(fills.along), e, local.index(first[r])))
            elif turns:
                fills.along_axial.append((len(fills.along), e, local.index(first[r]), rotations.axis[r]))
            fills.along.append((e, len(local) - 1, int(a), axes[t]))
    fills.local.append(local)


def _port_columns(layout: Layout, local: list[list[int]], ports: Index, template: Array) -> None:
    """Rotation inputs: identity (three unknowns) or the axis (one)."""
    for side, offset in ((0, 3), (1, 6)):
        for e, dofs in enumerate(local):
            r = int(ports[side, e])
            start = layout.rotation_dofs[r]
            if start in dofs:
                column = dofs.index(start)
                if layout.rotations.kind[r] == Turn.FREE:
                    template[e, column : column + 3, offset : offset + 3] = np.eye(3)
                else:
                    template[e, column, offset : offset + 3] = layout.rotations.axis[r]


def _stack(entries: list, width: int, vector: bool) -> tuple:  # type: ignore[type-arg]
    """Columns of index tuples as integer arrays, the last as vectors (F, 3) where `vector`."""
    columns = tuple(np.array([entry[k] for entry in entries], dtype=np.intp) for k in range(width))
    if not vector:
        return columns
    return (*columns, np.array([entry[width] for entry in entries], dtype=float).reshape(-1, 3))


def _pairs(unknowns: Index, size: int) -> Index:
    """Flat target of every local tangent entry (E * L * L), -1 where a coordinate is prescribed."""
    i, j = unknowns[:, :, None], unknowns[:, None, :]
    return np.where((i >= 0) & (j >= 0), i * size + j, -1).ravel()


def _layers(target: Index) -> Layers:
    """Split a scatter with repeated targets into layers without repeats, so that each is one indexed addition."""
    source = np.nonzero(target >= 0)[0]
    layers: list[tuple[Index, Index]] = []
    while len(source):
        _, first = np.unique(target[source], return_index=True)
        chosen: NDArray[np.bool_] = np.zeros(len(source), dtype=bool)
        chosen[first] = True
        layers.append((source[chosen], target[source[chosen]]))
        source = source[~chosen]
    return tuple(layers)
