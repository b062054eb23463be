"""What the freedom of redundant drives is used for, as a quadratic programme in steps of their set values.

Of the steps that keep the tool point where it shall be, those of least sum of (f / force_limit)^2, of least strain
energy, with a given internal force, or with given set values of the redundant drives.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.internal_force import InternalForces, conjugate_gains
from pkmcal_cli.correction.quadratic_programme import Optimum, Programme, solve
from pkmcal_cli.correction.strained_pose import LoadedTool, StrainedPose, held_drives
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.units.unit_text import parse_unit

Choice = Literal["min-force", "min-energy", "preload", "nominal"]
BOUNDED: tuple[Choice, ...] = ("min-force", "min-energy")
"""Choices that keep limits of force and tension."""
_NO_RESISTANCE = 1e-9  # of the largest change of force by a step: less is none
_TAUT = 1e-6  # share by which tensions stay above, and forces below, their limits: rounding does not break them


@dataclass(frozen=True)
class Bounds:
    """Linear bounds A step <= b of all rows, A (n, c, D), b (n, c); `names` (c,) in words."""

    matrix: Array
    bound: Array
    names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Redundancy:
    """How the redundant drives of a machine are set.

    aimed_forces (N, A): internal forces, for `preload`; set_values (N, A): for `nominal`; internal: of all rows.
    """

    tool: LoadedTool
    values: Array
    choice: Choice
    internal: InternalForces
    aimed_forces: Array
    set_values: Array

    @cached_property
    def drives(self) -> Index:
        """Drives that have set values, (D,)."""
        return held_drives(self.tool.machine)

    @cached_property
    def spans(self) -> Array:
        """Readings (D,) that move each drive by the size of the machine, or by 1 rad."""
        model = self.tool.machine
        lengths = [model.topology.moves_length(model.topology.drives[a]) for a in self.drives]
        return np.where(lengths, model.length, 1.0) / model.gains[self.drives]

    def step(self, pose: StrainedPose, readings: Array, error: Array) -> tuple[Array, Optimum, tuple[str, ...]]:
        """Steps (N, D) of set values from readings (N, A) that remove errors (N, h), and the optimum of the rest.

        Also its bounds in words: of ropes, those are bounds whose tensions some row can change there.
        """
        jacobian = pose.by_tool[:, :, self.drives] * self.spans / self.tool.sizes[:, None]
        jacobian = np.nan_to_num(jacobian)
        _, _, right = np.linalg.svd(jacobian)
        there = -(np.linalg.pinv(jacobian) @ np.nan_to_num(error / self.tool.sizes)[..., None])[..., 0] * self.spans
        free = np.swapaxes(right[:, len(self.tool.held) :], 1, 2) * self.spans[:, None]  # (N, D, r)
        free = self._in_forces(pose, free)
        bounds = self._bounds(pose, readings)
        optimum = solve(self._programme(pose, readings, there, free, bounds))
        return there + (free @ optimum.y[..., None])[..., 0], optimum, bounds.names

    def _in_forces(self, pose: StrainedPose, free: Array) -> Array:
        """The same directions, of which a unit changes the forces by one scale, each other ones."""
        changed = np.nan_to_num(pose.by_force[:, :, self.drives] / self.internal.scale[:, None]) @ free
        size = np.abs(changed).max(axis=(1, 2), initial=0.0, keepdims=True)
        size[size == 0.0] = 1.0
        upper = np.asarray(np.linalg.qr(changed / size, mode="r"))  # (N, r, r)
        weak = (np.abs(np.einsum("nkk->nk", upper)) < _NO_RESISTANCE).astype(float)  # motions that no force resists
        upper = upper + weak[:, :, None] * np.eye(free.shape[2])
        return np.asarray(np.swapaxes(np.linalg.solve(np.swapaxes(upper, 1, 2), np.swapaxes(free, 1, 2)), 1, 2) / size)

    def _programme(self, pose: StrainedPose, readings: Array, there: Array, free: Array, bounds: Bounds) -> Programme:
        curvature, slope = self._objective(pose, readings, there, free)
        matrix = bounds.matrix @ free
        room = bounds.bound - (bounds.matrix @ there[..., None])[..., 0]
        return Programme(curvature=curvature, slope=slope, matrix=matrix, bound=room)

    def _objective(self, pose: StrainedPose, readings: Array, there: Array, free: Array) -> tuple[Array, Array]:
        """Curvature (N, r, r) and slope (N, r) of what is made least, by amounts of the free steps."""
        by_force = np.nan_to_num(pose.by_force[:, :, self.drives])
        if self.choice == "min-energy":
            work = by_force[:, self.drives] * conjugate_gains(self.tool.machine, self.values)[self.drives, None]
            work = 0.5 * (work + np.swapaxes(work, 1, 2))
            slope = np.nan_to_num(pose.by_energy[:, self.drives]) + (work @ there[..., None])[..., 0]
            back = np.swapaxes(free, 1, 2)
            return back @ work @ free, (back @ slope[..., None])[..., 0]
        if self.choice == "nominal":
            redundant = [k for k, a in enumerate(self.drives) if self.tool.machine.topology.drives[a].redundant]
            left = ((readings - self.set_values)[:, self.drives] + there) / self.spans
            return _squares(free[:, redundant] / self.spans[redundant][:, None], left[:, redundant])
        moved = by_force @ free
        forces = np.nan_to_num(pose.force) + (by_force @ there[..., None])[..., 0]
        if self.choice == "preload":
            return _squares(self.internal.amounts(moved), self.internal.amounts(forces - self.aimed_forces))
        return _squares(moved / self.internal.scale[:, None], forces / self.internal.scale)

    def _bounds(self, pose: StrainedPose, readings: Array) -> Bounds:
        """Limits of travel, of force and of tension that a step has to keep, each in its own size."""
        parts = [*self._travel(readings), *self._force(pose), *self._tension(pose)] if self.choice in BOUNDED else []
        if not parts:
            return Bounds(np.zeros((len(readings), 0, len(self.drives))), np.zeros((len(readings), 0)), ())
        matrix, bound, names = zip(*parts, strict=True)
        return Bounds(np.stack(matrix, axis=1), np.stack(bound, axis=1), names)

    def _travel(self, readings: Array) -> list[tuple[Array, Array, str]]:
        out = []
        for k, a in enumerate(self.drives):
            actuator = self.tool.machine.actuators[a]
            unit = parse_unit(actuator.unit)
            for sign, limit in ((-1.0, actuator.limits[0]), (1.0, actuator.limits[1])):
                if np.isfinite(limit):
                    row = np.zeros((len(readings), len(self.drives)))
                    row[:, k] = sign / self.spans[k]
                    room = (sign * (limit - readings[:, a])) / self.spans[k]
                    out.append((row, room, f"travel limit of `{actuator.name}` ({unit.format(limit, 6)})"))
        return out

    def _force(self, pose: StrainedPose) -> list[tuple[Array, Array, str]]:
        out = []
        for a in self.drives:
            actuator = self.tool.machine.actuators[a]
            limit = actuator.force_limit * (1 - _TAUT)
            for sign in (-1.0, 1.0) if np.isfinite(limit) else ():
                row = sign * np.nan_to_num(pose.by_force[:, a][:, self.drives]) / limit
                room = 1.0 - sign * np.nan_to_num(pose.force[:, a]) / limit
                out.append((row, room, f"`force_limit` of `{actuator.name}`"))
        return out

    def _tension(self, pose: StrainedPose) -> list[tuple[Array, Array, str]]:
        """Ropes whose tension drives can change stay taut, by their `t_min` or at least just so."""
        out = []
        scale = float(np.min(self.internal.scale))
        for k, (g, e, name) in enumerate(self.tool.ropes):
            slope = np.nan_to_num(pose.by_tension[:, k][:, self.drives])
            if slope.any():
                stated = [t for t in self.tool.machine.least_tensions if t.member == (g, e)]
                least = max((t.tension / t.weight for t in stated), default=0.0)
                size = max(least, scale)
                room = (np.nan_to_num(pose.tension[:, k]) - least * (1 + _TAUT)) / size
                which = stated[0].name if stated else name
                limit = f"`t_min` of rope `{which}`" if stated else f"rope `{which}`, which would be slack"
                out.append((-slope / size, room, limit))
        return out


def _squares(matrix: Array, left: Array) -> tuple[Array, Array]:
    """Curvature and slope of 1/2 |matrix y + left|^2."""
    back = np.swapaxes(matrix, 1, 2)
    return np.asarray(back @ matrix), np.asarray((back @ left[..., None])[..., 0])


def binding_names(names: tuple[str, ...], binding: NDArray[np.bool_]) -> list[str]:
    """Which bounds hold a row, (c,), each once."""
    return list(dict.fromkeys(n for n, on in zip(names, binding, strict=True) if on))
