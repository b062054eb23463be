"""Reflectors on a body that are elsewhere than the machine file says: their distances to the others tell.

They are what no motion of the machine and no place of the instrument changes. Which of them are elsewhere shows where
fewest have to be, and no others as few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pkmcal_cli.base.rotation import best_motion
from pkmcal_cli.gross_errors.displaced import Names
from pkmcal_cli.gross_errors.mirror import Points, motion_of
from pkmcal_cli.gross_errors.plausibility import BETTER, FEW, GROSS, FloatArray, Hint, evidence, rms
from pkmcal_cli.gross_errors.sample import IntArray, Sample
from pkmcal_cli.units.unit_text import parse_unit

_FAR = 30.0  # times what noise and places in their ranges do to a distance: bodies are not that elastic
_RIGID = 1e-6  # of a distance: by which points of one body come closer to each other
_FLAT = 1e-3  # of their size: points on a line do not show how they are turned
_MOST = 2  # reflectors that may be elsewhere
_ALIKE = 4.0  # as many reflectors that leave so many times the least explain it as well
_REMEDY = "look at its coordinates in the machine file, and at the reflector"


@dataclass(frozen=True)
class OtherReflector:
    """Channels of all reflectors of a body, by name, and which of them is elsewhere.

    shape (p, d): where they are to each other as read; offset (d,): in the same axes, from the stated point to the
    one that is read, m.
    """

    points: tuple[Names, ...]
    which: int
    shape: FloatArray
    offset: FloatArray

    def put_back(self, readings: FloatArray, names: Sequence[str]) -> FloatArray:
        """Readings (N, C) of channels of these names as they would have been at the stated point."""
        out = readings.copy()
        if not all(n in names for point in self.points for n in point):
            return out
        columns = np.array([[names.index(n) for n in point] for point in self.points])  # (p, d)
        for row in np.nonzero(np.isfinite(readings[:, columns]).all(axis=(1, 2)))[0]:
            turned, _ = best_motion(self.shape, readings[row, columns])
            out[row, columns[self.which]] -= turned @ self.offset
        return out


Places = tuple[OtherReflector, ...]
"""Of reflectors that are elsewhere, each as it is once those before it are put back."""


def explain_reflectors(sample: Sample) -> tuple[Hint, ...]:
    """Hints on the reflectors that are elsewhere, of each instrument that sees several."""
    hints, names = list[Hint](), [c.name for c in sample.part.model.channels]
    for points in [*(p for p, _ in sample.standing.values()), *sample.frames]:
        hints += _suspicions(sample, points, _places(sample, points, names), names)
    return tuple(hints)


def _places(sample: Sample, points: Points, names: Sequence[str]) -> Places:
    """Which points of an instrument are elsewhere; none also where that explains too little, or nothing tells which."""
    d = 2 if sample.part.model.topology.planar else 3
    columns = np.array(points)
    if columns.shape[1:] != (d,) or len(columns) < d:
        return ()
    rows = _whole_rows(sample, columns)
    if len(rows) < FEW or not _one_body(sample.predicted[rows][:, columns]):
        return ()
    off = np.abs(np.subtract(*_distances(sample, columns))) / _expected(sample, columns, rows)
    before, allowed = _left(sample, points, (), names), GROSS * rms(sample.prior_rms[columns])
    for count in range(1, min(_MOST, len(columns) - 1) + 1):
        which = [some for some in combinations(range(len(columns)), count) if _may_be(off, some)]
        tried = [places for some in which if (places := _elsewhere(sample, points, some, rows, names))]
        left = [_left(sample, points, places, names) for places in tried]
        least = min(left, default=np.inf)
        if least <= min(BETTER * before, allowed):
            return tried[int(np.argmin(left))] if sum(x <= _ALIKE * least for x in left) == 1 else ()
    return ()


def _may_be(off: FloatArray, which: tuple[int, ...]) -> bool:
    """Whether distances, `off` (p, p), between others are as they should be, and each of these has one that is not."""
    others = np.delete(np.delete(off, which, 0), which, 1)
    return bool(others.max(initial=0.0) <= GROSS and (off[list(which)].max(axis=1) > _FAR).all())


def _whole_rows(sample: Sample, columns: IntArray) -> IntArray:
    """Rows in which all points, of channels (p, d), are read and predicted."""
    return np.nonzero(np.isfinite((sample.readings + sample.predicted)[:, columns]).all(axis=(1, 2)))[0]


def _distances(sample: Sample, columns: IntArray) -> tuple[FloatArray, FloatArray]:
    """Between each two points, on average (p, p), as read and as predicted."""
    rows = _whole_rows(sample, columns)
    read, predicted = (_mean_distances(table[rows][:, columns]) for table in (sample.readings, sample.predicted))
    return read, predicted


def _expected(sample: Sample, columns: IntArray, rows: IntArray) -> FloatArray:
    """Standard deviation of these distances (p, p), by noise of one row and by parameters in their ranges."""
    places, changes = sample.predicted[rows][:, columns], sample.changes[rows][:, columns]  # (n, p, d), (n, p, d, k)
    noise = np.hypot.reduce(sample.part.sigma[rows][:, columns].mean(axis=0), axis=1)  # (p,)
    between = places[:, :, None] - places[:, None]
    apart = np.linalg.norm(between, axis=3)
    along = between / np.where(apart > 0, apart, 1.0)[..., None]
    rates = np.einsum("npqd,npqdk->pqk", along, changes[:, :, None] - changes[:, None]) / len(rows)
    return np.asarray(np.hypot(np.linalg.norm(rates, axis=2), np.hypot.outer(noise, noise)))


def _mean_distances(places: FloatArray) -> FloatArray:
    """Between each two of points (n, p, d), on average (p, p)."""
    return np.asarray(np.linalg.norm(places[:, :, None] - places[:, None], axis=3).mean(axis=0))


def _one_body(places: FloatArray) -> bool:
    """Whether points (n, p, d) keep their distances, and show how they are turned."""
    for i, j in combinations(range(places.shape[1]), 2):
        apart = np.linalg.norm(places[:, i] - places[:, j], axis=1)
        if not np.ptp(apart) <= _RIGID * apart.max():
            return False
    sizes = np.linalg.svd(places[0] - places[0].mean(axis=0), compute_uv=False)
    return bool(sizes[places.shape[2] - 2] > _FLAT * sizes[0])


def _elsewhere(
    sample: Sample, points: Points, which: tuple[int, ...], rows: IntArray, names: Sequence[str]
) -> Places:
    """Where some of the points are instead, if the others are where they should be; none with too few."""
    motion = motion_of(sample.readings, sample.predicted, [p for k, p in enumerate(points) if k not in which])
    if motion is None:
        return ()
    columns, some = np.array(points), list(which)
    places = sample.predicted[rows][:, columns]
    off = sample.readings[rows][:, columns[some]] @ motion[0].T + motion[1] - places[:, some]
    turned = [best_motion(places[0], place)[0] for place in places]
    offsets = np.mean([each @ rotation for rotation, each in zip(turned, off, strict=True)], axis=0)
    named, shape, out = tuple(tuple(names[k] for k in p) for p in points), places[0].copy(), []
    for k, offset in zip(reversed(which), reversed(offsets), strict=True):  # the last is put back with all others right
        shape = shape + np.outer(np.arange(len(shape)) == k, offset)
        out.append(OtherReflector(named, k, shape, offset))
    return tuple(reversed(out))


def _left(sample: Sample, points: Points, places: Places, names: Sequence[str]) -> float:
    """Rms of what these points are off once some are put back, whatever place of the instrument nobody knows."""
    readings, columns = sample.readings, [k for p in points for k in p]
    for place in places:
        readings = place.put_back(readings, names)
    return rms((sample.compared(readings, sample.predicted) - sample.predicted)[:, columns])


def _suspicions(sample: Sample, points: Points, places: Places, names: Sequence[str]) -> list[Hint]:
    """In words, for each that is elsewhere: the distances as read, and as the machine file has them."""
    unit = parse_unit(sample.part.model.channels[points[0][0]].unit)
    before, after = (_left(sample, points, some, names) for some in ((), places))
    hints, reflectors = list[Hint](), [names[p[0]].rpartition(".")[0] for p in points]
    for place in places:
        others = [k for k in range(len(points)) if k != place.which]
        apart = [table[place.which] for table in _distances(sample, np.array(points))]
        seen = ", ".join(f"{unit.format(float(apart[0][k]), 4)} from `{reflectors[k]}`" for k in others)
        stated = ", ".join(unit.format(float(apart[1][k]), 4) for k in others)
        message = f"`{reflectors[place.which]}` looks read elsewhere on its body than the machine file says, {seen} "
        message += f"instead of {stated}: {evidence(unit, before, after)} without that; {_REMEDY}"
        channels = place.points[place.which]
        hints.append(
            Hint(kind="offset", names=channels, message=message, before=before, after=after, places=(place,))
        )
    return hints
