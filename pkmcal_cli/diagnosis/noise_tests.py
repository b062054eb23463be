"""The noise that tests stand on: the stated sigma, or what the residual shows where the statement is too small."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.holdout import replicate_groups
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.groups import POSE, TEMPERATURE, TIME, group_columns
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.memory import Memory
from pkmcal_cli.diagnosis.outlying_rows import Tails
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.score import KEPT, Score, log_evidence

_SURELY = 1e-4  # chance of so little noise at which the stated sigma is too large
_LEAST = 1e-8  # of the stated variance; what simulated tables without noise leave is less, and rounding
_MOSTLY = 0.5  # of chi-square that one row must explain to be left out of the noise
_FEWEST = 20  # values that must be free once shapes are projected out
_FEW = 10  # the same, beside an effect
_REPEATED = 20  # degrees of freedom from which repeated poses tell the noise
_DOUBT = 0.2  # the stated sigma is kept unless so improbable: an estimate costs little, a sigma too small false alarms
_ALIKE = 1e-4  # p value below which successive rows are not independent
FREE = 0.2  # share of a value's variance that must be left once shapes are projected out
_NOTABLE = 0.05  # share of an estimate of the noise that an effect may have before it is estimated beside the effect
_CERTAIN = 1e-12  # p value that needs no better noise
_SPARED = 4  # squares left out where there are few
_TRIM = 0.05  # share of the largest squares left out, so that bad rows do not count as noise


def noise_scale(linear: Linear, problem: Problem, groups: Mapping[str, Array]) -> Scale:
    """Scale of the noise: of repeated poses where there are some, else of what no smooth group explains."""
    repeated = _pure_error(linear, problem, groups)
    if repeated is not None:
        return repeated
    if linear.dof > 0 and linear.chi2 < float(chdtri(linear.dof, 1 - _SURELY)):  # whatever effects may be in it
        return Scale(max(linear.chi2 / linear.dof, _LEAST), float(linear.dof), float(linear.dof))
    free = _unsmooth(linear, groups)
    if free.dof < _FEWEST or (free.freedom > FREE).sum() < _FEWEST:  # what declared parameters leave, effects included
        return _of_few(linear)
    variance, dof = _variance_of(free.unexplained, free.freedom, free.dof)
    return replace(_doubted(variance, dof), rough=True)


def p_values_beside(
    linear: Linear, groups: Mapping[str, Array], scale: Scale, scores: Iterable[tuple[Hypothesis, Score]], p: Array
) -> Array:
    """p values (H,) of effects, of noise in which what the effect itself does has no part; `p`: by the noise `scale`.

    A rough estimate contains what an effect does, unless it is smooth: T over one with f degrees of freedom that
    contains T is at most f, and no effect in few rows would be significant. Where its columns are projected out, what
    is left is independent of T, and their ratio is F (test of a part of a linear model; Seber and Lee 2003, 4.3).
    """
    tested = list(scores)
    statistic = np.array([score.statistic for _, score in tested])
    doubtful = (p > _CERTAIN) & (statistic > _NOTABLE * scale.variance * scale.dof)
    if not (scale.rough and doubtful.any()):
        return p
    free, p = _unsmooth(linear, groups), p.copy()
    for k in doubtful.nonzero()[0]:
        hypothesis, score = tested[k]
        p[k] = (_noise_beside(free, linear.tested(hypothesis) @ score.basis) or scale).p_of(score)
    return p


def _noise_beside(free: Linear, columns: Array) -> Scale | None:
    """The noise in what smooth groups, and an effect with these columns (n, m), leave: not less than stated; None
    where they leave little.

    As an estimate throughout: the statement was improbable, and that it is not any more beside one of many effects
    would be chance, where sigma is too small.
    """
    unit = columns / np.sqrt((columns**2).sum(axis=0))
    values, vectors = np.linalg.eigh(unit.T @ free.free(unit))
    unit = unit @ (vectors[:, values > KEPT] / np.sqrt(values[values > KEPT]))
    left = free.free(unit)  # (n, s)
    unexplained, freedom = free.unexplained - left @ (unit.T @ free.unexplained), free.freedom - (left**2).sum(axis=1)
    dof = free.dof - left.shape[1]
    if dof < _FEW or (freedom > FREE).sum() < _FEW:
        return None
    variance, dof = _variance_of(unexplained, freedom, dof)
    return Scale(max(variance, 1.0), dof)


def _unsmooth(linear: Linear, groups: Mapping[str, Array]) -> Linear:
    """The problem with what is smooth projected out."""
    shapes = np.hstack([*_none(linear), *map(linear.whitened, groups.values())])
    return linear.projecting(linear.projected, extra=shapes)


def _variance_of(unexplained: Array, freedom: Array, dof: float) -> tuple[float, float]:
    """Variance of values (n,) of which a share (n,) is left, with so many degrees of freedom together, and its own."""
    kept = freedom > FREE  # else what was projected out follows the value
    variance, worth = _without_tails(unexplained[kept] ** 2 / freedom[kept])
    return variance, worth * dof


def chance_of_noise(linear: Linear) -> float:
    """p value of a residual as large as this, of noise as it is stated and of no more than that.

    Whatever ranges say: all directions of the declared parameters are projected out. The largest squares count by the
    others, or noise with tails would be too large noise.
    """
    free = linear.projecting((), extra=linear.fixed[0])
    dof, kept = float(free.freedom.sum()), free.freedom > FREE
    if not kept.any():
        return 1.0
    squares = free.unexplained[kept] ** 2 / free.freedom[kept]
    variance, worth = _without_tails(squares)
    p = float(max(chdtrc(dof, float((free.unexplained**2).sum())), chdtrc(worth * dof, worth * dof * variance)))
    return Tails.of(np.sqrt(squares)).of_sum(p)


def _of_few(linear: Linear) -> Scale:
    """Noise by all that declared parameters leave, but for a single row that is most of it."""
    kept = without_odd_row(linear)
    kept = kept if kept.dof > 0 else linear
    if kept.dof <= 0:
        return Scale()
    return replace(_doubted(kept.chi2 / kept.dof, kept.dof, whole=True), part=kept is linear)


def without_odd_row(linear: Linear) -> Linear:
    """The problem with the piece projected out that has most of chi-square, if that is most of it; else itself."""
    worst = int(np.argmax(np.bincount(linear.pieces.ravel(), linear.unexplained**2)))
    without = linear.without([worst])
    return without if without.chi2 < _MOSTLY * linear.chi2 else linear


def _none(linear: Linear) -> list[Array]:
    return [np.zeros((len(linear.residual), 0))]


def _doubted(variance: float, dof: float, whole: bool = False) -> Scale:
    """The stated noise, unless an estimate makes it improbable."""
    if improbable(np.array(variance), float(dof)):
        return Scale(variance, float(dof), float(dof), whole)
    return Scale(checked=float(dof), whole=whole)


def improbable(variance: Array, dof: float) -> NDArray[np.bool_]:
    """Whether estimated variances, over the stated one, take its place."""
    return np.asarray(variance > float(chdtri(dof, _DOUBT)) / dof)


def _pure_error(linear: Linear, problem: Problem, groups: Mapping[str, Array]) -> Scale | None:
    """Noise within repeated poses of one session, approached from the same sides; None with few of them.

    What is smooth in time and temperature is taken off before.
    """
    if linear.memory is not None:
        return None  # rows that were made independent are no repeated poses any more
    slow = [groups[name] for name in (TIME, TEMPERATURE) if name in groups]
    columns = problem.rows.columns
    same = [columns[n] for n in columns if n.startswith(("dir.", "session.")) or n == "payload"]
    keys = np.column_stack([replicate_groups(problem), *same]) if same else replicate_groups(problem)[:, None]
    _, label = np.unique(np.nan_to_num(keys), axis=0, return_inverse=True)
    label = label.ravel()
    channels = problem.readings.shape[1]
    free = linear.projecting(linear.projected, extra=np.hstack([*_none(linear), *slow]))
    residual = free.unexplained / np.sqrt(np.maximum(free.freedom, FREE)) if slow else linear.residual
    residual = residual.reshape(-1, channels)
    whole = linear.on.all(axis=1)
    counts = np.bincount(label[whole])
    dof = int(np.maximum(counts - 1, 0).sum()) * channels
    if dof < _REPEATED:
        return None
    means = np.stack([np.bincount(label[whole], c[whole]) for c in residual.T], axis=1) / np.maximum(counts, 1)[:, None]
    return _doubted(float(((residual[whole] - means[label[whole]]) ** 2).sum()) / dof, dof)


def _without_tails(squares: Array) -> tuple[float, float]:
    """Variance of normal values by squares (n,), of which the largest are left out: some also where there are few.

    And what a degree of freedom is worth in it.
    """
    count = len(squares)
    spared = max(int(_TRIM * count), min(_SPARED, count // 6))
    inner = np.sort(squares)[: count - spared]
    share, worth = _trimmed(spared / count)
    return float(inner.sum()) / count / share, worth


def _trimmed(spared: float) -> tuple[float, float]:
    """Mean square of a standard normal variable without a share of the largest squares, over all; its efficiency.

    The influence of a square x on the trimmed mean is min(x, q), q being the largest that is kept (Huber 1981, 3.3);
    efficiency: variance of the mean of all squares, relative to it, over that of the trimmed one.
    """
    from scipy.special import ndtri

    if spared == 0.0:
        return 1.0, 1.0
    z = float(ndtri(1 - spared / 2))
    density = float(np.exp(-z * z / 2) / np.sqrt(2 * np.pi))
    share = 1 - spared - 2 * z * density
    fourth = 3 * (1 - spared) - 2 * density * (z**3 + 3 * z)  # mean of x^2 of squares x < q
    variance = fourth + z**4 * spared - (share + z**2 * spared) ** 2
    return share, 2 * share**2 / variance


def time_order(problem: Problem) -> NDArray[np.intp]:
    """Rows (N,) in the order in which they were measured: by time where it is known, else as they stand."""
    time = problem.rows.columns.get("time")
    known = time is not None and bool(np.isfinite(time).all())
    return np.argsort(time, kind="stable") if known and time is not None else np.arange(len(problem))


def successive(linear: Linear, problem: Problem) -> tuple[float, float]:
    """Correlation of successive rows' residuals, and its p value; large residuals count as three times the usual."""
    residual = linear.unexplained.reshape(problem.readings.shape)[time_order(problem)]
    size = np.sqrt((residual**2).mean())
    on = linear.on[time_order(problem)]
    pairs = on[1:] & on[:-1]
    residual = np.clip(residual / size, -3.0, 3.0)
    squares = np.where(pairs, residual[1:] ** 2, 0.0).sum() * np.where(pairs, residual[:-1] ** 2, 0.0).sum()
    share = float(np.where(pairs, residual[1:] * residual[:-1], 0.0).sum() / np.sqrt(squares)) if squares > 0 else 0.0
    return share, float(chdtrc(1, share**2 * pairs.sum()))


