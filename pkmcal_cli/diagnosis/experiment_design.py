"""Before anyone measures: what a plan of poses can detect and tell apart, and which points are best added to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem, usable
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.detection import Detection
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.noise_tests import noise_scale
from pkmcal_cli.diagnosis.score import Score
from pkmcal_cli.diagnosis.threshold import critical_p, smallest_p
from pkmcal_cli.diagnosis.trial import Procedure
from pkmcal_cli.diagnosis.visible_sizes import VisibleSizes, visible_sizes

ALIKE = 0.95  # cosine above which two effects are an ambiguity group
_EXCHANGED = 60  # points up to which exchanges are tried
_ROUNDING = 1e-13  # share of a column's sum of squares: columns that differ by less are one
Status = Literal["detectable", "weak", "invisible"]


@dataclass(frozen=True, kw_only=True)
class Visibility(VisibleSizes):
    """What a plan says of one hypothesis; `msb`: minimal separable size of the leading parameter, SI.

    `rival`: the hypothesis most like it, `cosine` of their angle.
    """

    msb: float
    rival: str
    cosine: float

    @property
    def status(self) -> Status:
        """Detectable where half the plausible size (one standard deviation) is detected, weak below the whole one."""
        if self.absorbed_by or not self.mdb < self.plausible:
            return "invisible"
        return "detectable" if self.detected < 0.5 * self.plausible else "weak"


@dataclass(frozen=True)
class Plan:
    """A plan of poses and what it shows; `groups`: names of hypotheses that it cannot tell apart.

    sizes: of hypotheses at single places, as a diagnosis at the rate of false alarms that is asked for detects them.
    """

    candidates: Candidates
    problem: Problem
    linear: Linear
    scores: tuple[Score, ...]
    sizes: tuple[VisibleSizes, ...]
    cosines: Array  # (H, H)

    @cached_property
    def visibilities(self) -> tuple[Visibility, ...]:
        """Of every hypothesis."""
        return tuple(self._visibility(k) for k in range(len(self.scores)))

    @cached_property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Ambiguity groups: connected by cosines above 0.95."""
        alike = csr_array((self.cosines > ALIKE).astype(float))
        count, label = connected_components(alike, directed=False)
        names = np.array([h.name for h in self.candidates.single])
        grouped = [tuple(names[label == k].tolist()) for k in range(count)]
        return tuple(g for g in grouped if len(g) > 1)

    def _visibility(self, k: int) -> Visibility:
        sizes, others = self.sizes[k], self.cosines[k].copy()
        others[k] = 0.0
        rival = int(np.argmax(others))
        cosine = float(others[rival])
        sine = np.sqrt(max(1 - cosine**2, 0.0))
        return Visibility(
            **vars(sizes),
            msb=sizes.mdb / sine if sine > 0 else float("inf"),
            rival=self.candidates.single[rival].name if cosine > 0 else "",
            cosine=cosine,
        )


def plan_of(
    candidates: Candidates, problem: Problem, values: Array, selected: tuple[str, ...], alpha: float, seed: int
) -> Plan:
    """What a plan can show at parameter values (P,), and a diagnosis with this false-alarm rate can find.

    A diagnosis tests groups of places too; what a plan shows is told of single ones.
    """
    others = [n for h in candidates.hypotheses for n in h.parameters]
    linear = linear_problem(problem, values, selected, others, None)
    procedure = expected_procedure(linear, problem, candidates.hypotheses, alpha, seed)
    hypotheses = candidates.single
    scores = linear.scores_of(hypotheses)
    detection = Detection(linear, problem, hypotheses, seed, candidates.hypotheses)
    sizes = visible_sizes(detection, procedure)
    return Plan(candidates, problem, linear, scores, sizes, cosines_between(linear, hypotheses, scores))


