"""What drives and ropes bear at rows and on the ways to them: within what they may, or why not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.internal_force import InternalForces
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, WarmStart, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.touching import tcp_places

_INTERNAL = 0.05  # of `force_limit`: internal force on the way beyond that at the pose; of `t_min`: lack of tension
_ON_THE_WAY = (1.0, 0.75, 0.5, 0.25)  # of the way back
FORCES = "forces on the way to it, or at it, beyond `force_limit`"
LOST = "no equilibrium on the way to it"


@dataclass(frozen=True)
class BorneLoads:
    """Forces (N, A) of drives at rows, inf where the machine does not get there, (N,) `lost`.

    ropes: by row, the first that is slack or pulls less than it has to; start: for predictions of rows nearby.
    """

    forces: Array
    lost: NDArray[np.bool_]
    ropes: dict[int, str]
    start: WarmStart

    @classmethod
    def of(cls, model: Model, values: Array, rows: Rows, to: WarmStart | None = None) -> BorneLoads:
        """At parameter values (P,); to: ends of the ways on which rows are, where a little tension may be lacking."""
        prediction = predict(model, values, rows, Request(forces=True, compare=to is None), to)
        lacking = 0.0 if to is None else _INTERNAL
        assert prediction.forces is not None and prediction.tension is not None
        ropes = {row: names[0] for row, names in prediction.slack.items()}
        for rope, tensions in zip(model.least_tensions, prediction.tension.T, strict=True):
            below = np.nonzero(prediction.solved & rope.missed(tensions, lacking))[0]
            ropes = {int(row): rope.name for row in below} | ropes
        forces = np.where(prediction.solved[:, None], np.nan_to_num(prediction.forces), np.inf)
        return cls(forces, ~prediction.solved, ropes, prediction.start)

    def refused(self, limits: Array) -> dict[int, str]:
        """Why rows that the machine gets to cannot be, by number; limits (A,) of the forces."""
        over = np.nonzero((np.abs(self.forces) > limits).any(axis=1) & ~self.lost)[0]
        ropes = {k: f"rope `{n}` slack, or below its `t_min`, on the way to it or at it" for k, n in self.ropes.items()}
        return {int(k): FORCES for k in over} | ropes


@dataclass(frozen=True)
class Ways:
    """Ways to rows at parameter values (P,); there: what is borne at their ends; internal: None without limits."""

    model: Model
    values: Array
    rows: Rows
    there: BorneLoads
    internal: InternalForces | None

    @classmethod
    def to(cls, model: Model, values: Array, rows: Rows) -> Ways:
        """To rows (N)."""
        there, internal = BorneLoads.of(model, values, rows), None
        if np.isfinite(_limits(model)).any():
            inverse = drive_positions(model, tcp_places(model, values, rows), values, derivatives=True)
            assert inverse.by_pose is not None
            internal = InternalForces.of(model, values, np.nan_to_num(inverse.by_pose))
        return cls(model, values, rows, there, internal)

    def refused_ends(self) -> dict[int, str]:
        """Why the machine cannot be at some rows, by number."""
        return self.there.refused(_limits(self.model))

    def refused(self, back: Array, some: NDArray[np.intp]) -> dict[int, str]:
        """Why some rows cannot be approached from back (N, A), by number.

        Forces have to be within limits, internal ones hardly beyond those at the pose, and ropes taut.
        """
        limits, why = _limits(self.model), dict[int, str]()
        for share in _ON_THE_WAY:
            moved = self.rows.take(some).moved(share * back[some])
            borne = BorneLoads.of(self.model, self.values, moved, self.there.start.take(some))
            if self.internal is not None:
                internal = InternalForces(self.internal.basis[some], self.internal.scale)
                more = np.abs(internal.part(borne.forces) - internal.part(self.there.forces[some]))
                why = {int(k): FORCES for k in np.nonzero(~(more <= _INTERNAL * limits).all(axis=1))[0]} | why
            why = borne.refused(limits) | {int(k): LOST for k in np.nonzero(borne.lost)[0]} | why
        return {int(some[k]): text for k, text in why.items()}


def _limits(model: Model) -> Array:
    return np.array([a.force_limit for a in model.actuators])
