"""Frames: rigid bodies, springs between them, and slender beams of many Euler-Bernoulli elements. SI units.

Every element has the axes of its chord (x along it, rolled as its ends are on average). Against these its ends have
small rotation vectors, to which the textbook's stiffness applies: EA/L; GJ/L; EI/L [[4, 2], [2, 4]] about y and z.
The energy is 1/2 r^T K r of such deformations r and of springs, less the work of dead forces. r is exact in the pose of
the bodies, so its derivatives bring the geometric stiffness; what an element neglects within itself falls as the square
of its length, so that two meshes extrapolate. The minimum is found by Gauss and Newton's method with r's derivatives by
complex steps; the weight of an element is that of masses at Gauss points of its cubic curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""Numbers, complex where a derivative is taken."""
STEP = 1e-30
MAX_STEPS = 60
DONE = 1e-15
"""Step (m, rad) below which the pose is accepted, or the last that still fell."""


@dataclass
class Frame:
    """Bodies with their poses, and what joins them; a body moves along `free` (6, k), its rotations about its origin.

    Bodies are numbered in the order in which they are added.
    """

    place: list[Array] = field(default_factory=list)
    turn: list[Array] = field(default_factory=list)
    free: list[Array] = field(default_factory=list)
    springs: list[tuple[int, int, Array]] = field(default_factory=list)
    elements: list[tuple[int, int, Array, Array, float, Array]] = field(default_factory=list)
    forces: list[tuple[int, Array, Array]] = field(default_factory=list)

    def body(self, place: Sequence[float] | Array, turn: Array | None = None, free: Array | None = None) -> int:
        """A body: place (3,), orientation (3, 3), motions (6, k) that it has; by default all."""
        self.place.append(np.array(place, dtype=float))
        self.turn.append(np.eye(3) if turn is None else np.array(turn, dtype=float))
        self.free.append(np.eye(6) if free is None else np.reshape(np.array(free, dtype=float), (6, -1)))
        return len(self.place) - 1

    def spring(self, i: int, j: int, stiffness: Sequence[float]) -> None:
        """Springs (x, y, z, rx, ry, rz) in the axes of body i; at rest where body j is in one pose with it."""
        self.springs.append((i, j, np.diag(np.array(stiffness, dtype=float))))

    def beam(self, i: int, j: int, ends: tuple[Array, Array], length: float, section: Section, pieces: int) -> None:
        """A beam from a point of body i to one of body j, in their axes; at rest it runs along the x axes of both."""
        nodes = [(i, ends[0])]
        first, last = self.at(i, ends[0]), self.at(j, ends[1])
        for k in range(1, pieces):
            nodes.append((self.body(first + (last - first) * k / pieces, self.turn[i]), np.zeros(3)))
        nodes.append((j, ends[1]))
        part = length / pieces
        for (a, at_a), (b, at_b) in pairwise(nodes):
            self.elements.append((a, b, np.array([at_a, at_b]), section.stiffness(part), part, section.weight))

    def at(self, body: int, point: Array) -> Array:
        """Where a point of a body is."""
        out: Array = self.place[body] + self.turn[body] @ point
        return out

    def solve(self) -> int:
        """Moves all bodies to the minimum of the energy; returns the number of steps."""
        before = np.inf
        for count in range(1, MAX_STEPS + 1):
            step, motion = self._step()
            size = float(np.abs(step).max())
            for k, (way, moved) in enumerate(zip(self.free, motion, strict=True)):
                if way.shape[1]:
                    self.place[k] = self.place[k] + moved[:3]
                    self.turn[k] = rotation(moved[3:]) @ self.turn[k]
            if size < DONE or (size < 1e-12 and size > 0.5 * before):
                return count
            before = size
        raise RuntimeError(f"frame: no equilibrium, last step {before:g}")

    def _step(self) -> tuple[Array, list[Array]]:
        """One step of Gauss and Newton: of all coordinates, and as motions (6,) of the bodies."""
        first = np.cumsum([0, *(way.shape[1] for way in self.free)])
        gradient, matrix = np.zeros(first[-1]), np.zeros((first[-1], first[-1]))
        for pairs, r, jacobian, stiffness in (self._of_elements(), *([self._of_springs()] if self.springs else [])):
            force = np.einsum("ekl,el->ek", stiffness, r)
            own = np.einsum("eka,ek->ea", jacobian, force)
            square = np.einsum("eka,ekl,elb->eab", jacobian, stiffness, jacobian)
            for e, (i, j) in enumerate(pairs):
                way = np.zeros((12, self.free[i].shape[1] + self.free[j].shape[1]))
                way[:6, : self.free[i].shape[1]], way[6:, self.free[i].shape[1] :] = self.free[i], self.free[j]
                at = np.r_[first[i] : first[i + 1], first[j] : first[j + 1]]
                gradient[at] += way.T @ own[e]
                matrix[np.ix_(at, at)] += way.T @ square[e] @ way
        for body, point, force in self._dead_forces():
            arm = self.turn[body] @ point
            gradient[first[body] : first[body + 1]] -= self.free[body].T @ np.r_[force, np.cross(arm, force)]
        step = -np.linalg.solve(matrix, gradient)
        return step, [way @ step[first[k] : first[k + 1]] for k, way in enumerate(self.free)]

    def _dead_forces(self) -> list[tuple[int, Array, Array]]:
        """Forces at points of bodies: those given, and the elements' weight by Gauss points of their curves."""
        out = list(self.forces)
        nodes, weights = np.polynomial.legendre.leggauss(3)
        tangent = np.array([1.0, 0.0, 0.0])
        for a, b, ends, _, length, weight in self.elements:
            for s, w in zip(0.5 + 0.5 * nodes, 0.5 * weights, strict=True):
                f = w * length * weight
                cubic = (1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3, 3 * s**2 - 2 * s**3, s**3 - s**2)
                # the place of the curve is h0 p_a + h1 L t_a + h2 p_b + h3 L t_b
                for body, end, (along, across) in ((a, ends[0], cubic[:2]), (b, ends[1], cubic[2:])):
                    out.append((body, end, along * f))
                    out += [(body, tangent, across * length * f), (body, np.zeros(3), -across * length * f)]
        return out

    def _of_elements(self) -> tuple[list[tuple[int, int]], Array, Array, Array]:
        pairs = [(e[0], e[1]) for e in self.elements]
        ends, stiffness, length = (np.array([e[k] for e in self.elements]) for k in (2, 3, 4))

        def deformation(place: Array, turn: Array) -> Array:
            return _against_chord(place, turn, ends, length)

        return pairs, *self._with_derivative(pairs, deformation), stiffness

    def _of_springs(self) -> tuple[list[tuple[int, int]], Array, Array, Array]:
        pairs = [(s[0], s[1]) for s in self.springs]
        stiffness = np.array([s[2] for s in self.springs])

        def deformation(place: Array, turn: Array) -> Array:
            way = np.einsum("eji,ej->ei", turn[:, 0], place[:, 1] - place[:, 0])
            return np.concatenate([way, small_rotation(np.einsum("eji,ejk->eik", turn[:, 0], turn[:, 1]))], axis=1)

        return pairs, *self._with_derivative(pairs, deformation), stiffness

    def _with_derivative(self, pairs: list[tuple[int, int]], deformation: Any) -> tuple[Array, Array]:
        """Deformations (E, m) and their derivatives (E, m, 12) by the motions of both bodies."""
        place = np.array([[self.place[i], self.place[j]] for i, j in pairs])
        turn = np.array([[self.turn[i], self.turn[j]] for i, j in pairs])
        columns = []
        for side in (0, 1):
            for k in range(6):
                moved, turned = place.astype(complex), turn.astype(complex)
                if k < 3:
                    moved[:, side, k] += 1j * STEP
                else:
                    turned[:, side] += 1j * STEP * np.cross(np.eye(3)[k - 3], turn[:, side], axisb=1, axisc=1)
                columns.append(deformation(moved, turned).imag / STEP)
        return deformation(place, turn), np.stack(columns, axis=2)


