"""Complete predictions of hexapod7, in elastic steps, and how the time of the Triglide grows with its rows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Request, Rows, predict, row_chunks
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.stages import BaseCoefficients, commanded_coefficients

from .frames import elastic_step
from .steps import against_bare
from .timing import Effort, Line, Times, side_by_side

MACHINES = Path(__file__).resolve().parents[1] / "machines"
_ERROR = 1e-4  # m, of every parameter


@dataclass(frozen=True)
class Task:
    """Rows of a machine whose parameters are off nominal."""

    model: Model
    values: Array
    rows: Rows


def model(name: str) -> Model:
    """A shipped machine."""
    return compile_machine(read_machine(MACHINES / f"{name}.yaml")).model


def hexapod(count: int) -> Task:
    """hexapod7 with errors up to 0.1 mm, at poses spread over its workspace."""
    made, random = model("hexapod7"), np.random.default_rng(0)
    poses = made.tool.reference + np.hstack(
        [random.uniform(-0.08, 0.08, (count, 3)), random.uniform(-0.15, 0.15, (count, 3))]
    )
    found = drive_positions(made, poses)
    assert not found.status.any()
    values = made.nominal + random.uniform(-_ERROR, _ERROR, len(made.nominal))
    return Task(made, values, Rows.at(found.readings))


def hexapod_lines(effort: Effort) -> list[Line]:
    """Step, complete prediction, prediction from the previous iterate, Jacobian."""
    count, rounds = effort.rows(1000), effort.rounds
    task = hexapod(count)
    made, rows, system = task.model, task.rows, task.model.exact
    iterates = _iterates(task)
    coefficients = commanded_coefficients(made, BaseCoefficients.of(made, task.values, rows), rows)
    state = iterates[-1].state
    parts = [(coefficients[chunk], state.take(chunk)) for chunk in row_chunks(system, count)]
    names = made.names[:10]
    cases = {
        "step": lambda: [elastic_step(system, *part) for part in parts],
        "complete": lambda: predict(made, task.values, rows),
        "jacobian": lambda: predict(made, task.values, rows, Request(parameters=names)),
        "first": lambda: predict(made, task.values, rows, start=iterates[0].start),
        "later": lambda: predict(made, task.values, rows, start=iterates[1].start),
    }
    times = side_by_side(cases, rounds)
    first, later = (predict(made, task.values, rows, start=it.start).steps / count for it in iterates[:2])
    bare = against_bare("hexapod7", system, coefficients, state, rounds)
    return [bare, *_hexapod_table(times, iterates[-1].steps / count, first, later, count)]


def triglide(count: int) -> Task:
    """The Triglide with errors of 0.1 mm in every length, at positions spread over its workspace."""
    made, random = model("triglide"), np.random.default_rng(0)
    poses = np.full((count, 6), np.nan)
    poses[:, 0], poses[:, 1] = random.uniform(0.2, 0.7, count), random.uniform(0.17, 0.38, count)
    readings = drive_positions(made, poses).readings
    values = made.nominal + _ERROR * np.array([p.dimension == "length" for p in made.parameters])
    return Task(made, values, Rows.at(readings))


def small_machines(effort: Effort) -> list[Line]:
    """The step of a small machine against its bare solution, and what a call costs at numbers of rows as measured."""
    task, few = triglide(effort.rows(2000)), triglide(effort.rows(80))
    base = BaseCoefficients.of(task.model, task.values, task.rows)
    coefficients = commanded_coefficients(task.model, base, task.rows)
    state = predict(task.model, task.values, task.rows).state
    own = {"triglide": triglide(effort.rows(231)), "hexapod7": hexapod(effort.rows(231))}
    limits, lines = {"triglide": 3.0, "hexapod7": 60.0}, []
    for name, other in own.items():
        start, request = (
            predict(other.model, other.values, other.rows).start,
            Request(parameters=other.model.names[:10]),
        )
        times = side_by_side(
            {
                "plain": partial(predict, other.model, other.values, other.rows, start=start),
                "with": partial(predict, other.model, other.values, other.rows, request, start),
            },
            effort.rounds,
        )
        note = f"prediction from the solution {1e3 * times.median('plain'):.1f} ms"
        added = 1e3 * (times.median("with") - times.median("plain"))
        what = f"Jacobian of 10 parameters, {len(other.rows)} poses of {name}"
        lines.append(Line(what, added, limits[name], unit="ms", note=note))
    times = side_by_side({"predict": partial(predict, few.model, few.values, few.rows)}, 3 * effort.rounds)
    return [
        against_bare("triglide", task.model.exact, coefficients, state, effort.rounds),
        Line(f"`exact` prediction of the Triglide, {len(few.rows)} rows", 1e3 * times.median("predict"), 5, unit="ms"),
        *lines,
    ]


def _iterates(task: Task) -> list[Prediction]:
    """Predictions at nominal parameters, 1 um from the solution of the fit, and at it."""
    made, random = task.model, np.random.default_rng(1)
    near = task.values + random.uniform(-1e-6, 1e-6, len(task.values))
    return [predict(made, values, task.rows) for values in (made.nominal, near, task.values)]


def _hexapod_table(times: Times, complete: float, first: float, later: float, count: int) -> list[Line]:
    added = times.ratio("jacobian", "complete") - 1
    per_row = f"{1e3 * times.median('complete'):.0f} ms for {count} rows"
    return [
        Line(
            "complete `exact` prediction from the reference configuration : step",
            times.ratio("complete", "step"),
            12,
            note=f"{complete:.1f} iterations per row, {per_row}",
        ),
        Line(
            "prediction from the first iterate of a fit (nominal, 0.1 mm away) : step",
            times.ratio("first", "step"),
            3,
            note=f"{first:.1f} iterations per row",
        ),
        Line(
            "prediction from a later iterate (1 um away) : step",
            times.ratio("later", "step"),
            3,
            note=f"{later:.1f} iterations per row",
        ),
        Line("Jacobian of 10 parameters, added : complete prediction", added, 1.5),
    ]


def triglide_lines(effort: Effort) -> list[Line]:
    """Time a row of the Triglide for growing numbers of rows."""
    counts = tuple(effort.rows(count) for count in (20_000, 80_000))
    task = triglide(max(counts))

    def run(count: int) -> State:
        return predict(task.model, task.values, task.rows.take(slice(count))).state

    times = side_by_side({str(count): partial(run, count) for count in counts}, min(effort.rounds, 3))
    per_row = [1e6 * times.median(str(count)) / count for count in counts]
    lines = [
        Line(f"`exact` prediction of the Triglide, {count} rows", value, unit="us per row")
        for count, value in zip(counts, per_row, strict=True)
    ]
    spread = times.ratio(str(counts[-1]), str(counts[0])) * counts[0] / counts[-1]
    return [*lines, Line(f"time per row, {counts[-1]} rows : {counts[0]} rows", spread, 1.2, note="linear: 1")]
