"""A machine of pinned rods: set values to poses (energy minimum) and poses to set values. SI units
throughout."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from . import pinned
from .pinned import Array, DeadForce, Rods, State

Parameters = Mapping[str, float]


@dataclass(frozen=True)
class Forward:
    """N rows: `tcp` (N, freedoms of the platform) in m and rad (rotation vector), `travel` (N, drives) in m,
    elastic `energy` (N,) in J, `tension` (N, rods) in N, positive when pulled, `drive_force` (N, drives) in N
    towards greater travel."""

    tcp: Array
    travel: Array
    energy: Array
    tension: Array
    drive_force: Array


@dataclass(frozen=True, kw_only=True)
class Machine:
    """A machine of pinned rods.

    `rods(p)`: its rods for parameters p. `guess(q, p)`: platform position (3,) near the solution, without
    turn. `inverse_row(tcp, p)`: drive positions without strain for one pose. `redundant`: drives outside the
    non-redundant substructure. `weight`: force (3,) in N on the platform's origin.
    """

    name: str
    drives: tuple[str, ...]
    redundant: tuple[str, ...]
    freedoms: tuple[int, ...]
    channels: tuple[str, ...]
    nominal: Parameters
    ranges: Parameters
    rods: Callable[[Parameters], Rods]
    guess: Callable[[Array, Parameters], Array]
    inverse_row: Callable[[Array, Parameters], Array]
    weight: tuple[float, float, float] = (0.0, 0.0, 0.0)
    loads: tuple[DeadForce, ...] = field(init=False)

    def __post_init__(self) -> None:
        loads = (DeadForce(np.array(self.weight), np.zeros(3)),) if any(self.weight) else ()
        object.__setattr__(self, "loads", loads)

    def completed(self, parameters: Parameters | None) -> dict[str, float]:
        """Nominal values, replaced by the given ones."""
        unknown = set(parameters or {}) - set(self.nominal)
        if unknown:
            raise KeyError(f"{self.name} has no parameter {sorted(unknown)}")
        return {**self.nominal, **(parameters or {})}

    def solve(
        self,
        q: ArrayLike,
        parameters: Parameters | None = None,
        force: Mapping[str, float] | None = None,
        stiffness: Mapping[str, float] | None = None,
        loads: Sequence[DeadForce] = (),
    ) -> pinned.Equilibrium:
        """Equilibrium of one row; `q` (drives,) in m. See `forward`."""
        values = self.completed(parameters)
        travel = np.asarray(q, float)
        start = State.at(self.guess(travel, values), travel)
        column = self.drives.index
        return pinned.minimise(
            self.rods(values),
            start,
            self.freedoms,
            (*self.loads, *loads),
            {column(name): value for name, value in (force or {}).items()},
            {column(name): value for name, value in (stiffness or {}).items()},
        )

    def forward(
        self,
        q: ArrayLike,
        parameters: Parameters | None = None,
        force: Mapping[str, float] | None = None,
        stiffness: Mapping[str, float] | None = None,
        loads: Sequence[DeadForce] = (),
    ) -> Forward:
        """Poses for set values `q` (N, drives) in m, in the order of `drives`.

        `force`: drives under force control, with their constant force in N, positive where it pushes towards
        greater travel; their columns of `q` are only the start, their travel is an output. `stiffness`:
        drives that yield about their set value, in N/m. `loads`: dead forces on points of the platform.
        """
        found = [self.solve(row, parameters, force, stiffness, loads) for row in np.atleast_2d(q)]
        poses = [
            np.concatenate([e.state.position, pinned.rotation_vector(e.state.rotation)])[list(self.freedoms)]
            for e in found
        ]
        return Forward(
            np.array(poses, float),
            np.array([e.state.travel for e in found], float),
            np.array([e.energy for e in found]),
            np.array([e.tension for e in found], float),
            np.array([e.drive_force for e in found], float),
        )

    def inverse(self, tcp: ArrayLike, parameters: Parameters | None = None) -> Array:
        """Drive positions (N, drives) in m without strain and without weight, for TCP positions (N, 2 or 3)
        in m and no turn of the platform."""
        values = self.completed(parameters)
        poses = np.atleast_2d(np.asarray(tcp, float))
        return np.array([self.inverse_row(row, values) for row in poses])
