"""Readings of an instrument that stands elsewhere than the machine file says, or that reads another point of a body.

One shift, one rigid motion or one offset explains them all then, which a fit would force upon the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import exp, log, small_motions
from pkmcal_cli.gross_errors.displaced import Names, OtherPlace, OtherPoint
from pkmcal_cli.gross_errors.frame_turns import Turns, orientations
from pkmcal_cli.gross_errors.mirror import Points, motion_of
from pkmcal_cli.gross_errors.plausibility import (
    BETTER,
    FEW,
    GROSS,
    Displaced,
    FloatArray,
    Hint,
    evidence,
    misfit,
    rms,
)
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import parse_unit

IntArray = NDArray[np.intp]
Cells = tuple[IntArray, IntArray]
"""Rows (m, 1) and columns (m, d) in a table."""

_FAR = 30.0
"""Times what parameters in their ranges and noise cause: less may be ranges that were guessed too small."""
_NEARLY_ALL = 0.05  # of what is off: who explains all but so much is right, whatever else is wrong
_MUCH = 0.1  # share of the largest component from which on another one is told
_AS_WELL = 1.5  # times what another explanation leaves: a simpler one does as well
_PLACE = "if it stands there, state `frame: fitted`, else look for another origin, tool or zero"
_POINT = "look at the tool, the reflector, and `at` of the sensor"


def explain_place(sample: Sample) -> tuple[tuple[Hint, ...], float, float]:
    """Instruments of a stated place whose readings are far off, but all in one way.

    Returns hints, and the misfit before and after they are followed.
    """
    hints, corrected = list[Hint](), sample.readings
    for name, (points, turns) in sample.standing.items():
        seen = _Seen(sample, name, points, turns)
        if (hint := seen.hint()) is not None:
            hints.append(hint)
            corrected = hint.places[0].put_back(corrected, seen.names)
    tables = [np.where(_judged_channels(sample), table, np.nan) for table in (sample.readings, corrected)]
    before, after = (misfit(table, sample.predicted, tables[0]) for table in tables)
    return tuple(hints), before, after


def _judged_channels(sample: Sample) -> NDArray[np.bool_]:
    """Channels (C,) that vary more than errors of parameters cause, or are off by more."""
    off = np.array([rms(left) for left in (sample.readings - sample.predicted).T])
    return np.asarray(sample.informative | (off > GROSS * sample.prior_rms))


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
        """That it reads elsewhere; None where it does not, or where that does not explain its readings."""
        columns = [k for p in self.points for k in p]
        expected, far = self.sample.prior_rms[columns], self._off(self.sample.readings)
        if not (far > _FAR * expected)[np.isfinite(far)].any():
            return None
        displaced, where, remedy = self._explanation()
        rest = self._left(displaced)
        known = np.isfinite(far) & np.isfinite(rest)
        before, after = rms(far[known]), rms(rest[known])
        explained = (rest <= GROSS * expected)[known].all() or after <= _NEARLY_ALL * before
        if not (known.any() and explained) or after > BETTER * before:
            return None
        proof = evidence(parse_unit(self.sample.part.model.channels[columns[0]].unit), before, after)
        message = f"the readings of `{self.instrument}` look taken {where}: {proof} without that; {remedy}"
        names = tuple(self.names[k] for k in columns)
        return Hint(kind="offset", names=names, message=message, before=before, after=after, places=(displaced,))

    def _explanation(self) -> tuple[Displaced, str, str]:
        """What explains them best, in words, and the remedy."""
        place, point = self._place(), self._point()
        if point is not None and _AS_WELL * rms(self._left(point)) < rms(self._left(place)):
            away = self._components(point.offset)
            return point, f"at another point of the body, away by {away} in its own axes", _POINT
        by = f"shifted by {self._components(self._shifts if place.turned else -place.shift)}"
        if place.turned:
            by = f"turned by {parse_unit('deg').format(_angle(place.rotation), 3)} and {by} (in the middle)"
        return place, f"from another place, {by}", _PLACE

    def _off(self, readings: FloatArray) -> FloatArray:
        """Rms of readings (n, C) less predictions, by coordinate of the points."""
        left = readings - self.sample.predicted
        return np.array([rms(left[:, k]) for p in self.points for k in p])

    def _left(self, displaced: Displaced) -> FloatArray:
        """The same once they are put back."""
        return self._off(displaced.put_back(self.sample.readings, self.names))

    def _place(self) -> OtherPlace:
        """By a shift; where that leaves more, by a rigid motion."""
        turns = tuple(self._named(vector) for vector in self.turns)
        shifted = OtherPlace(self._point_names, turns, np.eye(len(self.points[0])), -self._shifts)
        shifted = self._refined(shifted, False)
        whole = len(self.points[0]) == (2 if self.sample.part.model.topology.planar else 3)
        motion = motion_of(self.sample.readings, self.sample.predicted, self.points) if whole else None
        if motion is None:
            return shifted
        moved = self._refined(OtherPlace(self._point_names, turns, *motion), True)
        return shifted if rms(self._left(shifted)) <= _AS_WELL * rms(self._left(moved)) else moved

    def _point(self) -> OtherPoint | None:
        """By one offset in the axes of the body; None where its orientation is not read, or by too few readings."""
        if len(self.turns) != 1 or len(self.points[0]) != (2 if self.sample.part.model.topology.planar else 3):
            return None
        axes = orientations(self.sample.readings[:, list(self.turns[0])])  # (n, d, d)
        left = self.sample.readings - self.sample.predicted
        rows, at = self._cells(left + axes[:, :1, 0])  # nan without an orientation
        if len(rows) < FEW:
            return None
        return OtherPoint(self._point_names, self._named(self.turns[0]), self._beside(left[at], at, axes[rows]))

    def _refined(self, place: OtherPlace, turning: bool) -> OtherPlace:
        """Moved by what is left, beside errors of parameters within their ranges: these move points together too."""
        predicted, axes = self.sample.predicted, len(self.points[0])
        left = place.put_back(self.sample.readings, self.names) - predicted
        rows, at = self._cells(left)
        if len(rows) < FEW:
            return place
        motions = small_motions(predicted[at]) if turning else np.tile(np.eye(axes), (len(rows), 1, 1))  # (m, d, f)
        by = self._beside(left[at], at, motions)
        back, middle = _rotation(-by[: len(by) - axes], axes), predicted[at].mean(axis=0)
        shift = back @ (place.shift - middle) + middle - by[len(by) - axes :]
        return replace(place, rotation=back @ place.rotation, shift=shift)

    def _cells(self, left: FloatArray) -> tuple[IntArray, Cells]:
        """Rows (m,) with all coordinates of a point, and where these are in a table (n, C), (m, d)."""
        known = np.stack([np.isfinite(left[:, list(p)]).all(axis=1) for p in self.points], axis=1)
        rows, which = np.nonzero(known)
        return rows, (rows[:, None], np.array(self.points)[which])

    def _beside(self, left: FloatArray, at: Cells, motions: FloatArray) -> FloatArray:
        """How much (f,) of what moves points (m, d, f) explains what is left (m, d), beside parameters in ranges."""
        sigma, free = self.sample.part.sigma[at], motions.shape[2]
        by_all = np.concatenate([motions, self._by_ranges[at]], axis=2) / sigma[..., None]
        within = np.eye(by_all.shape[2])[free:]
        system = np.concatenate([by_all.reshape(-1, by_all.shape[2]), within])
        residual = np.concatenate([(left / sigma).ravel(), np.zeros(len(within))])
        return np.asarray(np.linalg.lstsq(system, residual)[0][:free])

    @cached_property
    def _by_ranges(self) -> FloatArray:
        """What errors of the parameters of their prior standard deviations do to predictions (n, C, p)."""
        evaluation = self.sample.evaluation
        ranges = {p.name: p.range for p in self.sample.part.model.parameters}
        jacobian = evaluation.prediction.jacobian
        assert jacobian is not None
        return np.asarray(jacobian * np.array([ranges[n] / 2 for n in evaluation.parameters]).reshape(-1))

    @cached_property
    def _shifts(self) -> FloatArray:
        """By how much each coordinate is larger than predicted, on average (d,); 0 with few readings."""
        out = []
        for axis in zip(*self.points, strict=True):
            off = (self.sample.readings - self.sample.predicted)[:, list(axis)]
            known = np.isfinite(off)
            out.append(float(off[known].mean()) if known.sum() >= FEW else 0.0)
        return np.array(out)

    @cached_property
    def _point_names(self) -> tuple[Names, ...]:
        return tuple(self._named(p) for p in self.points)

    def _named(self, columns: Sequence[int]) -> Names:
        return tuple(self.names[k] for k in columns)

    def _components(self, vector: FloatArray) -> str:
        """Those of a vector (d,) that count, in words."""
        channels, much = self.sample.part.model.channels, _MUCH * np.abs(vector).max()
        each = [(channels[k], float(v)) for k, v in zip(self.points[0], vector, strict=True) if abs(v) >= much]
        return ", ".join(f"`{c.name}` {parse_unit(c.unit).format(v, 3)}" for c, v in each)


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