def expected_procedure(
    linear: Linear, problem: Problem, hypotheses: Sequence[Hypothesis], alpha: float, seed: int
) -> Procedure:
    """What a diagnosis with this false-alarm rate will ask of hypotheses, of noise as it is stated."""
    every = [part for h in hypotheses for part in h.nested_parts]
    draws = smallest_p(linear, [linear.tested(h) for h in every], linear.scores_of(every), seed)
    drawn = replace(linear, residual=linear.on.ravel() * np.random.default_rng(seed).normal(size=linear.on.size))
    checked = noise_scale(drawn, problem, group_columns(problem))
    return Procedure(critical_p(draws, Alpha(alpha).catalogue), replace(checked, variance=1.0))


def cosines_between(linear: Linear, hypotheses: Sequence[Hypothesis], scores: Sequence[Score]) -> Array:
    """Cosines (H, H) of the angles between what hypotheses explain after projection.

    Of several principal angles the largest one of the smaller hypothesis: 1 where the larger one contains it.
    """
    bases = []
    for h, s in zip(hypotheses, scores, strict=True):
        free = linear.free(linear.tested(h) @ s.basis)
        bases.append(np.linalg.qr(free)[0] if s.count else np.zeros((len(free), 0)))
    out = np.eye(len(bases))
    for i, a in enumerate(bases):
        for j in range(i):
            if a.shape[1] and bases[j].shape[1]:
                out[i, j] = out[j, i] = min(float(np.linalg.svd(a.T @ bases[j], compute_uv=False)[-1]), 1.0)
    return out


@dataclass(frozen=True)
class Aim:
    """What further points are for: to see a hypothesis, to tell several apart, or to determine parameters."""

    kind: Literal["see", "separate", "determine"]
    parameters: tuple[tuple[str, ...], ...]  # by hypothesis


@dataclass(frozen=True)
class Chosen:
    """Rows chosen out of the candidates' and the aim's figure before and after: information in prior units."""

    rows: NDArray[np.intp]
    before: float
    after: float


def best_points(
    linear: Linear, blocks: Array, planned: int, aim: Aim, count: int, *, exchange: bool = True
) -> Chosen:
    """The best `count` rows to add to the first `planned` ones; `blocks` (M, C, q): whitened rows of all columns.

    Greedy, in the order of their gain; then, with `exchange`, exchanged one by one while that is better (Fedorov).
    """
    rows, prior, groups = arranged(linear, blocks, aim)
    start = np.einsum("mca,mcb->ab", rows[:planned], rows[:planned]) + np.diag(prior)
    search = _PointSearch(start, rows[planned:], groups, aim.kind)
    chosen: list[int] = []
    for _ in range(min(count, len(rows) - planned)):
        chosen.append(search.best(chosen))
    chosen = search.exchanged(chosen) if exchange and count <= _EXCHANGED else chosen
    return Chosen(np.array(chosen, dtype=np.intp), search.figure([]), search.figure(chosen))


def arranged(linear: Linear, blocks: Array, aim: Aim) -> tuple[Array, Array, list[NDArray[np.intp]]]:
    """Rows (M, C, q) of what is projected out and of the aim's columns, weights (q,) of their priors, the aim's groups.

    What is projected out are directions, of which some are held; to determine parameters, the parameters themselves.
    """
    if aim.kind == "determine":
        names = list(linear.projected)
        fixed, prior = blocks[..., [linear.names.index(n) for n in names]], np.full(len(names), 1e-6)
        return fixed, prior, [np.array([names.index(n) for n in group]) for group in aim.parameters]
    columns, weights = linear.fixed
    aimed = list(dict.fromkeys(n for group in aim.parameters for n in group))
    aimed_columns = blocks[..., [linear.names.index(n) for n in aimed]]
    rows = np.concatenate([columns.reshape(*blocks.shape[:2], -1), aimed_columns], axis=2)
    first = columns.shape[1]
    groups = [np.array([first + aimed.index(n) for n in group]) for group in aim.parameters]
    return rows, np.concatenate([np.diag(weights), np.zeros(len(aimed))]) + 1e-9, groups


def covariance_of(normal: Array) -> Array:
    """The inverse (q, q) of a normal matrix (q, q); very large, not infinite, along what it does not determine."""
    size = np.sqrt(np.diag(normal))
    equal = normal / np.outer(size, size)
    return np.asarray(np.linalg.inv(equal + _ROUNDING * np.eye(len(size))) / np.outer(size, size))


