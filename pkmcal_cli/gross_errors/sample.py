"""A sample of a table, beside what the model predicts for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, log_jacobian, small_motions
from pkmcal_cli.calibration.fitted_frames import of_unplaced
from pkmcal_cli.calibration.misfit import residuals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate
from pkmcal_cli.gross_errors.frame_turns import lever
from pkmcal_cli.gross_errors.mirror import MORE_THAN_AXES, brought_back
from pkmcal_cli.gross_errors.plausibility import FEW, GROSS, Hint, rms, spread
from pkmcal_cli.prediction import WarmStart

IntArray = NDArray[np.intp]
_ROWS = 200  # a sample of a long table shows a gross mistake as well
_HALF = 0.5
_TURNED = 0.2  # rad: a frame that may be turned by more than this is turned nobody knows how
_NO_TURN = 1e-9  # share of the largest motion of points: what turns points on a line about it moves none
_FEW, _FEWEST = 0.1, 6  # share of rows, at least one, of as many or more


@dataclass(frozen=True)
class Sample:
    """A sample of the table, predicted at the starting values.

    whole: the whole table; rows (n,): numbers of the sample's rows in it; prior_rms (C,): rms that errors of parameters
    (names, without those of unknown frames) and noise cause, less what an instrument takes up that stands anywhere.
    """

    whole: Problem
    rows: IntArray
    part: Problem
    evaluation: Evaluation
    prior_rms: Array
    parameters: tuple[str, ...]

    @classmethod
    def of(
        cls, problem: Problem, values: Array, parameters: tuple[str, ...], states: WarmStart | None = None
    ) -> Sample:
        """Predict a sample of rows, drawn so that it does not keep step with a grid; `states`: of all rows."""
        count = len(problem)
        rows = np.arange(count)
        if count > _ROWS:
            rows = np.sort(np.random.default_rng(0).choice(count, _ROWS, replace=False))
        sample = problem.take(rows)
        of_unknown_frames = {
            n for e in problem.model.effects if e.at in problem.model.fitted_frames for n in e.parameters
        }
        without_frames = tuple(n for n in parameters if n not in of_unknown_frames)
        evaluation = evaluate(sample, values, without_frames, None if states is None else states.take(rows))
        made = cls(problem, rows, sample, evaluation, np.zeros(len(problem.model.channels)), without_frames)
        made = replace(made, prior_rms=_prior_rms(made))
        return replace(made, prior_rms=_with_alignment(made))

    @cached_property
    def predicted(self) -> Array:
        """Predictions (n, C), nan where there are none."""
        return np.where(self.evaluation.prediction.solved[:, None], self.evaluation.prediction.values, np.nan)

    @cached_property
    def changes(self) -> Array:
        """What errors of parameters by half their ranges do to predictions (n, C, p); none of unknown frames."""
        ranges = {p.name: p.range for p in self.part.model.parameters}
        jacobian = self.evaluation.prediction.jacobian
        assert jacobian is not None
        return np.asarray(jacobian * (np.array([ranges[n] for n in self.parameters]).reshape(-1) / 2))

    @cached_property
    def informative(self) -> NDArray[np.bool_]:
        """Channels (C,) that vary far more than errors of parameters and noise cause; all where few rows are known."""
        varies = np.maximum(spread(self.predicted), spread(self.readings))
        return np.asarray((varies > GROSS * self.prior_rms) | self.mostly_lost)

    @property
    def mostly_lost(self) -> bool:
        """Whether most rows cannot be predicted."""
        return not bool(self.evaluation.prediction.solved.mean() > _HALF)

    @cached_property
    def gross(self) -> bool:
        """Whether rows cannot be predicted, or more is left than parameters explain."""
        residual = self.seen(self.readings, self.predicted) - self.predicted
        large = [rms(r) > GROSS * u for r, u in zip(residual.T, self.prior_rms, strict=True) if np.isfinite(r).any()]
        return any(large) or not self.evaluation.prediction.solved.all()

    def still_gross(self, hints: Sequence[Hint]) -> bool:
        """Whether a channel is off by more than parameters explain once what is suspected is put right."""
        expected = {c.name: u for c, u in zip(self.part.model.channels, self.prior_rms, strict=True)}
        return any(h.after > GROSS * max(expected.get(n, np.inf) for n in h.names) for h in hints)

    @cached_property
    def few_rows_off(self) -> bool:
        """Whether a few rows alone are grossly off: what the others do not show is no mistake of a column.

        A column that is off in most of its cells may be one, however few they are.
        """
        residual = self.seen(self.readings, self.predicted) - self.predicted
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.abs(np.where(self.prior_rms > 0, residual / self.prior_rms, 0.0))
        cells, off = np.isfinite(relative).sum(axis=0), (relative > GROSS).sum(axis=0)
        if ((cells >= FEW) & (off > _HALF * cells)).any():
            return False
        known = np.isfinite(relative).any(axis=1) | ~self.evaluation.prediction.solved
        each = np.where(np.isfinite(relative), relative, 0.0).max(axis=1, initial=0.0)
        each = np.where(self.evaluation.prediction.solved, each, np.inf)[known]
        return self.gross and len(each) >= _FEWEST and int((each > GROSS).sum()) <= max(1, int(_FEW * len(each)))

    def unexplained(self, tables: Sequence[Array]) -> list[float]:
        """Chi-square per reading that errors of parameters in their ranges leave of tables (n, C), this sample first.

        Infinite where a table lacks what the first one has.
        """
        off = np.stack([self.compared(table, self.predicted) - self.predicted for table in tables], axis=2)  # (n, C, k)
        known: NDArray[np.bool_] = self.part.measured & np.isfinite(off[..., 0])
        noise, left = self.part.sigma[known][:, None], off[known]
        changes = _less_motions(self, self.changes)[known] / noise  # (m, p), in half ranges
        held = np.eye(changes.shape[1], changes.shape[1] + len(tables))
        whole = np.vstack([np.hstack([changes, np.nan_to_num(left) / noise]), held])
        upper = np.asarray(np.linalg.qr(whole, mode="r"))
        rest = upper[changes.shape[1] :, changes.shape[1] :]
        chi2 = np.where(np.isfinite(left).all(axis=0), (rest**2).sum(axis=0), np.inf)
        return [float(each) / max(len(noise), 1) for each in chi2]

    @cached_property
    def readings(self) -> Array:
        """What was measured (n, C), nan elsewhere, and of instruments that stand nobody knows where."""
        unknown = of_unplaced(self.part, self.evaluation.values)
        return np.where(self.part.measured & ~unknown, self.part.readings, np.nan)

    def seen(self, readings: Array, predicted: Array) -> Array:
        """Readings (n, C) as they compare with predictions: turns by the shorter way, unknown frames brought back.

        Nan for channels that parameters may move as much as poses do: they tell nothing.
        """
        out = self.compared(readings, predicted)
        silent = ~self.informative
        silent[self.of_unknown_frames] = False
        out[:, silent] = np.nan
        return out

    def compared(self, readings: Array, predicted: Array) -> Array:
        """As `seen`, of all channels; nan of unknown frames that cannot be brought back."""
        out = np.where(np.isfinite(readings), self._nearest(readings, predicted), np.nan)
        out[:, self.of_unknown_frames] = np.nan
        for points, turns in zip(self.frames, self.turns, strict=True):
            columns = [k for p in (*points, *turns) for k in p]
            out[:, columns] = brought_back(readings, predicted, points, turns)[:, columns]
        out[:, np.isinf(self.prior_rms)] = np.nan
        return out

    def _nearest(self, readings: Array, predicted: Array) -> Array:
        known = np.isfinite(readings)
        part = Problem(
            model=self.part.model,
            rows=self.part.rows,
            readings=readings,
            sigma=self.part.sigma,
            drive_sigma=self.part.drive_sigma,
            measured=known,
        )
        return residuals(part, predicted) + predicted

    @cached_property
    def of_unknown_frames(self) -> list[int]:
        """Channels of instruments that stand anywhere."""
        model = self.part.model
        return [int(k) for s in model.sensors if s.name in model.fitted_frames for k in s.channels]

    @cached_property
    def frames(self) -> list[list[list[int]]]:
        """By instrument that stands anywhere, the channels of the coordinates of its points, if it reads all."""
        return [points for points, _ in self._whole.values()]

    @cached_property
    def turns(self) -> list[list[list[int]]]:
        """The channels of whole rotation vectors of each of these instruments."""
        return [turns for _, turns in self._whole.values()]

    @cached_property
    def _whole(self) -> dict[str, tuple[list[list[int]], list[list[int]]]]:
        axes, fitted = 2 if self.part.model.topology.planar else 3, self.part.model.fitted_frames
        pointed = {n: [p for p in points if len(p) == axes] for n, points in self._points.items() if n in fitted}
        return {n: (points, self._turns_of(n)) for n, points in pointed.items() if points}

    @cached_property
    def standing(self) -> dict[str, tuple[list[list[int]], list[list[int]]]]:
        """By instrument whose place the machine file states: the channels of its points' coordinates, as many of each,
        and of whole rotation vectors.
        """
        out = {}
        for name, points in self._points.items():
            if name not in self.part.model.fitted_frames:
                out[name] = [p for p in points if len(p) == len(points[0])], self._turns_of(name)
        return out

    @cached_property
    def _points(self) -> dict[str, list[list[int]]]:
        """By instrument, the channels of the coordinates of each point that it reads."""
        out: dict[str, list[list[int]]] = {}
        for sensor in self.part.model.sensors:
            if point := [channel for channel, _ in sorted(sensor.places, key=lambda pair: pair[1])]:
                out.setdefault(sensor.name, []).append(point)
        return out

    def _turns_of(self, name: str) -> list[list[int]]:
        whole = 1 if self.part.model.topology.planar else 3
        read = (sorted(s.rotates, key=lambda pair: pair[1]) for s in self.part.model.sensors if s.name == name)
        return [[channel for channel, _ in pairs] for pairs in read if len(pairs) == whole]


def _with_alignment(sample: Sample) -> Array:
    """Rms (C,) that errors of parameters and noise cause, also where points that are off show how a frame is turned.

    Infinite where the points do not show it.
    """
    out = sample.prior_rms.copy()
    for points, turns in zip(sample.frames, sample.turns, strict=True):
        across = lever(np.concatenate([sample.predicted[:, p] for p in points]))
        off = rms(out[[k for p in points for k in p]])
        for columns in turns:
            out[columns] = np.hypot(out[columns], off / across) if off < _TURNED * across else np.inf
    return out


def _prior_rms(sample: Sample) -> Array:
    """Rms (C,) of residuals that noise and errors of parameters within their ranges cause."""
    variance = (_less_motions(sample, sample.changes) ** 2).sum(axis=2)
    noise = np.where(sample.part.measured, sample.part.sigma, np.nan) ** 2
    return np.array([np.sqrt(_mean(v) + _mean(n)) for v, n in zip(variance.T, noise.T, strict=True)])


def _less_motions(sample: Sample, moved: Array) -> Array:
    """What errors of parameters do to predictions (n, C, p), less the rigid motion that brings a frame back by it."""
    moved, predicted, known = moved.copy(), sample.predicted, np.isfinite(sample.readings + sample.predicted)
    for points, turns in zip(sample.frames, sample.turns, strict=True):
        rows, which = np.nonzero(np.stack([known[:, p].all(axis=1) for p in points], axis=1))
        if len(rows) < len(points[0]) + MORE_THAN_AXES:
            continue
        at = rows[:, None], np.array(points)[which]
        motions, by = small_motions(predicted[at]), moved[at]
        rates = np.linalg.lstsq(motions.reshape(-1, motions.shape[2]), by.reshape(-1, moved.shape[2]), _NO_TURN)[0]
        moved[:, [k for p in points for k in p]] = np.nan  # what is not whole is not brought back
        moved[at] = by - motions @ rates
        for vector in turns:
            spin = rates[: -len(points[0])]
            moved[:, vector] -= spin if len(vector) == 1 else log_jacobian(predicted[:, vector]) @ spin
    return moved


def _mean(values: Array) -> float:
    """Mean of what is finite; 0 without any."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else 0.0
