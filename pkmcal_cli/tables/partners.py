"""Rows that a measurement joins: `to` names the `id` of the other one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.errors import MAX_FAULTS, BadInput, Fault, Location, did_you_mean
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
    if not any(partners) and not joined.any():
        return
    counts = Counter(zip(found.file_index.tolist(), found.ids, strict=True))
    for row, name in enumerate(partners):
        file = int(found.file_index[row])
        where = Location(found.files[file], int(found.line[row]))
        count = counts[file, name] if name else 1
        if not name and joined[row]:
            hint = "`to`: the `id` of the other row"
            yield Fault("csv-partner", "a distance between two rows, but `to` names no other row", where, hint)
        elif name and name == found.ids[row]:
            yield Fault("csv-partner", f"`to` names `{name}`, this row itself", where, "the `id` of the other row")
        elif count != 1:
            known = [i for other, i in list(counts)[:_NEAR] if other == file and i]
            hint = "give every row its own `id`" if count else did_you_mean(name, known) or "is the `id` missing?"
            what = f"`to` names `{name}`, " + (f"the `id` of {count} rows" if count else "no row's `id`")
            yield Fault("csv-partner", what, where, hint)
