"""The order in which a plan is measured: so that drift, backlash and pose do not go together."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from pkmcal_cli.loading import LoadedMachine
from pkmcal_cli.prediction import Rows
from pkmcal_cli.tables.csv_write import open_writer

DATUM_EVERY = 20  # rows between visits of the datum pose
_OVERRUN = 0.01  # of a drive's travel in the plan: how far away the approach begins
_SHORT = 1e-3  # m or rad, where a drive stands still in the whole plan


def write_schedule(
    loaded: LoadedMachine, rows: Rows, planned: int, seed: int, target: str, inputs: Collection[str], force: bool
) -> int:
    """Write a table of poses in the order of measurement; returns the number of its rows. Raises OutputError.

    Rows in random order; each approached from a random side (`dir.ACTUATOR`; rows after the first `planned` keep
    theirs), beginning at `approach.ACTUATOR`; the first pose again every 20 rows. What joins rows is kept (`to`).
    """
    model, rng = loaded.model, np.random.default_rng(seed)
    held = [a for a, d in enumerate(model.layout.drives) if not d.force_controlled]
    names = [model.actuators[a].name for a in held]
    readings = rows.readings[:, held]
    side = np.stack([rows.columns[f"dir.{n}"] for n in names], axis=1)
    side[:planned] = rng.choice([-1.0, 1.0], (planned, len(held)))
    limits = np.array([model.actuators[a].limits for a in held])
    overrun = _OVERRUN * np.ptp(readings, axis=0)
    begin = np.clip(readings - side * np.where(overrun > 0, overrun, _SHORT), limits[:, 0], limits[:, 1])
    order = _with_datum([int(k) for k in rng.permutation(len(rows))])
    index = np.array([row for row, _ in order])
    ids = [f"datum_{k}" if datum else f"p{row + 1}" for k, (row, datum) in enumerate(order, start=1)]
    units = [model.actuators[a].unit for a in held]
    partners = _partners(rows, order, ids)
    headers: list[tuple[str, str | None]] = [("id", None), *[("to", None) for _ in partners]]
    headers += [(loaded.machine.actuators[n].column or n, u) for n, u in zip(names, units, strict=True)]
    headers += [(f"dir.{n}", None) for n in names] + [(f"approach.{n}", u) for n, u in zip(names, units, strict=True)]
    with open_writer(target, headers, inputs, digits=9, force=force) as writer:
        writer.write([ids, *partners, *readings[index].T, *side[index].T, *begin[index].T])
    return len(ids)


def _partners(rows: Rows, order: list[tuple[int, bool]], ids: list[str]) -> list[list[str]]:
    """A column with the `id` of the row that each is joined to; no column where none is. The datum is joined once."""
    if rows.partner is None or not (rows.partner >= 0).any():
        return []
    first = {row: k for k, (row, _) in reversed(list(enumerate(order)))}
    joined = [int(rows.partner[row]) if first[row] == k else -1 for k, (row, _) in enumerate(order)]
    return [["" if partner < 0 else ids[first[partner]] for partner in joined]]


def _with_datum(order: list[int]) -> list[tuple[int, bool]]:
    """Row numbers in order; the first is the datum: at the start, after every 20 rows and at the end."""
    datum = (order[0], True)
    out = [datum]
    for k, row in enumerate(order[1:]):
        out.append((row, False))
        if (k + 1) % DATUM_EVERY == 0:
            out.append(datum)
    return out if out[-1] == datum else [*out, datum]
