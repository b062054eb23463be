"""What drives and ropes bear in the rows of a table: forces above limits, slack ropes, drives that fight each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.model.freedoms import LEAST_MISFIT
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Request, Rows, WarmStart, predict
from pkmcal_cli.report.number_format import handy
from pkmcal_cli.units.unit_text import Unit, parse_unit


@dataclass
class _Worst:
    """In how many rows something is beyond its limit, and where most: value in SI."""

    rows: int = 0
    value: float = 0.0
    row_origin: RowOrigin | None = None

    def add(self, beyond: NDArray[np.bool_], values: Array, row_origin: Callable[[int], RowOrigin]) -> None:
        """Count rows (N,) and keep the one with the largest value (N,) of them."""
        self.rows += int(beyond.sum())
        if beyond.any():
            row = int(np.argmax(np.where(beyond, values, -np.inf)))
            if self.row_origin is None or values[row] > self.value:
                self.value, self.row_origin = float(values[row]), row_origin(row)

    def json(self, value: str, scale: float = 1.0) -> dict[str, Any]:
        """The same for JSON, the value in SI by its name."""
        at = self.row_origin
        return {
            "n_rows": self.rows,
            value: scale * self.value,
            "row": None if at is None else (at.id or at.line or None),
        }


def limited(model: Model) -> bool:
    """Whether the machine states limits of forces."""
    return bool(model.least_tensions) or any(np.isfinite(a.force_limit) for a in model.actuators)


@dataclass(kw_only=True)
class Loads:
    """A tally over the rows of a model, filled block by block; lacking: share of a limit by which it may be missed."""

    model: Model
    lacking: float = 0.0
    total: int = 0
    over: dict[str, _Worst] = field(default_factory=dict)  # by actuator
    low_tension: dict[str, _Worst] = field(default_factory=dict)  # by rope; values are negative tensions
    apart: _Worst = field(default_factory=_Worst)  # drives that no pose satisfies, m
    force: _Worst = field(default_factory=_Worst)  # largest drive force in those rows
    drive: str = ""  # whose
    slack: Counter[str] = field(default_factory=Counter)
    slack_rows: int = 0

    @classmethod
    def of(
        cls,
        model: Model,
        values: Array,
        rows: Rows,
        row_origin: Callable[[int], RowOrigin],
        start: WarmStart | None = None,
        lacking: float = 0.0,
    ) -> Loads:
        """The loads of rows at parameter values (P,), SI."""
        loads = cls(model=model, lacking=lacking)
        loads.add(values, rows, predict(model, values, rows, Request(forces=limited(model)), start), row_origin)
        return loads

    @classmethod
    def of_fit(cls, problem: Problem, fit: Fit, row_origin: Callable[[int], RowOrigin]) -> Loads:
        """The loads of the rows of a fit."""
        return cls.of(problem.model, fit.values, problem.moved(fit.shift), row_origin, fit.last.start)

    def add(self, values: Array, rows: Rows, prediction: Prediction, row_origin: Callable[[int], RowOrigin]) -> None:
        """Count the solved rows of a prediction at parameter values (P,), SI; `row_origin`: where a row stands."""
        self.total += int(prediction.solved.sum())
        if prediction.forces is not None and prediction.tension is not None:
            self._add_limits(prediction.solved, np.abs(prediction.forces), prediction.tension, row_origin)
        apart = np.nonzero(self._disagreeing(prediction))[0]
        if len(apart):
            some = predict(self.model, values, rows.take(apart), Request(forces=True), prediction.start.take(apart))
            self._add_disagreement(some, lambda k: row_origin(int(apart[k])))
        for names in prediction.slack.values():
            self.slack.update(names)
        self.slack_rows += len(prediction.slack)

    def _disagreeing(self, prediction: Prediction) -> NDArray[np.bool_]:
        """Rows (N,) whose drives are apart by more than is no doubt, and of which more are taut than hold the pose.

        Where all drives state their largest forces, these say what is too much: ropes may be tensioned on purpose.
        """
        stated = np.isfinite([a.force_limit for a in self.model.actuators]).all()
        compared = prediction.solved & (prediction.misfit > 0) & (not stated)
        if not compared.any():  # a frame without drives has no pose
            return compared
        slack = np.zeros(len(compared), dtype=np.intp)
        slack[list(prediction.slack)] = [len(names) for names in prediction.slack.values()]
        redundant = len(self.model.held_drives) - slack > self.model.motion_of(self.model.posed).freedoms
        return np.asarray(compared & redundant & self.model.in_doubt(prediction.misfit))

    def _add_limits(
        self, solved: NDArray[np.bool_], forces: Array, tensions: Array, row_origin: Callable[[int], RowOrigin]
    ) -> None:
        """Forces (N, A) above limits and tensions (N, R) below theirs."""
        for k, actuator in enumerate(self.model.actuators):
            over = solved & (forces[:, k] > (1.0 + self.lacking) * actuator.force_limit)
            self.over.setdefault(actuator.name, _Worst()).add(over, forces[:, k], row_origin)
        for k, rope in enumerate(self.model.least_tensions):
            below = solved & rope.missed(tensions[:, k], self.lacking)
            self.low_tension.setdefault(rope.name, _Worst()).add(below, -tensions[:, k], row_origin)

    def _add_disagreement(self, prediction: Prediction, row_origin: Callable[[int], RowOrigin]) -> None:
        """Rows whose drives hold positions that no pose satisfies within ranges and noise."""
        assert prediction.forces is not None
        forces, solved = np.abs(np.nan_to_num(prediction.forces)), prediction.solved
        self.apart.add(solved, prediction.misfit * self.model.length, row_origin)
        largest = self.force.value
        self.force.add(solved, forces.max(axis=1), row_origin)
        if self.force.value > largest:
            row = int(np.argmax(np.where(solved, forces.max(axis=1), -np.inf)))
            self.drive = self.model.actuators[int(np.argmax(forces[row]))].name

    @property
    def warnings(self) -> list[str]:
        """One sentence for each thing that is beyond its limit."""
        out = []
        for actuator in self.model.actuators:
            worst = self.over.get(actuator.name, _Worst())
            if worst.rows:
                limit, value = self._force(actuator.name, actuator.force_limit), self._force(actuator.name, worst.value)
                message = f"force of `{actuator.name}` above its `force_limit` of {limit}"
                out.append(f"warning: {message} in {self._rows(worst)}: up to {value} at {worst.row_origin}")
        for rope in self.model.least_tensions:
            worst = self.low_tension.get(rope.name, _Worst())
            if worst.rows:
                newton = parse_unit("N")
                message = f"tension of rope `{rope.name}` below its `t_min` of {handy(rope.tension, newton)}"
                least = handy(max(-worst.value, 0.0), newton)
                out.append(f"warning: {message} in {self._rows(worst)}: down to {least} at {worst.row_origin}")
        if self.apart.rows:
            expected = handy(self.model.expected_misfit * self.model.length, parse_unit("mm"))
            by_ranges = self.model.explained_misfit > LEAST_MISFIT
            limit = "parameter ranges and noise explain" if by_ranges else f"{LEAST_MISFIT:g} of the machine's size"
            most = handy(self.apart.value, parse_unit("mm"))
            message = f"the actuators strain the structure by up to {most} in {self._rows(self.apart)}"
            why = f"more than {limit} ({expected}): they disagree, or loads are large"
            most = self._force(self.drive, self.force.value)
            force = f"forces up to {most} (`{self.drive}` at {self.force.row_origin})"
            out.append(f"warning: {message}, {why}; {force}")
        return out

    @property
    def notes(self) -> list[str]:
        """Which ropes are slack."""
        if not self.slack_rows:
            return []
        names = ", ".join(f"{name} {n}" for name, n in self.slack.most_common())
        return [f"slack ropes, which carry nothing, in {self.slack_rows} of {count(self.total, 'row')}: {names}"]

    def show(self, to: Listener) -> None:
        """Warnings, then notes."""
        for text in self.warnings:
            to.warn(text)
        to.notes(self.notes)

    def json(self) -> dict[str, Any]:
        """The same for JSON; forces in N or N m, lengths in m."""
        limits = {a.name: a.force_limit for a in self.model.actuators if np.isfinite(a.force_limit)}
        least = {rope.name: rope.tension for rope in self.model.least_tensions}
        return {
            "force_limit": [
                {"actuator": n, "limit": limit, **self.over.get(n, _Worst()).json("largest")}
                for n, limit in limits.items()
            ],
            "t_min": [
                {"rope": n, "limit": t, **self.low_tension.get(n, _Worst()).json("least", -1.0)}
                for n, t in least.items()
            ],
            "disagreement": self.apart.json("largest"),
            "slack": {"n_rows": self.slack_rows, "ropes": dict(self.slack)},
        }

    def _rows(self, worst: _Worst) -> str:
        return f"{worst.rows} of {count(self.total, 'row')}"

    def _force(self, name: str, value: float) -> str:
        return handy(value, self._unit(name))

    def _unit(self, name: str) -> Unit:
        """Newton, or newton metre of a crank."""
        drive = next(d for d in self.model.topology.drives if d.name == name)
        return parse_unit("N" if self.model.topology.moves_length(drive) else "N m")
