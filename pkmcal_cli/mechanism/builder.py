"""Builds a `Topology` piece by piece: coefficients, rotations, translations, points, links.

The compiler calls it in any order; only `build` turns lists into index arrays, when every count is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements import Element
from pkmcal_cli.mechanism.coefficients import CoefficientTable, Formula
from pkmcal_cli.mechanism.connection_points import (
    ConnectionPoint,
    Ends,
    Link,
    Member,
    Number,
    Point,
    offset_vectors_of,
    slides_of,
    springs_of,
)
from pkmcal_cli.mechanism.topology import (
    GROUND,
    Drive,
    DriveKind,
    Group,
    RotationKind,
    Rotations,
    Topology,
)


@dataclass(kw_only=True)
class TopologyBuilder:
    """Collects the pieces of a machine; `build` freezes them."""

    planar: bool
    constants: list[float] = field(default_factory=list)
    formulas: list[tuple[int, Formula]] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    rotations: list[tuple[int, Array, Array, tuple[int, int, int], str]] = field(default_factory=list)
    filed: dict[int, Array] = field(default_factory=dict)  # orientation in the file where it is not the reference one
    carriers: dict[int, int] = field(default_factory=dict)  # of frames
    translations: list[tuple[int, float, bool, str]] = field(default_factory=list)
    offsets: list[tuple[int, int, int]] = field(default_factory=list)
    members: list[Member] = field(default_factory=list)
    points: list[Link] = field(default_factory=list)
    aims: list[Member] = field(default_factory=list)
    forces: list[tuple[str, int, int]] = field(default_factory=list)  # (translation | rotation, number, coefficient)
    nominal: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.vector((0.0, 0.0, 0.0), "zero")  # offset 0 pads
        self.rotation(RotationKind.FIXED, name="base")

    def coefficient(self, value: Number, label: str) -> int:
        """A new coefficient; returns its number."""
        self.labels.append(label)
        if isinstance(value, Formula):
            self.formulas.append((len(self.constants), value))
            value = float(np.real(value.function(self.nominal)))
        self.constants.append(float(value))
        return len(self.constants) - 1

    def vector(self, value: Sequence[Number], label: str) -> int:
        """A new offset vector (three coefficients, m); returns its number."""
        parts = list(value) + [0.0] * (3 - len(value))
        x, y, z = (self.coefficient(v, f"{label}.{c}") for v, c in zip(parts, "xyz", strict=True))
        self.offsets.append((x, y, z))
        return len(self.offsets) - 1

    def rotation(
        self,
        kind: int,
        name: str,
        axis: Array | None = None,
        reference: Array | None = None,
        coefficients: Sequence[int] = (),
    ) -> int:
        """A new rotation; `coefficients`: its angle (AXIS, driven)."""
        where = (*coefficients, -1, -1, -1)[:3]
        axis = np.array([0.0, 0.0, 1.0]) if axis is None else np.asarray(axis, dtype=float)
        self.rotations.append(
            (kind, axis, np.eye(3) if reference is None else reference, (where[0], where[1], where[2]), name)
        )
        return len(self.rotations) - 1

    def frame(
        self, name: str, rotation: Sequence[Number], carrier: int = GROUND, reference: Array | None = None
    ) -> int:
        """A new rotation that coefficients turn against its carrier by a rotation vector (rad, the carrier's axes)."""
        kind, axis = self.rotations[carrier][:2]
        coefficients = [self.coefficient(v, f"{name}.turn.{c}") for v, c in zip(rotation, "xyz", strict=True)]
        made = self.rotation(kind, name, axis, reference, coefficients)
        self.carriers[made] = carrier
        return made

    def translation(self, reference: float, name: str, coefficient: int = -1, free: bool = True) -> int:
        """A new translation; `coefficient` holds its value where it is prescribed."""
        self.translations.append((coefficient, reference, free, name))
        return len(self.translations) - 1

    def offset(self, rotation: int, value: Sequence[Number], label: str) -> Point:
        """A point at a constant offset in a rotation's triad."""
        return Point(((rotation, 1.0, self.vector(value, label)),), ())

    def link(
        self,
        element: Element,
        name: str,
        connections: Ends,
        *,
        rest: Sequence[Number],
        stiffness: Sequence[Number],
        rigid: Sequence[bool],
        triads: tuple[Array, Array] | None = None,
        prestress: Sequence[Number] | None = None,
        springs: Sequence[bool] = (),
        slides: Sequence[tuple[int, float]] = (),
    ) -> None:
        """An element between two connection points; `slides`: translations that add to its length, with factors."""
        self.members.append(
            Member(
                element=element,
                name=name,
                links=(Link(connections=connections, triads=triads or (np.eye(3), np.eye(3))),),
                rest=tuple(rest),
                stiffness=tuple(stiffness),
                prestress=tuple(prestress or (0.0,) * len(element.strains)),
                rigid=tuple(rigid),
                rope=False,
                springs=tuple(springs),
                slides=tuple(slides),
            )
        )

    def rope(
        self, element: Element, name: str, links: Sequence[Link], *, rest: Number, stiffness: Number | None
    ) -> None:
        """A rope over one or several links; `stiffness` None: rigid."""
        self.members.append(
            Member(
                element=element,
                name=name,
                links=tuple(links),
                rest=(rest,),
                stiffness=(0.0 if stiffness is None else stiffness,),
                prestress=(0.0,),
                rigid=(stiffness is None,),
                rope=True,
                path=len(links) > 1 or links[0].weight != 1.0,
            )
        )

    def aim(self, element: Element, name: str, connections: Ends, triad: Array | None = None) -> int:
        """Constraints that hold point j at a pose given by coefficients, for inverse positions; `triad`: of j.

        Returns their number among the aims.
        """
        triads = (np.eye(3), np.eye(3) if triad is None else triad)
        zeros = (0.0,) * len(element.strains)
        self.aims.append(
            Member(
                element=element, name=name, links=(Link(connections=connections, triads=triads),), rest=zeros,
                stiffness=(0.0,) * len(element.patterns), prestress=zeros, rigid=(True,) * len(zeros), rope=False,
            )
        )  # fmt: skip
        return len(self.aims) - 1

    def reading_point(self, connection: ConnectionPoint) -> int:
        """A point that sensors read; returns its number among the points."""
        self.points.append(Link(connections=(ConnectionPoint(Point(), GROUND), connection)))
        return len(self.points) - 1

    def force(self, kind: str, number: int, coefficient: int) -> None:
        """A constant force along a translation, or moment about one rotation (its axis, or its three base axes)."""
        self.forces.append((kind, number, coefficient))

    def build(self, drives: Sequence[tuple[Drive, str, str]], parked: Sequence[int] = ()) -> Topology:
        """The frozen topology. `drives`: a drive with the element and strain names of a STRAIN target."""
        groups: list[Group] = []
        sequence: list[Link] = []
        for members in self._groups():
            groups.append(self._group(members, sequence))
        aims = [self._group([member], sequence) for member in self.aims]
        first_point = len(sequence)
        sequence += self.points
        offset_vectors = offset_vectors_of(sequence, self.offsets, len(self.translations))
        return Topology(
            planar=self.planar,
            coefficients=CoefficientTable(np.array(self.constants), tuple(self.formulas), tuple(self.labels)),
            translation_coefficients=np.array([t[0] for t in self.translations], dtype=np.intp),
            translation_reference=np.array([t[1] for t in self.translations]),
            translation_free=np.array([t[2] for t in self.translations], dtype=bool),
            translation_names=tuple(t[3] for t in self.translations),
            rotations=self._rotating(),
            offset_vectors=offset_vectors,
            groups=tuple(groups),
            aims=tuple(aims),
            points=np.arange(first_point, len(sequence)),
            force_dofs=np.array(self._forced_dofs(), dtype=np.intp),
            force_coefficients=np.array([coefficient for _, _, coefficient in self.forces], dtype=np.intp),
            drives=tuple(_located(drive, element, strain, groups) for drive, element, strain in drives),
            parked=tuple(parked),
        )

    def _groups(self) -> list[list[Member]]:
        out: dict[tuple[Element, bool], list[Member]] = {}
        for member in self.members:
            out.setdefault((member.element, member.path), []).append(member)
        return list(out.values())

    def _group(self, members: list[Member], sequence: list[Link]) -> Group:
        """The group of alike members; their links go to the end of the sequence of all."""
        element = members[0].element
        labels = [member.name for member in members for _ in member.links]
        links = [link for member in members for link in member.links]
        where = slice(len(sequence), len(sequence) + len(links))
        sequence += links

        def block(kind: str, of: Sequence[str], values: list[tuple[Number, ...]], names: Sequence[str]) -> slice:
            start = len(self.constants)
            for label, row in zip(of, values, strict=True):
                for name, value in zip(names, row, strict=True):
                    self.coefficient(value, f"{label}.{kind}.{name}")
            return slice(start, len(self.constants))

        numbers = [str(k) for k in range(len(element.patterns))]
        every = [member.name for member in members]
        owners = np.repeat(np.arange(len(members)), [len(member.links) for member in members])
        return Group(
            element=element,
            names=tuple(every),
            links=where,
            rotation=np.array([[link.connections[side].rotation for link in links] for side in (0, 1)], dtype=np.intp),
            triads=np.array([[link.triads[side] for link in links] for side in (0, 1)]),
            sizes=block("size", labels, [link.sizes for link in links], element.sizes),
            path=owners if members[0].path else None,
            weights=np.array([link.weight for link in links]),
            rest=block("rest", every, [member.rest for member in members], element.strains),
            stiffness=block("stiffness", every, [member.stiffness for member in members], numbers),
            prestress=block("prestress", every, [member.prestress for member in members], element.strains),
            rigid=np.array([member.rigid for member in members], dtype=bool).reshape(len(every), -1),
            rope=np.array([member.rope for member in members], dtype=bool),
            springs=springs_of(members),
            slides=slides_of(members, len(self.translations)),
        )

    def _rotating(self) -> Rotations:
        return Rotations(
            kind=np.array([int(r[0]) for r in self.rotations]),
            axis=np.array([r[1] for r in self.rotations]),
            reference=np.array([r[2] for r in self.rotations]),
            filed=np.array([self.filed.get(k, r[2]) for k, r in enumerate(self.rotations)]),
            coefficients=np.array([r[3] for r in self.rotations], dtype=np.intp),
            carrier=np.array([self.carriers.get(k, -1) for k in range(len(self.rotations))], dtype=np.intp),
            names=tuple(r[4] for r in self.rotations),
        )

    def _forced_dofs(self) -> list[int]:
        """Coordinates on which constant forces act: translations first, then the rotations' own."""
        widths = np.array([0, 3, 1])[[int(r[0]) for r in self.rotations]]
        widths[list(self.carriers)] = 0
        first = len(self.translations) + np.cumsum(widths) - widths
        dofs = []
        for kind, number, _ in self.forces:
            if kind == "translation":
                dofs.append(number)
                continue
            rotation, axis = divmod(number, 3)
            dofs.append(int(first[rotation]) + (axis if widths[rotation] == 3 else 0))
        return dofs


def _located(drive: Drive, element: str, strain: str, groups: Sequence[Group]) -> Drive:
    """A STRAIN drive with its target and coefficients filled in."""
    if drive.kind is not DriveKind.STRAIN:
        return drive
    for g, group in enumerate(groups):
        if element in group.names and strain in group.element.strains:
            e, m = group.names.index(element), group.element.strains.index(strain)
            at = e * len(group.element.strains) + m
            coefficient, force_coefficient = group.rest.start + at, group.prestress.start + at
            rigid = bool(group.rigid[e, m])
            return replace(
                drive, target=(g, e, m), coefficient=coefficient, force_coefficient=force_coefficient, rigid=rigid
            )
    raise KeyError(f"drive {drive.name}: no element {element} with strain {strain}")
