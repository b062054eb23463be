"""Rows of a simulation, kept for its picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.pictures.simulation_picture import Simulated, simulation_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Request, Rows, WarmStart, predict
from pkmcal_cli.workflow.arguments import checked_method

_MOST = 200_000  # rows


@dataclass(kw_only=True)
class KeptRows:
    """Readings, forces, tool points and uncertainties of solved rows, block by block."""

    model: Model
    values: Array
    method: str
    forces_asked: bool
    drawable: bool  # else nothing is kept
    tables: Sequence[str]
    solved: list[tuple[Rows, WarmStart]] = field(default_factory=list)
    readings: list[Array] = field(default_factory=list)
    forces: list[Array] = field(default_factory=list)
    uncertainty: list[Array] = field(default_factory=list)
    count: int = 0

    def add(self, rows: Rows, readings: Array, forces: Array | None, u: list[Array], start: WarmStart) -> None:
        """Keep solved rows; u: standard uncertainties (N,) of the tool point's coordinates, or none."""
        if not self.drawable or self.count >= _MOST or not len(rows):
            return
        self.count += len(rows)
        self.solved.append((rows, start))
        self.readings.append(readings)
        if forces is not None and self.forces_asked:
            self.forces.append(forces)
        if u:
            self.uncertainty.append(np.column_stack(u))

    def picture(self, loaded: LoadedMachine) -> Picture:
        """All of them."""
        named = titles(loaded.model.name, "simulation", self.tables)
        return simulation_picture(self._simulated, named, loaded.machine.file_units)

    @property
    def _simulated(self) -> Simulated:
        full = tcp_model(self.model)
        asked, names = Request(method=checked_method(self.method)), [channel.name for channel in full.channels]
        tool = [predict(full, self.values, rows, asked, start).values for rows, start in self.solved]
        none = np.zeros((0, len(names)))
        return Simulated(
            model=self.model,
            coordinates=tuple(names),
            tool=np.vstack([none, *tool]),
            readings=np.vstack([np.zeros((0, len(self.model.channels))), *self.readings]),
            forces=np.vstack(self.forces) if self.forces else None,
            uncertainty=np.vstack(self.uncertainty) if self.uncertainty else None,
        )
