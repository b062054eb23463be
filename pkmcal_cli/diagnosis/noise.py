"""The noise that tests stand on: the stated sigma, or what the residual shows where the statement is too small."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import chdtri

from pkmcal_cli.diagnosis.linear import Linear, Scale
from pkmcal_cli.rotation import Array

_DOUBT = 0.01  # the stated sigma is kept unless so improbable
_TRIM = 0.05  # share of the largest squares left out, so that bad rows do not count as noise


def noise_scale(linear: Linear, groups: Mapping[str, Array]) -> Scale:
    """Scale of the noise from what neither parameters nor any smooth group explain."""
    if not groups:
        return Scale()
    extra = np.hstack(list(groups.values()))
    free = linear.projecting(linear.projected, extra=extra)
    squares = np.sort(free.rest[np.abs(free.rest) > 0] ** 2)
    dof = free.used - free._factor[0].shape[1]
    if dof < 20:
        return Scale()
    kept = squares[: int((1 - _TRIM) * len(squares))]
    variance = float(kept.sum()) / len(squares) / _trimmed_share() * free.used / dof
    limit = float(chdtri(dof, _DOUBT)) / dof
    return Scale(variance, float(dof)) if variance > limit else Scale()


def _trimmed_share() -> float:
    """Mean square of a standard normal variable without its largest squares, over all."""
    from scipy.special import ndtri

    z = float(ndtri(1 - _TRIM / 2))
    density = np.exp(-z * z / 2) / np.sqrt(2 * np.pi)
    return float(1 - _TRIM - 2 * z * density)
