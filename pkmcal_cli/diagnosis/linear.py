"""The calibrated problem near its solution, whitened: scores of hypotheses with the declared parameters projected out.

With A the declared parameters' columns in standard deviations of their priors, V = I + A P A^T (P: infinite for the
directions that the data determine, 1 for those that are held, and for all where their ranges are a prior of the fit),
r the residual and C a hypothesis: information I = C^T V^-1 C, score g = C^T V^-1 r, statistic T = g^T I^-1 g (Rao; the
w test of Baarda and Teunissen).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from pkmcal_cli.base.definite import Factor, factored, solved, with_diagonal
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identifiability import Directions, directions
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise, lost_rows, predicted_part
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.memory import Memory
from pkmcal_cli.diagnosis.score import KEPT, Score, projected_out, score_in, scores_among
from pkmcal_cli.prediction import WarmStart


@dataclass(frozen=True, kw_only=True)
class Linear:
    """Whitened residual (n,), columns (n, q) of all parameters in standard deviations of their priors, by name.

    `projected`: names of those that are projected out; `used` counts measured values.
    """

    residual: Array
    columns: Array
    names: tuple[str, ...]
    ranges: Array  # (q,) SI, two standard deviations
    projected: tuple[str, ...]
    used: int
    channels: int
    extra: Array | None = None  # (n, k) further columns to project out, without names
    memory: Memory | None = None  # by which successive rows were alike
    measured: NDArray[np.bool_] | None = None  # (N, C) values that take part: measured, and predicted; None for all
    known: tuple[Array, Array] | None = None  # besides the values: errors (k,) and columns (k, q) of what is known
    once: tuple[int, ...] = ()  # channels of what was measured once, on the bench
    along: Array | None = None  # (q, g) what moves with a datum, in ranges; None where none is held

    @cached_property
    def on(self) -> NDArray[np.bool_]:
        """Values (N, C) that take part."""
        shape = len(self.residual) // self.channels, self.channels
        return np.ones(shape, dtype=bool) if self.measured is None else self.measured

    @cached_property
    def pieces(self) -> NDArray[np.intp]:
        """What each value (N, C) is part of: its row; measured on the bench, a piece numbered after rows."""
        rows, channels = self.on.shape
        out = np.tile(np.arange(rows)[:, None], (1, channels))
        out[:, list(self.once)] = rows + np.arange(len(self.once))
        return out

    @cached_property
    def spectrum(self) -> Directions:
        """What data say of the projected parameters."""
        columns = np.vstack([self.of(self.projected), self._besides[1]])
        beside = None if self.along is None else self.along[[self._index[n] for n in self.projected]]
        return directions(columns, self.projected, np.full(len(self.projected), 2.0), beside=beside)  # in ranges

    @cached_property
    def _besides(self) -> tuple[Array, Array]:
        """Errors (k,) and columns (k, p) of what is known of the projected parameters besides."""
        if self.known is None:
            return np.zeros(0), np.zeros((0, len(self.projected)))
        errors, columns = self.known[0], self.known[1][:, [self._index[n] for n in self.projected]]
        rows = columns.any(axis=1)
        return errors[rows], columns[rows]

    @cached_property
    def fixed(self) -> tuple[Array, Array]:
        """Directions (n, d) that are projected out, and the precision (d, d) of their priors: 1 where they are held."""
        spectrum = self.spectrum
        a, besides = self.of(self.projected) @ spectrum.vectors.T, self._besides[1] @ spectrum.vectors.T
        prior = np.diag(np.where(spectrum.held, 1.0, 0.0)) + besides.T @ besides
        if self.extra is not None:
            a, prior = np.hstack([a, self.extra]), with_diagonal(prior, 1e-6 * (self.extra**2).sum(axis=0) + 1e-12)
        return a, prior

    @cached_property
    def pull(self) -> Array:
        """What is known besides, as the right side (d,) of the normal equations of the same directions."""
        errors, columns = self._besides
        return np.append(self.spectrum.vectors @ (columns.T @ errors), np.zeros(len(self.fixed[1]) - columns.shape[1]))

    @cached_property
    def _factor(self) -> tuple[Array, Factor]:
        """The same directions and the Cholesky factor of their normal matrix."""
        a, prior = self.fixed
        return a, factored(a.T @ a + prior)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: k for k, name in enumerate(self.names)}

    def free(self, x: Array) -> Array:
        """V^-1 x of columns (n, k) or a vector (n,)."""
        a, factor = self._factor
        return x - a @ solved(factor, a.T @ x) if a.shape[1] else x

    @cached_property
    def unexplained(self) -> Array:
        """V^-1 r (n,), of parameters that are what is known of them."""
        a, factor = self._factor
        return self.free(self.residual) - (a @ solved(factor, self.pull) if self.pull.any() else 0.0)

    @cached_property
    def freedom(self) -> Array:
        """Share (n,) of each value's variance that projection leaves; 0 where nothing was measured."""
        a, factor = self._factor
        taken = np.einsum("nk,kn->n", a, solved(factor, a.T)) if a.shape[1] else np.zeros(len(self.residual))
        return np.where((self.residual != 0) | (np.abs(self.columns).max(axis=1, initial=0.0) > 0), 1 - taken, 0.0)

    @cached_property
    def chi2(self) -> float:
        """r^T V^-1 r, with what is known besides."""
        explained = float(self.residual @ self.unexplained)
        if not self.pull.any():
            return explained
        a, factor = self._factor
        errors, step = self._besides[0], solved(factor, a.T @ self.residual + self.pull)
        return explained + float(errors @ errors - self.pull @ step)

    @cached_property
    def dof(self) -> float:
        """Mean of chi2 where nothing is missing: measured values, and what is known besides, less projected directions.

        Not less those that are held: their priors are in V. Of further columns those that say the same count once.
        """
        free = self.used + len(self._besides[0]) - int((~self.spectrum.held).sum())
        if self.extra is None:
            return float(free)
        inverse = np.diag(solved(self._factor[1], np.eye(len(self.fixed[1]))))
        return free - float((1.0 - inverse * np.diag(self.fixed[1]))[len(self.spectrum.held) :].sum())

    def of(self, names: Sequence[str]) -> Array:
        """Columns (n, k) of some parameters."""
        return self.columns[:, [self._index[n] for n in names]]

    def scale_of(self, names: Sequence[str]) -> Array:
        """One standard deviation of the priors (k,), SI."""
        return 0.5 * self.ranges[[self._index[n] for n in names]]

    def projecting(self, names: tuple[str, ...], extra: Array | None = None, residual: Array | None = None) -> Linear:
        """The same with other columns projected out, or another residual."""
        extra = None if extra is None else self._taking_part(extra)
        out = replace(self, projected=names, extra=extra, residual=self.residual if residual is None else residual)
        if names == self.projected:
            vars(out)["spectrum"] = self.spectrum  # of the same columns
        return out

    def besides(self, columns: Array) -> Linear:
        """The same with further columns (n, k), whitened, projected out."""
        return self.projecting(self.projected, columns if self.extra is None else np.hstack([self.extra, columns]))

    def without(self, pieces: Sequence[int]) -> Linear:
        """The same with some `pieces` projected out besides, each a free shift of its readings."""
        shifts = np.zeros((*self.on.shape, len(pieces), self.channels))
        for k, piece in enumerate(pieces):
            rows, channels = np.nonzero(self.pieces == piece)
            shifts[rows, channels, k, channels] = 1.0
        return self.besides(self.whitened(shifts.reshape(self.on.size, -1)))

    def _taking_part(self, x: Array) -> Array:
        """Columns (n, k) or a vector (n,), zero where a value does not take part."""
        return x if self.on.all() else np.asarray((x.T * self.on.ravel()).T)

    def only(self, names: tuple[str, ...], projected: tuple[str, ...]) -> Linear:
        """The same with the columns of some parameters, of which `projected` are projected out."""
        at = [self._index[n] for n in names]
        known = None if self.known is None else (self.known[0], self.known[1][:, at])
        along, columns = None if self.along is None else self.along[at], self.columns[:, at]
        kept = replace(self, columns=columns, names=names, ranges=self.ranges[at], projected=projected)
        return replace(kept, known=known, along=along)

    def prewhitened(self, memory: Memory | None) -> Linear:
        """The same with successive rows made independent; itself where they are."""
        if memory is None:
            return self
        changed = replace(self, memory=memory)
        extra = None if self.extra is None else changed.whitened(self.extra)
        residual, columns = changed.whitened(self.residual), changed.whitened(self.columns)
        return replace(changed, residual=residual, columns=columns, extra=extra)

    def whitened(self, x: Array) -> Array:
        """Columns (n, k) or a vector (n,) of values that take part, made independent from row to row."""
        x = self._taking_part(x)
        if self.memory is None:
            return x
        order, share = self.memory.order, self.memory.correlation
        shaped = x.reshape(len(order), self.channels, -1)[order]
        on = self.memory.measured[order][..., None]
        before = on[1:] & on[:-1]
        changed = (shaped[1:] - share * shaped[:-1]) / np.sqrt(1 - share**2)
        shaped[1:] = np.where(before, changed, shaped[1:])
        out = np.empty_like(shaped)
        out[order] = shaped
        return np.asarray(out.reshape(x.shape))

    def explained(self, columns: Array) -> tuple[float, int]:
        """Statistic T of columns (n, k) of any size, and the number of directions that are left of them."""
        columns = self._taking_part(columns)
        length = np.sqrt((columns**2).sum(axis=0))
        unit = columns[:, length > 0] / length[length > 0]
        values, vectors = np.linalg.eigh(unit.T @ self.free(unit))
        seen = values > 1e-6 * values.max(initial=0.0)
        gradient = vectors[:, seen].T @ (unit.T @ self.unexplained)
        return float((gradient**2 / values[seen]).sum()), int(seen.sum())

    def tested(self, hypothesis: Hypothesis) -> Array:
        """Columns (n, k) of a hypothesis by which it is judged: its free parameters projected out, and 0 themselves."""
        columns = self.of(hypothesis.parameters)
        free = [hypothesis.parameters.index(name) for name in hypothesis.free]
        length = np.sqrt((columns[:, free] ** 2).sum(axis=0))
        unit = columns[:, free][:, length > 0] / length[length > 0]
        if unit.shape[1]:
            values, vectors = np.linalg.eigh(unit.T @ self.free(unit))
            basis = unit @ vectors[:, values > KEPT]
            columns = columns - basis @ ((basis.T @ self.free(columns)) / values[values > KEPT, None])
            columns[:, free] = 0.0
        return columns

    def beside(self, hypothesis: Hypothesis) -> Linear:
        """The same with the free parameters of a hypothesis projected out too."""
        return replace(self, projected=(*self.projected, *hypothesis.free)) if hypothesis.free else self

    @cached_property
    def _normal(self) -> tuple[Array, Array, Array]:
        """C^T V^-1 C (q, q), C^T V^-1 r (q,) and squared lengths (q,) of all columns C."""
        a, (factor, lower) = self._factor
        whole = self.columns.T @ self.columns
        length2 = np.diag(whole).copy()
        if a.shape[1]:
            half = solve_triangular(factor, a.T @ self.columns, trans=0 if lower else 1, lower=lower)
            whole = whole - half.T @ half
        return whole, self.columns.T @ self.unexplained, length2

    def score_of(self, hypothesis: Hypothesis) -> Score:
        """Score of a hypothesis, whatever its free parameters are."""
        return self.scores_of([hypothesis])[0]

    def scores_of(self, hypotheses: Sequence[Hypothesis]) -> tuple[Score, ...]:
        """Scores of hypotheses, whatever their free parameters are."""
        at = [[self._index[n] for n in h.parameters] for h in hypotheses]
        return scores_among(self._normal, at, [[n in h.free for n in h.parameters] for h in hypotheses])

    def scores_beside(self, first: Hypothesis, hypotheses: Sequence[Hypothesis]) -> tuple[Score, ...]:
        """The same, whatever the parameters of a first hypothesis are too."""
        of_first = np.isin(self.names, first.parameters)
        information, gradient = projected_out(*self._normal, of_first)
        length2 = np.where(of_first, 0.0, self._normal[2])
        at = [[self._index[n] for n in h.parameters] for h in hypotheses]
        free = [[n in h.free for n in h.parameters] for h in hypotheses]
        return scores_among((information, gradient, length2), at, free)

    def score(self, columns: Array) -> Score:
        """Score of a hypothesis with these columns (n, k)."""
        information = columns.T @ self.free(columns)
        return score_in(information, columns.T @ self.unexplained, np.einsum("nk,nk->k", columns, columns))


