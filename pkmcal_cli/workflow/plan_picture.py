"""The picture of a plan: where its points are, and what they show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.experiment_design import Plan
from pkmcal_cli.language.tool_point import tool_point_of
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.pictures.analysis_pictures import PlannedPositions, plan_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.touching import tcp_places
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.plots import Plot


@dataclass(frozen=True)
class PlannedRows:
    """Parameter values (P,), SI, rows of the plan, if it has some, and rows that are added, if any are."""

    values: Array
    planned: Rows | None
    added: Rows | None


def draw_plan(
    plot: Plot | None, plan: Plan | None, loaded: LoadedMachine, rows: PlannedRows, to: Reporter
) -> None:
    """Write the picture, if any; `plan`: None where points are chosen for a table that grows. Raises OutputError."""
    if plot is not None:
        named = titles(loaded.model.name, "plan", plot.tables)
        plot.write(plan_picture(plan, named, loaded.machine.file_units, _places(loaded, rows)), to)


def _places(loaded: LoadedMachine, rows: PlannedRows) -> PlannedPositions | None:
    """Poses of the tool point; None without one."""
    if tool_point_of(loaded.machine) is None:
        return None
    names = [channel.name for channel in tcp_model(loaded.model).channels]
    columns = [DIRECTIONS.index(name) for name in names]
    places_of = []
    for part in (rows.planned, rows.added):
        some = part is not None and len(part) > 0
        values = rows.values[: len(loaded.model.parameters)]
        places = tcp_places(loaded.model, values, part)[:, columns] if part is not None and some else None
        places_of.append(np.zeros((0, len(names))) if places is None else places[np.isfinite(places).all(axis=1)])
    return PlannedPositions(places_of[0], places_of[1], tuple(names))
