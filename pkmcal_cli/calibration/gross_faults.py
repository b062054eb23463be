"""Which gross mistake of a table explains residuals that no parameters explain: in channels, drives or rows.

Channels are compared with predictions, drives with the positions that the inverse model gives at measured poses, or
where no pose was measured by predicting again with columns changed. Where several explanations do as well, as on a
symmetric machine, the one that changes least is told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.calibration.drive_columns import explain_by_prediction
from pkmcal_cli.calibration.measured_pose import measured_poses
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate, residuals
from pkmcal_cli.inverse import drive_positions
from pkmcal_cli.language.unit_text import parse_unit
from pkmcal_cli.rotation import Array
from pkmcal_cli.tables.column_faults import explain_columns
from pkmcal_cli.tables.mirror import brought_back, explain_frame
from pkmcal_cli.tables.plausibility import BETTER, EXPLAINED, GROSS, Hint, evidence, misfit, rms, spread
from pkmcal_cli.tables.row_shift import RowShift, apply_shifts, find_row_shifts

IntArray = NDArray[np.intp]

_ROWS = 200  # a sample of a long table shows a gross mistake as well
_POSES = 20  # of these, rows for which the inverse model is asked
_ALIKE = 4.0  # explanations that leave so many times the least do as well
_HALF = 0.5
_PART = 0.5  # share of the misfit that hints may leave where no explanation is complete
_FEWEST = 4  # poses by which drives are judged


@dataclass(frozen=True)
class _Reason:
    """An explanation: its hints, and the relative misfit before and after they are followed."""

    hints: tuple[Hint, ...]
    before: float
    after: float

    @property
    def complete(self) -> bool:
        """Whether it explains all there is to explain."""
        return np.isfinite(self.after) and self.after <= BETTER * self.before


def gross_faults(
    problem: Problem,
    values: Array,
    parameters: Sequence[str],
    sessions: IntArray,
    place: Callable[[int], str],
) -> tuple[Hint, ...]:
    """Suspicions, at parameter values (P,); none where `parameters`, in their ranges, explain the residuals.

    sessions (N,): number of the session of each row; place: words for a row.
    """
    scene = Scene.of(problem, values, tuple(parameters))
    if not scene.gross:
        return ()
    reasons = [_channels(scene, True), _rows(scene, sessions, place)]
    if not reasons[0].hints:
        reasons.append(_channels(scene, False))  # a wrong unit of an angle is lost when whole turns are taken off
    if reasons[0].before > EXPLAINED and not reasons[1].complete:  # no less than what an explanation may leave
        reasons.append(_drives(scene))
        unplaced = scene.loose or np.isinf(reasons[-1].before)  # drives cannot be judged by poses
        if unplaced and not any(r.complete and not _of_drives(problem, r) for r in reasons):
            hints, before = explain_by_prediction(scene.sample, values, scene.seen)
            reasons += [_Reason((h,), before, h.after) for h in hints]
    return _chosen([r for r in reasons if r.hints])


def _of_drives(problem: Problem, reason: _Reason) -> bool:
    """Whether channels of an explanation are readings of drives, so that it may as well be other drives."""
    drives = {c.name for c in problem.model.channels if c.quantity == "drive"}
    return any(drives & set(h.names) for h in reason.hints)


def _chosen(reasons: list[_Reason]) -> tuple[Hint, ...]:
    """The hints of the explanation that leaves least; of those that do as well, of that which changes least."""
    complete = [r for r in reasons if r.complete]
    if not complete:
        best = min(reasons, key=lambda r: r.after, default=None)
        return () if best is None or best.after > _PART * best.before else best.hints
    least = min(r.after for r in complete)
    good = [r for r in complete if r.after <= _ALIKE * least]
    fewest = min(len(r.hints) for r in good)
    first, *others = sorted((r.hints for r in good if len(r.hints) == fewest), key=lambda h: h[0].kind != "rotated")
    told = {(h.kind, h.names) for h in first}
    others = [o for o in others if not told & {(h.kind, h.names) for h in o}]
    return (*first, *(replace(h, message=f"or else {h.message}") for o in others for h in o))


@dataclass(frozen=True)
class Scene:
    """A sample of the table, predicted at the starting values.

    whole: the whole table; rows (n,): numbers of the sample's rows in it; usual (C,): rms that errors of parameters
    and noise cause.
    """

    whole: Problem
    rows: IntArray
    sample: Problem
    evaluation: Evaluation
    usual: Array

    @classmethod
    def of(cls, problem: Problem, values: Array, parameters: tuple[str, ...]) -> Scene:
        """Predict a sample of rows, drawn so that it does not keep step with a grid."""
        count = len(problem)
        rows = np.arange(count)
        if count > _ROWS:
            rows = np.sort(np.random.default_rng(0).choice(count, _ROWS, replace=False))
        sample = problem.take(rows)
        loose = {n for e in problem.model.effects if e.at in problem.model.fitted_frames for n in e.parameters}
        asked = tuple(n for n in parameters if n not in loose)
        evaluation = evaluate(sample, values, asked)
        return cls(problem, rows, sample, evaluation, _usual(sample, evaluation, asked))

    @cached_property
    def predicted(self) -> Array:
        """Predictions (n, C), nan where there are none."""
        return np.where(self.evaluation.prediction.solved[:, None], self.evaluation.prediction.values, np.nan)

    @cached_property
    def telling(self) -> NDArray[np.bool_]:
        """Channels (C,) that vary far more than errors of parameters and noise cause; all where few rows are known."""
        known = self.evaluation.prediction.solved.mean() > _HALF
        varies = np.maximum(spread(self.predicted), spread(self.readings))
        return np.asarray((varies > GROSS * self.usual) | (not known))

    @cached_property
    def gross(self) -> bool:
        """Whether rows cannot be predicted, or more is left than parameters explain."""
        rest = self.seen(self.readings, self.predicted) - self.predicted
        large = [rms(r) > GROSS * u for r, u in zip(rest.T, self.usual, strict=True) if np.isfinite(r).any()]
        return any(large) or not self.evaluation.prediction.solved.all()

    @property
    def readings(self) -> Array:
        """What was measured (n, C), nan elsewhere."""
        return np.where(self.sample.measured, self.sample.readings, np.nan)

    def seen(self, readings: Array, predicted: Array) -> Array:
        """Readings (n, C) as they compare with predictions: turns by the shorter way, loose frames brought back.

        Nan for channels that parameters may move as much as poses do: they tell nothing.
        """
        out = np.where(np.isfinite(readings) & self.telling, self._nearest(readings, predicted), np.nan)
        out[:, self.loose] = np.nan
        for points in self.frames:
            columns = [k for p in points for k in p]
            out[:, columns] = brought_back(readings, predicted, points)[:, columns]
        return out

    def _nearest(self, readings: Array, predicted: Array) -> Array:
        known = np.isfinite(readings)
        part = Problem(self.sample.model, self.sample.rows, readings, self.sample.sigma, self.sample.drive_sigma, known)
        return residuals(part, predicted) + predicted

    @cached_property
    def loose(self) -> list[int]:
        """Channels of instruments that stand anywhere."""
        model = self.sample.model
        return [int(k) for s in model.sensors if s.name in model.fitted_frames for k in s.channels]

    @cached_property
    def frames(self) -> list[list[list[int]]]:
        """By instrument that stands anywhere, the channels of the coordinates of its points, if it reads all."""
        model = self.sample.model
        axes = 2 if model.layout.planar else 3
        found: dict[str, list[list[int]]] = {}
        for sensor in model.sensors:
            point = [channel for channel, _ in sorted(sensor.places, key=lambda place: place[1])]
            if sensor.name in model.fitted_frames and len(point) == axes:
                found.setdefault(sensor.name, []).append(point)
        return list(found.values())


def _usual(sample: Problem, evaluation: Evaluation, parameters: tuple[str, ...]) -> Array:
    """Rms (C,) of residuals that noise and errors of parameters within their ranges cause."""
    ranges = {p.name: p.range for p in sample.model.parameters}
    prior = np.array([ranges[n] for n in parameters]).reshape(-1) / 2
    jacobian = evaluation.prediction.jacobian
    assert jacobian is not None
    variance = ((jacobian * prior) ** 2).sum(axis=2)
    noise = np.where(sample.measured, sample.sigma, np.nan) ** 2
    return np.array([np.sqrt(_mean(v) + _mean(n)) for v, n in zip(variance.T, noise.T, strict=True)])


def _mean(values: Array) -> float:
    """Mean of what is finite; 0 without any."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else 0.0


