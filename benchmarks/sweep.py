"""How the cost grows: with rows, parameters, sessions, the distance from the reference configuration; large tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

from .frames import compiled
from .predictions import MACHINES, Task, hexapod, triglide
from .program import calibration_line
from .timing import Effort, exponent, side_by_side


@dataclass(frozen=True)
class Growth:
    """Cost of one task in several sizes, s."""

    what: str
    sizes: tuple[float, ...]
    cost: tuple[float, ...]
    note: str = ""

    def cells(self) -> tuple[str, str, str, str, str]:
        """What, sizes, cost, exponent, note."""
        power = f"{exponent(self.sizes, self.cost):.2f}" if len(self.sizes) > 1 else ""
        sizes = ", ".join(f"{size:g}" for size in self.sizes)
        return self.what, sizes, ", ".join(f"{1e3 * cost:.3g}" for cost in self.cost) + " ms", power, self.note


def growths(effort: Effort) -> Iterator[Growth]:
    """All of them."""
    few = Effort(min(effort.rounds, 5), effort.share)
    yield from _rows(few)
    yield _parameters(few)
    yield from _sessions(few)
    yield _distance(few)
    yield from _large(few)


def _measured(
    what: str, effort: Effort, sizes: Sequence[float], runs: Sequence[Callable[[], object]], note: str = ""
) -> Growth:
    times = side_by_side({str(k): run for k, run in enumerate(runs)}, effort.rounds)
    return Growth(what, tuple(sizes), tuple(times.median(str(k)) for k in range(len(runs))), note)


def _rows(effort: Effort) -> Iterator[Growth]:
    for name, task, counts in (
        ("Triglide", triglide(effort.rows(20480)), (20, 80, 320, 1280, 5120, 20480)),
        ("hexapod7", hexapod(effort.rows(1280)), (20, 80, 320, 1280)),
    ):
        sizes = [min(count, len(task.rows)) for count in counts]
        runs = [partial(predict, task.model, task.values, task.rows.take(slice(size))) for size in sizes]
        if sizes[-1] > sizes[0]:
            yield _measured(f"rows: `exact` prediction of {name}", effort, sizes, runs)


def _parameters(effort: Effort) -> Growth:
    task = hexapod(effort.rows(200))
    start, names = predict(task.model, task.values, task.rows).start, task.model.names
    sizes = sorted({1, 3, 10, 30, len(names)} - {k for k in (30,) if k > len(names)})
    runs = [partial(_jacobian, task, start=start, names=names[:size]) for size in sizes]
    return _measured(f"parameters: Jacobian of hexapod7, {len(task.rows)} rows", effort, sizes, runs)


def _jacobian(task: Task, start: object, names: tuple[str, ...]) -> object:
    return predict(task.model, task.values, task.rows, Request(parameters=names), start)  # type: ignore[arg-type]


def _sessions(effort: Effort) -> Iterator[Growth]:
    """Jacobian of all parameters, those of each session's own among them; the rows are shared out."""
    text = (MACHINES / "triglide.yaml").read_text(encoding="utf-8")
    made = compiled(text.replace("frame: machine", "frame: fitted per session"))
    own = [p.name for p in made.parameters if p.per_session]
    count = effort.rows(640, 16)
    readings = triglide(count).rows.readings
    sizes = (2, 4, 8, 16) if count < 64 else (2, 8, 32, 64)
    runs = []
    for size in sizes:
        names = tuple(f"s{k}" for k in range(size))
        columns = {f"session.{s}": (np.arange(count) % size == k).astype(float) for k, s in enumerate(names)}
        several = made.for_sessions(names)
        rows = Rows(readings, np.full(readings.shape, np.nan), columns)
        runs.append(partial(predict, several, several.nominal, rows, Request(parameters=several.names)))
    what = f"sessions: Jacobian of all parameters of the Triglide, {count} rows"
    yield _measured(what, effort, sizes, runs, f"{len(own)} of them in each session")


def _distance(effort: Effort) -> Growth:
    """Poses on spheres of growing size about the reference configuration, shares of 80 mm and 0.15 rad."""
    base, random = hexapod(effort.rows(200)), np.random.default_rng(5)
    shares, runs, steps = (0.125, 0.25, 0.5, 1.0), [], []
    away = random.normal(size=(len(base.rows), 6))
    away = away / np.linalg.norm(away, axis=1)[:, None] * np.repeat([0.08, 0.15], 3)
    for share in shares:
        found = drive_positions(base.model, base.model.tool.reference + share * away)
        rows = Rows.at(found.readings)
        runs.append(partial(predict, base.model, base.values, rows))
        steps.append(predict(base.model, base.values, rows).steps / len(rows))
    note = f"{', '.join(f'{step:.1f}' for step in steps)} iterations per row"
    what = f"distance: cold prediction of hexapod7, {len(base.rows)} rows, share of 80 mm and 0.15 rad"
    return _measured(what, effort, shares, runs, note)


def _large(effort: Effort) -> Iterator[Growth]:
    """A fleet, and candidate poses of a plan."""
    one = calibration_line(Effort(min(effort.rounds, 3), effort.share)).measured
    yield Growth("fleet: 500 calibrations of the Scissors", (500,), (500 * one,), f"500 times {one:.2f} s")
    for name, task in (("Triglide", triglide(effort.rows(20000))), ("hexapod7", hexapod(effort.rows(2000)))):
        request = Request(parameters=task.model.names[:10])
        run = partial(predict, task.model, task.values, task.rows, request)
        (taken,) = _measured("", Effort(1, effort.share), (1,), (run,)).cost
        part = len(task.rows)
        note = f"{part} poses measured, times {1e5 / part:g}"
        yield Growth(
            f"candidates: 10^5 poses of {name}, Jacobian of 10 parameters", (1e5,), (taken * 1e5 / part,), note
        )
