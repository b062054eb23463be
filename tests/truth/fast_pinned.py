"""Equilibria of many rows at once: a platform on pinned rods, minimum of the potential energy, double precision.

Rod r in row n:  e = |t + R a - b| - l;  tension T = k (e - g tanh(e / w)), g half the clearance of its joints and
w = 1.05 g, so that the rod carries little while its joints cross the clearance. All SI (m, N, rad, N/m, J).
Newton's method with closed-form gradient and Hessian, a turn of the platform being exp(step) R.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MAX_STEPS = 60
DONE = 1e-12
"""Newton step (m, rad) at which a row is accepted."""
GAP_WIDTH = 1.05
"""Width of the crossing of a clearance over half the clearance; above 1 the law stays monotonic."""


@dataclass(frozen=True)
class Load:
    """A force (N, 3) in N, constant in base axes, on a point (3,) in m of the platform."""

    force: Array
    point: Array


@dataclass(frozen=True, kw_only=True)
class Problem:
    """N rows of R rods: ends on the platform `body` (R, 3) in its frame and on the carriages `base` (N, R, 3) in m,
    natural `length` (N, R) in m, `stiffness` (N, R) in N/m, half clearance `gap` (R,) in m, loads, and which of x,
    y, z, rx, ry, rz the platform is free in."""

    body: Array
    base: Array
    length: Array
    stiffness: Array
    gap: Array
    loads: tuple[Load, ...]
    freedoms: tuple[int, ...]


@dataclass(frozen=True)
class Balance:
    """Equilibria: position (N, 3) in m, rotation (N, 3, 3), tension (N, R) in N (positive: pulled), unit vectors
    (N, R, 3) of the rods from carriage to platform."""

    position: Array
    rotation: Array
    tension: Array
    unit: Array


def skew(vectors: Array) -> Array:
    """Matrices (..., 3, 3) of the cross product from the left, of vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def rotations(vectors: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) in rad."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    cross = skew(vectors)
    turned: Array = np.eye(3) + np.sinc(angle / np.pi) * cross + np.sinc(angle / 2 / np.pi) ** 2 / 2 * cross @ cross
    return turned


def spring(problem: Problem, stretch: Array) -> tuple[Array, Array, Array]:
    """Tension in N, its slope in N/m and energy in J, each (N, R), for elongations (N, R) in m."""
    gap = problem.gap
    width = np.where(gap > 0, GAP_WIDTH * gap, 1.0)
    share = stretch / width
    force = problem.stiffness * (stretch - gap * np.tanh(share))
    slope = problem.stiffness * (1 - gap / width / np.cosh(np.clip(share, -300, 300)) ** 2)
    log_cosh = np.logaddexp(share, -share) - np.log(2)
    return force, slope, problem.stiffness * (stretch**2 / 2 - gap * width * log_cosh)


def turning(force: Array, lever: Array) -> Array:
    """Second derivative (..., 3, 3) of force . exp(turn) lever by the turn, for vectors (..., 3)."""
    mixed = force[..., :, None] * lever[..., None, :]
    dot = (force * lever).sum(-1)[..., None, None]
    second: Array = (mixed + np.swapaxes(mixed, -1, -2)) / 2 - dot * np.eye(3)
    return second


def potential(problem: Problem, position: Array, rotation: Array) -> Array:
    """Potential (N,) in J."""
    chord = position[:, None] + np.einsum("nij,rj->nri", rotation, problem.body) - problem.base
    value = spring(problem, np.linalg.norm(chord, axis=-1) - problem.length)[2].sum(1)
    for load in problem.loads:
        value = value - (load.force * (position + rotation @ load.point)).sum(1)
    return value


def derivatives(problem: Problem, position: Array, rotation: Array) -> tuple[Array, Array, Array, Array]:
    """Gradient (N, 6) and Hessian (N, 6, 6) by translation and turn, tension (N, R), unit vectors (N, R, 3)."""
    arm = np.einsum("nij,rj->nri", rotation, problem.body)
    chord = position[:, None] + arm - problem.base
    reach = np.linalg.norm(chord, axis=-1)
    unit = chord / reach[..., None]
    force, slope, _ = spring(problem, reach - problem.length)
    motion = np.concatenate([np.broadcast_to(np.eye(3), (*reach.shape, 3, 3)), -skew(arm)], -1)
    grown = np.einsum("nri,nriv->nrv", unit, motion)
    across = motion - unit[..., :, None] * grown[..., None, :]
    gradient = np.einsum("nr,nrv->nv", force, grown)
    stiff = np.swapaxes(slope[..., None] * grown, 1, 2) @ grown
    swung = (np.sqrt(np.abs(force) / reach)[..., None, None] * across).reshape(len(reach), -1, 6)
    signed = swung * np.repeat(np.sign(force), 3, axis=1)[..., None]
    hessian = stiff + np.swapaxes(signed, 1, 2) @ swung
    hessian[:, 3:, 3:] += turning(force[..., None] * unit, arm).sum(1)
    for load in problem.loads:
        lever = rotation @ load.point
        gradient[:, :3] -= load.force
        gradient[:, 3:] -= np.cross(lever, load.force)
        hessian[:, 3:, 3:] -= turning(load.force, lever)
    return gradient, hessian, force, unit


def solve(problem: Problem, start: Array) -> Balance:
    """Minimum of the potential of every row near the positions `start` (N, 3) in m, platform not turned.

    A Newton step that would raise the potential of its row is halved. RuntimeError where a row does not settle.
    """
    free = list(problem.freedoms)
    position = np.array(start)
    rotation: Any = np.broadcast_to(np.eye(3), (len(start), 3, 3))
    for _ in range(MAX_STEPS):
        gradient, hessian, tension, unit = derivatives(problem, position, rotation)
        step = np.zeros((len(start), 6))
        step[:, free] = -np.linalg.solve(hessian[:, free][:, :, free], gradient[:, free, None])[..., 0]
        size = np.abs(step).max(1)
        if size.max() < DONE:
            return Balance(position, rotation, tension, unit)
        if size.max() > 1e-8:
            step *= damping(problem, position, rotation, step)[:, None]
        position = position + step[:, :3]
        rotation = rotations(step[:, 3:]) @ rotation
    raise RuntimeError(f"no equilibrium within {MAX_STEPS} steps, last step {size.max():.1e}")


def damping(problem: Problem, position: Array, rotation: Array, step: Array) -> Array:
    """Share (N,) of each row's step (N, 6) that does not raise its potential."""
    before, share = potential(problem, position, rotation), np.ones(len(step))
    for _ in range(12):
        part = share[:, None] * step
        after = potential(problem, position + part[:, :3], rotations(part[:, 3:]) @ rotation)
        worse = (after > before + 1e-12 * (1 + np.abs(before))) & (np.abs(part).max(1) > 1e-8)
        if not worse.any():
            break
        share[worse] /= 2
    return share
