"""What the errors of identified parameters are made of: noise, what their own ranges hold, what is not identified.

The estimate is linear in what is measured, so its error is T e + (T J - 1) z + T H h with noise e, true offsets z and h
from nominal of the parameters that are identified and of the others, and their Jacobians J and H. The last part is
that of consider covariances (Schmidt 1966; Tapley, Schutz, Born 2004, ch. 6). Offsets and noise have scales that are
estimated (`range_scales`), so errors are mixtures of normal ones, with tails like Student's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.fitted_frames import placed_anywhere
from pkmcal_cli.calibration.held_share import HeldShare, held_share
from pkmcal_cli.calibration.identifiability import Directions
from pkmcal_cli.calibration.instruments import Instruments
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_scales import Evidence, Scales, drawn_scales
from pkmcal_cli.calibration.robust import without_far_off
from pkmcal_cli.calibration.scale_start import first_factors

COVER = 1.959963985  # standard uncertainties of a 95 % interval
_HALVINGS = 30


@dataclass(frozen=True, kw_only=True)
class ErrorBudget:
    """Errors of p identified parameters `names`, besides h others that are `held` with a range; SI.

    `datum`: g parameters to which they are relative. data (G, p, p): covariance by the noise of each of G instruments
    as stated; by_own (p, p + g), by_held (p, h): errors by offsets of half a range, by_own with those of the datum;
    half_ranges (p + g + h,); scales: of the offsets, identified ones first, then the datum's, and of the noise;
    counts, worth (G,): readings of each instrument, and what its stated variance is worth; once (G,): whether it has
    measured on the bench, and so only once; share: of the held ones in the residuals.
    """

    names: tuple[str, ...]
    held: tuple[str, ...]
    instruments: tuple[str, ...]
    data: Array
    by_own: Array
    by_held: Array
    half_ranges: Array
    scales: Scales
    counts: Array
    worth: Array
    share: HeldShare
    once: NDArray[np.bool_]
    datum: tuple[str, ...] = ()
    known_by: str = "the ranges"  # what is known of identified parameters besides the data

    @property
    def every(self) -> tuple[str, ...]:
        """All whose offsets have scales, in their order."""
        return (*self.names, *self.datum, *self.held)

    def _std(self, by_own: Array, by_held: Array) -> Array:
        """Standard uncertainties (p,) by noise and by some offsets (p, p), (p, h)."""
        squares = np.hstack([by_own, by_held]) ** 2
        noise = np.diagonal(self.data, axis1=1, axis2=2)  # (G, p)
        return _equivalent(self.scales.variances @ squares.T + self.scales.noise @ noise)

    @cached_property
    def std(self) -> Array:
        """Standard uncertainties (p,): 1.96 of them hold 95 % of the errors."""
        return self._std(self.by_own, self.by_held)

    @cached_property
    def std_by_data(self) -> Array:
        """The part (p,) of noise and of what ranges hold."""
        return self._std(self.by_own, np.zeros_like(self.by_held))

    @cached_property
    def std_by_held(self) -> Array:
        """The part (p,) of parameters that are not identified."""
        return np.asarray(np.sqrt(np.maximum(self.std**2 - self.std_by_data**2, 0.0)))

    @cached_property
    def noise_covariance(self) -> Array:
        """Covariance (p, p) by noise alone, as large as it turned out to be."""
        return np.asarray(np.tensordot(self.scales.typical_noise, self.data, 1))

    @property
    def spread(self) -> float:
        """By what the stated variances of the readings were multiplied, on the whole."""
        half2 = self.half_ranges[: len(self.names)] ** 2
        before = float((np.diag(self.data.sum(axis=0)) / half2).sum())
        return float((np.diag(self.noise_covariance) / half2).sum()) / before if before > 0 else 1.0

    @property
    def factors(self) -> Array:
        """By what the stated ranges (p + g,) of what was identified are multiplied, where noise is as stated."""
        return np.asarray(self.scales.typical[: self.by_own.shape[1]] / np.sqrt(self.spread))

    @cached_property
    def share_of_ranges(self) -> Array:
        """Share (p,) of the variance by noise and ranges that ranges make."""
        by_ranges = (self.by_own**2) @ self.scales.typical[: self.by_own.shape[1]] ** 2
        whole = by_ranges + np.diag(self.noise_covariance)
        return np.asarray(np.divide(by_ranges, whole, out=np.zeros(len(by_ranges)), where=whole > 0))

    @cached_property
    def noise_variances(self) -> Array:
        """Of the instruments (G,), in stated ones, as wide as the mixtures are."""
        return _equivalent(self.scales.noise) ** 2

    @property
    def without_held(self) -> ErrorBudget:
        """The part of noise and of what ranges hold: as if what is not identified were as it is nominally."""
        half_ranges = np.append(self.half_ranges[: self.by_own.shape[1]], np.zeros(len(self.held)))
        return replace(self, by_held=np.zeros_like(self.by_held), half_ranges=half_ranges)

    @cached_property
    def joint_covariance(self) -> Array:
        """Covariance (p + h, p + h) of the errors of all: what a held parameter shifts others by is in it.

        Each cause, an offset or the noise of an instrument, is as wide as its own mixture: a factor for each parameter
        would spoil the sums that cancel, and one for all would give to the noise the tails of ranges.
        """
        (p, free), h = self.by_own.shape, len(self.held)
        below = np.hstack([np.zeros((h, free)), np.diag(-self.half_ranges[free:])])  # what is held is off by its offset
        by_offset = np.vstack([np.hstack([self.by_own, self.by_held]), below]) * _equivalent(self.scales.variances)
        out = by_offset @ by_offset.T
        out[:p, :p] += np.tensordot(self.noise_variances, self.data, 1)
        return np.asarray(out)

    @property
    def covariance(self) -> Array:
        """Covariance (p, p) of the identified ones."""
        return self.joint_covariance[: len(self.names), : len(self.names)]


def _equivalent(variances: Array) -> Array:
    """Standard deviations (p,) of normal errors that are within 95 % limits where mixtures (M, p) are."""
    deviation = np.sqrt(variances)
    low, high = np.zeros(deviation.shape[1]), 20.0 * deviation.max(axis=0, initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            inside = np.where(deviation > 0, 2.0 * ndtr(middle / deviation) - 1.0, 1.0).mean(axis=0)
            low, high = np.where(inside < 0.95, middle, low), np.where(inside < 0.95, high, middle)
    return np.asarray(high / COVER)


def held_parameters(problem: Problem, selected: tuple[str, ...], datum: tuple[str, ...]) -> tuple[str, ...]:
    """Parameters that are not identified, and not exact.

    Those of effects are what their entries say, but for such with a range of their own; those that are declared as the
    datum define the axes.
    """
    known = {*selected, *datum, *problem.model.datum}
    with_range = (p for p in problem.model.parameters if p.stated and not p.fixed and p.range > 0)
    return tuple(p.name for p in with_range if p.name not in known)


def error_budget(
    problem: Problem, fit: Fit, held: tuple[str, ...] = (), scales: Scales | None = None, noise: float | None = None
) -> ErrorBudget:
    """Of a fit that has ended. `scales`: known from elsewhere; noise: what all stated variances are multiplied by."""
    problem, both, p = without_far_off(problem), (*fit.selected, *held), len(fit.selected)
    index = [problem.model.names.index(n) for n in both]
    half = 0.5 * problem.model.ranges[index]
    last = evaluate_condensed(problem, fit.values, both, fit.last.start, fit.shift) if held else fit.last
    near = condensed(problem, last)
    groups = Instruments.of(problem, near.channel)
    jacobian = near.jacobian * half
    said = evidence = _evidence(problem, fit, groups.without(near.frames, problem), jacobian, near.residual, index)
    information = said.information
    whole, scale = information.sum(axis=0), half[:p, None]
    prior, spread, datum = problem.prior, np.asarray(np.eye(p)), _datum_of(problem, fit)
    if prior is not None and prior.stated:
        spread = np.asarray(np.linalg.inv(prior.columns(fit.selected) * half[:p]))
        evidence = evidence.of_known(spread, prior.errors(problem.model, fit.values))
    elif datum.names:
        spread = np.hstack([spread, datum.beside])
        evidence = evidence.beside_datum(datum.beside, datum.offsets, datum.kinds, datum.ranged)
    if scales is None:
        scales = _scales(evidence, noise)
    gain = _gain(fit.directions, jacobian[:, :p], half[:p])  # (p, p): by it J^T y gives the estimate
    return ErrorBudget(
        names=fit.selected,
        datum=datum.names,
        held=held,
        instruments=groups.names,
        data=gain @ information[:, :p, :p] @ gain.T * np.outer(half[:p], half[:p]),
        by_own=(gain @ whole[:p, :p] - np.eye(p)) @ spread * scale,
        by_held=gain @ whole[:p, p:] * scale,
        half_ranges=np.insert(half, p, datum.half_ranges),
        scales=scales,
        counts=groups.counts,
        worth=groups.freedom,
        share=held_share(held, said, gain),
        once=groups.once,
        known_by="the ranges" if prior is None or not prior.stated else "the prior",
    )


@dataclass(frozen=True)
class _Datum:
    """Parameters held as datum, g, whose ranges count: what moves along (p, g) in ranges; half ranges (g,); offsets
    from nominal (g,) in these, where they are held; ranged (g,): whether their ranges say something of others."""

    names: tuple[str, ...]
    beside: Array
    half_ranges: Array
    offsets: Array
    kinds: tuple[str, ...]
    ranged: NDArray[np.bool_]


def _datum_of(problem: Problem, fit: Fit) -> _Datum:
    """Of a fit; none where an earlier calibration says how far off parameters are."""
    model, held, beside = problem.model, problem.datum, problem.beside(fit.selected)
    if held is None or beside is None or (problem.prior is not None and problem.prior.stated):
        return _Datum((), np.zeros((len(fit.selected), 0)), np.zeros(0), np.zeros(0), (), np.zeros(0, dtype=bool))
    parameters = [model.parameters[model.names.index(n)] for n in held.held]
    half = np.array([0.5 * p.range for p in parameters])
    kinds = tuple(p.kind or p.dimension for p in parameters)
    ranged = np.array([n not in placed_anywhere(model) for n in held.held])
    return _Datum(held.held, beside, half, held.offsets(model, fit.values) / half, kinds, ranged)


def _scales(evidence: Evidence, noise: float | None) -> Scales:
    """Drawn after the data; noise: what all stated variances are multiplied by, if that is known."""
    if noise is None:
        return drawn_scales(evidence, first_factors(evidence))
    evidence = evidence.with_noise(noise)
    scales = drawn_scales(evidence, first_factors(evidence))
    return replace(scales, noise=np.full(scales.noise.shape, noise))


def _evidence(
    problem: Problem, fit: Fit, groups: Instruments, jacobian: Array, residual: Array, index: list[int]
) -> Evidence:
    """What each instrument says: whitened residual (n,) and Jacobian (n, q) in half ranges, of parameters `index`."""
    rows = [np.nonzero(groups.group_of == k)[0] for k in range(len(groups.names))]
    parts = [(jacobian[r], residual[r]) for r in rows]
    parameters = [problem.model.parameters[k] for k in index]
    offsets = 2.0 * (fit.values - problem.model.nominal)[index] / problem.model.ranges[index]
    identified = np.arange(len(index)) < len(fit.selected)
    unranged = placed_anywhere(problem.model)
    return Evidence(
        information=np.array([j.T @ j for j, _ in parts]),
        score=np.array([j.T @ r for j, r in parts]),
        squares=np.array([r @ r for _, r in parts]),
        counts=groups.counts,
        freedom=groups.freedom,
        centre=np.where(identified, offsets, 0.0),
        kinds=tuple(p.kind or p.dimension for p in parameters),
        estimated=identified & np.array([p.name not in unranged for p in parameters], dtype=bool),
    )


def _gain(spectrum: Directions, jacobian: Array, half: Array) -> Array:
    """(J^T J)^-1 (p, p) of all equations (n, p) in the directions that a fit moves, in half ranges."""
    moved = spectrum.vectors[~spectrum.held] * (spectrum.ranges / (2.0 * half))  # (d, p)
    if not moved.size:
        return np.zeros((len(half), len(half)))
    upper = np.asarray(np.linalg.qr(jacobian @ moved.T, mode="r"))
    root = np.linalg.solve(upper.T, moved)  # (d, p)
    return np.asarray(root.T @ root)
