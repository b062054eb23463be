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
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.data_information import DataInformation

_RANK = 1e-9  # of the largest singular value
_SEEN = 0.01  # per half range: what rows see less of is nothing that a set says
_WORTH = 0.5  # in noise per half range: a contrast that is worth a test
_FREE, _CHANGE = 10.0, 4.0  # half ranges: prior standard deviations of what may be anything, and of a change
_KNOWN = 1.0  # half ranges to which a change is known that all sets determine
_RIVAL = 3.84  # of chi-square: so much worse another single parameter may explain a change (95 %)
_LEFT = 0.01  # p value of what is left, below which one parameter does not explain a change


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """What one data set says: matrix (r, q) and right (r,) in its noise, by the common parameters in `scale`.

    freedom: degrees of freedom by which its noise is known.
    """

    matrix: Array
    right: Array
    noise: float
    freedom: float


@dataclass(frozen=True, kw_only=True)
class Common:
    """Data sets in their common parameters: `names`, scale (q,) SI, offsets from `reference` (q,) SI."""

    names: tuple[str, ...]
    scale: Array
    reference: Array
    sets: tuple[DataSet, ...]

    @cached_property
    def matrix(self) -> Array:
        """All equations (m, q)."""
        return np.vstack([s.matrix for s in self.sets])

    @cached_property
    def right(self) -> Array:
        """Right-hand sides (m,) of all."""
        return np.concatenate([s.right for s in self.sets])

    @cached_property
    def set_of(self) -> NDArray[np.intp]:
        """Number (m,) of the set of each equation."""
        return np.repeat(np.arange(len(self.sets)), [len(s.right) for s in self.sets])


def common(
    data: Sequence[DataInformation], values: Sequence[dict[str, float]], per_campaign: Sequence[set[str]]
) -> Common:
    """Data sets in the parameters that all have; own: names that are each set's own, though others have them too."""
    apart = set().union(*per_campaign)
    names = tuple(n for n in data[0].names if n not in apart and all(n in d.names for d in data))
    scales = np.array([[d.scale[d.names.index(n)] for n in names] for d in data]).reshape(len(data), len(names))
    scale, reference = scales.max(axis=0), np.array([values[0][n] for n in names])
    sets = []
    for d, v in zip(data, values, strict=True):
        index = [d.names.index(n) for n in names]
        others = [k for k in range(len(d.names)) if k not in set(index)]
        shared = d.root[:, index] * (scale / d.scale[index])
        right = d.right + shared @ ((np.array([v[n] for n in names]) - reference) / scale)
        sets.append(_data_set(d, d.root[:, others], shared, right))
    return Common(names=names, scale=scale, reference=reference, sets=tuple(sets))


def _data_set(d: DataInformation, unshared: Array, shared: Array, right: Array) -> DataSet:
    """Equations without what is the set's own, in units of its noise."""
    if unshared.shape[1]:
        u, s, _ = np.linalg.svd(unshared)
        null_directions = u[:, int((s > _RANK * s.max(initial=0.0)).sum()) :]
        shared, right = null_directions.T @ shared, null_directions.T @ right
    gone = len(d.right) - len(right)
    u, s, vt = np.linalg.svd(shared)
    rank = int((s > max(_SEEN, _RANK * s.max(initial=0.0))).sum())
    turned = u.T @ right
    left, freedom = d.left + float((turned[rank:] ** 2).sum()), max(d.count - gone - rank, 0)
    noise = 1.0 if np.isinf(d.worth) else (left + d.worth) / (freedom + d.worth)
    size = np.sqrt(noise)
    matrix = s[:rank, None] * vt[:rank] / size
    return DataSet(matrix=matrix, right=turned[:rank] / size, noise=noise, freedom=freedom + d.worth)


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
    free = u[:, int((s > _SEEN).sum()) :]
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
class Changes:
    """Changes (k,) of parameters `names` per unit of time, SI, with posterior covariance (k, k), and by chance alone.

    null (k, k): covariance of the estimates where nothing changes; p_values (k,) of each alone, holm (k,) corrected,
    nan where the sets do not determine the change: `determined` (k,).
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    null: Array
    determined: NDArray[np.bool_]
    p_values: Array
    holm: Array

    @property
    def std(self) -> Array:
        """Standard uncertainties (k,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def changes(c: Common, moved: Sequence[str], times: Sequence[float], freedom: float) -> Changes:
    """How the parameters `moved` change with time (n,), one value for each set; others are the same in all.

    Their values, of which little is known, are those at the mean time, so that no set comes first.
    """
    where = [c.names.index(n) for n in moved]
    moving = c.matrix[:, where] * (np.array(times) - np.mean(times))[c.set_of][:, None]
    design, q, k = np.hstack([c.matrix, moving]), len(c.names), len(where)
    known = np.ones(q)
    known[where] = 1.0 / _FREE
    whole = np.linalg.inv(design.T @ design + np.diag(np.append(known**2, np.full(k, _CHANGE**-2))))
    gain = whole[q:] @ design.T
    scale, by_offset = c.scale[where], gain @ c.matrix
    null = (gain @ gain.T + by_offset @ by_offset.T) * np.outer(scale, scale)
    values, posterior = gain @ c.right * scale, whole[q:, q:] * np.outer(scale, scale)
    determined = np.sqrt(np.diag(whole)[q:]) <= _KNOWN
    z = np.abs(values) / np.sqrt(np.maximum(np.diag(null), 1e-300))
    single = np.where(determined, 2.0 * stdtr(min(freedom, 1e9), -z), np.nan)
    return Changes(
        names=tuple(moved),
        values=values,
        covariance=posterior,
        null=null,
        determined=determined,
        p_values=single,
        holm=holm(single),
    )


def holm(p_values: Array) -> Array:
    """Holm's step-down correction of p values (k,); nan stays nan and is not counted."""
    out, known = np.full(len(p_values), np.nan), np.nonzero(np.isfinite(p_values))[0]
    order = known[np.argsort(p_values[known], kind="stable")]
    count = len(order)
    out[order] = np.minimum(np.maximum.accumulate(p_values[order] * (count - np.arange(count))), 1.0)
    return out


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


def alone(c: Common, contrasts: Array, test: Omnibus, times: Sequence[float]) -> Alone | None:
    """Of all common parameters; None where no contrast sees any of them."""
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
