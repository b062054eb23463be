"""Rows of a simulation, kept for its picture."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.pictures.simulation_picture import Simulated, simulation_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Request, Rows, WarmStart, predict
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.workflow.arguments import checked_method
from pkmcal_cli.workflow.plots import write_plot

_MOST = 200_000  # rows


@dataclass(kw_only=True)
class KeptRows:
    """Readings, forces, tool points and uncertainties of solved rows, block by block."""

    model: Model
    values: Array
    method: str
    forces_asked: bool
    plot: str | None  # file of the picture; None: nothing is kept
    tables: Sequence[str]
    force: bool
    tool: list[Array] = field(default_factory=list)
    readings: list[Array] = field(default_factory=list)
    forces: list[Array] = field(default_factory=list)
    uncertainty: list[Array] = field(default_factory=list)
    count: int = 0

    def add(self, rows: Rows, readings: Array, forces: Array | None, u: list[Array], start: WarmStart) -> None:
        """Keep solved rows; u: standard uncertainties (N,) of the tool point's coordinates, or none."""
        if self.plot is None or self.count >= _MOST or not len(rows):
            return
        self.count += len(rows)
        full = tcp_model(self.model)
        prediction = predict(full, self.values, rows, Request(checked_method(self.method)), start)
        self.tool.append(prediction.values[:, full.measuring(Measurand.POSITION)])
        self.readings.append(readings)
        if forces is not None and self.forces_asked:
            self.forces.append(forces)
        if u:
            positions = [u[k] for k in full.measuring(Measurand.POSITION)]
            self.uncertainty.append(np.sqrt(np.sum(np.square(positions), axis=0)))

    def draw(self, loaded: LoadedMachine, inputs: Collection[str], to: Reporter) -> None:
        """The picture of all of them, where it is wanted. Raises OutputError."""
        if self.plot is not None:
            named = titles(loaded.model.name, "simulation", self.tables)
            picture = simulation_picture(self.simulated, named, loaded.machine.file_units.length)
            write_plot(picture, self.plot, inputs, to, force=self.force)

    @property
    def simulated(self) -> Simulated:
        """All of them."""
        names = [c.name for c in tcp_model(self.model).channels if c.measurand is Measurand.POSITION]
        none = np.zeros((0, len(names)))
        return Simulated(
            model=self.model,
            coordinates=tuple(names),
            tool=np.vstack([none, *self.tool]),
            readings=np.vstack([np.zeros((0, len(self.model.channels))), *self.readings]),
            forces=np.vstack(self.forces) if self.forces else None,
            uncertainty=np.concatenate(self.uncertainty) if self.uncertainty else None,
        )
