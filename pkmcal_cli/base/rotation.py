"""Finite rotations on stacked arrays, written so that complex values pass through analytically.

Rotation matrices carry components from a moving triad to base axes; increments `theta` are rotation vectors in
base axes applied from the left: R <- exp([theta]x) R (rad). New arrays lie in memory with the first index (the rows of
machines) running fastest, so that every operation on a component is one on a contiguous run of rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""Numbers: real, or complex where a derivative is taken by complex step."""

_SMALL = 1e-4  # below this angle (rad) the series of sin and cos are exact to double precision


def skew(v: Array) -> Array:
    """Cross-product matrices [v]x, shape (..., 3, 3), of vectors (..., 3)."""
    out = np.zeros((*v.shape, 3), dtype=v.dtype, order="F")
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def cross(a: Array, b: Array) -> Array:
    """Cross product over the last axis; several times faster than np.cross on small stacked arrays."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    c0 = a1 * b2 - a2 * b1
    out = np.empty((*c0.shape, 3), dtype=c0.dtype, order="F")
    out[..., 0], out[..., 1], out[..., 2] = c0, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return out


def dot(a: Array, b: Array) -> Array:
    """Scalar product over the last axis without conjugation."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def times(a: Array, b: Array) -> Array:
    """Products of stacked small matrices, (..., 3, 3); unlike a @ b fast where the first index runs fastest."""
    return np.asarray(np.einsum("...ij,...jk->...ik", a, b))


def _coefficients(angle2: Array) -> tuple[Array, Array]:
    """sin(a)/a and (1 - cos a)/a^2 from a^2; series near zero, complex-safe."""
    small = np.abs(angle2) < _SMALL**2
    safe = np.where(small, 1.0, angle2)
    a = np.sqrt(safe)
    s1 = np.where(small, 1 - angle2 / 6, np.sin(a) / a)
    s2 = np.where(small, 0.5 - angle2 / 24, (1 - np.cos(a)) / safe)
    return s1, s2


def _third_coefficient(angle2: Array, s1: Array) -> Array:
    """(a - sin a)/a^3 from a^2 and s1 = sin(a)/a."""
    small = np.abs(angle2) < _SMALL**2
    return np.where(small, 1 / 6 - angle2 / 120, (1 - s1) / np.where(small, 1.0, angle2))


def polar_angle(sine: Array, cosine: Array) -> Array:
    """Angle in (-pi, pi] of the direction (cosine, sine), which need not have length 1; passes complex steps."""
    if not (np.iscomplexobj(sine) or np.iscomplexobj(cosine)):
        return np.asarray(np.arctan2(sine, cosine))
    slope = cosine.real * sine.imag - sine.real * cosine.imag
    return np.asarray(np.arctan2(sine.real, cosine.real) + 1j * slope / (sine.real**2 + cosine.real**2))


def exp(theta: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad (Rodrigues): cos I + s1 [v]x + s2 v v^T."""
    angle2 = dot(theta, theta)
    s1, s2 = _coefficients(angle2)
    out = (s2[..., None] * theta)[..., :, None] * theta[..., None, :]
    sine, cosine = s1[..., None] * theta, 1.0 - s2 * angle2
    for k in range(3):
        out[..., k, k] += cosine
        out[..., k - 2, k - 1] -= sine[..., k]
        out[..., k - 1, k - 2] += sine[..., k]
    return np.asarray(out)


def left_jacobian(theta: Array) -> Array:
    """d(left increment)/d(theta) of exp: exp(theta + d) = exp(J d) exp(theta), shape (..., 3, 3)."""
    angle2 = dot(theta, theta)
    s1, s2 = _coefficients(angle2)
    s3, k = _third_coefficient(angle2, s1), skew(theta)
    return np.asarray(np.eye(3) + s2[..., None, None] * k + s3[..., None, None] * (k @ k))


def log(rotation: Array) -> Array:
    """Rotation vectors (..., 3), rad, of rotation matrices (..., 3, 3); angle in [0, pi], analytic below pi."""
    r = rotation
    axial = 0.5 * np.stack([r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], -1)
    sine = np.sqrt(dot(axial, axial))
    cosine = 0.5 * (np.trace(r, axis1=-2, axis2=-1) - 1.0)
    angle = 2 * np.arctan(sine / (1.0 + cosine)) if np.iscomplexobj(r) else np.arctan2(sine, cosine)
    small = np.abs(sine) < 1e-8
    factor = np.where(small, 1.0, angle / np.where(small, 1.0, sine))
    theta = np.asarray(axial * factor[..., None])
    flipped = small & (cosine.real < 0)
    return _log_half_rotation(theta, r, flipped) if flipped.any() else theta


def _log_half_rotation(theta: Array, rotation: Array, where: NDArray[np.bool_]) -> Array:
    """Replace the entries of `theta` whose rotation is a half turn: the axis is the column of (R + I)/2."""
    half = 0.5 * (rotation[where] + np.eye(3))
    column = np.argmax(np.diagonal(half, axis1=-2, axis2=-1), axis=-1)
    axis = np.take_along_axis(half, column[:, None, None], axis=-1)[..., 0]
    theta = theta.copy()
    theta[where] = np.pi * axis / np.sqrt(dot(axis, axis))[..., None]
    return theta


def other_way_round(theta: Array) -> Array:
    """Rotation vectors (..., 3) of the same rotations about the opposite axes; those of no rotation stay."""
    angle = np.sqrt(dot(theta, theta))[..., None]
    none = angle == 0
    return np.where(none, theta, theta * (1 - 2 * np.pi / np.where(none, 1.0, angle)))


def log_jacobian(theta: Array) -> Array:
    """Inverse of `left_jacobian`: d(log(exp(d) R))/dd at d = 0 for theta = log R, shape (..., 3, 3)."""
    angle2 = dot(theta, theta)
    small = angle2 < 1e-6
    safe = np.where(small, 1.0, angle2)
    a = np.sqrt(safe)
    c = np.where(small, 1 / 12 + angle2 / 720, 1 / safe - (1 + np.cos(a)) / (2 * a * np.sin(a)))
    k = skew(theta)
    return np.asarray(np.eye(3) - 0.5 * k + c[..., None, None] * (k @ k))


def best_rotation(here: Array, there: Array) -> Array:
    """The rotation (d, d) that brings centred points `here` (n, d) closest to `there` (Kabsch 1976); never a mirror."""
    left, _, right = np.linalg.svd(here.T @ there)
    mirror = np.ones(here.shape[1])
    mirror[-1] = np.sign(np.linalg.det(left @ right))
    return np.asarray(right.T @ np.diag(mirror) @ left.T)


def best_motion(here: Array, there: Array) -> tuple[Array, Array]:
    """Rotation (d, d) and shift (d,) that bring points `here` (n, d) closest to `there` (n, d) (Kabsch 1976)."""
    a, b = here.mean(axis=0), there.mean(axis=0)
    rotation = best_rotation(here - a, there - b)
    return rotation, b - rotation @ a


def small_motions(places: Array) -> Array:
    """How places (n, d) move (n, d, f) by small rotations about their middle, three or in the plane one, and shifts."""
    axes = places.shape[1]
    about = np.pad(places - places.mean(axis=0), ((0, 0), (0, 3 - axes)))
    turns = -skew(about)[:, :axes, 2 * (3 - axes) :]
    return np.concatenate([turns, np.broadcast_to(np.eye(axes), (len(places), axes, axes))], axis=2)
