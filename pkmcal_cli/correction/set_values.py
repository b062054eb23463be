"""The elasto-geometrical inverse: set values at which the predicted tool point is where it shall be.

Newton's method on the set values with exact derivatives of the equilibrium; what redundant drives leave free is a small
quadratic programme in every step (`redundancy`). All rows together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.internal_force import InternalForces
from pkmcal_cli.correction.redundancy import BOUNDED, Choice, Redundancy, binding_names
from pkmcal_cli.correction.strained_pose import LoadedTool, StrainedPose
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.limits import limit_excess
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows, WarmStart
from pkmcal_cli.prediction.inverse_kinematics import DrivePositions, drive_positions
from pkmcal_cli.units.unit_text import parse_unit

_STEPS, _SHORTEST = 30, 1 / 64  # in all, and as a share of a whole step
_EXACT = 1e-12  # of the machine's size, or rad: the tool point is there
_CONVERGED = 1e-7  # of a drive's force scale, or of its force: it changes no more
_ROUNDING = 1e-14  # of the machine's size, or rad: a step that is none
_THERE = 1e-9  # of the machine's size, or rad: a prediction from scratch finds the tool point there
_EXCEEDED = 1e-7  # of a limit
_GROWN = 0.9  # a step that leaves more of the error than so was too long
_LONGEST = 0.1  # of the machine's size, or rad: a step
_LIMITED = "no set values within all limits; in the way"
_ELSEWHERE = "a prediction from these set values leads elsewhere: the pose is ambiguous"


@dataclass(frozen=True, kw_only=True)
class Aim:
    """What is wanted: poses (N, 6) of the tool point at coordinates `held`, under the circumstances of `rows` (N).

    The readings of the rows are the set values of the nominal machine.
    """

    poses: Array
    held: tuple[str, ...]
    rows: Rows

    @property
    def targets(self) -> Array:
        """Coordinates (N, h) that are held."""
        return self.poses[:, [DIRECTIONS.index(name) for name in self.held]]

    def take(self, rows: Index) -> Aim:
        """Some of them."""
        return Aim(poses=self.poses[rows], held=self.held, rows=self.rows.take(rows))


@dataclass(frozen=True, kw_only=True)
class SetValues:
    """Rows with set values; after: the machine there; internal: of its forces; failed: why rows have none."""

    rows: Rows
    after: StrainedPose
    internal: InternalForces
    failed: dict[int, str]


def set_values(model: Model, values: Array, aim: Aim, strainless: DrivePositions, choice: Choice) -> SetValues:
    """Set values that bring the tool point of a machine with parameter values (P,) to where it is wanted.

    strainless: of the same machine at the poses, with derivatives; all are reached.
    """
    assert strainless.by_pose is not None
    tool, ropes = LoadedTool(model, aim.held), model.exact.ropes
    internal = InternalForces.of(model, values, strainless.by_pose)
    redundancy = Redundancy(
        tool=LoadedTool(model, aim.held, taut=True) if ropes else tool, values=values, choice=choice, internal=internal,
        aimed_forces=_declared(model, aim, choice), set_values=aim.rows.readings,
    )  # fmt: skip
    begin, drives = aim.rows.readings.copy(), redundancy.drives
    if choice != "nominal":
        begin[:, drives] = strainless.readings[:, drives]
    search = _Search(redundancy, aim, replace(aim.rows, readings=begin))
    search.run()
    if ropes and choice not in BOUNDED:  # now with ropes that go slack
        search = _Search(replace(redundancy, tool=tool), aim, search.rows)
        search.run()
    after = tool.at(values, search.rows, aim.targets)
    failed = _beyond(model, search.rows, _checked(tool, aim, after, search))
    return SetValues(rows=search.rows, after=after, internal=internal, failed=failed)


def _declared(model: Model, aim: Aim, choice: Choice) -> Array:
    """Internal forces (N, A) of the machine as its file declares it, at the set values of the nominal machine."""
    if choice != "preload":
        return np.zeros(aim.rows.readings.shape)
    nominal = drive_positions(model, aim.poses, None, aim.held, derivatives=True)
    assert nominal.by_pose is not None
    there = LoadedTool(model, aim.held).at(model.nominal, aim.rows, aim.targets)
    return InternalForces.of(model, model.nominal, nominal.by_pose).part(np.nan_to_num(there.force))


def _checked(tool: LoadedTool, aim: Aim, after: StrainedPose, search: _Search) -> dict[int, str]:
    """Reasons of rows that a prediction from scratch does not confirm, besides those that are known.

    Where there is none, limits that are kept may strain the machine more than it can be.
    """
    error = np.abs(after.tool - aim.targets) / tool.sizes
    there = np.nan_to_num(error, nan=np.inf).max(axis=1, initial=0.0) < _THERE
    lost = {int(k): _ELSEWHERE for k in np.nonzero(~there & after.prediction.solved)[0]}
    unsolved = np.nonzero(~after.prediction.solved)[0].tolist()
    return lost | {k: search.limits.get(k, after.prediction.reason(k)) for k in unsolved} | search.failed


def _beyond(model: Model, rows: Rows, failed: dict[int, str]) -> dict[int, str]:
    """The same for set values beyond limits of travel, whatever the redundancy is used for."""
    out = dict(failed)
    for a, actuator in enumerate(model.actuators):
        excess = limit_excess(rows.readings[:, a], actuator.limits)
        unit = parse_unit(actuator.unit)
        low, high = (unit.format(v, 6) for v in actuator.limits)
        for k in np.nonzero(excess > 0)[0].tolist():
            at = unit.format(float(rows.readings[k, a]), 6)
            out.setdefault(k, f"travel limit of `{actuator.name}` ({low} to {high}): it would have to go to {at}")
    return out


def _unsettled(pose: StrainedPose, row: int) -> str:
    """Why a row does not come to its end."""
    slack = pose.prediction.slack.get(row)
    if slack:
        return f"no set values found: slack ropes ({', '.join(slack)}) do not hold the tool point there"
    return "no set values found: the tool point does not settle"


class _Search:
    """Newton's method for all rows: set values that move until the tool point is there and the forces have settled.

    A step counts that brings the tool point nearer, or after which the next one is shorter (Deuflhard 2004, natural
    monotonicity): ropes that tighten move the tool point first.
    """

    def __init__(self, redundancy: Redundancy, aim: Aim, rows: Rows) -> None:
        self.redundancy, self.aim, self.rows = redundancy, aim, rows
        self.failed: dict[int, str] = {}
        self.moving = np.ones(len(rows), dtype=bool)
        self.step = np.zeros((len(rows), len(redundancy.drives)))
        self.share = np.ones(len(rows))  # of a whole step that the last one was
        self.start: WarmStart  # states at the last poses that count
        self.away = np.full(len(rows), np.inf)  # how far the tool point was there from where it shall be
        self.length = np.full(len(rows), np.inf)  # of the whole step from there
        self.beyond: dict[int, list[str]] = {}  # bounds in the way of rows that cannot keep all
        self.binding: dict[int, list[str]] = {}  # bounds that hold rows
        self.limits: dict[int, str] = {}  # the same as reasons, at the end

    def run(self) -> None:
        """Search until no row moves; rows that do not end are `failed`.

        The first poses are compared with others, as the drives that are not redundant may not hold them.
        """
        tool, values, targets = self.redundancy.tool, self.redundancy.values, self.aim.targets
        pose = tool.at(values, self.rows, targets, "readings")
        self.start = pose.prediction.start
        for _ in range(_STEPS):
            self._advance(pose)
            if not self.moving.any():
                break
            pose = tool.at(values, self.rows, targets, "readings", self.start, compare=False)
        self._end(pose)

    def _advance(self, pose: StrainedPose) -> None:
        """One step of all rows that move; back by half where the last one led nowhere."""
        redundancy, drives = self.redundancy, self.redundancy.drives
        error = pose.tool - self.aim.targets
        away = np.nan_to_num(np.abs(error) / redundancy.tool.sizes, nan=np.inf).max(axis=1)
        step, optimum, names = redundancy.step(pose, self.rows.readings, error)
        length = np.abs(step / redundancy.spans).max(axis=1, initial=0.0)
        nearer = (away < _GROWN * self.away) | (away < _THERE) | (length < (1.0 - 0.25 * self.share) * self.length)
        good = pose.prediction.solved & nearer
        back, here = self.moving & ~good, np.nonzero(good)[0]
        self.start = self.start.put(here, pose.prediction.start.take(here))
        readings = self.rows.readings.copy()
        readings[np.ix_(np.nonzero(back)[0], drives)] -= 0.5 * self.step[back]
        self.step[back] *= 0.5
        self.share[back] *= 0.5
        for k in np.nonzero(back & (self.share < _SHORTEST))[0].tolist():
            self.failed[k] = _unsettled(pose, k) if pose.prediction.solved[k] else pose.prediction.reason(k)
            self.moving[k] = False
        converged = good & self._converged(pose, error, step)
        go = np.nonzero(self.moving & good & ~converged)[0]
        self.share[go] = np.minimum(2.0 * self.share[go], np.minimum(1.0, _LONGEST / np.maximum(length[go], 1e-300)))
        self.step[go], self.away[go], self.length[go] = self.share[go, None] * step[go], away[go], length[go]
        readings[np.ix_(go, drives)] += self.step[go]
        self.moving &= ~converged
        binding = {k: binding_names(names, optimum.binding[k]) for k in here.tolist()}
        exceeded = {k: some for k, some in binding.items() if optimum.excess[k] > _EXCEEDED}
        self.beyond = exceeded | {k: some for k, some in self.beyond.items() if not good[k]}
        self.binding |= binding
        self.rows = replace(self.rows, readings=readings)

    def _converged(self, pose: StrainedPose, error: Array, step: Array) -> NDArray[np.bool_]:
        """Rows (N,) whose tool point is there, and whose forces a further step (N, D) changes by rounding at most."""
        redundancy = self.redundancy
        there = (np.abs(error) < _EXACT * np.maximum(redundancy.tool.sizes, 1.0)).all(axis=1)
        changed = np.abs((pose.by_force[:, :, redundancy.drives] @ step[..., None])[..., 0])
        still = (changed < _CONVERGED * np.maximum(redundancy.internal.scale, np.abs(pose.force))).all(axis=1)
        rounding = (np.abs(step / redundancy.spans) < _ROUNDING).all(axis=1)
        return np.asarray(there & (still | rounding))

    def _end(self, pose: StrainedPose) -> None:
        """Why rows have no set values: no limits that are kept, or no end."""
        for k in np.nonzero(self.moving)[0].tolist():
            self.failed[k] = _unsettled(pose, k)
        held = self.binding | self.beyond
        self.limits = {k: f"{_LIMITED}: {', '.join(some)}" for k, some in held.items() if some}
        self.failed |= {k: self.limits.get(k, _unsettled(pose, k)) for k in self.beyond}
