"""Effects in the pipeline: displacements of their sockets in every row, and the chain rule to their parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import WIDTHS
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.effect_sites import PlacedEffect, Socket
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.inputs import Reactions, SocketInputs
from pkmcal_cli.prediction.rows import Rows

_STEP = 1e-40


@dataclass(frozen=True)
class Displacement:
    """Of one socket: d (N, W); derivatives (N, W, P) with respect to asked parameters, numbered by `columns` (P,);
    by_reading (N, W, A) with respect to the readings of drives, None where they do not matter.
    """

    socket: Socket
    d: Array
    by_parameter: Array
    columns: Index
    by_reading: Array | None

    def take(self, rows: slice) -> Displacement:
        """Some rows."""
        by_reading = None if self.by_reading is None else self.by_reading[rows]
        return Displacement(self.socket, self.d[rows], self.by_parameter[rows], self.columns, by_reading)


@dataclass(frozen=True)
class Displacements:
    """All displacements of a table."""

    slots: tuple[Displacement, ...] = ()

    def take(self, rows: slice) -> Displacements:
        """Some rows."""
        return Displacements(tuple(d.take(rows) for d in self.slots))

    def apply(self, slots: Array) -> None:
        """Displace slots (N, S) in place."""
        for each in self.slots:
            mine, moved = each.socket.slots, each.d @ each.socket.matrix.T
            slots[:, mine] = slots[:, mine] * np.exp(moved) if each.socket.scales else slots[:, mine] + moved

    def chain(self, slots: Array, by_slot: Array, jacobian: Array | None, by_drive: Array) -> None:
        """Add what the effects' parameters do to `jacobian` (N, C, P'), and what readings do to `by_drive` (N, C, A).

        Afterwards `by_slot` (N, C, S) is that with respect to the slots before they are displaced.
        """
        for each in self.slots:
            mine = each.socket.slots
            by_moved = by_slot[..., mine] * slots[:, None, mine] if each.socket.scales else by_slot[..., mine]
            by_d = by_moved @ each.socket.matrix  # (N, C, W)
            if jacobian is not None and len(each.columns):
                jacobian[..., each.columns] += by_d @ each.by_parameter
            if each.by_reading is not None:
                by_drive += by_d @ each.by_reading
        for each in self.slots:
            if each.socket.scales:
                moved = each.d @ each.socket.matrix.T
                by_slot[..., each.socket.slots] *= np.exp(moved)[:, None]


def displacements(
    model: Model, values: Array, rows: Rows, parameters: Sequence[str], reactions: Reactions | None
) -> Displacements:
    """Displacements of all effects at parameter values (P,); without `reactions` those that need none."""
    numbers = model.by_name(values)
    slots: list[Displacement] = []
    asked = {name: k for k, name in enumerate(parameters)}
    for placed in model.effects:
        if placed.effect.reactive and reactions is None:
            continue
        mine = [numbers[name] for name in placed.parameters]
        if not any(mine) and not any(name in asked for name in placed.parameters):
            continue
        for socket in placed.sockets:
            at = SocketInputs(socket, model, rows, placed, reactions)
            slots.append(_displacement(model, placed, at, mine, asked))
    return Displacements(tuple(slots))


def _displacement(
    model: Model, placed: PlacedEffect, at: SocketInputs, mine: list[float], asked: dict[str, int]
) -> Displacement:
    """One socket's; only in the rows of the session where the effect belongs to one."""
    planar = model.layout.planar
    on = _rows_of(placed, at)
    d = np.asarray(placed.effect.displacement(at, mine, planar), dtype=float) * on
    chosen = [k for k, name in enumerate(placed.parameters) if name in asked]
    by_parameter = np.zeros((*d.shape, len(chosen)))
    for j, k in enumerate(chosen):
        stepped = [value + 1j * _STEP * (i == k) for i, value in enumerate(mine)]
        by_parameter[..., j] = np.imag(placed.effect.displacement(at, stepped, planar)) / _STEP * on
    columns = np.array([asked[placed.parameters[k]] for k in chosen], dtype=np.intp)
    by_reading = None
    if d.any():
        by_reading = _by_reading(placed, at, mine, planar) * np.reshape(on, (-1, 1, 1))
        if at.reactions is not None and placed.effect.reactive:
            by_pull = _step_in(placed, replace(at, pull_step=1j * _STEP), mine, planar) * on
            by_parameter, columns = _with_reaction(by_parameter, columns, by_pull, at, len(asked))
            by_reading = by_reading + _of_reaction(by_pull, at, at.reactions.by_drive)
    return Displacement(at.socket, d, by_parameter, columns, by_reading)


def _by_reading(placed: PlacedEffect, at: SocketInputs, mine: list[float], planar: bool) -> Array:
    """Derivative (N, W, A) by the reading of the socket's own drive."""
    out = np.zeros((at.rows, WIDTHS[placed.effect.port], len(at.model.actuators)))
    if at.socket.actuator >= 0:
        out[..., at.socket.actuator] = _step_in(placed, replace(at, step=1j * _STEP), mine, planar)
    return out


def _step_in(placed: PlacedEffect, stepped: SocketInputs, mine: list[float], planar: bool) -> Array:
    return np.asarray(np.imag(placed.effect.displacement(stepped, mine, planar)) / _STEP)


def _of_reaction(by_pull: Array, at: SocketInputs, by: Array | None) -> Array | float:
    """What a displacement's force (by_pull (N, W)) hands on of its derivatives (N, R, k): (N, W, k)."""
    if by is None or at.reactions is None:
        return 0.0
    return np.asarray(by_pull[..., None] * by[:, at.reactions.places.index(at.socket.place), None])


def _with_reaction(
    by_parameter: Array, columns: Index, by_pull: Array, at: SocketInputs, asked: int
) -> tuple[Array, Index]:
    """Derivatives by all asked parameters, since they change the force."""
    if not asked or at.reactions is None:
        return by_parameter, columns
    out = np.zeros((*by_parameter.shape[:2], asked)) + _of_reaction(by_pull, at, at.reactions.jacobian)
    out[..., columns] += by_parameter
    return out, np.arange(asked)


def _rows_of(placed: PlacedEffect, at: SocketInputs) -> NDArray[np.float64] | float:
    session = placed.at if placed.effect.places == "session" else placed.session
    if not session:
        return 1.0
    return np.asarray(at.table.columns.get(f"session.{session}", np.zeros(at.rows)))[:, None]
