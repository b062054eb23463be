"""One of several reflectors on a body that is elsewhere than the machine file says: its distances to the others tell.

They are what no motion of the machine and no place of the instrument changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pkmcal_cli.base.rotation import best_motion
from pkmcal_cli.gross_errors.displaced import Names
from pkmcal_cli.gross_errors.mirror import Points, motion_of
from pkmcal_cli.gross_errors.plausibility import BETTER, FEW, GROSS, FloatArray, Hint, evidence, misfit, rms
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import parse_unit

_FAR = 30.0  # times what parameters in their ranges and noise cause, as of other places
_RIGID = 1e-6  # of a distance: by which points of one body come closer to each other
_FLAT = 1e-3  # of their size: points on a line do not show how they are turned
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


def explain_reflectors(sample: Sample) -> tuple[tuple[Hint, ...], float, float]:
    """Hints, and the misfit before and after they are followed."""
    hints, corrected = list[Hint](), sample.readings
    names = [c.name for c in sample.part.model.channels]
    for points in [*(p for p, _ in sample.standing.values()), *sample.frames]:
        if (hint := _hint(sample, points, names)) is not None:
            hints.append(hint)
            corrected = hint.places[0].put_back(corrected, names)
    tables = [sample.compared(table, sample.predicted) for table in (sample.readings, corrected)]
    before, after = (misfit(table, sample.predicted, tables[0]) for table in tables)
    return tuple(hints), before, after


def _hint(sample: Sample, points: Points, names: Sequence[str]) -> Hint | None:
    """That one of the points of an instrument is elsewhere; None where none is, or where it explains too little."""
    d = 2 if sample.part.model.topology.planar else 3
    columns = np.array(points)
    if columns.shape[1:] != (d,) or len(columns) < d:
        return None
    read, predicted = (table[:, columns] for table in (sample.readings, sample.predicted))  # (n, p, d)
    rows = np.nonzero(np.isfinite(read + predicted).all(axis=(1, 2)))[0]
    if len(rows) < FEW or not _one_body(predicted[rows]):
        return None
    expected = np.hypot.reduce(sample.prior_rms[columns], axis=1)  # (p,)
    off = np.abs(_mean_distances(read[rows]) - _mean_distances(predicted[rows])) / np.hypot.outer(expected, expected)
    tried = []
    for k in range(len(columns)):
        if off[k].max() > _FAR and np.delete(np.delete(off, k, 0), k, 1).max() <= GROSS:
            place = _elsewhere(sample, points, k, rows, names)
            tried += [place] if place is not None else []
    left = [_left(sample, points, place.put_back(sample.readings, names)) for place in tried]
    if not left:
        return None
    after, before = min(left), _left(sample, points, sample.readings)
    if after > BETTER * before or after > GROSS * rms(sample.prior_rms[columns]):
        return None
    place = tried[int(np.argmin(left))]
    return _suspicion(sample, place, read[rows], predicted[rows], before, after)


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
    sample: Sample, points: Points, which: int, rows: np.ndarray, names: Sequence[str]
) -> OtherReflector | None:
    """Where one of the points is instead, if the others are where they should be; None with too few."""
    others = [p for k, p in enumerate(points) if k != which]
    motion = motion_of(sample.readings, sample.predicted, others)
    if motion is None:
        return None
    columns = np.array(points)
    shape = sample.predicted[rows[0], columns]
    off = sample.readings[rows][:, columns[which]] @ motion[0].T + motion[1] - sample.predicted[rows][:, columns[which]]
    turned = [best_motion(shape, sample.predicted[row, columns])[0] for row in rows]
    offset = np.mean([rotation.T @ each for rotation, each in zip(turned, off, strict=True)], axis=0)
    shape = shape + np.outer(np.arange(len(shape)) == which, offset)
    return OtherReflector(tuple(tuple(names[k] for k in p) for p in points), which, shape, offset)


def _left(sample: Sample, points: Points, readings: FloatArray) -> float:
    """Rms of what readings (n, C) of these points are off, whatever place of the instrument nobody knows."""
    columns = [k for p in points for k in p]
    return rms((sample.compared(readings, sample.predicted) - sample.predicted)[:, columns])


def _suspicion(
    sample: Sample, place: OtherReflector, read: FloatArray, predicted: FloatArray, before: float, after: float
) -> Hint:
    """In words: the distances as read, and as the machine file has them."""
    channel = {c.name: c for c in sample.part.model.channels}
    unit = parse_unit(channel[place.points[0][0]].unit)
    others = [k for k in range(len(place.points)) if k != place.which]
    apart = [_mean_distances(table)[place.which] for table in (read, predicted)]
    name, *rest = (place.points[k][0].rpartition(".")[0] for k in (place.which, *others))
    seen = ", ".join(f"{unit.format(float(apart[0][k]), 4)} from `{n}`" for k, n in zip(others, rest, strict=True))
    stated = ", ".join(unit.format(float(apart[1][k]), 4) for k in others)
    message = f"`{name}` looks read elsewhere on its body than the machine file says, {seen} instead of {stated}: "
    message += f"{evidence(unit, before, after)} without that; {_REMEDY}"
    names = place.points[place.which]
    return Hint(kind="offset", names=names, message=message, before=before, after=after, places=(place,))
