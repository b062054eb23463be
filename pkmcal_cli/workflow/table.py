"""The table that `simulate` writes: the columns under which `calibrate` finds them again."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.unit_text import UnitError, parse_unit
from pkmcal_cli.model import Model
from pkmcal_cli.prediction import Prediction
from pkmcal_cli.rotation import Array
from pkmcal_cli.tables.columns import columns_of
from pkmcal_cli.tables.csv_sniff import split_header
from pkmcal_cli.tables.csv_write import Values

ENERGY = "strain_energy_J"


class SimulatedTable:
    """Columns of a machine's simulated readings.

    `given`: forces of force-controlled drives come from the poses' table; `asked`: forces of all drives and the
    energy are wanted.
    """

    def __init__(self, machine: Machine, model: Model, given: bool, asked: bool) -> None:
        self.asked = asked
        self.drives = [a for a, d in enumerate(model.layout.drives) if not d.force_controlled]
        known = {(c.name, c.role): c for c in columns_of(machine)}
        self.columns: list[tuple[str, str | None]] = [("id", None)]
        for a in self.drives:
            self._add(known[model.actuators[a].name, "actuator"].header, model.actuators[a].unit)
        for channel in model.channels:
            self._add(known[channel.name, "channel"].header, channel.unit)
        self.forces = [a for a in range(len(model.actuators)) if asked or (given and a not in self.drives)]
        self.scales = []
        for a in self.forces:
            column = known[f"{model.actuators[a].name}.force", "force"]
            self._add(column.header, column.unit)
            self.scales.append(column.scale)
        if asked:
            self.columns.append((ENERGY, None))

    def _add(self, header: str, unit: str | None) -> None:
        """A column; a header that names its unit itself keeps it."""
        cell = split_header(header)
        try:
            named = cell.unit is not None and parse_unit(cell.unit)
        except UnitError:
            named = False
        self.columns.append((cell.name, cell.unit) if named else (header, unit))

    def cells(
        self, ids: list[str], positions: Array, forces: Array, readings: Array, found: Prediction
    ) -> list[Values]:
        """Columns of solved rows: drive positions (N, A), given forces (N, A), readings (N, C)."""
        cells: list[Values] = [ids, *(positions[:, a] for a in self.drives), *readings.T]
        if self.asked:
            assert found.forces is not None and found.energy is not None
            forces = found.forces
        with np.errstate(invalid="ignore", divide="ignore"):
            cells += [forces[:, a] / scale for a, scale in zip(self.forces, self.scales, strict=True)]
        return [*cells, found.energy] if self.asked and found.energy is not None else cells
