"""The table that `sensitivity -o` writes: by how much one coordinate moves at each position, for each parameter."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pkmcal_cli.base.files import is_stream
from pkmcal_cli.calibration.mean_sensitivity import Sensitivity
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.csv_files.writer import Values, open_writer
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.report.analysis_report import unit_along
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.workflow.pose_set import PoseSet

_PLACES = 12  # of m or rad: what is less is rounding


def write_shifts(
    target: str,
    loaded: LoadedMachine,
    inputs: Mapping[str, str],
    result: Sensitivity,
    poses: PoseSet,
    coordinate: str,
    *,
    force: bool,
) -> None:
    """Columns `id`, the coordinates of the tool point, then `shift.PARAMETER`. Raises OutputError."""
    units, done = loaded.machine.file_units, np.nonzero(result.prediction.solved)[0]
    fine = "urad" if coordinate.startswith("r") else "um"
    columns: list[tuple[str, str | None]] = [("id", None)]
    columns += [(name, unit_along(units, name).text) for name in result.coordinates]
    columns += [(f"shift.{name}", fine) for name in result.names]
    places = [poses.poses.row_origin(int(k)) for k in done]
    cells: list[Values] = [[p.id or str(p.line or 1) for p in places]]
    cells += list(np.round(result.prediction.values[done], _PLACES).T + 0.0)
    cells += list(result.shifts[done, result.coordinates.index(coordinate)].T)
    own_origin = Origin("shifts", f"shifts of {coordinate} by position, predicted", provenance(inputs))
    origin = None if is_stream(target) else own_origin
    with open_writer(target, columns, inputs, origin=origin, digits=9, force=force) as writer:
        writer.write(cells)
