"""Have machines changed between data sets? What the sets determine in common, without priors, selections and datums.

Each set i says R_i theta = y_i + e_i of all parameters (`DataInformation`); what belongs to it alone (frames of
instruments, sessions, parameters that others lack) is projected out. Combinations n of the y of all sets with
sum n_i^T R_i = 0 hold no parameter, whatever its value: where nothing has changed they are noise. Their sum of squares
is the omnibus test, an F test since the noise of each set is estimated by what it leaves. Changes of parameters are
estimated with all others; those that a fit held are the same unknown values in all sets, so a prior that is shared
cancels as far as the sets are alike. Chow 1960, Econometrica 28; Holm 1979, Scand. J. Statist. 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.data_sets import SEEN, Common

_WORTH = 0.5  # in noise per half range: a contrast that is worth a test
_FREE, _CHANGE = 10.0, 4.0  # half ranges: prior standard deviations of what may be anything, and of a change
_LIKELY = 1.0  # half ranges: the same of what is predicted by changes, so that what no data determine stays
_KNOWN = 1.0  # half ranges to which a change is known that all sets determine
_RIVAL = 3.84  # of chi-square: so much worse another single parameter may explain a change (95 %)
_LEFT = 0.01  # p value of what is left, below which one parameter does not explain a change


@dataclass(frozen=True)
class Omnibus:
    """Test of no change: statistic (chi-square over its degrees of freedom), dof, freedom of the noise, p value."""

    statistic: float
    dof: int
    freedom: float
    p_value: float


def omnibus(c: Common) -> tuple[Omnibus, Array]:
    """One test of all that the sets determine in common, and the contrasts (m, dof) that it is of."""
    kept = _contrasts(c)
    dof = kept.shape[1]
    if not dof:
        return Omnibus(float("nan"), 0, float("nan"), float("nan")), kept
    statistic = float(((kept.T @ c.right) ** 2).sum()) / dof
    freedom = _freedom(c, (kept**2).sum(axis=1) / dof)
    return Omnibus(statistic, dof, freedom, float(fdtrc(dof, min(freedom, 1e9), statistic))), kept


def _contrasts(c: Common) -> Array:
    """Orthonormal combinations (m, d) of the equations without any parameter, which a change of a range would show."""
    u, s, _ = np.linalg.svd(c.matrix)
    free = u[:, int((s > SEEN).sum()) :]
    if not free.shape[1]:
        return free
    by_change = np.hstack([(free * (c.set_of == k)[:, None]).T @ c.matrix for k in range(len(c.sets))])
    basis, size, _ = np.linalg.svd(by_change, full_matrices=False)
    return np.asarray(free @ basis[:, size > _WORTH])


def _freedom(c: Common, share: Array) -> float:
    """Degrees of freedom of the noise of a sum to which equations contribute shares (m,) (Satterthwaite)."""
    of_set = np.array([share[c.set_of == k].sum() for k in range(len(c.sets))])
    worth = np.array([max(s.freedom, 1e-9) for s in c.sets])
    return float(1.0 / max(((of_set / of_set.sum()) ** 2 / worth).sum(), 1e-12))


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Changes (k,) of parameters `names`, SI, with posterior covariance (k, k); null: that of estimates by chance.

    alone: whether they are one, by which all is explained.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    null: Array
    alone: bool = False

    @property
    def std(self) -> Array:
        """Standard uncertainties (k,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


@dataclass(frozen=True, kw_only=True)
class Changes(Estimate):
    """Estimates and their tests: p_values (k,) of each alone, holm (k,) corrected.

    These are nan where the sets do not determine the change: `determined` (k,).
    """

    determined: NDArray[np.bool_]
    p_values: Array
    holm: Array

    def per(self, time: float) -> Changes:
        """Per unit of a time in which they happened."""
        covariance, null = self.covariance / time**2, self.null / time**2
        return replace(self, values=self.values / time, covariance=covariance, null=null)


def estimate(c: Common, moved: Sequence[str], times: Sequence[float], known_to: float) -> Estimate:
    """How the parameters `moved` change where times (n,) go from 0 to 1, one for each set; others are the same in all.

    Their values, of which little is known, are those at the mean time, so that no set comes first. known_to: half
    ranges to which changes are known to be 0.
    """
    where = [c.names.index(n) for n in moved]
    moving = c.matrix[:, where] * (np.array(times) - np.mean(times))[c.set_of][:, None]
    design, q, k = np.hstack([c.matrix, moving]), len(c.names), len(where)
    known = np.ones(q)
    known[where] = 1.0 / _FREE
    whole = np.linalg.inv(design.T @ design + np.diag(np.append(known**2, np.full(k, known_to**-2))))
    gain = whole[q:] @ design.T
    scale, by_offset = c.scale[where], gain @ c.matrix
    size = np.outer(scale, scale)
    return Estimate(
        names=tuple(moved),
        values=gain @ c.right * scale,
        covariance=whole[q:, q:] * size,
        null=(gain @ gain.T + by_offset @ by_offset.T) * size,
    )


def changes(c: Common, moved: Sequence[str], times: Sequence[float], freedom: float) -> Changes:
    """Estimated with hardly any knowledge of the changes, and tested."""
    e = estimate(c, moved, times, _CHANGE)
    determined = e.std <= _KNOWN * c.scale[[c.names.index(n) for n in moved]]
    z = np.abs(e.values) / np.sqrt(np.maximum(np.diag(e.null), 1e-300))
    single = np.where(determined, 2.0 * stdtr(min(freedom, 1e9), -z), np.nan)
    return Changes(**vars(e), determined=determined, p_values=single, holm=holm(single))


def holm(p_values: Array) -> Array:
    """Holm's step-down correction of p values (k,); nan stays nan and is not counted."""
    out, known = np.full(len(p_values), np.nan), np.nonzero(np.isfinite(p_values))[0]
    order = known[np.argsort(p_values[known], kind="stable")]
    count = len(order)
    out[order] = np.minimum(np.maximum.accumulate(p_values[order] * (count - np.arange(count))), 1.0)
    return out


def likely_changes(c: Common, moved: Sequence[str], times: Sequence[float]) -> Estimate:
    """Estimated with ranges as knowledge of the changes, as a calibration has it of the values: to predict by."""
    return estimate(c, moved, times, _LIKELY)


@dataclass(frozen=True)
class Single:
    """One parameter that alone has changed: change and standard uncertainty, SI; p value of what is left."""

    name: str
    value: float
    std: float
    p_left: float

    @property
    def explains(self) -> bool:
        """Whether it leaves no more than noise, as far as can be told."""
        return not self.p_left < _LEFT

    @property
    def estimate(self) -> Estimate:
        """The change as an estimate where all else stands still."""
        values, covariance = np.array([self.value]), np.array([[self.std**2]])
        return Estimate(names=(self.name,), values=values, covariance=covariance, null=covariance, alone=True)

    def per(self, time: float) -> Self:
        """The change per unit of a time in which it happened."""
        return replace(self, value=self.value / time, std=self.std / time)


@dataclass(frozen=True)
class Alone(Single):
    """One parameter whose change alone explains most.

    rivals: others that do so nearly as well, the best first; sufficient: all whose change alone leaves no more than
    noise.
    """

    rivals: tuple[Single, ...]
    sufficient: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The parameter and its rivals."""
        return (self.name, *(r.name for r in self.rivals))

    def equals(self, named: Sequence[str]) -> tuple[Single, ...]:
        """The parameter and its rivals, what is `named` first; nothing where only others are."""
        if named and set(named).isdisjoint(self.names):
            return ()
        return tuple(sorted((self, *self.rivals), key=lambda r: bool(named) and r.name not in named))

    def per(self, time: float) -> Self:
        """This one and its rivals."""
        return replace(super().per(time), rivals=tuple(r.per(time) for r in self.rivals))


def alone(c: Common, contrasts: Array, test: Omnibus, times: Sequence[float]) -> Alone | None:
    """Of all common parameters, with times (n,) from 0 to 1; None where no contrast sees any of them."""
    seen = contrasts.T @ (c.matrix * np.array(times)[c.set_of][:, None])  # (d, q)
    size, pulled = (seen**2).sum(axis=0), seen.T @ (contrasts.T @ c.right)
    good = size > _WORTH**2
    if not good.any():
        return None
    size = np.where(good, size, np.inf)
    explained = pulled**2 / size
    left = np.maximum(test.statistic * test.dof - explained, 0.0)
    p_values = np.full(len(left), np.nan)
    if test.dof > 1:
        p_values = fdtrc(test.dof - 1, min(test.freedom, 1e9), left / (test.dof - 1))
    values, std = pulled / size * c.scale, c.scale / np.sqrt(size)

    def single(k: int) -> tuple[str, float, float, float]:
        return c.names[k], float(values[k]), float(std[k]), float(p_values[k])

    best = int(np.argmax(explained))
    near = [k for k in np.argsort(-explained) if k != best and explained[k] > explained[best] - _RIVAL and good[k]]
    enough = good & ~(p_values < _LEFT)
    sufficient = tuple(name for name, is_enough in zip(c.names, enough, strict=True) if is_enough)
    return Alone(*single(best), tuple(Single(*single(k)) for k in near), sufficient)


def changed(changes: Changes, single: Alone | None, test: Omnibus, alpha: float) -> tuple[str, ...]:
    """Names of what has changed, at a level: none unless the test of all alarms.

    Parameters by their own tests (Holm). Where a single change explains everything, those of them that do not so alone
    are left out: each is then a share of a longer explanation, in which what was held, or hardly seen, stood still.
    Where none is left, the single parameter and its rivals.
    """
    if not test.p_value < alpha:
        return ()
    significant = tuple(name for name, p in zip(changes.names, changes.holm, strict=True) if p < alpha)
    if single is None or not single.explains:
        return significant
    return tuple(name for name in significant if name in single.sufficient) or single.names


def chosen_by_all(c: Common, chosen: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Parameters that every fit identified: their changes are estimated; what a fit held is taken as unchanged."""
    return tuple(n for n in c.names if all(n in names for names in chosen))