@dataclass(frozen=True)
class _PointSearch:
    """Rows of a pool (M, C, q) that raise an aim's figure over a normal matrix `start` (q, q)."""

    start: Array
    pool: Array
    groups: list[NDArray[np.intp]]
    kind: str

    def figure(self, chosen: Sequence[int]) -> float:
        """The aim's figure with some rows."""
        return float(self._of([c[None] for c in self._covariances(covariance_of(self._normal(chosen)))])[0])

    def best(self, chosen: Sequence[int]) -> int:
        """The row that raises the figure most, not one of those chosen."""
        inverse = covariance_of(self._normal(chosen))
        gained = self.pool @ inverse  # (M, C, q)
        middle = np.linalg.inv(np.eye(self.pool.shape[1]) + gained @ self.pool.swapaxes(1, 2))  # (M, C, C)
        changed = []
        for group, before in zip(self._blocks, self._covariances(inverse), strict=True):
            part = gained[..., group]  # (M, C, g)
            changed.append(before - np.einsum("mca,mcd,mdb->mab", part, middle, part))
        figure = self._of(changed)
        figure[list(chosen)] = -np.inf
        return int(np.argmax(figure))

    def exchanged(self, chosen: list[int], rounds: int = 3) -> list[int]:
        """Rows exchanged one by one while the figure rises."""
        for _ in range(rounds):
            before = list(chosen)
            for k in range(len(chosen)):
                others = chosen[:k] + chosen[k + 1 :]
                chosen = [*others[:k], self.best(others), *others[k:]]
            if chosen == before:
                break
        return chosen

    def _normal(self, chosen: Sequence[int]) -> Array:
        some = self.pool[list(chosen)]
        return np.asarray(self.start + np.einsum("mca,mcb->ab", some, some))

    @property
    def _blocks(self) -> list[NDArray[np.intp]]:
        return [np.concatenate(self.groups)] if self.kind == "determine" else self.groups

    def _covariances(self, inverse: Array) -> list[Array]:
        """Of each group's parameters (g, g), all others projected out."""
        return [inverse[np.ix_(g, g)] for g in self._blocks]

    def _of(self, covariances: list[Array]) -> Array:
        """Figure (M,) of covariances (M, g, g): the smallest information of a group; `determine`: log determinant."""
        if self.kind == "determine":
            return np.asarray(-np.linalg.slogdet(covariances[0])[1])
        return smallest_information(covariances)


def smallest_information(covariances: Sequence[Array]) -> Array:
    """Of covariances (M, g, g) of each group's parameters, the least information (M,) that any group has.

    Along the direction in which its numbers are known best: an effect is seen where some of its numbers are.
    """
    return np.asarray(np.min([1.0 / np.linalg.eigvalsh(c)[:, 0] for c in covariances], axis=0))


def whitened_blocks(linear: Linear, rows: int) -> Array:
    """Whitened rows (M, C, q) of a problem's columns."""
    return linear.columns.reshape(rows, linear.channels, -1)


def with_rows(problem: Problem, rows: Problem) -> Problem:
    """Two problems of one model as one table."""
    from pkmcal_cli.prediction import joined_rows

    both = replace(
        problem,
        rows=joined_rows([problem.rows, rows.rows]),
        readings=np.vstack([problem.readings, rows.readings]),
        sigma=np.vstack([problem.sigma, rows.sigma]),
        drive_sigma=np.vstack([problem.drive_sigma, rows.drive_sigma]),
        side_sigma=_side_sigma([problem, rows]),
        measured=np.vstack([problem.measured, rows.measured]),
    )
    return usable(both)


def _side_sigma(parts: Sequence[Problem]) -> Array | None:
    """Of rows one after the other (N, A); sides of points that are planned are known."""
    if all(p.side_sigma is None for p in parts):
        return None
    return np.vstack([np.zeros_like(p.drive_sigma) if p.side_sigma is None else p.side_sigma for p in parts])
