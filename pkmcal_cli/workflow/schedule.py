"""The order in which a plan is measured: so that drift, backlash and pose do not go together."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.waypoints import Stations, waypoints
from pkmcal_cli.correction.whole_steps import whole_steps
from pkmcal_cli.csv_files.dialect import split_header
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.commanded import forced
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.touching import tcp_places
from pkmcal_cli.tables.columns import columns_of
from pkmcal_cli.workflow.approaches import Approaches
from pkmcal_cli.workflow.schedule_forms import Schedule, write_form
from pkmcal_cli.workflow.table import force_columns

DATUM_EVERY = 20  # rows between visits of the datum pose
PACE = 20.0  # s a row: the way there, coming to rest, reading
_ORDERS = 30  # random orders, of which that is taken in which time goes least with sides and poses
_NOTABLE = 0.05  # correlation below which nothing is worth a word


@dataclass(frozen=True)
class ScheduleOptions:
    """Form of a schedule, seed of its order; dwell, s, and feed, mm/min, of programs; whether files are replaced;
    where it comes from.
    """

    form: str
    seed: int
    dwell: float
    feed: float
    force: bool
    origin: Origin


def write_schedule(
    loaded: LoadedMachine, rows: Rows, ways: Approaches, options: ScheduleOptions, target: str, inputs: Collection[str]
) -> list[str]:
    """Write poses in the order of measurement; returns what is to be said of it. Raises OutputError and BadInput.

    Rows in random order, each approached from `approach.ACTUATOR`, all drives together, so from its sides
    (`dir.ACTUATOR`); the first pose again every 20 rows; one session after the other. What joins rows is kept (`to`).
    """
    model = loaded.model
    held = [a for a, d in enumerate(model.topology.drives) if not d.force_controlled]
    there, begins = (whole_steps(model, q) for q in (rows.readings, rows.readings + ways.back))
    side = ways.side[:, held]
    order, together = _in_sessions(rows, side, held, np.random.default_rng(options.seed))
    index = np.array([row for row, _ in order])
    ids = [f"datum_{k}" if datum else f"p{row + 1}" for k, (row, datum) in enumerate(order, start=1)]
    actuators, programmed = [model.actuators[a] for a in held], options.form == "gcode"
    schedule = Schedule(
        machine=model.name, ids=ids, partners=_partners(rows, order, ids),
        sessions=[rows.session_names[k] for k in rows.session[index]] if rows.session_names else [],
        drives=[(a.name, loaded.machine.actuators[a.name].column or a.name, a.unit) for a in actuators],
        there=there[index][:, held], begin=begins[index][:, held], side=side[index], readings=_readings(loaded),
        following={model.actuators[a].name: ways.side[index, a] for a in np.nonzero(forced(model))[0]},
        forces=force_columns(loaded.machine, model, rows.forces[index]),
        ways=_ways(model, there[index], begins[index], held) if programmed else (),
        dwell=options.dwell, feed=options.feed, origin=options.origin,
    )  # fmt: skip
    write_form(options.form, schedule, target, inputs, options.force)
    return _summary(target, order, together)


def _ways(model: Model, there: Array, begin: Array, held: list[int]) -> list[Array]:
    """Set values (k, h) on the way from each row (N, A) to where the approach of the next one begins; first: none."""
    if len(there) < 2:
        return [there[:0, held]] * len(there)
    begins, ends = (Stations(q, tcp_places(model, model.nominal, Rows.at(q))) for q in (there[:-1], begin[1:]))

    def inverse(poses: Array) -> Array:
        return drive_positions(model, poses, held=model.independent_coordinates).readings

    between = waypoints(model, inverse, begins, ends)
    return [there[:0, held], *(way[:, held] for way in between)]


def _readings(loaded: LoadedMachine) -> list[tuple[str, str | None]]:
    """Headers and units of the columns that a measurement fills in."""
    known = {(c.name, c.role): c for c in columns_of(loaded.machine)}
    read = [c for c in loaded.model.channels if np.isnan(c.once)]
    return [(split_header(known[c.name, "channel"].header).name, known[c.name, "channel"].unit) for c in read]


def _summary(target: str, order: list[tuple[int, bool]], together: float) -> list[str]:
    """Length, duration and order of a schedule in words."""
    visits = sum(datum for _, datum in order)
    minutes = max(1, round(len(order) * PACE / 60))
    sentences = [
        f"written: {target} ({len(order)} rows in the order of measurement, {visits} of them at the datum pose)",
        f"about {minutes} min at {PACE:g} s a row; warm up first: move to and fro until the datum pose reads the same",
    ]
    if together > _NOTABLE:
        sentences.append(f"time is correlated with sides or poses (largest correlation {together:.2f})")
    return sentences


def _in_sessions(
    rows: Rows, side: Array, held: list[int], rng: np.random.Generator
) -> tuple[list[tuple[int, bool]], float]:
    """Rows in the order of measurement, each with whether it visits the datum; the worst correlation of a session."""
    order: list[tuple[int, bool]] = []
    worst = 0.0
    for session in np.unique(rows.session):
        some = np.nonzero(rows.session == session)[0]
        drawn, together = _order(side[some], rows.readings[some][:, held], rng)
        order += _with_datum([int(some[k]) for k in drawn])
        worst = max(worst, together)
    return order, worst


def _order(side: Array, readings: Array, rng: np.random.Generator) -> tuple[list[int], float]:
    """Rows in a random order in which time, and its square, go least with sides and poses (N, h); that correlation."""
    columns = np.hstack([side, readings])
    columns = columns - columns.mean(axis=0)
    size = np.sqrt((columns**2).sum(axis=0))
    columns = columns[:, size > 0] / size[size > 0]
    time = np.linspace(-1.0, 1.0, len(side))
    clock = np.stack([time, time**2 - (time**2).mean()], axis=1)
    clock /= np.maximum(np.sqrt((clock**2).sum(axis=0)), 1e-300)
    orders = [rng.permutation(len(side)) for _ in range(_ORDERS)]
    worst = [float(np.abs(columns[order].T @ clock).max(initial=0.0)) for order in orders]
    best = int(np.argmin(worst))
    return [int(k) for k in orders[best]], worst[best]


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
