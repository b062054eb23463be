"""Beams as chains of rigid pieces: bending, torsion and stretch in springs between the pieces. SI units.

A beam of length L with n springs of each kind: spring stations at the middles of n equal parts h = L / n,
rigid pieces between them. At each station two bending hinges (EI / h each), one twist (GJ / h) and one slide
(EA / h). The error of a place or an energy falls as 1 / n^2 (midpoint rule), so two values of n extrapolate.

All chains of a set have the same joints; arrays run over chains C and joints M. Joint m turns about, or
slides along, an axis of the piece before it. Place of a point p: dp/dz_m = axis x (p - origin) for a turn, =
axis for a slide; d2p/dz_j dz_m = axis_j x dp/dz_m for a turn j at or before m, 0 for a slide j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pinned import WIDE, Array


@dataclass(frozen=True)
class Section:
    """Stiffness of a straight beam: EA in N, EI (both directions) and GJ in N m^2, mass per length in
    kg/m."""

    ea: float
    ei: float
    gj: float
    mass: float

    @classmethod
    def tube(cls, outer: float, inner: float, e: float, g: float, density: float) -> Section:
        """Tube with diameters in m, moduli in Pa, density in kg/m^3."""
        area = np.pi / 4 * (outer**2 - inner**2)
        second = np.pi / 64 * (outer**4 - inner**4)
        return cls(e * area, e * second, g * 2 * second, density * area)


@dataclass(frozen=True)
class Joint:
    """A joint of all chains: axis 0, 1, 2 of the piece before it; `before` (C,) m along axis 0 ahead of it;
    `spring` (C,) in N/m or N m/rad, 0 for a free one; `kind`: "free", "bend", "twist", "stretch" or
    "drive"."""

    axis: int
    slides: bool
    before: Array
    spring: Array
    kind: str


@dataclass(frozen=True)
class Chains:
    """C chains of M joints: `base` (C, 3) in m, `frame` (C, 3, 3) the first piece's axes as columns, `tail`
    (C,) m along axis 0 behind the last joint."""

    base: Array
    frame: Array
    joints: tuple[Joint, ...]
    tail: Array

    @property
    def turns(self) -> NDArray[np.bool_]:
        """Which joints (M,) turn."""
        return np.array([not joint.slides for joint in self.joints])

    @property
    def springs(self) -> Array:
        """Spring stiffness (C, M)."""
        return np.array([joint.spring for joint in self.joints], WIDE).T

    def of_kind(self, *kinds: str) -> NDArray[np.bool_]:
        """Which joints (M,) are of the given kinds."""
        return np.array([joint.kind in kinds for joint in self.joints])


@dataclass(frozen=True)
class Shape:
    """Place of the chains: axes and origins of the joints (C, M, 3), tips (C, 3) in m, last frames (C, 3,
    3)."""

    axes: Array
    origins: Array
    tip: Array
    frame: Array


def beam(length: Array, section: Section, pieces: int) -> tuple[list[Joint], Array]:
    """Joints of a beam of natural length (C,) in m, and the rigid half piece (C,) in m behind the last
    one."""
    part = np.asarray(length, WIDE) / pieces
    joints = []
    for station in range(pieces):
        ahead = part / 2 if station == 0 else part
        joints += [
            Joint(1, False, ahead, section.ei / part, "bend"),
            Joint(2, False, 0 * part, section.ei / part, "bend"),
            Joint(0, False, 0 * part, section.gj / part, "twist"),
            Joint(0, True, 0 * part, section.ea / part, "stretch"),
        ]
    return joints, part / 2


def shifted(joints: Sequence[Joint], ahead: Array) -> list[Joint]:
    """The same joints, the first one `ahead` (C,) m further along."""
    first = joints[0]
    return [Joint(first.axis, first.slides, first.before + ahead, first.spring, first.kind), *joints[1:]]


def shape(chains: Chains, z: Array) -> Shape:
    """Place of the chains for joint values `z` (C, M) in rad and m."""
    frame, place = np.array(chains.frame, WIDE), np.array(chains.base, WIDE)
    axes, origins = [], []
    for m, joint in enumerate(chains.joints):
        place = place + frame[:, :, 0] * joint.before[:, None]
        axis = frame[:, :, joint.axis]
        axes.append(axis)
        origins.append(place)
        if joint.slides:
            place = place + axis * z[:, m, None]
        else:
            second, third = (joint.axis + 1) % 3, (joint.axis + 2) % 3
            c, s = np.cos(z[:, m, None]), np.sin(z[:, m, None])
            frame = frame.copy()
            old = frame[:, :, second].copy()
            frame[:, :, second] = c * old + s * frame[:, :, third]
            frame[:, :, third] = c * frame[:, :, third] - s * old
    tip = place + frame[:, :, 0] * chains.tail[:, None]
    return Shape(np.stack(axes, 1), np.stack(origins, 1), tip, frame)


def columns(chains: Chains, found: Shape, point: Array, joints: int) -> Array:
    """Derivative (C, M, 3) of points (C, 3) that the first `joints` joints carry."""
    turns = chains.turns[None, :, None]
    moved = np.where(turns, np.cross(found.axes, point[:, None] - found.origins), found.axes)
    moved[:, joints:] = 0
    return moved


def curvature(chains: Chains, found: Shape, moved: Array, force: Array) -> NDArray[np.float64]:
    """Second derivative (C, M, M) of force . point for forces (C, 3) in N, with `moved` from `columns`."""
    lever = np.cross(force[:, None], found.axes) * chains.turns[None, :, None]
    upper = np.triu(lever.astype(float) @ moved.astype(float).transpose(0, 2, 1))
    whole: NDArray[np.float64] = upper + np.triu(upper, 1).transpose(0, 2, 1)
    return whole


def cantilever(length: float, section: Section, pieces: int, force: Sequence[float]) -> tuple[Array, float]:
    """Tip (3,) in m and elastic energy in J of a beam along x, clamped at the origin, dead force (3,) in N at
    the tip. Newton's method with the load in ten steps."""
    joints, tail = beam(np.array([length]), section, pieces)
    chains = Chains(np.zeros((1, 3)), np.eye(3)[None], tuple(joints), tail)
    z = np.zeros((1, len(joints)), WIDE)
    for share in np.linspace(0.1, 1, 10):
        pull = share * np.array([force], WIDE)
        for _ in range(60):
            found = shape(chains, z)
            moved = columns(chains, found, found.tip, len(joints))
            gradient = chains.springs * z - np.einsum("cmi,ci->cm", moved, pull)
            hessian = np.diag(chains.springs[0].astype(float)) - curvature(chains, found, moved, pull)[0]
            step = np.linalg.solve(hessian, gradient[0].astype(float))
            z = z - step
            if np.abs(step).max() < 1e-14:
                break
        else:
            raise RuntimeError("cantilever: no equilibrium")
    return shape(chains, z).tip[0], float((chains.springs * z**2).sum() / 2)
