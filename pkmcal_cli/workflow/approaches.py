"""From where a pose is approached: the tool point steps back, and the drives' sides follow from the inverse model.

So every side that a plan states can be had, with all drives of a redundant machine together. On the way back the drives
move at once, each straight to its set value; what they then hold against each other, beyond what they do at the pose
itself, is kept below a share of what they may, and ropes stay taut.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.overruns import LEAST, overruns
from pkmcal_cli.correction.waypoints import GAP
from pkmcal_cli.loading.pose_channels import Channels
from pkmcal_cli.model.limits import drive_limits
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.touching import rise
from pkmcal_cli.report.loads import limited
from pkmcal_cli.workflow.borne_loads import FORCES, Ways

_TRIES = 16  # directions in which the tool point may step back
_SHORTER = (1.0, 0.3, 0.1)  # lengths of the way that are tried
_ENOUGH = 0.3  # of the overrun, by the drive that moves least
_LONGEST = 0.05  # of the machine's size, or rad: step of the tool point
_BEYOND = 1e-7  # m or rad, beyond rounding
_STILL = 0.1  # of the overrun: a drive that moves less has no side
_SMALL = 1e-4  # of the machine's size, or rad: step for the directions in which drives move
_HALVINGS = 4
NO_WAY = "no neighbouring pose to approach it from"
_INSIDE = "choose poses further inside the workspace, or check `force_limit`"
_TAUT = (
    "choose poses at which all ropes pull; where redundant drives hold positions, state `t_min` of the ropes, or give "
    "set values that tension them"
)


@dataclass(frozen=True)
class Approaches:
    """By how much drives (N, A) are off where an approach begins; sides (N, A), -1, 1, or 0 for one that rests.

    refused: why poses cannot be approached, by their numbers.
    """

    back: Array
    side: Array
    refused: Mapping[int, str] = field(default_factory=dict)

    def take(self, rows: NDArray[np.intp]) -> Approaches:
        """Some of them, none of which is refused."""
        return Approaches(self.back[rows], self.side[rows])

    def followed_by(self, others: Approaches) -> Approaches:
        """Both as one, of which none is refused."""
        return Approaches(np.vstack([self.back, others.back]), np.vstack([self.side, others.side]))

    def columns(self, model: Model) -> dict[str, Array]:
        """Sides as columns of rows."""
        return {f"dir.{a.name}": column for a, column in zip(model.actuators, self.side.T, strict=True)}


@dataclass(frozen=True)
class ApproachFrom:
    """From where rows are to be approached: sides (N, A) of drives that are preferred, 0 where any will do.

    away (N, 6): direction in the tool point's coordinates, lengths in sizes of the machine, that leads away from what
    is touched; the approach comes from there, within 45 deg. 0: from anywhere.
    """

    sides: Array
    away: Array

    @classmethod
    def of(
        cls, model: Model, values: Array, rows: Rows, touched: Channels | None, sides: Array | None = None
    ) -> ApproachFrom:
        """For rows (N) in which channels (N, C) touch, at parameter values (P,); sides (N, A), nan: any will do."""
        slopes = (np.zeros((len(rows), 6)) if touched is None else rise(model, values, rows, touched)) * _sizes(model)
        away = slopes / np.maximum(np.sqrt((slopes**2).sum(axis=1, keepdims=True)), 1e-300)
        return cls(np.zeros(rows.readings.shape) if sides is None else np.nan_to_num(sides), away)

    def take(self, rows: NDArray[np.intp]) -> ApproachFrom:
        """Of some rows."""
        return ApproachFrom(self.sides[rows], self.away[rows])


def approaches(
    model: Model, values: Array, rows: Rows, poses: Array, rng: np.random.Generator, origin: ApproachFrom
) -> Approaches:
    """Approaches of rows (N) at poses (N, 6) of the tool point, at parameter values (P,), from random directions."""
    held = [a for a, d in enumerate(model.topology.drives) if not d.force_controlled]
    overrun = np.full(rows.readings.shape[1], np.inf)
    overrun[held] = overruns(model, rows.readings, held)
    back, reachable = _steps_back(model, poses, overrun, origin, rng)
    refused = {int(k): NO_WAY for k in np.nonzero(~reachable)[0]}
    back, unsafe = _shortened(model, values, rows, np.where(reachable[:, None], np.nan_to_num(back), 0.0))
    refused |= {k: why for k, why in unsafe.items() if reachable[k]}
    still = np.abs(back) < _STILL * np.where(np.isinf(overrun), LEAST, overrun)
    return Approaches(back, np.where(still, 0.0, -np.sign(back)), refused)


def _steps_back(
    model: Model, poses: Array, overrun: Array, origin: ApproachFrom, rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """By how much drives (N, A) are off where approaches begin, and which (N,) there are; shorter ones at borders."""
    back, reachable = np.zeros(origin.sides.shape), np.zeros(len(poses), dtype=bool)
    for share in _SHORTER:
        left = np.nonzero(~reachable)[0]
        if len(left):
            back[left], reachable[left] = _best_step(model, poses[left], share * overrun, origin.take(left), rng)
    return back, reachable


def _best_step(
    model: Model, poses: Array, overrun: Array, origin: ApproachFrom, rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """The same for one length of steps: within reach and travel, and the workspace where the poses are in it.

    Of a few random directions that with most of the wanted sides, then one in which every drive moves enough, or, where
    none is, that in which the laziest drive moves most.
    """
    count, limits = len(poses), drive_limits(model.actuators)
    size, held = _sizes(model), model.independent_coordinates
    unit, every = _directions(held, _TRIES * count, rng), np.tile(poses, (_TRIES, 1))
    unit = _from_outside(unit, np.tile(origin.away, (_TRIES, 1))) * size
    there = np.tile(drive_positions(model, poses, held=held).readings, (_TRIES, 1))
    slope = (there - drive_positions(model, every - _SMALL * unit, held=held).readings) / _SMALL
    share = np.abs(np.nan_to_num(slope)) / overrun  # overruns per size of the machine
    moving = share.max(axis=0, initial=0.0) > 0
    if not moving.any():
        return np.zeros((count, len(limits))), np.zeros(count, dtype=bool)
    laziest = share[:, moving].min(axis=1)
    step = np.minimum(1.0 / np.maximum(laziest, 1e-12), _LONGEST)
    step = _nearly_straight(model, every, step, unit, there)
    back = drive_positions(model, every - step[:, None] * unit, held=held)
    good = back.reached & ~np.isnan(there).any(axis=1)
    outside = (there < limits[:, 0] - _BEYOND) | (there > limits[:, 1] + _BEYOND)  # a plan that goes there knows why
    good &= (((back.readings >= limits[:, 0]) & (back.readings <= limits[:, 1])) | outside).all(axis=1)
    if model.workspace is not None:
        good &= model.workspace.holds(back.poses, back.readings) | ~model.workspace.holds(every, there)
    suits = (np.sign(slope) * np.tile(origin.sides, (_TRIES, 1)) >= 0).mean(axis=1)
    moves = np.minimum(step * laziest, _ENOUGH)  # among those that move enough chance decides: all kinds of sides
    worth = np.where(good, 2.0 * suits + moves, -1.0).reshape(_TRIES, count)
    best, row = worth.argmax(axis=0), np.arange(count)
    off = np.nan_to_num(back.readings - there).reshape(_TRIES, count, -1)[best, row]
    return off, worth[best, row] >= 0


def _nearly_straight(model: Model, poses: Array, step: Array, unit: Array, there: Array) -> Array:
    """Steps (N,) shortened until drives that move straight, all at once, stay where the inverse model has them.

    Of a redundant machine, which else would be strained on the way: the gap grows with the square of the step.
    """
    if not model.overdetermined:
        return step
    held = model.independent_coordinates
    back, middle = (drive_positions(model, poses - (s * step)[:, None] * unit, held=held).readings for s in (1.0, 0.5))
    gap = np.abs((middle - 0.5 * (back + there)) * model.gains)
    worst = np.nan_to_num(gap, nan=np.inf).max(axis=1)
    return np.asarray(step * np.minimum(1.0, np.sqrt(GAP * model.length / np.maximum(worst, 1e-300))))


def _directions(held: tuple[str, ...], count: int, rng: np.random.Generator) -> Array:
    """Unit directions (N, 6) in the coordinates that the tool point moves independently."""
    free = [DIRECTIONS.index(c) for c in held]
    drawn = rng.normal(size=(count, len(free)))
    out = np.zeros((count, 6))
    out[:, free] = drawn / np.sqrt((drawn**2).sum(axis=1, keepdims=True))
    return out


def _from_outside(unit: Array, away: Array) -> Array:
    """Directions (N, 6) turned so that they come from where unit vectors (N, 6) lead, within 45 deg; 0: as they are."""
    along = (unit * away).sum(axis=1, keepdims=True)
    turned = np.where(along > 0, -unit, unit) - away
    return np.asarray(turned / np.sqrt((turned**2).sum(axis=1, keepdims=True)))


def _sizes(model: Model) -> Array:
    """What the coordinates (6,) of the tool point count in: sizes of the machine, rad."""
    return np.where(np.arange(6) < 3, model.length, 1.0)


def no_approach(model: Model, refused: Mapping[int, str]) -> BadInput:
    """What is said where no pose is left, and the remedy of what keeps most of them."""
    every = Counter(refused.values()).most_common()
    reasons = "; ".join(f"{why} ({n})" for why, n in every)
    message = f"none of {count(len(refused), 'pose')} can be measured: {reasons}"
    hint = _INSIDE if every[0][0] in (FORCES, NO_WAY) else _TAUT
    return BadInput.single(message, Location(model.name), hint, "approach")


def _shortened(model: Model, values: Array, rows: Rows, back: Array) -> tuple[Array, dict[int, str]]:
    """Ways back (N, A), shortened until forces are within limits and ropes taut; why others cannot be, by number."""
    if not (limited(model) or model.exact.ropes):
        return back, {}
    back, ways = back.copy(), Ways.to(model, values, rows)
    ends = ways.refused_ends()
    left = np.array([k for k in np.nonzero(~ways.there.lost)[0].tolist() if k not in ends], dtype=np.intp)
    why: dict[int, str] = {}
    for _ in range(_HALVINGS if len(left) else 0):
        why = ways.refused(back, left)
        left = np.array(list(why), dtype=np.intp)
        if not len(left):
            break
        back[left] *= 0.5
    return back, ends | why
