"""One elastic step against the bare solution of its equations, and against another program."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg.lapack import dposv, dsysv

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.prediction import row_chunks

from . import other_program
from .beam_frame import beam_frame
from .frames import REFERENCE, Frame, elastic_step, equations, planar_frame, spatial_frame
from .structures import SIZES, structure
from .timing import Effort, Line, exponent, side_by_side

_COMPARED = 60  # configurations that the other program solves in a round


def against_bare(name: str, system: System, coefficients: Array, state: State, rounds: int) -> Line:
    """Assembly and solution against the faster of LAPACK row by row and np.linalg.solve of the same matrices."""
    chunks = [chunk for chunk in row_chunks(system, len(coefficients)) if chunk.stop - chunk.start >= 8]
    parts = [(coefficients[chunk], state.take(chunk)) for chunk in chunks]
    ready = [equations(system, *part) for part in parts]
    routine = "sysv" if system.constraints else "posv"
    bare = BARE[routine]
    times = side_by_side(
        {
            routine: lambda: [bare(*pair) for pair in ready],
            "gesv": lambda: [np.linalg.solve(*pair) for pair in ready],
            "step": lambda: [elastic_step(system, *part) for part in parts],
        },
        rounds,
    )
    rows = sum(len(part[0]) for part in parts)
    fastest = min((routine, "gesv"), key=times.median)
    step, unit = (1e6 * times.median(case) / rows for case in ("step", fastest))
    note = f"{system.size} unknowns; step {step:.1f} us per row, bare ({fastest}) {unit:.1f} us"
    limit = 3.0 if system.size >= LARGE else None
    return Line(f"one elastic step, {name} : bare solve", times.ratio("step", fastest), limit, note=note)


def _positive(matrices: Array, right: Array) -> None:
    """LAPACK's Cholesky solver, row by row."""
    for matrix, b in zip(matrices, right, strict=True):
        dposv(matrix, b)


def _symmetric(matrices: Array, right: Array) -> None:
    """LAPACK's symmetric indefinite solver, row by row."""
    for matrix, b in zip(matrices, right, strict=True):
        dsysv(matrix, b)


BARE = {"posv": _positive, "sysv": _symmetric}
LARGE = 40
"""Unknowns from which on a step is required to cost little more than the solution of its equations."""


def frames_against_bare(effort: Effort) -> list[Line]:
    """The frames that the other program solves too."""
    frames = {
        "planar frame of rods": planar_frame(effort.rows(1000)),
        "planar frame of beams": beam_frame(effort.rows(1000)),
        "spatial frame": spatial_frame(effort.rows(256)),
    }
    return [
        against_bare(name, frame.model.exact, frame.coefficients, frame.state, effort.rounds)
        for name, frame in frames.items()
    ]


def growth_lines(effort: Effort) -> list[Line]:
    """How the step of a row grows from about 100 to 900 unknowns."""
    lines = []
    for kind, sizes in SIZES.items():
        frames = [structure(kind, size, effort.rows(32)) for size in effort.sizes(sizes)]
        cases = {str(f.model.exact.size): partial(elastic_step, f.model.exact, f.coefficients, f.state) for f in frames}
        times = side_by_side(cases, effort.rounds)
        per_row = [1e6 * times.median(size) / len(frames[0].coefficients) for size in cases]
        power = exponent([float(size) for size in cases], per_row)
        note = f"{', '.join(cases)} unknowns: {', '.join(f'{x:.0f}' for x in per_row)} us per row"
        lines.append(Line(f"{kind} of beams: exponent of the step in the unknowns", power, 1.2, note=note))
    return lines


def against_other_program(effort: Effort) -> list[Line]:
    """Both frames against OpenSees, with the same displacements; nothing where it is not installed."""
    ops = other_program.load()
    if ops is None:
        return []
    count = effort.rows(_COMPARED, 4)
    planar, beams, spatial = (
        solver(ops, count) for solver in (other_program.planar, other_program.beams, other_program.spatial)
    )
    rods, welded, space = (
        planar_frame(effort.rows(2000)),
        beam_frame(effort.rows(2000)),
        spatial_frame(effort.rows(512)),
    )
    return [
        _compared(ops, "planar frame of rods", "planar_three_rods", frame=rods, other=planar, least=20, effort=effort),
        _compared(ops, "planar frame of beams", "", frame=welded, other=beams, least=20, effort=effort),
        _compared(ops, "spatial frame", "spatial_gough_stewart", frame=space, other=spatial, least=5, effort=effort),
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
    note = (
        f"{system.size} unknowns; {fastest} of OpenSees {version}; engine {per_row:.1f} us; "
        f"displacements agree to {deviation:.0e}"
    )
    return Line(f"{name}: OpenSees, rebuilt : one step", ratio, least, least=True, note=note)


def _deviation(key: str, mine: Array, theirs: Array) -> float:
    """Largest relative deviation between the programs, and of the first row from the reference `key`, if any."""
    among = float(np.abs(theirs / mine[: len(theirs)] - 1).max())
    if not key:
        return among
    given = np.array(REFERENCE[key]["displacement_of_T"])
    given[: min(3, len(given))] *= 1e-3
    return float(max(among, np.abs(mine[0] / given - 1).max()))
