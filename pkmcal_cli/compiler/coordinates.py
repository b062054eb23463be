"""Coordinates of the topology under construction: travels, rotations, points, and where they are in the reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.compiler.axes import Vector, carried
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.mechanism.builder import TopologyBuilder
from pkmcal_cli.mechanism.connection_points import Number, Point
from pkmcal_cli.mechanism.topology import GROUND, RotationKind


@dataclass(frozen=True)
class ReferenceConfiguration:
    """The nominal one, closed: travels (m) and orientations (3, 3) by name that replace those of the file."""

    translations: dict[str, float] = field(default_factory=dict)
    orientations: dict[str, Array] = field(default_factory=dict)


@dataclass(kw_only=True)
class Coordinates:
    """New coordinates for a machine, at their values in the assembled reference configuration."""

    machine: Machine
    configuration: ReferenceConfiguration
    builder: TopologyBuilder
    carriage_travel: dict[str, int] = field(default_factory=dict)  # body or prismatic joint -> travel
    anchors: dict[tuple[str, str], int] = field(default_factory=dict)  # (kind, name) -> offset vector, for effects

    @property
    def planar(self) -> bool:
        """Whether the machine lives in the plane."""
        return self.machine.space == "planar"

    @property
    def nominal(self) -> dict[str, float]:
        """Nominal parameter values, SI."""
        return self.builder.nominal

    def new_rotation(self, name: str, filed: Array | None = None) -> int:
        """An unknown rotation: about z in the plane, any in space. `filed`: its orientation in the file."""
        filed = np.eye(3) if filed is None else filed
        reference = self.configuration.orientations.get(name, filed)
        made = self.builder.rotation(RotationKind.AXIS if self.planar else RotationKind.FREE, name, reference=reference)
        self.builder.filed[made] = filed
        return made

    def new_travel(self, name: str, reference: float, coefficient: int = -1) -> int:
        """A travel, at its assembled value where there is one."""
        return self.builder.translation(self.configuration.translations.get(name, reference), name, coefficient)

    def free_point(self, name: str, at: Array) -> Point:
        """A point free to move along the base axes."""
        axes = np.eye(3)[: 2 if self.planar else 3]
        translations = (self.new_travel(f"{name}.{c}", float(v)) for v, c, _ in zip(at, "xyz", axes, strict=False))
        return Point((), tuple((GROUND, t, tuple(axis)) for t, axis in zip(translations, axes, strict=True)))

    def position(self, point: Point) -> Array:
        """Place of a point in the reference configuration, base axes (3,), m."""
        b, out = self.builder, np.zeros(3)
        for r, sign, index in point.offsets:
            out = out + self.orientation(r) @ (sign * np.array([b.constants[k] for k in b.offsets[index]]))
        for r, t, axis in point.translations:
            out = out + self.orientation(r) @ (b.translations[t][1] * np.array(axis))
        return out

    def orientation(self, rotation: int) -> Array:
        """Orientation of a rotation in the reference configuration, (3, 3)."""
        _, _, reference, coefficients, _ = self.builder.rotations[rotation]
        carrier = self.builder.carriers.get(rotation)
        if carrier is None:
            return reference
        return np.asarray(self.orientation(carrier) @ self._frame_rotation(coefficients) @ reference)

    def filed_orientation(self, rotation: int) -> Array:
        """Orientation of a rotation in the file's configuration, (3, 3)."""
        _, _, reference, coefficients, _ = self.builder.rotations[rotation]
        carrier = self.builder.carriers.get(rotation)
        if carrier is None:
            return self.builder.filed.get(rotation, reference)
        return np.asarray(self.filed_orientation(carrier) @ self._frame_rotation(coefficients) @ reference)

    def _frame_rotation(self, coefficients: Sequence[int]) -> Array:
        return exp(np.array([self.builder.constants[k] for k in coefficients]))

    def tilted(self, rotation: int, tilt: Vector | None, name: str, since: Array | None = None) -> int:
        """The rotation that carries what parameters turn against a rotation; that one itself where there is no turn.

        `tilt` in base axes, at the orientation `since` (3, 3); default: at that of the reference configuration.
        """
        if tilt is None:
            return rotation
        reference = self.orientation(rotation) if since is None else since
        return self.builder.frame(name, carried(tilt, reference.T), rotation)

    def anchored(self, kind: str, name: str, rotation: int, value: Sequence[Number], label: str) -> Point:
        """A point at a constant offset that effects can move."""
        point = self.builder.offset(rotation, value, label)
        self.anchors[kind, name] = point.offsets[0][2]
        return point
