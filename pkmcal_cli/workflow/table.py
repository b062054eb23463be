"""The table that `simulate` writes: the columns under which `calibrate` finds them again; those of poses for others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.csv_files.dialect import split_header
from pkmcal_cli.csv_files.writer import Values
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.commanded import forced
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Rows
from pkmcal_cli.tables.columns import columns_of, temperature_column
from pkmcal_cli.units.unit_text import UnitError, parse_unit

ENERGY = "strain_energy_J"


class PosedTable:
    """Columns that say where a machine's drives are and under which circumstances.

    `forces_stated`: forces of force-controlled drives come from the poses' table; `joined`: rows name others;
    `covariates`: time, temperatures, directions ... that the table has, and sessions.
    """

    def __init__(
        self, machine: Machine, model: Model, forces_stated: bool, covariates: Sequence[str], joined: bool = False
    ) -> None:
        self.machine, self.model, self.joined = machine, model, joined
        self.covariates, self.sessions = [n for n in covariates if n != "session"], "session" in covariates
        self.drives = [a for a, d in enumerate(model.topology.drives) if not d.force_controlled]
        pulling = [a for a in range(len(model.actuators)) if a not in self.drives]
        stated = [machine.actuators[a.name].force for a in model.actuators]
        self.unstated = [a for a in pulling if (force := stated[a]) is None or force.otherwise is None]
        self.forces = pulling if forces_stated else self.unstated
        self.known = {(c.name, c.role): c for c in columns_of(machine)}
        self.columns: list[tuple[str, str | None]] = [("id", None)]
        self.columns += [("session", None)] if self.sessions else []
        self.columns += [("to", None)] if joined else []
        for name in self.covariates:
            column = self.known.get((name, "covariate")) or temperature_column(name, machine)
            assert column is not None
            self._add(column.header, column.unit)
        for a in self.drives:
            self._add(self.known[model.actuators[a].name, "actuator"].header, model.actuators[a].unit)

    def _add_forces(self) -> None:
        self.scales = []
        for a in self.forces:
            column = self.known[f"{self.model.actuators[a].name}.force", "force"]
            self._add(column.header, column.unit)
            self.scales.append(column.scale)

    def pose_cells(self, ids: list[str], rows: Rows) -> list[Values]:
        """Columns of rows, but for forces."""
        cells: list[Values] = [ids]
        if self.sessions:
            cells.append([rows.session_names[k] for k in rows.session])
        if self.joined:
            partner = np.full(len(rows), -1) if rows.partner is None else rows.partner
            cells.append([ids[k] if k >= 0 else "" for k in partner])
        return [*cells, *(rows.columns[n] for n in self.covariates), *(rows.readings[:, a] for a in self.drives)]

    def force_cells(self, forces: Array) -> list[Values]:
        """Columns of forces (N, A); a drive whose force nobody states pulls with none."""
        forces = forces.copy()
        forces[:, self.unstated] = np.nan_to_num(forces[:, self.unstated])
        with np.errstate(invalid="ignore", divide="ignore"):
            return [forces[:, a] / scale for a, scale in zip(self.forces, self.scales, strict=True)]

    def _add(self, header: str, unit: str | None) -> None:
        """A column; a header that names its unit itself keeps it."""
        cell = split_header(header)
        if unit is not None and cell.unit == parse_unit(unit).text:
            self.columns.append((cell.name, unit))
            return
        try:
            named = cell.unit is not None and parse_unit(cell.unit)
        except UnitError:
            named = False
        self.columns.append((cell.name, cell.unit) if named else (header, unit))


def force_columns(machine: Machine, model: Model, forces: Array) -> list[tuple[str, str | None, Values]]:
    """Headers, units and cells (N,) of commanded forces (N, A): what the machine file leaves to a table, or one has."""
    table = PosedTable(machine, model, bool(np.isfinite(forces[:, forced(model)]).any()), ())
    others = len(table.columns)
    table._add_forces()
    heads = table.columns[others:]
    return [(*head, cells) for head, cells in zip(heads, table.force_cells(forces), strict=True)]


class SimulatedTable(PosedTable):
    """Columns of a machine's simulated readings; `asked`: forces of all drives and the energy are wanted."""

    def __init__(
        self,
        machine: Machine,
        model: Model,
        forces_stated: bool,
        asked: bool,
        covariates: Sequence[str],
        joined: bool = False,
    ) -> None:
        super().__init__(machine, model, forces_stated, covariates, joined)
        self.asked = asked
        self.read = [k for k, c in enumerate(model.channels) if np.isnan(c.once)]  # not what was measured once
        for k in self.read:
            channel = model.channels[k]
            self._add(self.known[channel.name, "channel"].header, channel.unit)
        self.forces = list(range(len(model.actuators))) if asked else self.forces
        self._add_forces()
        if asked:
            self.columns.append((ENERGY, None))

    def cells(self, ids: list[str], rows: Rows, readings: Array, prediction: Prediction) -> list[Values]:
        """Columns of solved rows and their readings (N, C)."""
        cells, forces = [*self.pose_cells(ids, rows), *readings[:, self.read].T], rows.forces
        if self.asked:
            assert prediction.forces is not None and prediction.energy is not None
            forces = prediction.forces
        cells += self.force_cells(forces)
        return [*cells, prediction.energy] if self.asked and prediction.energy is not None else cells
