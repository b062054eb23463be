"""Forces of redundant drives in two parts: what carries the load, and what drives only hold against each other.

The forces f of the drives do work on motions of the tool by E = dq/dp of the mechanism with its drives released: E^T f
carries the load, and what lies in the null space of E^T is internal. The part that carries the load is that of least
sum of (f / scale)^2, so the two are orthogonal in units of `scale`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import DriveKind
from pkmcal_cli.model.model import Model


@dataclass(frozen=True)
class InternalForces:
    """Basis (N, A, k) of internal forces in units of `scale` (A,), N or N m; its columns are orthonormal."""

    basis: Array
    scale: Array

    @classmethod
    def of(cls, model: Model, values: Array, by_pose: Array) -> InternalForces:
        """At parameter values (P,); by_pose (N, A, f): of the readings of released drives by the tool's coordinates."""
        scale = force_scales(model)
        moved = np.nan_to_num(by_pose) * (scale * conjugate_gains(model, values))[:, None]
        size = np.abs(moved).max(axis=(1, 2), initial=0.0, keepdims=True)
        whole = np.linalg.qr(moved / np.where(size > 0, size, 1.0), mode="complete")[0]
        return cls(np.asarray(whole[:, :, by_pose.shape[2] :]), scale)

    def amounts(self, forces: Array) -> Array:
        """How much of each internal force (N, k), or of several (N, k, m), is in forces (N, A) or (N, A, m)."""
        if forces.ndim == 2:
            return np.asarray(np.einsum("nak,na->nk", self.basis, forces / self.scale))
        return np.asarray(np.einsum("nak,nam->nkm", self.basis, forces / self.scale[:, None]))

    def part(self, forces: Array) -> Array:
        """The internal part (N, A) of forces (N, A)."""
        return np.asarray(np.einsum("nak,nk->na", self.basis, self.amounts(forces)) * self.scale)


def force_scales(model: Model) -> Array:
    """What each drive's force (A,) is measured by: its `force_limit`; without one, the mean of the others', or 1 N.

    Of torques: times the size of the machine.
    """
    limits = np.array([a.force_limit for a in model.actuators])
    length = np.array([1.0 if model.topology.moves_length(d) else model.length for d in model.topology.drives])
    stated = np.isfinite(limits)
    mean_limit = float((limits / length)[stated].mean()) if stated.any() else 1.0
    return np.where(stated, limits, mean_limit * length)


def conjugate_gains(model: Model, values: Array) -> Array:
    """Work (A,) of a unit of a drive's force per unit of its reading: its gain with the sign of its force."""
    gains = model.topology.coefficients.values(model.by_name(values))[[a.gain_coefficient for a in model.actuators]]
    signs = [-d.force_sign if d.kind is DriveKind.STRAIN else 1.0 for d in model.topology.drives]
    return np.asarray(gains * signs)
