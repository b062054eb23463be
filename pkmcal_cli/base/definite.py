"""Linear equations with a symmetric positive definite matrix, factored once and solved often.

By LAPACK itself: scipy's `cho_solve` takes longer to look at what it is given than to solve for a few dozen unknowns.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cho_factor
from scipy.linalg.lapack import dpotrs

from pkmcal_cli.base.rotation import Array

Factor = tuple[Array, bool]
"""Of `factored`: the matrix that holds it, and whether in its lower triangle."""


def factored(matrix: Array) -> Factor:
    """Cholesky factor of a matrix (n, n); raises LinAlgError where it is not positive definite."""
    return cho_factor(matrix) if len(matrix) else (np.zeros((0, 0)), True)


def solved(factor: Factor, x: Array) -> Array:
    """Solution of columns (n, k) or of a vector (n,)."""
    if not x.size:
        return np.zeros_like(x)
    out, wrong = dpotrs(factor[0], x, lower=factor[1])
    if wrong:
        raise LinAlgError(f"dpotrs: {wrong}")
    return np.asarray(out)


def with_diagonal(matrix: Array, diagonal: Array) -> Array:
    """The matrix (n + k, n + k) with blocks (n, n) and, on the diagonal, (k,)."""
    n, size = len(matrix), len(matrix) + len(diagonal)
    out = np.zeros((size, size))
    out[:n, :n] = matrix
    out[np.arange(n, size), np.arange(n, size)] = diagonal
    return out
