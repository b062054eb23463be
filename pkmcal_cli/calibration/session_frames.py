"""Many sessions with a frame of the instrument each: these are eliminated from a fit, session by session.

A frame matters in the rows of its session alone. For each step of the other parameters the best step of the frames is
known, so a linearised problem is projected on what no frame of a row's session does, and the frames follow (variable
projection, Golub and Pereyra 1973; the reduced system of bundle adjustment, Triggs et al. 2000). What a fit costs is
then linear in the number of sessions. Ranges of frames, which nobody stated, take no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows

_SEEN = 1e-10  # of the largest singular value of a session's frames
_SHARE = 1e-3  # of a frame number in what its session does not determine, from which on it is not either

Bases = Sequence[tuple[NDArray[np.intp], Array]]
"""Of each session its n rows, and an orthonormal basis (n C, r) of what its frames do to their whitened readings."""


@dataclass(frozen=True, kw_only=True)
class FrameSteps:
    """How the frames of S sessions, with L numbers each, follow a step d (P',) of the others, SI.

    index (S, L): among the parameters; follows (S, L, 1 + P'): the step of a frame is that of the first column less
    the others times d; noise (S, L, L): covariance where the others are known; seen (S, L): whether the session's rows
    determine the number; bases: what frames do.
    """

    index: NDArray[np.intp]
    follows: Array
    noise: Array
    seen: NDArray[np.bool_]
    bases: Bases

    @property
    def rank(self) -> int:
        """Number of directions of all frames that rows determine."""
        return sum(basis.shape[1] for _, basis in self.bases)

    def moved(self, values: Array, step: Array) -> Array:
        """Values (P,) with the frames where they suit a step (P',) of the others best."""
        out = values.copy()
        out[self.index] += self.follows[..., 0] - self.follows[..., 1:] @ step
        return out

    def std(self, covariance: Array, noise: Array) -> Array:
        """Standard uncertainties (S, L) by that of the others (P', P') and variances of noise (L,), in stated ones.

        nan where the session's rows do not determine the number.
        """
        slopes = self.follows[..., 1:]
        variance = noise * np.einsum("sll->sl", self.noise) + ((slopes @ covariance) * slopes).sum(axis=2)
        return np.where(self.seen, np.sqrt(np.maximum(variance, 0.0)), np.nan)


@dataclass(frozen=True)
class SessionFrames:
    """Frames that are eliminated: shared names (L,) of their numbers, of which sensors each is, and the S sessions."""

    shared: tuple[str, ...]
    sensors: tuple[str, ...]
    sessions: tuple[str, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the parameters (S L,), session by session."""
        return tuple(f"{name}[{session}]" for session in self.sessions for name in self.shared)

    def of_rows(self, rows: Rows) -> list[NDArray[np.intp]]:
        """Numbers of the rows of each session."""
        none = np.zeros(len(rows))
        return [np.flatnonzero(rows.columns.get(f"session.{s}", none) > 0) for s in self.sessions]

    def eliminated(
        self, model: Model, rows: Rows, residual: Array, jacobian: Array
    ) -> tuple[Array, Array, FrameSteps]:
        """Residuals (N, C) and derivatives (N, C, P') without what frames do, and how these follow.

        jacobian (N, C, P' + L): by the others, then by the frame numbers of each row's session; whitened, SI.
        """
        place, width = {name: k for k, name in enumerate(model.names)}, len(self.shared)
        index = np.array([place[name] for name in self.names]).reshape(-1, width)
        size, count = model.ranges[index], jacobian.shape[2] - width
        residual, others = residual.copy(), jacobian[..., :count].copy()
        follows, noise = np.zeros((*index.shape, count + 1)), np.zeros((*index.shape, width))
        seen, bases = np.zeros(index.shape, dtype=bool), []
        for k, some in enumerate(self.of_rows(rows)):
            by_frame = jacobian[some, :, count:].reshape(-1, width) * size[k]  # (n C, L) in ranges
            u, s, vt = np.linalg.svd(by_frame, full_matrices=False)
            determined = s > _SEEN * s.max(initial=0.0)
            u, back = u[:, determined], size[k][:, None] * vt[determined].T / s[determined]  # (n C, r), (L, r)
            both = np.column_stack([residual[some].ravel(), others[some].reshape(len(by_frame), count)])
            along = u.T @ both  # (r, 1 + P')
            both -= u @ along
            residual[some] = both[:, 0].reshape(len(some), residual.shape[1])
            others[some] = both[:, 1:].reshape(len(some), *others.shape[1:])
            follows[k], noise[k] = back @ along, back @ back.T
            seen[k] = (vt[determined] ** 2).sum(axis=0) > 1.0 - _SHARE**2
            bases.append((some, u))
        steps = FrameSteps(index=index, follows=follows, noise=noise, seen=seen, bases=tuple(bases))
        return residual, others, steps
