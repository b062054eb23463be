"""The order in which a plan is measured: so that drift, backlash and pose do not go together."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.csv_files.writer import open_writer
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.workflow.sides import moves_together

DATUM_EVERY = 20  # rows between visits of the datum pose
_OVERRUN = 0.01  # of a drive's travel in the plan: how far away the approach begins
_SHORT = 1e-3  # m or rad, where a drive stands still in the whole plan


def write_schedule(
    loaded: LoadedMachine, rows: Rows, seed: int, target: str, inputs: Collection[str], force: bool
) -> int:
    """Write a table of poses in the order of measurement; returns the number of its rows. Raises OutputError.

    Rows in random order, each approached from its side (`dir.ACTUATOR`); where drives move one by one, beginning at
    `approach.ACTUATOR`. The first pose again every 20 rows. What joins rows is kept (`to`).
    """
    model, rng = loaded.model, np.random.default_rng(seed)
    held = [a for a, d in enumerate(model.topology.drives) if not d.force_controlled]
    names, units = [model.actuators[a].name for a in held], [model.actuators[a].unit for a in held]
    side = np.stack([rows.columns[f"dir.{n}"] for n in names], axis=1)
    begin = _begin(model, rows.readings, side, held)
    order = _with_datum([int(k) for k in rng.permutation(len(rows))])
    index = np.array([row for row, _ in order])
    ids = [f"datum_{k}" if datum else f"p{row + 1}" for k, (row, datum) in enumerate(order, start=1)]
    partners = _partners(rows, order, ids)
    headers: list[tuple[str, str | None]] = [("id", None), *[("to", None) for _ in partners]]
    headers += [(loaded.machine.actuators[n].column or n, u) for n, u in zip(names, units, strict=True)]
    headers += [(f"dir.{n}", None) for n in names]
    columns = [ids, *partners, *rows.readings[index][:, held].T, *side[index].T]
    if not moves_together(loaded):
        headers += [(f"approach.{n}", u) for n, u in zip(names, units, strict=True)]
        columns += [*begin[index].T]
    with open_writer(target, headers, inputs, digits=9, force=force) as writer:
        writer.write(columns)
    return len(ids)


def _begin(model: Model, readings: Array, side: Array, held: list[int]) -> Array:
    """Where drives begin to approach readings (N, A) from their sides (N, h), within their limits: (N, h)."""
    there, limits = readings[:, held], np.array([model.actuators[a].limits for a in held])
    overrun = _OVERRUN * np.ptp(there, axis=0)
    begin = there - side * np.where(overrun > 0, overrun, _SHORT)
    return np.asarray(np.clip(begin, limits[:, 0], limits[:, 1]))


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
