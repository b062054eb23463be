"""Errors of measured points by themselves, with what the instrument knows of each; judged by ISO 14253-1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.units.measurands import Measurand

K = 2.0
"""Coverage factor of expanded uncertainties."""


@dataclass(frozen=True)
class PointErrors:
    """Errors (n,) of points in rows (n,) and their expanded uncertainties U (n,) by the instrument, SI.

    Of positions, of lengths or of orientations.
    """

    rows: NDArray[np.intp]
    errors: Array
    expanded: Array

    def of(self, which: NDArray[np.bool_]) -> PointErrors:
        """Some of the points; which (n,)."""
        return PointErrors(self.rows[which], self.errors[which], self.expanded[which])

    @property
    def worst(self) -> int | None:
        """The point that is furthest off; None without any."""
        return int(np.argmax(self.errors)) if len(self.errors) else None


def point_errors(
    problem: Problem, errors: Array, on: NDArray[np.bool_], besides: Array | None = None
) -> PointErrors:
    """Distances of measured from predicted points in the coordinates measured; errors and `on` (N, C), m.

    U is twice the standard uncertainty of the instrument along the error (its largest where there is none); besides
    (N, C): standard uncertainties of readings for another reason.
    """
    return _errors(problem, errors, on, besides, _by_point(problem, Measurand.POSITION))


def orientation_errors(
    problem: Problem, errors: Array, on: NDArray[np.bool_], besides: Array | None = None
) -> PointErrors:
    """The same of orientations: the rotations, rad, from predicted to measured, about the axes measured."""
    return _errors(problem, errors, on, besides, _by_point(problem, Measurand.ORIENTATION))


def length_errors(
    problem: Problem, errors: Array, on: NDArray[np.bool_], besides: Array | None = None
) -> PointErrors:
    """The same of distances, spans and touched places, each by itself: measured less predicted length."""
    return _errors(problem, errors, on, besides, [[k] for k in problem.model.measuring(Measurand.DISTANCE)])


def _errors(
    problem: Problem, errors: Array, on: NDArray[np.bool_], besides: Array | None, groups: Sequence[list[int]]
) -> PointErrors:
    """Sizes of the errors of groups of channels."""
    rows, sizes, expanded = [], [], []
    for columns in groups:
        for row in np.nonzero(on[:, columns].any(axis=1))[0]:
            used = [k for k in columns if on[row, k]]
            e, noise = errors[row, used], problem.noise[row][np.ix_(used, used)]
            size = float(np.sqrt(e @ e))
            noise = noise if besides is None else noise + np.diag(besides[row, used] ** 2)
            variance = float(e @ noise @ e) / size**2 if size > 0 else float(np.linalg.eigvalsh(noise)[-1])
            rows.append(int(row))
            sizes.append(size)
            expanded.append(K * float(np.sqrt(variance)))
    return PointErrors(np.array(rows, dtype=np.intp), np.array(sizes), np.array(expanded))


def partly_measured(problem: Problem, rows: NDArray[np.intp]) -> int:
    """How many points in these rows lack a coordinate that is measured of the same point in other rows."""
    count = 0
    for columns in _by_point(problem, Measurand.POSITION):
        there = problem.measured[:, columns]
        there = there[:, there.any(axis=0)][np.unique(rows)]  # (points, coordinates that are measured at all)
        count += int(np.count_nonzero(there.any(axis=1) & ~there.all(axis=1)))
    return count


def _by_point(problem: Problem, measurand: Measurand) -> list[list[int]]:
    """Channels of each measured point, or body whose orientation was measured."""
    by_point: dict[int, list[int]] = {}
    for k in problem.model.measuring(measurand):
        by_point.setdefault(problem.model.channels[k].index, []).append(k)
    return list(by_point.values())


def joined(parts: Sequence[PointErrors]) -> PointErrors:
    """Points of several parts of a table together; their rows are those of the parts."""
    if not parts:
        return PointErrors(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0))
    return PointErrors(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("rows", "errors", "expanded")))


@dataclass(frozen=True)
class Judged:
    """Points by a tolerance, SI: one passes where |e| + U is within it, fails where |e| - U is not (ISO 14253-1).

    unpredicted: number of rows that nothing predicts, so nobody can tell; measurand: positions, lengths, orientations.
    """

    points: PointErrors
    tolerance: float
    unpredicted: int = 0
    measurand: Measurand = Measurand.POSITION

    @property
    def noun(self) -> str:
        """What is judged, in a word."""
        return "point" if self.measurand is Measurand.POSITION else self.error

    @property
    def error(self) -> str:
        """Of what its errors are."""
        return "length" if self.measurand is Measurand.DISTANCE else self.measurand.label

    @property
    def passed(self) -> NDArray[np.bool_]:
        """Points (n,) that conform."""
        return np.asarray(self.points.errors + self.points.expanded <= self.tolerance)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Points (n,) that do not conform."""
        return np.asarray(self.points.errors - self.points.expanded > self.tolerance)

    @property
    def undecided(self) -> NDArray[np.bool_]:
        """Points (n,) of which the instrument cannot tell."""
        return ~self.passed & ~self.failed

    @property
    def beyond_instrument(self) -> bool:
        """Whether no point can pass, whatever its error, as U is as large as the tolerance at each."""
        return bool(len(self.points.rows)) and bool((self.points.expanded >= self.tolerance).all())

    @property
    def verdict(self) -> str:
        """Of all: "pass" if every point passes, "fail" if one fails, else "undecided"."""
        if self.failed.any():
            return "fail"
        return "pass" if self.passed.all() and len(self.points.rows) and not self.unpredicted else "undecided"
