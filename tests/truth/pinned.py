"""Energy minimisation for a platform held by pinned rods and ropes, planar or spatial.

Everything is SI: m, N, rad, N/m, J. A rod is a spring with elongation

    e = |d| - l - feed * s,    d = t + R a - (b + s u),    energy 1/2 k e^2 + T e

(t, R: platform position and rotation matrix; a: rod end on the platform, in its frame; b + s u: rod end on
the carrier at travel s of its drive; l: natural length; feed: growth of the natural length per travel; T:
constant tension). The potential is the sum over the rods, minus the work of dead forces on points of the
platform, minus the work F s of the force-controlled drives, plus 1/2 kd (s - q)^2 for drives of stiffness kd.
Newton's method with the closed-form gradient and Hessian, gradient and state in extended precision, so the
pose is good to about 1e-15 m. Planar machines use the same formulas with the freedoms x, y (and rz) only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]
"""Float64 or long double."""

WIDE = np.longdouble
PLANAR_POINT = (0, 1)
"""Freedoms of a platform that is a point in the plane, out of x, y, z, rx, ry, rz."""
PLANAR = (0, 1, 5)
SPATIAL_POINT = (0, 1, 2)
SPATIAL = (0, 1, 2, 3, 4, 5)
MAX_STEPS = 200
STEP_DONE = 1e-15
"""Newton step (m, rad) below which the state is accepted."""


@dataclass(frozen=True, kw_only=True)
class Rods:
    """R rods as plain arrays; see the module's formula. `drive` (R,) names the drive by its column, -1:
    none."""

    body: Array
    base: Array
    along: Array
    feed: Array
    drive: NDArray[np.intp]
    length: Array
    stiffness: Array
    tension: Array
    rope: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        body: ArrayLike,
        base: ArrayLike,
        drive: Sequence[int],
        length: ArrayLike,
        stiffness: ArrayLike,
        along: ArrayLike | None = None,
        feed: ArrayLike | None = None,
        tension: ArrayLike | None = None,
        rope: ArrayLike | None = None,
    ) -> Rods:
        """Rods from lists; points (R, 2) or (R, 3) in m, lengths (R,) in m, stiffness (R,) in N/m."""
        count = len(drive)

        def points(values: ArrayLike | None) -> Array:
            given = np.zeros((count, 0)) if values is None else np.asarray(values, WIDE)
            return np.pad(given, ((0, 0), (0, 3 - given.shape[1]))).astype(WIDE)

        def scalars(values: ArrayLike | None) -> Array:
            return np.array(np.broadcast_to(0 if values is None else np.asarray(values, WIDE), count), WIDE)

        return cls(
            body=points(body),
            base=points(base),
            along=points(along),
            feed=scalars(feed),
            drive=np.asarray(drive, np.intp),
            length=scalars(length),
            stiffness=scalars(stiffness),
            tension=scalars(tension),
            rope=np.array(np.broadcast_to(False if rope is None else np.asarray(rope, bool), count)),
        )


@dataclass(frozen=True)
class State:
    """Platform position t (3,) in m, rotation matrix (3, 3), travel of the drives (A,) in m."""

    position: Array
    rotation: Array
    travel: Array

    @classmethod
    def at(cls, position: ArrayLike, travel: ArrayLike, turn: ArrayLike = (0, 0, 0)) -> State:
        """State at a position (2,) or (3,), with a rotation vector."""
        place = np.asarray(position, WIDE)
        return cls(np.pad(place, (0, 3 - place.size)), rotation_matrix(turn), np.array(travel, WIDE))

    def moved(self, step: Array) -> State:
        """State after a step (6 + A,): translation, rotation vector in base axes, travels."""
        return State(self.position + step[:3], rotation_matrix(step[3:6]) @ self.rotation, self.travel + step[6:])


@dataclass(frozen=True)
class Drives:
    """Which drives are free: constant `force` in N (work force * travel) or `stiffness` in N/m about
    `command`."""

    force: Mapping[int, float]
    stiffness: Mapping[int, float]
    command: Array


@dataclass(frozen=True)
class DeadForce:
    """A force (3,) in N, constant in base axes, on a point (3,) in m of the platform."""

    force: Array
    point: Array


@dataclass(frozen=True)
class Equilibrium:
    """A minimum: state, elastic energy in J, elongations (R,) in m, tensions (R,) in N, forces (A,) in N
    which the drives give towards greater travel, Newton steps taken."""

    state: State
    energy: float
    elongation: Array
    tension: Array
    drive_force: Array
    steps: int


def skew(vector: ArrayLike) -> Array:
    """Matrix (3, 3) of the cross product from the left."""
    x, y, z = np.asarray(vector, WIDE)
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], WIDE)


def rotation_matrix(vector: ArrayLike) -> Array:
    """Rotation matrix (3, 3) of a rotation vector (3,) in rad."""
    turn = np.asarray(vector, WIDE)
    angle: Any = np.sqrt(turn @ turn)
    cross = skew(turn)
    small = angle < 1e-3
    full = 1 - angle**2 / 6 + angle**4 / 120 if small else np.sin(angle) / angle
    half = 1 - angle**2 / 24 + angle**4 / 1920 if small else 2 * np.sin(angle / 2) / angle
    matrix: Array = np.eye(3, dtype=WIDE) + full * cross + half**2 / 2 * (cross @ cross)
    return matrix


def rotation_vector(matrix: ArrayLike) -> Array:
    """Rotation vector (3,) in rad of a rotation matrix (3, 3), for angles below pi."""
    turn = np.asarray(matrix, WIDE)
    twice_sine = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]], WIDE)
    sine = np.sqrt(twice_sine @ twice_sine) / 2
    angle = np.arctan2(sine, (np.trace(turn) - 1) / 2)
    turned: Array = twice_sine / 2 * (angle / sine if sine > 1e-10 else 1)
    return turned


def potential(
    rods: Rods, state: State, loads: Sequence[DeadForce], drives: Drives
) -> tuple[Any, Array, Array, Array, Array]:
    """Potential in J, gradient (6 + A,), Hessian (6 + A, 6 + A), elongations (R,), tensions (R,)."""
    count, width = rods.drive.size, 6 + state.travel.size
    driven = rods.drive >= 0
    travel = np.append(state.travel, 0)[rods.drive]
    arm = rods.body @ state.rotation.T
    chord = state.position + arm - rods.base - travel[:, None] * rods.along
    reach = np.sqrt((chord**2).sum(1))
    unit = chord / reach[:, None]
    elongation = reach - rods.length - rods.feed * travel
    taut = ~(rods.rope & (elongation <= 0))
    stiffness = np.where(taut, rods.stiffness, 0)
    tension = stiffness * elongation + rods.tension

    motion = np.zeros((count, 3, width), WIDE)
    motion[:, :, :3] = np.eye(3)
    motion[:, :, 3:6] = [-skew(a) for a in arm]
    rows = np.flatnonzero(driven)
    motion[rows, :, 6 + rods.drive[rows]] = -rods.along[rows]
    across = motion - unit[:, :, None] * np.einsum("ri,riw->rw", unit, motion)[:, None]
    slope = np.einsum("ri,riw->rw", unit, motion)
    slope[rows, 6 + rods.drive[rows]] -= rods.feed[rows]

    value: Any = (0.5 * stiffness * elongation**2 + rods.tension * elongation).sum()
    gradient = tension @ slope
    hessian = np.einsum("r,rv,rw->vw", stiffness, slope, slope)
    hessian += np.einsum("r,riv,riw->vw", tension / reach, across, across)
    for pull, lever in zip(tension[:, None] * unit, arm, strict=True):
        hessian[3:6, 3:6] += turning(pull, lever)
    for load in loads:
        lever = state.rotation @ np.asarray(load.point, WIDE)
        force = np.asarray(load.force, WIDE)
        value -= force @ (state.position + lever)
        gradient[:3] -= force
        gradient[3:6] -= np.cross(lever, force)
        hessian[3:6, 3:6] -= turning(force, lever)
    for column, push in drives.force.items():
        value -= push * state.travel[column]
        gradient[6 + column] -= push
    for column, spring in drives.stiffness.items():
        stretch = state.travel[column] - drives.command[column]
        value += 0.5 * spring * stretch**2
        gradient[6 + column] += spring * stretch
        hessian[6 + column, 6 + column] += spring
    return value, gradient, hessian, elongation, tension


def turning(force: Array, lever: Array) -> Array:
    """Second derivative (3, 3) of force . (rotated lever) by the rotation vector of the turn."""
    mixed = np.outer(force, lever)
    second: Array = (mixed + mixed.T) / 2 - (force @ lever) * np.eye(3, dtype=WIDE)
    return second


def minimise(
    rods: Rods,
    start: State,
    freedoms: Sequence[int],
    loads: Sequence[DeadForce] = (),
    force: Mapping[int, float] | None = None,
    stiffness: Mapping[int, float] | None = None,
) -> Equilibrium:
    """Minimum of the potential near `start`, over the platform's `freedoms` and the free drives.

    `force`: drives of constant force in N, by column. `stiffness`: drives that yield, N/m, about their travel
    in `start`. All other drives stay at their travel in `start`. Raises RuntimeError without a minimum.
    """
    drives = Drives(dict(force or {}), dict(stiffness or {}), start.travel)
    free = np.array([*freedoms, *(6 + c for c in sorted({*drives.force, *drives.stiffness}))])
    state, shift = start, 0.0
    size = np.inf
    value, gradient, hessian, elongation, tension = potential(rods, state, loads, drives)
    for count in range(MAX_STEPS):
        step = np.zeros(6 + state.travel.size, WIDE)
        reduced = hessian[np.ix_(free, free)].astype(float)
        scale = np.abs(reduced).max()
        while not positive(reduced + shift * scale * np.eye(free.size)):
            shift = max(10 * shift, 1e-9)
        system = reduced + shift * scale * np.eye(free.size)
        step[free] = -np.linalg.solve(system, gradient[free].astype(float))
        size = float(np.abs(step).max())
        if size < STEP_DONE and shift == 0:
            elastic = (tension**2 / np.where(rods.stiffness > 0, rods.stiffness, np.inf)).sum() / 2
            held = potential(rods, state, loads, Drives({}, {}, state.travel))[1][6:]
            return Equilibrium(state, float(elastic), elongation, tension, held, count)
        trial = state.moved(step)
        trial_terms = potential(rods, trial, loads, drives)
        if not trial_terms[0] <= value and size > 1e-7:
            shift = max(10 * shift, 1e-9)
            continue
        state = trial
        value, gradient, hessian, elongation, tension = trial_terms
        shift = 0.0 if shift < 1e-8 else shift / 100
    raise RuntimeError(f"no minimum within {MAX_STEPS} steps, last step {size:.1e}")


def positive(matrix: Array) -> bool:
    """Whether a symmetric matrix is positive definite, and well enough to solve with."""
    values = np.linalg.eigvalsh(matrix)
    return bool(values[0] > 1e-14 * max(values[-1], 1e-300))
