"""Whether an equilibrium is stable: the tangent is positive definite on what the rigid constraints leave free.

With K (n, n) the tangent and B (c, n) the gradients of the constraints that is so where K + rho B^T B has a Cholesky
factor for a large rho (Finsler's lemma; Debreu 1952). A saddle balances forces too, but no machine stays there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array

_PENALTY = 1e3  # of rho B^T B, against the largest entry of K


def definite(k: Array, b: Array) -> NDArray[np.bool_]:
    """Tell where (N,) K (N, n, n) is positive definite on what constraints with gradients B (N, c, n) leave free."""
    if b.shape[1]:
        steep = np.maximum(np.abs(b).max(axis=(1, 2)), 1e-300)
        size = np.maximum(np.abs(k).max(axis=(1, 2)), steep) / steep**2
        k = k + (_PENALTY * size)[:, None, None] * (np.swapaxes(b, 1, 2) @ b)
    out = np.ones(len(k), dtype=bool)
    _factored(0.5 * (k + np.swapaxes(k, 1, 2)), out)
    return out


def _factored(matrix: Array, out: NDArray[np.bool_]) -> None:
    """Set `out` (N,), a view, to whether each matrix has a Cholesky factor: all at once, else by halves."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            out[0] = False
            return
        half = len(matrix) // 2
        _factored(matrix[:half], out[:half])
        _factored(matrix[half:], out[half:])
