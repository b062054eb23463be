"""Rows that a measurement joins: `to` names the `id` of the other one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import MAX_FAULTS, BadInput, Fault, Location, did_you_mean
from pkmcal_cli.base.plural import count
from pkmcal_cli.language.channels import channels_of, kind_of_sensor
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.tables.measurement_set import Measurements

_NEAR = 10_000  # names among which a similar one is looked for


def partner_notes(measurements: Measurements, machine: Machine) -> list[str]:
    """Rows that name another one though no sensor joins rows."""
    n = sum(bool(name) for name in measurements.labels.get("to", ()))
    if not n or any(kind_of_sensor(s).joins for s in machine.sensors.values()):
        return []
    return [
        f"`to` names another row in {n} of {len(measurements)} rows, but the machine has no `span` sensor: not used"
    ]


def check_partners(measurements: Measurements, machine: Machine) -> None:
    """`to` must name the `id` of exactly one other row of its file; what joins rows needs it. Raises BadInput."""
    faults = list(_faults(measurements, _joined(measurements, machine)))
    if faults:
        raise BadInput(faults[:MAX_FAULTS], len(faults))


def _joined(measurements: Measurements, machine: Machine) -> NDArray[np.bool_]:
    """Rows (N,) in which a distance to another row was measured."""
    names = {c.name for c in channels_of(machine) if kind_of_sensor(machine.sensors[c.sensor]).joins}
    columns = [k for k, name in enumerate(measurements.channels) if name in names]
    return np.asarray(measurements.measured[:, columns].any(axis=1))


def _faults(measurements: Measurements, joined: NDArray[np.bool_]) -> Iterator[Fault]:
    partners = measurements.labels.get("to", ("",) * len(measurements))
    named = np.array([bool(name) for name in partners])
    bare = sorted({*measurements.file_index[joined].tolist()} - {*measurements.file_index[named].tolist()})
    for file in bare:  # nothing in the column, or no column: one fault, not one per row
        message = (
            f"distance to another row measured in {count(int(joined[measurements.file_index == file].sum()), 'row')}"
        )
        where = Location(measurements.files[file], 1)
        yield Fault(
            "csv-partner", f"{message}, but no row has a `to`", where, "give the `id` of the other row in column `to`"
        )
    rows = np.flatnonzero(named | (joined & ~np.isin(measurements.file_index, bare)))
    ids = Counter(zip(measurements.file_index.tolist(), measurements.ids, strict=True) if len(rows) else ())
    for row in rows.tolist():
        fault = _wrong_partner(measurements, row, partners[row], ids)
        if fault:
            yield fault


def _wrong_partner(measurements: Measurements, row: int, name: str, ids: Counter[tuple[int, str]]) -> Fault | None:
    """What is wrong with the name of the partner of one row; None if it is the `id` of one other row."""
    file = int(measurements.file_index[row])
    where = Location(measurements.files[file], int(measurements.line[row]))
    times = ids[file, name]
    if not name:
        hint = "give the `id` of the other row in column `to`"
        return Fault("csv-partner", "distance to another row measured, but `to` is empty", where, hint)
    if name == measurements.ids[row]:
        return Fault(
            "csv-partner", f"`to` names `{name}`, which is this row itself", where, "give the `id` of the other row"
        )
    if times == 1:
        return None
    known = [i for other, i in list(ids)[:_NEAR] if other == file and i]
    hint = "give every row a unique `id`" if times else did_you_mean(name, known) or "check the column `id`"
    message = f"`to` names `{name}`, which is the `id` of " + (f"{times} rows" if times else "no row")
    return Fault("csv-partner", message, where, hint)
