"""Readings of an instrument that does not stand where the machine file says: one rigid motion explains them all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import exp, log, small_motions
from pkmcal_cli.gross_errors.frame_turns import Turns, turned_back
from pkmcal_cli.gross_errors.mirror import Points, motion_of
from pkmcal_cli.gross_errors.plausibility import (
    BETTER,
    FEW,
    GROSS,
    FloatArray,
    Hint,
    OtherPlace,
    evidence,
    misfit,
    rms,
)
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import parse_unit

_FAR = 30.0
"""Times what parameters in their ranges and noise cause: less may be ranges that were guessed too small."""
_MUCH = 0.1  # share of the largest component from which on another one is told
_AS_WELL = 1.5  # times what the best motion leaves: a shift alone does as well


def explain_place(sample: Sample) -> tuple[tuple[Hint, ...], float, float]:
    """Instruments of a stated place whose readings are far off, but all by one shift, or by one rigid motion.

    Returns hints, and the misfit before and after they are followed.
    """
    hints, corrected = list[Hint](), sample.readings
    for name, (points, turns) in sample.standing.items():
        seen = _Seen(sample, name, points, turns)
        if (hint := seen.hint()) is not None:
            hints.append(hint)
            corrected = from_stated_place(corrected, seen.names, hint.places[0])
    before, after = (misfit(table, sample.predicted, sample.readings) for table in (sample.readings, corrected))
    return tuple(hints), before, after


def from_stated_place(readings: FloatArray, names: Sequence[str], place: OtherPlace) -> FloatArray:
    """Readings (N, C) of channels of these names as they would have been read from the stated place."""
    out, turned = readings.copy(), _turns_points(place)
    for point in place.points:
        here = [(names.index(n), k) for k, n in enumerate(point) if n in names]
        if turned and len(here) == len(point):
            columns = [c for c, _ in here]
            out[:, columns] = readings[:, columns] @ place.rotation.T + place.shift
        elif not turned:
            for column, k in here:
                out[:, column] += place.shift[k]
    for vector in place.turns if turned else ():
        if all(n in names for n in vector):
            columns = [names.index(n) for n in vector]
            out[:, columns] = turned_back(readings[:, columns], readings[:, columns], place.rotation)
    return out


def _turns_points(place: OtherPlace) -> bool:
    """Whether it is more than a shift."""
    return not np.array_equal(place.rotation, np.eye(len(place.rotation)))


@dataclass(frozen=True)
class _Seen:
    """What one instrument of a stated place reads: channels of its points, as many of each, and of rotation vectors."""

    sample: Sample
    instrument: str
    points: Points
    turns: Turns

    @property
    def names(self) -> list[str]:
        """Of all channels."""
        return [c.name for c in self.sample.part.model.channels]

    def hint(self) -> Hint | None:
        """That it stands elsewhere; None where it does not, or where that does not explain its readings."""
        columns = [k for p in self.points for k in p]
        expected, far = self.sample.prior_rms[columns], self._off(self.sample.readings)
        if not (far > _FAR * expected)[np.isfinite(far)].any():
            return None
        place = self._place()
        rest = self._off(from_stated_place(self.sample.readings, self.names, place))
        known = np.isfinite(far) & np.isfinite(rest)
        before, after = rms(far[known]), rms(rest[known])
        if not known.any() or (rest > GROSS * expected)[known].any() or after > BETTER * before:
            return None
        proof = evidence(parse_unit(self.sample.part.model.channels[columns[0]].unit), before, after)
        message = f"the readings of `{self.instrument}` look taken from another place, {self._words(place)}: {proof} "
        message += "without that; if it stands there, state `frame: fitted`, else look for another origin, tool or zero"
        names = tuple(self.names[k] for k in columns)
        return Hint(kind="offset", names=names, message=message, before=before, after=after, places=(place,))

    def _off(self, readings: FloatArray) -> FloatArray:
        """Rms of readings (n, C) less predictions, by coordinate of the points."""
        left = readings - self.sample.predicted
        return np.array([rms(left[:, k]) for p in self.points for k in p])

    def _place(self) -> OtherPlace:
        """By a shift; where that leaves more, by a rigid motion."""
        points, turns = (tuple(tuple(self.names[k] for k in p) for p in each) for each in (self.points, self.turns))
        shifted = self._refined(OtherPlace(points, turns, np.eye(len(points[0])), -np.array(self._shifts())), False)
        whole = len(points[0]) == (2 if self.sample.part.model.topology.planar else 3)
        motion = motion_of(self.sample.readings, self.sample.predicted, self.points) if whole else None
        if motion is None:
            return shifted
        moved = self._refined(OtherPlace(points, turns, *motion), True)
        left = [rms(self._off(from_stated_place(self.sample.readings, self.names, p))) for p in (shifted, moved)]
        return shifted if left[0] <= _AS_WELL * left[1] else moved

    def _refined(self, place: OtherPlace, turning: bool) -> OtherPlace:
        """Moved by what is left, beside errors of parameters within their ranges: these move points together too."""
        predicted, axes = self.sample.predicted, len(self.points[0])
        left = from_stated_place(self.sample.readings, self.names, place) - predicted
        known = np.stack([np.isfinite(left[:, list(p)]).all(axis=1) for p in self.points], axis=1)
        rows, which = np.nonzero(known)
        if len(rows) < FEW:
            return place
        at = rows[:, None], np.array(self.points)[which]  # (m, d)
        motions = small_motions(predicted[at]) if turning else np.tile(np.eye(axes), (len(rows), 1, 1))  # (m, d, f)
        free = motions.shape[2]
        by_all = np.concatenate([motions, self._by_ranges[at]], axis=2) / self.sample.part.sigma[at][..., None]
        within = np.eye(by_all.shape[2])[free:]
        system = np.concatenate([by_all.reshape(-1, by_all.shape[2]), within])
        residual = np.concatenate([(left[at] / self.sample.part.sigma[at]).ravel(), np.zeros(len(within))])
        by = np.linalg.lstsq(system, residual)[0][:free]
        back, middle = _rotation(-by[: free - axes], axes), predicted[at].mean(axis=0)
        shift = back @ (place.shift - middle) + middle - by[free - axes :]
        return replace(place, rotation=back @ place.rotation, shift=shift)

    @property
    def _by_ranges(self) -> FloatArray:
        """What errors of the parameters of their prior standard deviations do to predictions (n, C, p)."""
        evaluation = self.sample.evaluation
        ranges = {p.name: p.range for p in self.sample.part.model.parameters}
        jacobian = evaluation.prediction.jacobian
        assert jacobian is not None
        return np.asarray(jacobian * np.array([ranges[n] / 2 for n in evaluation.parameters]).reshape(-1))

    def _shifts(self) -> list[float]:
        """By how much each coordinate is larger than predicted, on average; 0 with few readings."""
        out = []
        for axis in zip(*self.points, strict=True):
            off = (self.sample.readings - self.sample.predicted)[:, list(axis)]
            known = np.isfinite(off)
            out.append(float(off[known].mean()) if known.sum() >= FEW else 0.0)
        return out

    def _words(self, place: OtherPlace) -> str:
        channels = self.sample.part.model.channels
        shifts = self._shifts() if _turns_points(place) else (-place.shift).tolist()
        much = _MUCH * max(map(abs, shifts))
        each = [(channels[k], s) for k, s in zip(self.points[0], shifts, strict=True) if abs(s) >= much]
        by = "shifted by " + ", ".join(f"`{c.name}` {parse_unit(c.unit).format(s, 3)}" for c, s in each)
        if not _turns_points(place):
            return by
        return f"turned by {parse_unit('deg').format(_angle(place.rotation), 3)} and {by} (in the middle)"


def _rotation(vector: FloatArray, axes: int) -> FloatArray:
    """Of a rotation vector: three components, in the plane one, none for no rotation (axes, axes)."""
    whole = np.zeros(3)
    whole[3 - len(vector) :] = vector
    return np.asarray(exp(whole[None])[0][:axes, :axes])


def _angle(rotation: FloatArray) -> float:
    """By which readings are turned against what they should be, rad; in the plane with its sense."""
    if len(rotation) == 2:
        return float(np.arctan2(rotation[0, 1], rotation[0, 0]))
    return float(np.linalg.norm(log(rotation[None])[0]))
