"""One elastic step against the bare solution of its equations, and against another program."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.prediction import row_chunks

from . import other_program
from .frames import REFERENCE, Frame, elastic_step, equations, planar_frame, spatial_frame
from .timing import Effort, Line, side_by_side

_COMPARED = 60  # configurations that the other program solves in a round


def against_bare(name: str, system: System, coefficients: Array, state: State, rounds: int) -> Line:
    """Assembly and solution against np.linalg.solve of the same matrices, chunk by chunk."""
    chunks = [chunk for chunk in row_chunks(system, len(coefficients)) if chunk.stop - chunk.start >= 8]
    parts = [(coefficients[chunk], state.take(chunk)) for chunk in chunks]
    ready = [equations(system, *part) for part in parts]
    times = side_by_side(
        {
            "bare": lambda: [np.linalg.solve(*pair) for pair in ready],
            "step": lambda: [elastic_step(system, *part) for part in parts],
        },
        rounds,
    )
    rows = sum(len(part[0]) for part in parts)
    note = f"{system.size} unknowns; bare {1e6 * times.median('bare') / rows:.0f} us per row"
    return Line(f"one elastic step, {name} : bare batched solve", times.ratio("step", "bare"), 3, note=note)


def frames_against_bare(effort: Effort) -> list[Line]:
    """The spatial frame; the planar one has fewer unknowns than the requirement speaks of."""
    frame = spatial_frame(effort.rows(256))
    return [against_bare("spatial frame", frame.model.exact, frame.coefficients, frame.state, effort.rounds)]


def against_other_program(effort: Effort) -> list[Line]:
    """Both frames against OpenSees, with the same displacements; nothing where it is not installed."""
    ops = other_program.load()
    if ops is None:
        return []
    count = effort.rows(_COMPARED, 4)
    planar, spatial = other_program.planar(ops, count), other_program.spatial(ops, count)
    frames = planar_frame(effort.rows(2000)), spatial_frame(effort.rows(512))
    return [
        _compared(
            ops, "planar three-rod frame", "planar_three_rods", frame=frames[0], other=planar, least=5, effort=effort
        ),
        _compared(
            ops, "spatial frame", "spatial_gough_stewart", frame=frames[1], other=spatial, least=2, effort=effort
        ),
    ]


def _compared(
    ops: Any, name: str, key: str, frame: Frame, other: other_program.Solve, least: float, effort: Effort
) -> Line:
    rows, system, count = len(frame.coefficients), frame.model.exact, effort.rows(_COMPARED, 4)
    chunks = list(row_chunks(system, rows))

    def engine() -> Array:
        return np.concatenate([frame.displacement(chunk) for chunk in chunks])

    cases: dict[str, Callable[[], object]] = {"engine": engine}
    cases |= {solver: partial(other, solver, count) for solver in other_program.SOLVERS}
    deviation = _deviation(key, engine(), np.array(other(other_program.SOLVERS[0], count)))
    times = side_by_side(cases, effort.rounds)
    fastest = min(other_program.SOLVERS, key=times.median)
    ratio = times.ratio(fastest, "engine") * rows / count
    per_row = 1e6 * times.median("engine") / rows
    version = ops.version()
    note = f"{fastest} of OpenSees {version}; engine {per_row:.1f} us; displacements agree to {deviation:.0e}"
    return Line(f"{name}: OpenSees, rebuilt : one step", ratio, least, least=True, note=note)


def _deviation(key: str, mine: Array, theirs: Array) -> float:
    """Largest relative deviation between the programs, and of the first row from the reference."""
    given = np.array(REFERENCE[key]["displacement_of_T"])
    given[: min(3, len(given))] *= 1e-3
    among = np.abs(theirs / mine[: len(theirs)] - 1).max()
    return float(max(among, np.abs(mine[0] / given - 1).max()))
