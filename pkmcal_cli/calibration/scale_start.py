"""Where the draws of scales begin: about 1, unless ranges are so far off that draws from there would not arrive.

Offsets that are far larger than their ranges look like noise as long as ranges hold them: draws stay there. The factor
of all ranges together for which the data are likeliest, its prior and that of the noise as in `range_scales`, tells.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.range_scales import LOG_PRIOR, LOG_TAU, Evidence

_ROUNDING = 1e-10  # of the largest eigenvalue of the information
_FAR = 10.0  # factors up to which draws arrive
_TO_STD = 0.6745  # median of the sizes of normal numbers


def first_factors(evidence: Evidence) -> Array:
    """Factors (q,) of the ranges of offsets: 1, or of most of a kind where these are far beyond their ranges."""
    out, on = np.ones(len(evidence.centre)), evidence.estimated
    if not on.any():
        return out
    centre = np.where(on, evidence.centre, 0.0)
    whole = evidence.information.sum(axis=0)
    pulled = evidence.score.sum(axis=0) + whole @ centre  # about nominal
    squares = float(evidence.squares.sum() + centre @ (evidence.score.sum(axis=0) + pulled))
    size, vectors = np.linalg.eigh(whole[np.ix_(on, on)])
    seen = size > _ROUNDING * size.max(initial=0.0)  # in the others offsets would be rounding, however large
    size, vectors = size[seen], vectors[:, seen]
    factor = _likeliest(size, vectors.T @ pulled[on], squares, evidence)
    if factor <= _FAR:
        return out
    offsets = vectors @ ((vectors.T @ pulled[on]) / (size + factor**-2))
    kinds = np.array(evidence.kinds)
    for kind in set(kinds[on].tolist()):
        most = float(np.median(np.abs(offsets[kinds[on] == kind]))) / _TO_STD
        out[on & (kinds == kind)] = most if most > _FAR else 1.0
    return out


def _likeliest(size: Array, pulled: Array, squares: float, evidence: Evidence) -> float:
    """The factor; size (q',): eigenvalues of the information, pulled (q',): of the score about nominal."""
    square = np.exp(2.0 * LOG_TAU)[:, None]  # (grid, 1)
    chi2 = np.maximum(squares - (pulled**2 * square / (1.0 + size * square)).sum(axis=1), 0.0)
    freedom, count = float(evidence.freedom.min()), float(evidence.counts.sum())
    misfit = chi2 if np.isinf(freedom) else (count + freedom) * np.log1p(chi2 / freedom)
    density = LOG_PRIOR - 0.5 * (misfit + np.log1p(size * square).sum(axis=1))
    return float(np.exp(LOG_TAU[np.argmax(density)]))
