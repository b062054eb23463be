"""Rows that are copies of others: the same readings to the last digit where noise would have made them differ."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import pdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.units.unit_text import parse_unit

_CHANCE = 0.01  # probability of as many coincidences among honest repetitions above which nothing is said
_DIGITS = 15


def copies(problem: Problem) -> list[tuple[int, ...]]:
    """Groups of two or more rows that are the same in all drives, forces and readings, in order.

    Repetitions may agree by chance where the table is written coarsely: none then. Time and temperature are not
    compared: an instrument that stands still writes the same readings at other times. Nor are touches, which all read
    the same: their noise is in the commands, and coarse encoders repeat.
    """
    known = np.array([not math.isnan(c.known) for c in problem.model.channels])  # the same in every row
    unaided = problem.measured & ~known
    read = np.where(unaided, problem.readings, np.nan)
    rows = np.nonzero(unaided.any(axis=1))[0]
    poses = np.hstack([problem.rows.readings, np.nan_to_num(problem.rows.forces)])[rows]
    repeated = _pairs(_labels(poses))
    if not repeated:
        return []
    whole = _labels(np.hstack([poses, read[rows]]))
    pairs = _pairs(whole)
    if not pairs:
        return []
    expected = repeated * _coincidence(problem, read)
    if pairs < 1 or float(pdtrc(pairs - 1, expected)) > _CHANCE:
        return []
    order = np.argsort(whole, kind="stable")
    groups = np.split(rows[order], np.nonzero(np.diff(whole[order]))[0] + 1)
    return sorted(tuple(int(k) for k in group) for group in groups if len(group) > 1)


def _labels(table: Array) -> Array:
    """Number (n,) of the distinct row that each row of a table (n, k) is; nan is equal to nan."""
    if not table.shape[1]:
        return np.zeros(len(table), dtype=np.intp)
    columns = [np.unique(column, return_inverse=True)[1] for column in table.T]  # one at a time: tables may be long
    order = np.lexsort(columns)
    new = np.zeros(len(table), dtype=bool)
    for column in columns:
        new[1:] |= np.diff(column[order]) != 0
    labels = np.empty(len(table), dtype=np.intp)
    labels[order] = np.cumsum(new)
    return labels


def _pairs(labels: Array) -> int:
    """Number of pairs of rows with one label."""
    sizes = np.unique(labels, return_counts=True)[1]
    return int((sizes * (sizes - 1) // 2).sum())


def _coincidence(problem: Problem, read: Array) -> float:
    """Probability that two repetitions of a pose agree in every channel, by the stated noise and the digits written.

    Two draws of standard deviation s, rounded to d, agree with probability d / (2 s sqrt(pi)) where d is small.
    """
    out = 1.0
    for k, channel in enumerate(problem.model.channels):
        some = ~np.isnan(read[:, k])
        if some.sum() > 1:
            sigma = float(np.median(problem.sigma[some, k]))
            step = _resolution(read[some, k], parse_unit(channel.unit).scale)
            out *= min(1.0, step / (2 * sigma * np.sqrt(np.pi))) if sigma > 0 else 1.0
    return out


def _resolution(values: Array, scale: float) -> float:
    """The largest step 1, 2 or 5 times a power of ten, in SI or in a unit, of which all values are multiples."""
    for unit in (1.0, scale):
        for digits in range(_DIGITS):
            for first in (10.0, 5.0, 2.0):
                step = first * 10.0 ** -(digits + 1) * unit
                number = values / step
                if np.abs(number - np.round(number)).max() < 1e-4 and np.abs(number).max() < 1e11:
                    return step
    return 0.0
