"""Command, geometry, stiffness and load stages: the slots of every row, and how they depend on what is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.layout import Index
from pkmcal_cli.model import Model
from pkmcal_cli.prediction.effects import Displacements, displacements
from pkmcal_cli.prediction.rows import Request, Rows
from pkmcal_cli.rotation import Array


def stage_slots(model: Model, values: Array, rows: Rows) -> Array:
    """Command, geometry, stiffness and load stages: slots (N, S) of every row at parameter values (P,)."""
    return commanded_slots(model, model.layout.slots.values(model.by_name(values)), rows)


def commanded_slots(model: Model, base: Array, rows: Rows) -> Array:
    """Slots (N, S) of every row from those of the parameters (S,)."""
    slots: Array = np.empty((len(rows), len(base)), order="F")
    slots[:] = base
    for a, (drive, actuator) in enumerate(zip(model.layout.drives, model.actuators, strict=True)):
        if drive.force_controlled:
            given = rows.forces[:, a]
            force = np.where(np.isnan(given), base[actuator.force_slot], given)
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


def drawing_slots(model: Model) -> Array:
    """Slots (1, S) at nominal parameters with every drive at the assembled drawing."""
    return model.drawn_slots.copy()


@dataclass(frozen=True)
class Chain:
    """Chain rule from slots to the parameters that are asked for."""

    model: Model
    slots: Index  # (U,) slots that depend on them
    jacobian: Array | None  # (U, P') d slots / d parameters; None where none is asked for

    @classmethod
    def of(cls, model: Model, values: Array, request: Request) -> Chain:
        """The chain at parameter values (P,)."""
        if request.parameters is None:
            return cls(model, np.zeros(0, dtype=np.intp), None)
        full = model.layout.slots.jacobian(model.by_name(values), request.parameters)
        used = np.nonzero(full.any(axis=1))[0]
        return cls(model, used, full[used])

    def apply(self, rows: Rows, slots: Array, by_slot: Array, moved: Displacements) -> tuple[Array | None, Array]:
        """Derivatives by slot (N, C, S) to those by parameter (N, C, P') and by drive reading (N, C, A).

        Effects and then the command stage add their share to `by_slot`.
        """
        jacobian = None if self.jacobian is None else np.zeros((*by_slot.shape[:2], self.jacobian.shape[1]))
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
            jacobian += by_slot[..., self.slots] @ self.jacobian
        return jacobian, by_drive
