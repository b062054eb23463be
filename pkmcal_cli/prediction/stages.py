"""Command, geometry, stiffness and load stages: the slots of every row, and how they depend on what is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.effects import Displacements, displacements
from pkmcal_cli.prediction.rows import Request, Rows


@dataclass(frozen=True)
class BaseSlots:
    """Slots (K, S) that parameters give, one line for each session that has parameters of its own, else one."""

    lines: Array
    sessions: tuple[str, ...]

    @classmethod
    def of(cls, model: Model, values: Array) -> BaseSlots:
        """At parameter values (P,)."""
        lines = [model.layout.slots.values(numbers) for numbers in model.by_session(values)]
        return cls(np.array(lines), model.sessions)

    def rows(self, rows: Rows) -> Array:
        """Slots (N, S) of rows, the row index running fastest."""
        out: Array = np.empty((len(rows), self.lines.shape[1]), order="F")
        out[:] = self.lines[0] if len(self.lines) == 1 else self.lines[rows.session_numbers(self.sessions)]
        return out

    @property
    def common(self) -> Array:
        """Slots (S,) of the mechanism: no session has its own of these."""
        return np.asarray(self.lines[0])


def commanded_slots(model: Model, given: BaseSlots, rows: Rows) -> Array:
    """Command, geometry, stiffness and load stages: slots (N, S) of every row from those of the parameters."""
    slots, base = given.rows(rows), given.common
    for a, (drive, actuator) in enumerate(zip(model.layout.drives, model.actuators, strict=True)):
        if drive.force_controlled:
            asked = rows.forces[:, a]
            force = np.where(np.isnan(asked), base[actuator.force_slot], asked)
            slots[:, drive.force_slot] += drive.force_sign * force
        else:
            slots[:, drive.slot] += base[actuator.gain_slot] * rows.readings[:, a]
    return slots


def drive_travels(model: Model, values: Array, readings: Array, rows: Rows) -> Array:
    """Travel (N, A) of every drive from reading zero at its reading (N, A), by its law and the effects on it, m or rad.

    Effects that need reactions are left out.
    """
    layout, table = model.layout, replace(rows, readings=np.nan_to_num(readings))
    base = layout.slots.values(model.by_name(values))
    gains = base[[a.gain_slot for a in model.actuators]]
    slots = np.tile(base, (len(table), 1))
    displacements(model, values, table, (), None).apply(slots)
    places = [drive.slot for drive in layout.drives]
    return np.asarray(readings * gains + slots[:, places] - base[places])


@dataclass(frozen=True)
class Chain:
    """Chain rule from slots to the parameters that are asked for."""

    model: Model
    slots: Index  # (U,) slots that depend on them
    jacobian: Array | None  # (K, U, P') d slots / d parameters, one for each session; None where none is asked for

    @classmethod
    def of(cls, model: Model, values: Array, request: Request) -> Chain:
        """The chain at parameter values (P,)."""
        if request.parameters is None:
            return cls(model, np.zeros(0, dtype=np.intp), None)
        shared = {p.name: (p.shared_name, p.session) for p in model.parameters}
        asked = [shared[name] for name in request.parameters]
        parts = []
        for session, numbers in zip(model.sessions or ("",), model.by_session(values), strict=True):
            names = list(dict.fromkeys(name for name, _ in asked))  # instances of one parameter share a column
            full = model.layout.slots.jacobian(numbers, names)[:, [names.index(name) for name, _ in asked]]
            parts.append(full * np.array([mine in ("", session) for _, mine in asked], dtype=float))
        every = np.stack(parts)
        used = np.nonzero(every.any(axis=(0, 2)))[0]
        return cls(model, used, every[:, used])

    def apply(self, rows: Rows, slots: Array, by_slot: Array, moved: Displacements) -> tuple[Array | None, Array]:
        """Derivatives by slot (N, C, S) to those by parameter (N, C, P') and by drive reading (N, C, A).

        Effects and then the command stage add their share to `by_slot`.
        """
        jacobian = None if self.jacobian is None else np.zeros((*by_slot.shape[:2], self.jacobian.shape[2]))
        by_drive = np.zeros((*by_slot.shape[:2], len(self.model.actuators)))
        moved.chain(slots, by_slot, jacobian, by_drive)
        for a, (drive, actuator) in enumerate(zip(self.model.layout.drives, self.model.actuators, strict=True)):
            if drive.force_controlled:
                given = np.isnan(rows.forces[:, a])[:, None] * drive.force_sign  # by the machine, not by a column
                by_slot[..., actuator.force_slot] += given * by_slot[..., drive.force_slot]
            else:
                by_drive[..., a] += by_slot[..., drive.slot] * slots[:, None, actuator.gain_slot]
                by_slot[..., actuator.gain_slot] += by_slot[..., drive.slot] * rows.readings[:, None, a]
        if jacobian is not None and self.jacobian is not None:
            lines = self.jacobian
            if len(lines) == 1:
                jacobian += by_slot[..., self.slots] @ lines[0]
            else:
                jacobian += by_slot[..., self.slots] @ lines[rows.session_numbers(self.model.sessions)]
        return jacobian, by_drive
