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


def partner_notes(found: Measurements, machine: Machine) -> list[str]:
    """Rows that name another one though no sensor joins rows."""
    n = sum(bool(name) for name in found.labels.get("to", ()))
    if not n or any(kind_of_sensor(s).joins for s in machine.sensors.values()):
        return []
    return [f"`to` names another row in {n} of {len(found)} rows, but no sensor of kind span is declared: not used"]


def check_partners(found: Measurements, machine: Machine) -> None:
    """`to` must name the `id` of exactly one other row of its file; what joins rows needs it. Raises BadInput."""
    faults = list(_faults(found, _joined(found, machine)))
    if faults:
        raise BadInput(faults[:MAX_FAULTS], len(faults))


def _joined(found: Measurements, machine: Machine) -> NDArray[np.bool_]:
    """Rows (N,) in which a distance to another row was measured."""
    names = {c.name for c in channels_of(machine) if kind_of_sensor(machine.sensors[c.sensor]).joins}
    columns = [k for k, name in enumerate(found.channels) if name in names]
    return np.asarray(found.measured[:, columns].any(axis=1))


def _faults(found: Measurements, joined: NDArray[np.bool_]) -> Iterator[Fault]:
    partners = found.labels.get("to", ("",) * len(found))
    named = np.array([bool(name) for name in partners])
    bare = sorted({*found.file_index[joined].tolist()} - {*found.file_index[named].tolist()})
    for file in bare:  # nothing in the column, or no column: one fault, not one per row
        what = f"a distance between two rows in {count(int(joined[found.file_index == file].sum()), 'row')}"
        where = Location(found.files[file], 1)
        yield Fault("csv-partner", f"{what}, but no row has a `to`", where, "column `to`: the `id` of the other row")
    ids = Counter(zip(found.file_index.tolist(), found.ids, strict=True))
    for row in np.flatnonzero(named | (joined & ~np.isin(found.file_index, bare))).tolist():
        fault = _wrong_partner(found, row, partners[row], ids)
        if fault:
            yield fault


def _wrong_partner(found: Measurements, row: int, name: str, ids: Counter[tuple[int, str]]) -> Fault | None:
    """What is wrong with the name of the partner of one row; None if it is the `id` of one other row."""
    file = int(found.file_index[row])
    where = Location(found.files[file], int(found.line[row]))
    times = ids[file, name]
    if not name:
        hint = "`to`: the `id` of the other row"
        return Fault("csv-partner", "a distance between two rows, but `to` names no other row", where, hint)
    if name == found.ids[row]:
        return Fault("csv-partner", f"`to` names `{name}`, this row itself", where, "the `id` of the other row")
    if times == 1:
        return None
    known = [i for other, i in list(ids)[:_NEAR] if other == file and i]
    hint = "give every row its own `id`" if times else did_you_mean(name, known) or "is the `id` missing?"
    what = f"`to` names `{name}`, " + (f"the `id` of {times} rows" if times else "no row's `id`")
    return Fault("csv-partner", what, where, hint)