@dataclass(frozen=True, kw_only=True)
class Section:
    """Stiffness of a straight beam along x: EA in N; EIy, EIz, GJ in N m^2; weight in N/m, base axes."""

    ea: float
    eiy: float
    eiz: float
    gj: float
    weight: Array = field(default_factory=lambda: np.zeros(3))

    def stiffness(self, length: float) -> Array:
        """Of stretch, twist, rotations about y at both ends, rotations about z at both ends: (6, 6)."""
        out = np.zeros((6, 6))
        out[0, 0], out[1, 1] = self.ea / length, self.gj / length
        for k, ei in ((2, self.eiy), (4, self.eiz)):
            out[k : k + 2, k : k + 2] = ei / length * np.array([[4.0, 2.0], [2.0, 4.0]])
        return out


def _against_chord(place: Array, turn: Array, ends: Array, length: Array) -> Array:
    """Stretch, twist and rotations of both ends of elements (E, 6) against the axes of their chords."""
    points = place + np.einsum("esij,esj->esi", turn, ends)
    chord = points[:, 1] - points[:, 0]
    size = np.sqrt((chord * chord).sum(1))
    x = chord / size[:, None]
    z = np.cross(x, turn[:, 0, :, 1] + turn[:, 1, :, 1])
    z = z / np.sqrt((z * z).sum(1))[:, None]
    own = np.stack([x, np.cross(z, x), z], axis=2)
    first, last = (small_rotation(np.einsum("eji,ejk->eik", own, turn[:, side])) for side in (0, 1))
    parts = [size - length, last[:, 0] - first[:, 0], first[:, 1], last[:, 1], first[:, 2], last[:, 2]]
    return np.stack(parts, axis=1)


def small_rotation(turn: Array) -> Array:
    """Rotation vectors (E, 3) of rotations by less than about 0.1 rad: s (1 + s^2 / 6 + ...), s the sine's vector."""
    s = 0.5 * np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1)
    q = (s * s).sum(1)[:, None]
    assert np.abs(q).max() < 0.01
    return np.asarray(s * (1 + q * (1 / 6 + q * (3 / 40 + q * (15 / 336 + q * 105 / 3456)))))


def rotation(vector: Array) -> Array:
    """Rotation matrix of a rotation vector (3,)."""
    angle = float(np.sqrt(vector @ vector))
    k = np.array([[0, -vector[2], vector[1]], [vector[2], 0, -vector[0]], [-vector[1], vector[0], 0]])
    if angle < 1e-12:
        return np.asarray(np.eye(3) + k)
    out: Array = np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * (k @ k)
    return out
