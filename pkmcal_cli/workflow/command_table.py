"""The table that `correct` writes: commands, which `simulate` reads again, and what they bring and cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.assessment import Assessment
from pkmcal_cli.csv_files.writer import Values
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.workflow.table import ENERGY, PosedTable


class CommandTable(PosedTable):
    """Columns of commands: first those that `simulate` reads, then errors, forces, energies, remarks."""

    def __init__(
        self, machine: Machine, model: Model, forces_stated: bool, covariates: Sequence[str], held: Sequence[str]
    ) -> None:
        super().__init__(machine, model, forces_stated, covariates)
        self._add_forces()
        units = machine.file_units
        for name in held:
            turning = name.startswith("r")
            small = "urad" if turning else "um"
            self.columns.append((f"target.{name}", (units.angle if turning else units.length).text))
            self.columns += [(f"{prefix}.{name}", small) for prefix in ("before", "u_before", "after", "u")]
        for drive, actuator in zip(model.topology.drives, model.actuators, strict=True):
            unit = "N" if model.topology.moves_length(drive) else "N m"
            self.columns += [(f"{prefix}.{actuator.name}", unit) for prefix in ("force", "u_force", "load", "internal")]
        self.columns += [(f"{ENERGY}_before", None), (ENERGY, None), ("remarks", None)]

    def cells(self, ids: list[str], result: Assessment) -> list[Values]:
        """Columns of the rows that have commands."""
        made, good = result.correction, result.correction.good
        remarks = result.remarks
        targets, open_ = made.aim.targets, np.full(made.aim.targets.shape, np.nan)
        cells = [*self.pose_cells(ids, made.rows.take(good)), *self.force_cells(made.rows.forces[good])]
        u_before = open_ if result.before is None else result.before.tool
        u_after = open_ if result.after is None else result.after.tool
        for k in range(targets.shape[1]):
            errors = (made.before.tool - targets, u_before, made.after.tool - targets, u_after)
            cells += [targets[good, k], *(e[good, k] for e in errors)]
        forces = made.after.force
        internal = made.internal.part(np.nan_to_num(forces))
        u_force: Array = np.full(forces.shape, np.nan) if result.after is None else result.after.force
        for a in range(forces.shape[1]):
            cells += [part[good, a] for part in (forces, u_force, forces - internal, internal)]
        cells += [made.before.energy[good], made.after.energy[good], [remarks[k] for k in good]]
        return cells
