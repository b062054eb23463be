"""Where the tool point of a machine is at set values, and what that costs: forces, tensions, strain energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import ropes_of, with_loads
from pkmcal_cli.prediction import Prediction, Request, Rows, WarmStart, predict
from pkmcal_cli.prediction.turns import nearer_way_round
from pkmcal_cli.prediction.unknown_shapes import by_unknown_shapes

_ROTATION = ("rx", "ry", "rz")


@dataclass(frozen=True, kw_only=True)
class StrainedPose:
    """N rows: tool coordinates (N, h), as told nearest to what is wanted; forces (N, A); tensions (N, R); energy (N,).

    The same with `by_`: derivatives by drive readings (N, ., A), or by parameters (N, ., P) where these were asked for;
    empty where neither was.
    """

    prediction: Prediction
    tool: Array
    force: Array
    tension: Array
    energy: Array
    by_tool: Array
    by_force: Array
    by_tension: Array
    by_energy: Array

    def without(self, rows: Index) -> StrainedPose:
        """The same with nan in some rows."""
        kept = {name: getattr(self, name).copy() for name in ("tool", "force", "tension", "energy")}
        for numbers in kept.values():
            numbers[rows] = np.nan
        return replace(self, **kept)


@dataclass(frozen=True)
class LoadedTool:
    """A machine whose tool point is watched at coordinates `held`, with all its loads; `taut`: its ropes push too."""

    machine: Model
    held: tuple[str, ...]
    taut: bool = False

    @cached_property
    def model(self) -> Model:
        """The machine with channels of all that is watched."""
        return with_loads(self.machine, self.taut)

    @cached_property
    def ropes(self) -> tuple[tuple[int, int, str], ...]:
        """Group, element and name of every rope."""
        return ropes_of(self.machine)

    @property
    def turning(self) -> NDArray[np.bool_]:
        """Coordinates (h,) that are angles."""
        return np.array([name in _ROTATION for name in self.held])

    @property
    def sizes(self) -> Array:
        """Size (h,) of each coordinate: that of the machine, m, or 1 rad."""
        return np.where(self.turning, 1.0, self.machine.length)

    def at(
        self,
        values: Array,
        rows: Rows,
        targets: Array,
        by: Sequence[str] | str = "",
        start: WarmStart | None = None,
        compare: bool = True,
    ) -> StrainedPose:
        """At set values and parameters (P,); targets (N, h); `by`: "readings", or names of parameters."""
        names = None if isinstance(by, str) else tuple(by)
        request = Request(parameters=names, by_drive=by == "readings", forces=True, compare=compare)
        prediction = predict(self.model, values, rows, request, start)
        slopes = prediction.jacobian if names is not None else prediction.by_drive
        if slopes is None:
            slopes = np.zeros((*prediction.values.shape, 0))
        tool, by_tool = self._tool(prediction.values, slopes, targets)
        assert prediction.energy is not None and prediction.forces is not None
        force, tension, energy = self._loads
        return StrainedPose(
            prediction=prediction, tool=tool, by_tool=by_tool, force=prediction.values[:, force],
            by_force=slopes[:, force], tension=prediction.values[:, tension], by_tension=slopes[:, tension],
            energy=prediction.energy, by_energy=slopes[:, energy],
        )  # fmt: skip

    def by_unknown_shapes(self, values: Array, rows: Rows, targets: Array, there: Prediction) -> tuple[Array, Array]:
        """What shapes do not know between their knots, in standard deviations: to the tool (N, h, S), to forces."""
        slopes = by_unknown_shapes(self.model, values, rows, there.start)
        return self._tool(there.values, slopes, targets)[1], slopes[:, self._loads[0]]

    @cached_property
    def _loads(self) -> tuple[slice, slice, int]:
        """Channels of forces, tensions and energy."""
        last = len(self.model.channels) - 1
        first = last - len(self.ropes)
        return slice(first - len(self.machine.actuators), first), slice(first, last), last

    def _tool(self, values: Array, slopes: Array, targets: Array) -> tuple[Array, Array]:
        """Coordinates that are held and their derivatives; rotations told the way round that is wanted."""
        names = [c.name for c in self.model.channels]
        angles = [names.index(n) for n in _ROTATION if n in names]
        if len(angles) == 3:
            rotations = np.full((len(values), 3), np.nan)
            for k, name in enumerate(self.held):
                if name in _ROTATION:
                    rotations[:, _ROTATION.index(name)] = targets[:, k]
            values, slopes = values.copy(), slopes.copy()
            values[:, angles], by = nearer_way_round(values[:, angles], slopes[:, angles], rotations)
            assert by is not None
            slopes[:, angles] = by
        columns = [names.index(n) for n in self.held]
        tool = values[:, columns]
        if len(angles) == 1:  # in the plane an angle may count turns
            tool = tool + np.where(self.turning, 2 * np.pi * np.round((targets - tool) / (2 * np.pi)), 0.0)
        return tool, slopes[:, columns]


def held_drives(model: Model) -> Index:
    """Drives that hold a position: those that have set values."""
    return np.array([a for a, d in enumerate(model.topology.drives) if not d.force_controlled], dtype=np.intp)