def independent(linear: Linear, problem: Problem, hypotheses: Sequence[Hypothesis] = ()) -> Linear:
    """The problem with successive rows made independent, where noise with a memory explains best that they are not.

    A step or an oscillation in time makes them alike too, and where poses stand in their order, any effect does and any
    smooth field; these are for others to find.
    """
    if linear.memory is not None:
        return linear
    groups = group_columns(problem)
    slow = groups.get(TIME)  # a drift is no memory
    share, p = successive(linear if slow is None else linear.projecting(linear.projected, extra=slow), problem)
    if share <= 0 or p > _ALIKE:
        return linear
    residual = linear.unexplained.reshape(problem.readings.shape)[time_order(problem)]
    made = linear.prewhitened(Memory(time_order(problem), share, linear.on))
    size, n = residual.shape[1], np.log(residual.size)
    memory = 0.5 * (linear.chi2 - made.chi2 - (len(residual) - 1) * size * np.log(1 - share**2)) - 0.5 * n
    step = 0.5 * _step(residual) - 0.5 * (size + 1) * n
    wave = 0.5 * _wave(residual) - 0.5 * (2 * size + 1) * n
    return made if memory > max(step, wave, _by_pose(linear, groups), _by_effect(linear, hypotheses)) else linear


def _by_pose(linear: Linear, groups: Mapping[str, Array]) -> float:
    """Log evidence (BIC) of a smooth field over the pose."""
    if POSE not in groups:
        return 0.0
    statistic, count = linear.explained(groups[POSE])
    return 0.5 * statistic - 0.5 * count * float(np.log(linear.used))


def _by_effect(linear: Linear, hypotheses: Sequence[Hypothesis]) -> float:
    """Log evidence of the best hypothesis, by stated noise."""
    scores = linear.scores_of(hypotheses)
    evidence = log_evidence(np.array([s.statistic for s in scores]), np.array([s.count for s in scores], dtype=np.intp))
    return float(evidence.max(initial=0.0))


def _step(residual: Array) -> float:
    """How much of the sum of squares of residuals (N, C) the best single step in their order explains."""
    rows = len(residual)
    first = np.arange(1, rows)
    sums = np.cumsum(residual - residual.mean(axis=0), axis=0)[:-1]
    return float(((sums**2).sum(axis=1) * rows / (first * (rows - first))).max())


def _wave(residual: Array) -> float:
    """How much the best single oscillation in their order explains."""
    power = np.abs(np.fft.rfft(residual, axis=0)) ** 2
    return float(power[1:-1].sum(axis=1).max() * 2 / len(residual))
