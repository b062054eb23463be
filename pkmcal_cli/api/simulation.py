"""Simulation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from pkmcal_cli.base.listener import Record
from pkmcal_cli.base.plural import count
from pkmcal_cli.csv_files.writer import Values
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.workflow.simulation import Simulation as Simulated
from pkmcal_cli.workflow.simulation import SimulationRequest, simulation

from .computing import computing
from .machine import Machine, load
from .options import whole
from .result import Result, messages_of
from .tables import Parameters, Table, frame_of, parameters_of, source_of


@dataclass
class _Rows:
    """Collects the columns of a table."""

    blocks: list[Sequence[Values]] = field(default_factory=list)

    def write(self, columns: Sequence[Values]) -> None:
        self.blocks.append(columns)

    def columns(self, count: int) -> list[Values]:
        """All blocks as one; without any, as many empty columns."""
        if not self.blocks:
            return [np.zeros(0)] * count
        return [np.concatenate([np.asarray(part) for part in parts]) for parts in zip(*self.blocks, strict=True)]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Simulation(Result):
    """What the instruments would read."""

    done: Simulated  # not stable
    rows: pd.DataFrame  # not stable: use `table`

    @property
    def ok(self) -> bool:
        """Whether all rows of the poses' table could be solved."""
        return not self.done.code

    @property
    def verdict(self) -> str:
        """How many rows."""
        tally = self.done.tally
        lost = f", {tally.n_failed} without a solution" if tally.n_failed else ""
        return f"{count(tally.rows, 'row')} simulated{lost}"

    @property
    def table(self) -> pd.DataFrame:
        """Poses and readings under the names and units of a measurement table, which `calibrate` takes."""
        return self.rows.copy()

    @property
    def failed(self) -> pd.DataFrame:
        """Rows without a solution: line, id, reason. Of points of a grid, only those that were told one by one."""
        rows = [(row_origin.line, row_origin.id, reason) for row_origin, reason in self.done.tally.failed]
        return pd.DataFrame(rows, columns=["line", "id", "reason"])

    def json(self) -> dict[str, Any]:
        """What `pkmcal simulate --json` says, without provenance."""
        return {name: value for name, value in self.done.json().items() if name != "output"}

    def _picture(self) -> Picture:
        return self.done.kept.picture(self.done.loaded)


def simulate(
    machine: str | os.PathLike[str] | Machine,
    poses: Table | None = None,
    *,
    grid: str | None = None,
    parameters: Parameters | None = None,
    method: str = "exact",
    noise: str = "none",
    seed: int = 0,
    forces: bool = False,
    uncertainty: bool = False,
) -> Simulation:
    """What would the instruments read at these positions? As `pkmcal simulate`. Raises PkmcalError."""
    known = load(machine)
    request = SimulationRequest(
        machine=known.file, poses=None if poses is None else source_of(poses, "poses"), grid=grid,
        parameters=parameters_of(parameters), method=method, noise=noise, seed=whole("seed", seed), forces=forces,
        uncertainty=uncertainty,
    )  # fmt: skip
    record, rows = Record(), _Rows()
    with computing():
        done = simulation(request, record, known.loaded, drawable=True)
        done.run(rows)
        done.tell(record)
    table = frame_of(done.columns, rows.columns(len(done.columns)))
    return Simulation(machine=known, done=done, rows=table, **messages_of(record))
