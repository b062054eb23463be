"""Alternatives without a name: a step or an oscillation in time, a local bump of a drive or guide, a smooth field.

They compete with what was accepted, by the same evidence. Where one of them explains better what effects of the
catalogue were accepted for, these may be stand-ins for something that the catalogue lacks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.groups import POSE, TIME, by_channel, drift_shapes, pose_shapes
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.noise_tests import time_order
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.unit_columns import unit_columns
from pkmcal_cli.model.effect_sites import ALL, PlacedEffect

_WIDTHS = (0.03, 0.045, 0.065, 0.1)  # full width at half maximum of bumps, in shares of the travel
_ROWS = 4  # on a bump, at least
_STEP = 0.3  # of their places, in widths
_FEWEST_CYCLES = 4.0  # slower oscillations are drift or temperature
_NEAR = 3  # rows from the change of a session, where a step is a new set-up
SMOOTH = "smooth drift"
_EDGE = 4  # rows before and after a step, at least


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """The best alternative of one kind: what it depends on, statistic and log evidence (BIC, tries counted).

    columns (n, k): its own, whitened; row: the first one after a step.
    """

    depends_on: str
    words: str
    statistic: float
    evidence: float
    rms: float  # of what it explains, in stated standard uncertainties
    columns: Array
    row: int | None


@dataclass(frozen=True)
class Family:
    """Alternatives of one kind: blocks of k columns each (n, m, k), and words for each of the m; of steps, the first
    row after each."""

    depends_on: str
    columns: Array
    words: Sequence[str]
    rows: Sequence[int] = ()


def families(problem: Problem, fit: Fit) -> list[Family]:
    """All alternatives at a solution, whitened."""
    return [f for f in (*in_time(problem), *fields(problem), _bumps(problem, fit)) if f]


def in_time(problem: Problem) -> tuple[Family | None, Family | None]:
    """Steps and oscillations in time of all readings."""
    return _steps(problem), _oscillations(problem)


def drift(problem: Problem) -> list[Family]:
    """Smooth drifts of all readings in time, or from row to row where that is not known, of several degrees.

    A slow one is hardly more than a line, and has fewer numbers than a curve: with those of a curve it would be a step.
    """
    when = _time(problem)
    shapes = drift_shapes(np.arange(float(len(problem))) if when is None else when)
    degrees = range(1, shapes.shape[1] + 1)
    return [Family(TIME, _blocks(problem, shapes[:, None, :degree]), [SMOOTH]) for degree in degrees]


def best_alternative(linear: Linear, scale: Scale, kinds: Sequence[Family]) -> Alternative | None:
    """The alternative with most evidence against a residual with declared parameters projected out."""
    best_of_kinds = [_best(linear, scale, kind) for kind in kinds]
    return max(best_of_kinds, key=lambda g: g.evidence, default=None)


def _best(linear: Linear, scale: Scale, kind: Family) -> Alternative:
    rows, tries, size = kind.columns.shape
    columns = linear.whitened(kind.columns.reshape(rows, -1)).reshape(kind.columns.shape)
    free = linear.free(columns.reshape(rows, -1)).reshape(columns.shape)
    information = np.einsum("nmk,nml->mkl", columns, free)
    before = np.einsum("nmk,nmk->mk", columns, columns)
    gradient = np.einsum("nmk,n->mk", columns, linear.unexplained)
    values, vectors = np.linalg.eigh(information)
    turned = np.einsum("mkd,mk->md", vectors, gradient)
    seen = values > 1e-3 * before.max(axis=1, keepdims=True, initial=1e-300)
    statistic = np.where(seen, turned**2 / np.where(seen, values, 1.0), 0.0).sum(axis=1)
    evidence = (statistic / scale.variance - seen.sum(axis=1) * np.log(linear.used)) / 2 - np.log(tries)
    best = int(np.argmax(evidence))
    excess = max(float(statistic[best]) - size * scale.variance, 0.0)
    rms = float(np.sqrt(excess / linear.used))
    return Alternative(
        depends_on=kind.depends_on,
        words=kind.words[best],
        statistic=float(statistic[best]),
        evidence=float(evidence[best]),
        rms=rms,
        columns=columns[:, best],
        row=kind.rows[best] if kind.rows else None,
    )


def _steps(problem: Problem) -> Family | None:
    """Shifts of all readings from one row on, in the order of time; not where a session changes."""
    order = time_order(problem)
    rows = len(problem)
    starts = np.array([k for k in range(_EDGE, rows - _EDGE) if not _changes(problem, order, k)], dtype=np.intp)
    if not len(starts):
        return None
    rank = np.argsort(order)
    shapes = (rank[:, None] >= starts).astype(float)
    first = [int(order[k]) for k in starts]
    words = [f"step at row {row + 1}{_when(problem, row)}" for row in first]
    return Family(TIME, _blocks(problem, shapes[:, :, None]), words, first)


def _when(problem: Problem, row: int) -> str:
    """When a row was measured, where that is known."""
    time = _time(problem)
    return "" if time is None else f" after {time[row] - time.min():.6g} s"


def _time(problem: Problem) -> Array | None:
    """Times (N,) of the rows, s, that differ; None where they are not known."""
    time = problem.rows.columns.get("time")
    return None if time is None or not np.isfinite(time).all() or not np.ptp(time) > 0 else time


def _changes(problem: Problem, order: NDArray[np.intp], k: int) -> bool:
    """Whether a session changes near place k of the order."""
    near = order[max(k - _NEAR, 0) : k + _NEAR]
    columns = problem.rows.columns
    return any(np.ptp(columns[name][near]) > 0 for name in columns if name.startswith("session."))


def _oscillations(problem: Problem) -> Family | None:
    """Sine and cosine of time in all readings."""
    time = _time(problem)
    if time is None:
        return None
    cycles = np.arange(_FEWEST_CYCLES, len(problem) / 2, 0.5)
    if not len(cycles):
        return None
    phase = 2 * np.pi * np.outer((time - time.min()) / np.ptp(time), cycles)
    shapes = np.stack([np.cos(phase), np.sin(phase)], axis=2)
    return Family(TIME, _blocks(problem, shapes), [f"oscillation, {c:g} periods in the table" for c in cycles])


def fields(problem: Problem) -> Iterator[Family]:
    """Smooth fields over the workspace, of several degrees."""
    for degree in range(2, 6):
        shapes = pose_shapes(problem, degree)
        if shapes.shape[1]:
            yield Family(POSE, _blocks(problem, shapes[:, None, :]), [f"smooth field of degree {degree}"])


def _blocks(problem: Problem, shapes: Array) -> Array:
    """Shapes (N, m, k) in each channel: (N * C, m, k * C)."""
    rows, tries, _ = shapes.shape
    columns = by_channel(problem, shapes.reshape(rows, -1))
    return columns.reshape(columns.shape[0], tries, -1)


def _bumps(problem: Problem, fit: Fit) -> Family | None:
    """Bumps over the travel of every drive and guide; carriages of one guide feel the same one."""
    placed: dict[tuple[str, str], PlacedEffect] = {}
    for e in problem.model.effects:
        if e.effect.enters in ("command", "guide") and e.at != ALL and not e.acts_in:
            placed.setdefault((e.effect.enters, e.at), e)
    units = unit_columns(problem, fit.values, fit.after.start, list(placed.values()))
    middle, width = np.array(list(_places())).T
    columns, words = list[Array](), list[str]()
    for e in placed.values():
        of_effect = [u for u in units if u.placed is e]
        travel = np.stack([u.inputs.travel for u in of_effect], axis=1)  # (N, S)
        if np.isfinite(travel).all() and np.ptp(travel) > 0:
            share = (travel - travel.min()) / np.ptp(travel)
            bumps = np.exp(-4 * np.log(2) * ((share[:, :, None] - middle) / width) ** 2)  # (N, S, places)
            wide = (bumps.max(axis=1) > 0.5).sum(axis=0) >= _ROWS  # on fewer rows they are odd rows
            columns.append(np.sum([u.shaped(bumps[:, s, wide]) for s, u in enumerate(of_effect)], axis=0))
            words += [
                f"local, {w * 100:.0f} % wide, at {100 * m:.0f} % of the travel of {e.at}"
                for m, w in zip(middle[wide], width[wide], strict=True)
            ]
    return Family(POSE, np.hstack(columns)[:, :, None], words) if words else None


def _places() -> Iterator[tuple[float, float]]:
    """Middles and full widths at half maximum of bumps, in shares of the travel in the table."""
    for width in _WIDTHS:
        for middle in np.arange(0.0, 1.0 + 1e-9, _STEP * width):
            yield float(middle), width
