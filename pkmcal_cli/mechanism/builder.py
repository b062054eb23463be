"""Builds a `Layout` piece by piece: slots, rotations, travels, points, links. The compiler's drafting table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements import Element
from pkmcal_cli.mechanism.coefficients import Formula, SlotTable
from pkmcal_cli.mechanism.connection_points import Link, Number, Point, Port, arms_of
from pkmcal_cli.mechanism.topology import GROUND, Arms, Drive, DriveKind, Group, Layout, Rotations, Turn


@dataclass(kw_only=True)
class LayoutBuilder:
    """Collects the pieces of a machine; `build` freezes them."""

    planar: bool
    constants: list[float] = field(default_factory=list)
    formulas: list[tuple[int, Formula]] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    rotations: list[tuple[Turn, Array, Array, tuple[int, int, int], str]] = field(default_factory=list)
    filed: dict[int, Array] = field(default_factory=dict)  # orientation in the file where it is not the drawn one
    travels: list[tuple[int, float, bool, str]] = field(default_factory=list)
    offsets: list[tuple[int, int, int]] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    points: list[Link] = field(default_factory=list)
    aims: list[Link] = field(default_factory=list)
    forces: list[tuple[str, int, int]] = field(default_factory=list)  # (travel | rotation, number, slot)
    nominal: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.vector((0.0, 0.0, 0.0), "zero")  # offset 0 pads
        self.rotation(Turn.FIXED, name="base")

    def slot(self, value: Number, label: str) -> int:
        """A new slot; returns its number."""
        self.labels.append(label)
        if isinstance(value, Formula):
            self.formulas.append((len(self.constants), value))
            value = float(np.real(value.function(self.nominal)))
        self.constants.append(float(value))
        return len(self.constants) - 1

    def vector(self, value: Sequence[Number], label: str) -> int:
        """A new offset vector (three slots, m); returns its number."""
        parts = list(value) + [0.0] * (3 - len(value))
        x, y, z = (self.slot(v, f"{label}.{c}") for v, c in zip(parts, "xyz", strict=True))
        self.offsets.append((x, y, z))
        return len(self.offsets) - 1

    def rotation(
        self,
        kind: Turn,
        name: str,
        axis: Array | None = None,
        drawn: Array | None = None,
        slots: Sequence[int] = (),
    ) -> int:
        """A new rotation; `slots`: its rotation vector (FIXED) or angle (AXIS, driven)."""
        where = (*slots, -1, -1, -1)[:3]
        axis = np.array([0.0, 0.0, 1.0]) if axis is None else np.asarray(axis, dtype=float)
        self.rotations.append((kind, axis, np.eye(3) if drawn is None else drawn, (where[0], where[1], where[2]), name))
        return len(self.rotations) - 1

    def travel(self, drawn: float, name: str, slot: int = -1, free: bool = True) -> int:
        """A new travel; `slot` holds its value where it is prescribed."""
        self.travels.append((slot, drawn, free, name))
        return len(self.travels) - 1

    def free_point(self, at: Sequence[float], name: str) -> Point:
        """A point with a travel along each base axis of the space."""
        axes = np.eye(3)[: 2 if self.planar else 3]
        return Point(
            (),
            tuple(
                (GROUND, self.travel(float(v), f"{name}.{c}"), tuple(axis))
                for v, c, axis in zip(at, "xyz", axes, strict=False)
            ),
        )

    def offset(self, rotation: int, value: Sequence[Number], label: str) -> Point:
        """A point at a constant offset in a rotation's triad."""
        return Point(((rotation, 1.0, self.vector(value, label)),), ())

    def link(
        self,
        element: Element,
        name: str,
        ports: tuple[Port, Port],
        *,
        rest: Sequence[Number],
        stiffness: Sequence[Number],
        rigid: Sequence[bool],
        triads: tuple[Array, Array] | None = None,
        prestress: Sequence[Number] | None = None,
        rope: bool = False,
    ) -> None:
        """An element between two ports."""
        frames = triads or (np.eye(3), np.eye(3))
        loads = tuple(prestress or (0.0,) * len(element.strains))
        self.links.append(
            Link(
                element=element,
                name=name,
                ports=ports,
                triads=frames,
                rest=tuple(rest),
                stiffness=tuple(stiffness),
                prestress=loads,
                rigid=tuple(rigid),
                rope=rope,
            )
        )

    def aim(self, element: Element, name: str, ports: tuple[Port, Port]) -> None:
        """Constraints that hold port j at a pose given by slots; they act in inverse positions only."""
        count = len(element.strains)
        frames = (np.eye(3), np.eye(3))
        numbers = (0.0,) * len(element.patterns)
        zeros, rigid = (0.0,) * count, (True,) * count
        self.aims.append(
            Link(
                element=element,
                name=name,
                ports=ports,
                triads=frames,
                rest=zeros,
                stiffness=numbers,
                prestress=zeros,
                rigid=rigid,
                rope=False,
            )
        )

    def reading_point(self, name: str, port: Port) -> int:
        """A point that sensors read; returns its number among the points."""
        self.points.append(
            Link(
                element=None,
                name=name,
                ports=(Port(Point(), GROUND), port),
                triads=(np.eye(3), np.eye(3)),
                rest=(),
                stiffness=(),
                prestress=(),
                rigid=(),
                rope=False,
            )
        )
        return len(self.points) - 1

    def force(self, kind: str, number: int, slot: int) -> None:
        """A constant force along a travel, or moment about one rotation (its axis, or its three base axes)."""
        self.forces.append((kind, number, slot))

    def build(self, drives: Sequence[tuple[Drive, str, str]], held: Sequence[int] = ()) -> Layout:
        """The frozen layout. `drives`: a drive with the element and strain names of a STRAIN target."""
        ordered = self._groups()
        groups: list[Group] = []
        sequence: list[Link] = []
        for element, links in ordered:
            start = len(sequence)
            sequence += links
            groups.append(self._group(element, links, slice(start, len(sequence))))
        aims = []
        for link in self.aims:
            assert link.element is not None
            aims.append(self._group(link.element, [link], slice(len(sequence), len(sequence) + 1)))
            sequence.append(link)
        first_point = len(sequence)
        sequence += self.points
        arms = self._arms(sequence)
        return Layout(
            planar=self.planar,
            slots=SlotTable(np.array(self.constants), tuple(self.formulas), tuple(self.labels)),
            travel_slots=np.array([t[0] for t in self.travels], dtype=np.intp),
            travel_drawn=np.array([t[1] for t in self.travels]),
            travel_free=np.array([t[2] for t in self.travels], dtype=bool),
            travel_names=tuple(t[3] for t in self.travels),
            rotations=self._turning(),
            arms=arms,
            groups=tuple(groups),
            aims=tuple(aims),
            points=np.arange(first_point, len(sequence)),
            force_dofs=np.array(self._forced_dofs(), dtype=np.intp),
            force_slots=np.array([slot for _, _, slot in self.forces], dtype=np.intp),
            drives=tuple(_located(drive, element, strain, groups) for drive, element, strain in drives),
            held=tuple(held),
        )

    def _groups(self) -> list[tuple[Element, list[Link]]]:
        out: dict[Element, list[Link]] = {}
        for link in self.links:
            assert link.element is not None
            out.setdefault(link.element, []).append(link)
        return list(out.items())

    def _group(self, element: Element, links: list[Link], where: slice) -> Group:
        def block(kind: str, values: list[tuple[Number, ...]], names: Sequence[str]) -> slice:
            start = len(self.constants)
            for link, row in zip(links, values, strict=True):
                for name, value in zip(names, row, strict=True):
                    self.slot(value, f"{link.name}.{kind}.{name}")
            return slice(start, len(self.constants))

        numbers = [str(k) for k in range(len(element.patterns))]
        return Group(
            element=element,
            names=tuple(link.name for link in links),
            links=where,
            rotation=np.array([[link.ports[side].rotation for link in links] for side in (0, 1)], dtype=np.intp),
            triads=np.array([[link.triads[side] for link in links] for side in (0, 1)]),
            rest=block("rest", [link.rest for link in links], element.strains),
            stiffness=block("stiffness", [link.stiffness for link in links], numbers),
            prestress=block("prestress", [link.prestress for link in links], element.strains),
            rigid=np.array([link.rigid for link in links], dtype=bool).reshape(len(links), len(element.strains)),
            rope=np.array([link.rope for link in links], dtype=bool),
        )

    def _turning(self) -> Rotations:
        return Rotations(
            np.array([int(r[0]) for r in self.rotations]),
            np.array([r[1] for r in self.rotations]),
            np.array([r[2] for r in self.rotations]),
            np.array([self.filed.get(k, r[2]) for k, r in enumerate(self.rotations)]),
            np.array([r[3] for r in self.rotations], dtype=np.intp),
            tuple(r[4] for r in self.rotations),
        )

    def _forced_dofs(self) -> list[int]:
        """Coordinates on which constant forces act: travels first, then the rotations' own."""
        widths = np.array([0, 3, 1])[[int(r[0]) for r in self.rotations]]
        first = len(self.travels) + np.cumsum(widths) - widths
        dofs = []
        for kind, number, _ in self.forces:
            turn, axis = divmod(number, 3)
            dofs.append(number if kind == "travel" else int(first[turn]) + (axis if widths[turn] == 3 else 0))
        return dofs

    def _arms(self, sequence: list[Link]) -> Arms:
        rows: list[tuple[int, int, list[tuple[float, int]], list[tuple[int, Array]]]] = []
        start = []
        for number, link in enumerate(sequence):
            start.append(len(rows))
            rows += [(number, r, offsets, travels) for r, offsets, travels in arms_of(link)]
        width = max(len(row[2]) for row in rows)
        offset = np.zeros((len(rows), width), dtype=np.intp)
        sign = np.zeros((len(rows), width))
        travel = np.zeros((len(self.travels), len(rows) * 3))
        for a, (_, _, offsets, travels) in enumerate(rows):
            for p, (factor, index) in enumerate(offsets):
                offset[a, p], sign[a, p] = index, factor
            for t, axis in travels:
                travel[t, 3 * a : 3 * a + 3] += axis
        return Arms(
            link=np.array([row[0] for row in rows], dtype=np.intp),
            rotation=np.array([row[1] for row in rows], dtype=np.intp),
            start=np.array(start, dtype=np.intp),
            offset=offset,
            sign=sign,
            travel=travel,
            offset_slots=np.array(self.offsets, dtype=np.intp),
        )


def _located(drive: Drive, element: str, strain: str, groups: Sequence[Group]) -> Drive:
    """A STRAIN drive with its target and slots filled in."""
    if drive.kind is not DriveKind.STRAIN:
        return drive
    for g, group in enumerate(groups):
        if element in group.names and strain in group.element.strains:
            e, m = group.names.index(element), group.element.strains.index(strain)
            at = e * len(group.element.strains) + m
            slot, force_slot = group.rest.start + at, group.prestress.start + at
            rigid = bool(group.rigid[e, m])
            return replace(drive, target=(g, e, m), slot=slot, force_slot=force_slot, rigid=rigid)
    raise KeyError(f"drive {drive.name}: no element {element} with strain {strain}")