def linear_problem(
    problem: Problem, values: Array, selected: tuple[str, ...], others: Sequence[str], start: WarmStart | None,
    compare: bool = True,
) -> Linear:  # fmt: skip
    """The problem linearised at parameter values (P,): `selected` are projected out, `others` are candidates.

    Rows that are not predicted there, without errors of the drives, take no part. Raises RowsFailed where half are not.
    compare: see `evaluate`; needless near a fit whose rows have been compared.
    """
    names = (*selected, *others)
    evaluation = evaluate(problem, values, names, start, compare=compare)
    if 2 * len(lost_rows(problem, evaluation)) >= max(int(problem.measured.any(axis=1).sum()), 1):
        raise RowsFailed(evaluation)
    part, evaluation = predicted_part(problem, evaluation)
    near = linearise(part, evaluation)
    places = {p.name: k for k, p in enumerate(problem.model.parameters)}
    ranges = problem.model.ranges[[places[n] for n in names]]
    (residual, columns), (errors, known), half = near.values, near.besides, 0.5 * ranges
    return Linear(
        residual=residual, columns=columns * half,
        names=names, ranges=ranges, projected=selected,
        used=part.count, channels=problem.readings.shape[1],
        measured=part.measured,
        known=(errors, known * half) if len(errors) else None,
        once=tuple(part.once),
        along=problem.beside(names),
    )  # fmt: skip