def _channels(scene: Scene, turns: bool) -> _Reason:
    """What explains the measured channels; `turns`: with turns by the shorter way."""
    names, units = _named(scene)
    readings, predicted = scene.readings, scene.predicted
    seen = scene.seen(readings, predicted) if turns else np.where(scene.telling, readings, np.nan)
    firm = seen.copy()
    firm[:, scene.loose] = np.nan
    found = explain_columns(firm, predicted, names, units, scene.usual)
    hints, corrected = list(found.hints), found.corrected
    for points in scene.frames:
        told, changed = explain_frame(readings, predicted, points, names, units)
        hints += told
        columns = [k for p in points for k in p]
        corrected[:, columns] = brought_back(changed, predicted, points)[:, columns]
    return _Reason(tuple(hints), *(misfit(table, predicted, seen) for table in (seen, corrected)))


def _named(scene: Scene) -> tuple[list[str], list[str]]:
    channels = scene.sample.model.channels
    return [c.name for c in channels], [c.unit for c in channels]


def _drives(scene: Scene) -> _Reason:
    """What explains the drives, by the positions that they have at the measured poses."""
    few = np.linspace(0, len(scene.rows) - 1, min(_POSES, len(scene.rows))).round().astype(int)
    part, values, model = scene.sample.take(few), scene.evaluation.values, scene.sample.model
    poses, rows = measured_poses(part, values)
    if len(rows) < _FEWEST:
        return _Reason((), np.inf, np.inf)
    expected, readings = drive_positions(model, poses, values).readings, part.rows.readings[rows]
    found = explain_columns(readings, expected, [a.name for a in model.actuators], [a.unit for a in model.actuators])
    return _Reason(found.hints, *(misfit(table, expected, readings) for table in (readings, found.corrected)))


