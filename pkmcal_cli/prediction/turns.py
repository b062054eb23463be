"""Which of the two rotation vectors of one rotation is predicted: that nearer to what an instrument read.

An instrument that reads one or two components of a rotation vector leaves open which it is; the whole rotation is
known where it is predicted, so it is decided there, with the derivatives.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array, other_way_round
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.observed import PlacedSensor

_ROTATION = (3, 4, 5)  # readings that are the components of a rotation vector
_LARGE = 0.75 * np.pi  # rad


def rotates_in_space(model: Model, sensor: PlacedSensor) -> bool:
    """Tell whether a sensor reads components of a rotation vector in space."""
    return bool(sensor.rotates) and not model.topology.planar


def outputs_of(model: Model, sensor: PlacedSensor) -> Index:
    """Tell which of the readings of its kind a sensor gives; in space, then those that complete a rotation vector."""
    return np.array(_outputs(sensor)) if rotates_in_space(model, sensor) else sensor.outputs


def _outputs(sensor: PlacedSensor) -> list[int]:
    outputs = sensor.outputs.tolist()
    return [*outputs, *(k for k in _ROTATION if k not in outputs)]


def tell_as_read(sensor: PlacedSensor, readings: Array, by: Array | None, measured: Array) -> None:
    """Put the other rotation vector of the same rotation into readings (N, K) and derivatives (N, K, S) in place.

    In rows where the components that were read (of `measured` (N, C)), one or more, are nearer to it.
    """
    places = np.array([_outputs(sensor).index(k) for k in _ROTATION])
    as_read = np.full((len(readings), 3), np.nan)
    for channel, k in sensor.rotates:
        as_read[:, k] = measured[:, channel]
    readings[:, places], slopes = nearer_way_round(readings[:, places], None if by is None else by[:, places], as_read)
    if by is not None and slopes is not None:
        by[:, places] = slopes


def nearer_way_round(turned: Array, slopes: Array | None, reference: Array) -> tuple[Array, Array | None]:
    """Choose rotation vectors (N, 3) with derivatives (N, 3, S): of two of each rotation that nearer to a reference.

    reference (N, 3): components, nan where unknown. Small components of a small turn have one way only: the turn
    must be large, or a component beyond half a turn.
    """
    known, turned = np.isfinite(reference), turned.copy()
    other = other_way_round(turned)
    here, there = (np.where(known, reference - v, 0.0) for v in (turned, other))
    large = (np.linalg.norm(turned, axis=1) > _LARGE) | (np.where(known, np.abs(reference), 0.0) > np.pi).any(axis=1)
    rows = np.nonzero(((there**2).sum(axis=1) < (here**2).sum(axis=1)) & large)[0]
    if slopes is not None and len(rows):
        slopes = slopes.copy()
        slopes[rows] = _other_slopes(turned[rows], slopes[rows])
    turned[rows] = other[rows]
    return turned, slopes


def _other_slopes(turned: Array, slopes: Array) -> Array:
    """Derivatives (n, 3, S) of v (1 - 2 pi / |v|) by those of rotation vectors v (n, 3)."""
    angle = np.linalg.norm(turned, axis=1)[:, None, None]
    along = turned[:, :, None] * np.einsum("nk,nks->ns", turned, slopes)[:, None]
    return np.asarray((1 - 2 * np.pi / angle) * slopes + 2 * np.pi / angle**3 * along)
