"""Observability."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import pandas as pd

from pkmcal_cli.base.listener import Record
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.workflow.analysis import AnalysisRequest, Observed, observability_drawn, observed

from .computing import computing
from .machine import Machine, load
from .options import Names, names_of
from .result import Result, messages_of
from .tables import Parameters, Table, frame_of, parameters_of, source_of


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Observability(Result):
    """What a plan of measurements would determine."""

    outcome: Observed  # not stable
    asked: AnalysisRequest  # not stable

    @property
    def ok(self) -> bool:
        """Whether anything is determined, and all that was named."""
        return self.rank > 0 and not self.outcome.missed

    @property
    def verdict(self) -> str:
        """How much is determined."""
        return f"rank {self.rank} of {len(self.outcome.result.selected)}, condition number {self.condition_number:.4g}"

    @property
    def rank(self) -> int:
        """Number of combinations of parameters that are determined."""
        return self.outcome.result.directions.rank

    @property
    def condition_number(self) -> float:
        """Of the range-scaled Jacobian, whitened; nan for none."""
        return float(self.outcome.result.directions.condition_number)

    @property
    def indices(self) -> Mapping[str, float]:
        """The observability indices O1 to O5."""
        return MappingProxyType(dict(self.outcome.result.indices))

    @property
    def parameters(self) -> pd.DataFrame:
        """Expected standard uncertainty `std` by parameter, that of the data alone, and range, in `unit`."""
        result, model = self.outcome.result, self.outcome.problem.model
        rows = []
        for name, std, alone in zip(result.selected, result.std, result.alone, strict=True):
            unit, half = parameter_unit(model, name), model.parameters[model.names.index(name)].range
            rows.append((name, std / unit.scale, alone / unit.scale, half / unit.scale, unit.text))
        head = ["name", "std", "std_of_data", "range", "unit"]
        return pd.DataFrame(rows, columns=head).set_index("name")

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Combinations of parameters that are not told apart, in words."""
        return tuple(text for c in self.outcome.result.undetermined for text in c.texts)

    @property
    def table(self) -> pd.DataFrame:
        """Drive readings of the positions that were used."""
        rows, model = self.outcome.problem.rows, self.outcome.problem.model
        columns = [(a.name, a.unit) for a in model.actuators]
        return frame_of(columns, list(rows.readings.T))

    def json(self) -> dict[str, Any]:
        """What `pkmcal observability --json` says."""
        return self.outcome.json()

    def _picture(self) -> Picture:
        return observability_drawn(self.asked, self.outcome)


def observe(
    machine: str | os.PathLike[str] | Machine,
    poses: Table | None = None,
    *,
    grid: str | None = None,
    parameters: Parameters | None = None,
    select: Names = "auto",
    offset: Mapping[str, str] | None = None,
) -> Observability:
    """What will these positions determine, how well, what can they not separate? As `pkmcal observability`.

    offset: by actuator, how far it is moved off its set value: `{"q1": "50 um"}`. Raises PkmcalError.
    """
    known = load(machine)
    moved = None if offset is None else tuple(f"{name}={amount}" for name, amount in offset.items())
    request = AnalysisRequest(
        machine=known.file, poses=None if poses is None else source_of(poses, "poses"), grid=grid,
        parameters=parameters_of(parameters), select=names_of(select), offset=moved,
    )  # fmt: skip
    record = Record()
    with computing():
        observation = observed(request, record, known.loaded)
        observation.loads.show(record)
    return Observability(machine=known, outcome=observation, asked=request, **messages_of(record))
