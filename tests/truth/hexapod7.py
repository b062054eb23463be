"""Gough-Stewart platform with seven legs whose beams bend, as chains of rigid pieces. SI units.

Leg i: universal joint at the base (first axis horizontal and across the drawn leg, fixed to the base; second
axis across the first and the leg), lower beam, rigid drive of travel q_i along the end of the lower beam,
upper beam of natural length a_i, ball joint on the platform. A beam's weight acts half at each of its ends.
Stationary point of

    sum 1/2 spring z^2 - weights - F q + sum lambda . (tip(z) - P(platform))

over the platform's pose, the joint values z of all legs and the forces lambda (7, 3) in N which the legs'
tips give to the platform. Newton's method with closed-form second derivatives, residuals in extended
precision.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from . import beam_chain, pinned
from . import dimensions as dim
from .beam_chain import Chains, Joint, Section
from .pinned import WIDE, Array, DeadForce, Rods, State
from .pinned_machine import Parameters

LEGS = len(dim.HEXAPOD7_LEGS)
SECTION = Section.tube(*dim.HEXAPOD7_DIAMETERS, dim.HEXAPOD7_E, dim.HEXAPOD7_G, dim.HEXAPOD7_DENSITY)
MAX_STEPS = 40
STEP_DONE = 1e-14
"""Newton step (m, rad) below which the state is accepted."""


@dataclass(frozen=True)
class Solved:
    """One row: platform state, elastic energies in J by kind of spring, `drive_force` (7,) in N (positive:
    the drive pushes towards greater travel), `tip_force` (7, 3) in N on the platform, Newton steps."""

    state: State
    energy: Mapping[str, float]
    drive_force: Array
    tip_force: Array
    steps: int


@dataclass(frozen=True)
class ForwardBent:
    """N rows: `tcp` (N, 6) in m and rad (rotation vector), `travel` and `drive_force` (N, 7) in m and N,
    energies (N,) in J: all, and that of bending and torsion alone."""

    tcp: Array
    travel: Array
    drive_force: Array
    energy: Array
    bending: Array


def points(p: Parameters, end: str) -> Array:
    """Base (end "b") or platform (end "p") points (7, 3) in m."""
    return np.array([[p[f"{end}{i}{axis}"] for axis in "xyz"] for i in dim.HEXAPOD7_LEGS], WIDE)


def drawn_frames() -> Array:
    """Axes (7, 3, 3) of the drawn legs as columns: along the leg, first and second axis of the universal
    joint."""
    way = points(dim.HEXAPOD7, "p") + np.array(dim.HEXAPOD7_DRAWN) - points(dim.HEXAPOD7, "b")
    along = way / np.sqrt((way**2).sum(1))[:, None]
    first = np.cross([0, 0, 1], along)
    first /= np.sqrt((first**2).sum(1))[:, None]
    return np.stack([along, first, np.cross(along, first)], 2)


def legs(p: Parameters, section: Section, pieces: int) -> Chains:
    """The seven legs as chains: universal joint, lower beam, drive, upper beam."""
    zero = np.zeros(LEGS, WIDE)
    universal = [Joint(axis, False, zero, zero, "free") for axis in (1, 2)]
    lower, behind = beam_chain.beam(np.full(LEGS, dim.HEXAPOD7_LOWER, WIDE), section, pieces)
    drive = Joint(0, True, behind, zero, "drive")
    upper, tail = beam_chain.beam(lengths(p), section, pieces)
    return Chains(points(p, "b"), drawn_frames(), (*universal, *lower, drive, *upper), tail)


def lengths(p: Parameters) -> Array:
    """Natural lengths (7,) of the upper beams in m."""
    return np.array([p[f"a{i}"] for i in dim.HEXAPOD7_LEGS], WIDE)


def straight(chains: Chains, start: pinned.Equilibrium, body: Array) -> tuple[Array, Array]:
    """Joint values (7, M) and tip forces (7, 3) of straight legs, from the machine of pinned rods."""
    state, pull = start.state, start.tension
    way = state.position + body @ state.rotation.T - chains.base
    way /= np.sqrt((way**2).sum(1))[:, None]
    local = np.einsum("cik,ci->ck", chains.frame, way)
    z = np.zeros((LEGS, len(chains.joints)), WIDE)
    # the universal joint turns the drawn direction to: cos a cos b, sin b, -sin a cos b
    z[:, 0] = np.arctan2(-local[:, 2], local[:, 0])
    z[:, 1] = np.arcsin(local[:, 1])
    z[:, chains.of_kind("drive")] = state.travel[:, None]
    stretch = chains.of_kind("stretch")
    z[:, stretch] = pull[:, None] / chains.springs[:, stretch]
    return z, -pull[:, None] * way


def platform_motion(arm: Array) -> Array:
    """Derivative (7, 3, 6) of platform points at `arm` (7, 3) from its origin by translation and turn."""
    return np.concatenate([np.broadcast_to(np.eye(3), (LEGS, 3, 3)), [-pinned.skew(a) for a in arm]], 2)


@dataclass(frozen=True, kw_only=True)
class Hexapod7:
    """The machine; `pieces`: springs per beam. `section` may be changed to look at stiffer or lighter
    beams."""

    pieces: int = 16
    section: Section = SECTION
    gravity: float = dim.GRAVITY
    name: str = "hexapod7"
    drives: tuple[str, ...] = tuple(f"q{i}" for i in dim.HEXAPOD7_LEGS)
    redundant: tuple[str, ...] = ("q7",)
    channels: tuple[str, ...] = ("x", "y", "z", "rx", "ry", "rz")
    nominal: Parameters = field(default_factory=lambda: dict(dim.HEXAPOD7))
    ranges: Parameters = field(default_factory=lambda: dim.half_widths(dim.HEXAPOD7))

    def inverse(self, tcp: ArrayLike, parameters: Parameters | None = None) -> Array:
        """Travels (N, 7) in m, without strain and weight, for poses (N, 6): place in m, rotation vector in
        rad."""
        p = {**self.nominal, **(parameters or {})}
        rows = []
        for pose in np.atleast_2d(np.asarray(tcp, float)):
            tip = pose[:3] + points(p, "p") @ pinned.rotation_matrix(pose[3:]).T
            reach = np.sqrt(((tip - points(p, "b")) ** 2).sum(1))
            rows.append(reach - dim.HEXAPOD7_LOWER - lengths(p))
        return np.array(rows, float)

    def forward(
        self,
        q: ArrayLike,
        parameters: Parameters | None = None,
        force: Mapping[str, float] | None = None,
        loads: Sequence[DeadForce] = (),
    ) -> ForwardBent:
        """Poses for travels `q` (N, 7) in m; `force` and `loads` as for `pinned_machine.Machine.forward`."""
        found = [self.solve(row, parameters, force, loads) for row in np.atleast_2d(np.asarray(q, float))]
        return ForwardBent(
            np.array([[*s.state.position, *pinned.rotation_vector(s.state.rotation)] for s in found], float),
            np.array([s.state.travel for s in found], float),
            np.array([s.drive_force for s in found], float),
            np.array([sum(s.energy.values()) for s in found]),
            np.array([s.energy["bend"] + s.energy["twist"] for s in found]),
        )

    def pinned_start(
        self, q: Array, p: Parameters, force: Mapping[int, float], loads: Sequence[DeadForce]
    ) -> pinned.Equilibrium:
        """The machine with its legs as straight pinned rods of the same axial stiffness."""
        rods = Rods.of(
            body=points(p, "p"),
            base=points(p, "b"),
            drive=range(LEGS),
            length=lengths(p) + dim.HEXAPOD7_LOWER,
            stiffness=self.section.ea / (lengths(p) + dim.HEXAPOD7_LOWER),
            feed=np.ones(LEGS),
        )
        return pinned.minimise(rods, State.at(dim.HEXAPOD7_DRAWN, q), pinned.SPATIAL, loads, force)

    def solve(
        self,
        q: ArrayLike,
        parameters: Parameters | None = None,
        force: Mapping[str, float] | None = None,
        loads: Sequence[DeadForce] = (),
    ) -> Solved:
        """Equilibrium of one row, `q` (7,) in m."""
        p = {**self.nominal, **(parameters or {})}
        chains = legs(p, self.section, self.pieces)
        pushed = {self.drives.index(name): value for name, value in (force or {}).items()}
        own = DeadForce(np.array([0, 0, -dim.HEXAPOD7_MASS * self.gravity]), np.zeros(3))
        dead = (own, *loads)
        start = self.pinned_start(np.asarray(q, float), p, pushed, dead)
        position, rotation = start.state.position, start.state.rotation
        z, tip_force = straight(chains, start, points(p, "p"))
        system = System(chains, points(p, "p"), pushed, dead, self.weights(p))
        for steps in range(1, MAX_STEPS + 1):
            turn, dz, dforce = system.step(position, rotation, z, tip_force)
            position, rotation = position + turn[:3], pinned.rotation_matrix(turn[3:]) @ rotation
            z, tip_force = z + dz, tip_force + dforce
            if max(np.abs(turn).max(), np.abs(dz).max()) < STEP_DONE:
                energy = {
                    kind: float((chains.springs * z**2)[:, chains.of_kind(kind)].sum() / 2)
                    for kind in ("bend", "twist", "stretch")
                }
                state = State(position, rotation, z[:, system.drive])
                return Solved(state, energy, system.drive_force(z, tip_force), tip_force, steps)
        raise RuntimeError("hexapod7: no equilibrium")

    def weights(self, p: Parameters) -> Array:
        """Weight (7, 3) in N, along -z, at the end of the lower beam, the start and the end of the upper
        beam."""
        lower = np.full(LEGS, dim.HEXAPOD7_LOWER) * self.section.mass / 2
        upper = lengths(p) * self.section.mass / 2
        return self.gravity * np.stack([lower, upper, upper], 1)


@dataclass(frozen=True)
class System:
    """The Newton system of one row; see the module."""

    chains: Chains
    body: Array
    pushed: Mapping[int, float]
    loads: Sequence[DeadForce]
    weights: Array

    @property
    def drive(self) -> int:
        """Number of the joint that is the drive."""
        return int(np.flatnonzero(self.chains.of_kind("drive"))[0])

    def chain_terms(self, z: Array, tip_force: Array) -> tuple[Array, Array, Array, Array]:
        """Tips (7, 3), their derivative (7, M, 3), gradient (7, M) and Hessian (7, M, M) of the legs'
        part."""
        chains = self.chains
        found = beam_chain.shape(chains, z)
        near = found.origins[:, self.drive]
        far = near + found.axes[:, self.drive] * z[:, self.drive, None]
        count = len(chains.joints)
        gradient = chains.springs * z
        hessian = np.zeros((LEGS, count, count))
        hessian[:, range(count), range(count)] = chains.springs
        down = np.array([0, 0, -1], WIDE)
        carried = [(near, self.drive), (far, self.drive + 1), (found.tip, count)]
        for (point, joints), weight in zip(carried, self.weights.T, strict=True):
            moved = beam_chain.columns(chains, found, point, joints)
            pull = weight[:, None] * down
            gradient = gradient - np.einsum("cmi,ci->cm", moved, pull)
            hessian -= beam_chain.curvature(chains, found, moved, pull)
        moved = beam_chain.columns(chains, found, found.tip, count)
        gradient = gradient + np.einsum("cmi,ci->cm", moved, tip_force)
        hessian += beam_chain.curvature(chains, found, moved, tip_force)
        return found.tip, moved, gradient, hessian

    def drive_force(self, z: Array, tip_force: Array) -> Array:
        """Force (7,) in N of the drives on the mechanism, towards greater travel."""
        force: Array = self.chain_terms(z, tip_force)[2][:, self.drive]
        return force

    def step(self, position: Array, rotation: Array, z: Array, tip_force: Array) -> tuple[Array, Array, Array]:
        """Newton step of the platform (6,), the joints (7, M) and the tip forces (7, 3)."""
        arm = self.body @ rotation.T
        motion = platform_motion(arm)
        tip, moved, gradient, hessian = self.chain_terms(z, tip_force)
        gap = tip - position - arm
        slope = -np.einsum("ciw,ci->w", motion, tip_force)
        curved = np.zeros((6, 6), WIDE)
        curved[3:, 3:] -= sum(pinned.turning(f, a) for f, a in zip(tip_force, arm, strict=True))
        for load in self.loads:
            lever = rotation @ np.asarray(load.point, WIDE)
            slope -= np.concatenate([load.force, np.cross(lever, load.force)])
            curved[3:, 3:] -= pinned.turning(np.asarray(load.force, WIDE), lever)

        count = z.shape[1]
        matrix = np.zeros((LEGS, count + 3, count + 3))
        matrix[:, :count, :count] = hessian
        matrix[:, :count, count:] = moved
        matrix[:, count:, :count] = moved.transpose(0, 2, 1)
        right = np.zeros((LEGS, count + 3, 7))
        right[:, :count, 0] = -gradient
        right[:, count:, 0] = -gap
        right[:, count:, 1:] = motion
        for leg in range(LEGS):
            if leg in self.pushed:
                right[leg, self.drive, 0] += self.pushed[leg]
            else:
                matrix[leg, self.drive] = matrix[leg, :, self.drive] = 0
                matrix[leg, self.drive, self.drive] = 1
                right[leg, self.drive] = 0
        solved = np.linalg.solve(matrix, right)
        forces = solved[:, count:]
        lead = (curved - np.einsum("ciw,civ->wv", motion, forces[:, :, 1:])).astype(float)
        turn = np.linalg.solve(lead, (-slope + np.einsum("ciw,ci->w", motion, forces[:, :, 0])).astype(float))
        whole = solved[:, :, 0] + solved[:, :, 1:] @ turn
        return turn.astype(WIDE), whole[:, :count].astype(WIDE), whole[:, count:].astype(WIDE)