def _rows(scene: Scene, sessions: IntArray, place: Callable[[int], str]) -> _Reason:
    """Whether readings belong to other rows: all of them, or those of some instruments."""
    best = _Reason((), np.inf, np.inf)
    for channels in _blocks(scene):
        found = _shifted(scene, channels, sessions, place)
        if found.complete:
            return found
        best = min(best, found, key=lambda r: r.after)
    return best


def _blocks(scene: Scene) -> list[list[int]]:
    """Channels that may be shifted together: all, those of instruments outside the drives, those of one instrument."""
    model = scene.sample.model
    measured = [k for k in range(len(model.channels)) if scene.sample.measured[:, k].any()]
    outside = [k for k in measured if model.channels[k].quantity not in ("drive", "force")]
    by_name: dict[str, list[int]] = {}
    for sensor in model.sensors:
        by_name.setdefault(sensor.name, []).extend(int(k) for k in sensor.channels)
    blocks = [measured, outside, *([k for k in each if k in measured] for each in by_name.values())]
    return [list(b) for b in dict.fromkeys(tuple(sorted(b)) for b in blocks) if b]


def _shifted(scene: Scene, channels: list[int], sessions: IntArray, place: Callable[[int], str]) -> _Reason:
    """Whether the readings of some channels belong to other rows."""
    readings = np.where(scene.whole.measured, scene.whole.readings, np.nan)
    predicted = scene.predicted
    some = np.full_like(readings, np.nan)
    some[:, channels] = readings[:, channels]
    shifts = find_row_shifts(some, predicted, scene.rows, sessions, scene.seen)
    right = readings.copy()
    right[:, channels] = apply_shifts(some, sessions, shifts)[:, channels]
    seen, corrected = (scene.seen(table[scene.rows], predicted) for table in (readings, right))
    alike = len({s.shift for s in shifts}) == 1 and all(s.whole for s in shifts)
    every = alike and len(shifts) == len(np.unique(sessions))
    told = shifts[:1] if every else shifts
    names, _ = _named(scene)
    whose = "" if len(channels) == len(names) else " of " + ", ".join(f"`{names[k]}`" for k in channels)
    hints = tuple(_row_hint(scene, s, whose, "" if every else _where(s, place)) for s in told)
    return _Reason(hints, *(misfit(table, predicted, seen) for table in (seen, corrected)))


def _where(shift: RowShift, place: Callable[[int], str]) -> str:
    return f" from {place(int(shift.rows[0]))} to {place(int(shift.rows[-1]))}"


def _row_hint(scene: Scene, found: RowShift, whose: str, where: str) -> Hint:
    """The channel that shows a shift most clearly gives the figures."""
    channels = scene.sample.model.channels
    with np.errstate(invalid="ignore", divide="ignore"):
        fall = np.nan_to_num(found.before / np.maximum(found.after, scene.usual))
    k = int(fall.argmax())
    unit = parse_unit(channels[k].unit)
    rows = {1: "one row", 2: "two rows"}[abs(found.shift)]
    other = {1: "next row", -1: "row before", 2: "row two further on", -2: "row two before"}[found.shift]
    before, after = float(found.before[k]), float(found.after[k])
    message = (
        f"the readings{whose} look shifted by {rows}{where}: "
        f"{evidence(unit, before, after).replace('residual', f'residual of `{channels[k].name}`,')} "
        f"when each row takes the readings of the {other}"
    )
    return Hint("rows", (channels[k].name,), message, before, after, tuple(found.rows.tolist()))
