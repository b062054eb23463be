"""Small quadratic programmes, one per row, all solved together: what the redundancy of a machine is used for.

Mehrotra's predictor and corrector (Nocedal, Wright 2006, algorithm 16.4), whose correction counts by how far the
prediction can go (Colombo, Gondzio 2008): a whole one may go round in circles (Cartis 2009), and so may steps on which
the products of slacks and multipliers grow again. Every bound may be exceeded by one common amount at a price that only
an infeasible programme pays, so there is always a solution, and where the amount is not zero it says which bounds are
in the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.tangent import solve_rows

_PRICE = 1e5  # of exceeding a bound by one: more than what any bound in use is worth
_STEPS = 60
_GAP = 1e-13  # mean product of slack and multiplier at which a row has ended
_BACK = 0.995  # share of the way to the next bound
_FLAT = 1e-12  # curvature added to directions without any, relative to the largest


@dataclass(frozen=True, kw_only=True)
class Programme:
    """min 1/2 y^T H y + g^T y under A y <= b: H (n, r, r), g (n, r), A (n, c, r), b (n, c)."""

    curvature: Array
    slope: Array
    matrix: Array
    bound: Array


@dataclass(frozen=True, kw_only=True)
class Optimum:
    """Solutions y (n, r); excess (n,): by which a bound has to be exceeded, about 0 where all can be kept.

    binding (n, c): bounds that hold the solution.
    """

    y: Array
    excess: Array
    binding: NDArray[np.bool_]


def solve(programme: Programme) -> Optimum:
    """The optimum of every row, whatever the units of objective and unknowns are."""
    scale = np.maximum(np.einsum("nkk->n", programme.curvature), 1e-300)
    curvature, slope = programme.curvature / scale[:, None, None], programme.slope / scale[:, None]
    rows, count, width = programme.matrix.shape
    if not count:
        flat = curvature + _FLAT * np.eye(width)
        y = np.nan_to_num(-solve_rows(flat, slope[..., None])[..., 0])
        return Optimum(y=y, excess=np.zeros(rows), binding=np.zeros((rows, 0), dtype=bool))
    unit = _unit(slope, programme)
    square = _FLAT * np.tile(np.eye(width + 1), (rows, 1, 1))
    square[:, :width, :width] += curvature
    linear = np.concatenate([slope / unit, np.full((rows, 1), _PRICE)], axis=1)
    every = np.zeros((rows, count + 1, width + 1))  # the last unknown is the excess, which is not negative
    every[:, :count, :width], every[:, :, width] = programme.matrix * unit[:, :, None], -1.0
    bound = np.concatenate([programme.bound, np.zeros((rows, 1))], axis=1)
    run = _Run(square, linear, every, bound)
    for _ in range(_STEPS):
        if not run.advance():
            break
    return Optimum(y=run.x[:, :width] * unit, excess=run.x[:, width], binding=(run.z > run.s)[:, :count])


def _unit(slope: Array, programme: Programme) -> Array:
    """Size (n, 1) of unknowns that matter: what the objective asks for, what leads to the furthest bound that is not
    kept, and what changes a bound by one. In others the price would be worth less than an objective in large numbers.
    """
    steep = np.abs(programme.matrix).max(axis=2, initial=0.0)  # (n, c)
    away = np.divide(np.maximum(-programme.bound, 0.0), steep, out=np.zeros(steep.shape), where=steep > 0.0)
    one = 1.0 / np.maximum(steep.max(axis=1), 1e-300)
    sizes = np.stack([np.abs(slope).max(axis=1, initial=0.0), away.max(axis=1), one])
    return np.asarray(np.where(steep.any(axis=1), sizes.max(axis=0), 1.0)[:, None])


class _Run:
    """Unknowns x (n, k), slacks s (n, m) and multipliers z (n, m) of all rows, of which some still move."""

    def __init__(self, square: Array, linear: Array, matrix: Array, bound: Array) -> None:
        self.square, self.linear, self.matrix, self.bound = square, linear, matrix, bound
        self.x = np.zeros(linear.shape)
        self.x[:, -1] = np.maximum(-bound.min(axis=1), 0.0) + 1.0  # inside of all bounds
        self.s = bound - _times(matrix, self.x)
        self.z = _PRICE / (self.s * (1.0 / self.s).sum(axis=1, keepdims=True))  # together they are worth the price
        self.active = np.arange(len(linear))

    def advance(self) -> bool:
        """One step of the rows that move; whether any is left."""
        at = self.active
        q, a, x, s, z = self.square[at], self.matrix[at], self.x[at], self.s[at], self.z[at]
        dual = _times(q, x) + self.linear[at] + _times(np.swapaxes(a, 1, 2), z)
        primal = _times(a, x) + s - self.bound[at]
        mean = (s * z).mean(axis=1)
        system = q + np.einsum("nck,nc,ncl->nkl", a, z / s, a)

        def direction(product: Array) -> tuple[Array, Array, Array]:
            right = -dual - _times(np.swapaxes(a, 1, 2), (z * primal - product) / s)
            dx = np.nan_to_num(solve_rows(system, right[..., None])[..., 0])
            ds = -primal - _times(a, dx)
            return dx, ds, (-product - z * ds) / s

        _, ds, dz = direction(s * z)
        far = np.minimum(_way(s, ds), _way(z, dz))[:, None]
        after = ((s + far * ds) * (z + far * dz)).mean(axis=1)
        centre = (after / mean) ** 3 * mean
        dx, ds, dz = direction(s * z + far**2 * ds * dz - centre[:, None])
        far = np.minimum(_BACK * np.minimum(_way(s, ds), _way(z, dz)), _lowest(s, ds, z, dz))[:, None]
        self.x[at], self.s[at], self.z[at] = x + far * dx, s + far * ds, z + far * dz
        self.active = at[(self.s[at] * self.z[at]).mean(axis=1) > _GAP]
        return bool(len(self.active))


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _way(value: Array, step: Array) -> Array:
    """How far (n,), at most 1, values (n, m) can go along a step and stay positive."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(step < 0, -value / step, np.inf)
    return np.asarray(np.minimum(ratio.min(axis=1), 1.0))


def _lowest(s: Array, ds: Array, z: Array, dz: Array) -> Array:
    """How far (n,) along steps of s and z (n, m) their product is least, where it falls at first; else inf."""
    slope, bend = (s * dz + z * ds).sum(axis=1), (ds * dz).sum(axis=1)
    turns = (slope < 0) & (bend > 0)
    return np.asarray(np.where(turns, -slope / np.where(turns, 2.0 * bend, 1.0), np.inf))
