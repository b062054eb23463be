"""Many sessions with a frame of the instrument each: what `calibrate` costs, and how much memory they add."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

from .frames import compiled
from .predictions import MACHINES
from .program import command_cost
from .timing import Effort, Line, exponent

_SESSIONS = (30, 60, 125, 250, 500)
_ROWS = 12  # of a session
_NOISE = 1e-5  # m


def session_lines(effort: Effort) -> Iterator[Line]:
    """As whole processes: of the Triglide, 12 rows a session; against as many rows of a single one."""
    sizes = list(effort.sizes(_SESSIONS))
    with tempfile.TemporaryDirectory() as folder:
        machine = Path(folder) / "machine.yaml"
        text = (MACHINES / "triglide.yaml").read_text(encoding="utf-8").replace("frame: machine", "frame: {}")
        cost = []
        for frame, count in (("fitted", 1), *(("fitted per session", size) for size in sizes)):
            machine.write_text(text.replace("frame: {}", f"frame: {frame}"), encoding="utf-8")
            table = _table(Path(folder), count, sizes[-1] if count == 1 else count)
            cost.append(command_cost("calibrate", str(machine), table, "-q"))
    (_, alone), *of_sessions = cost
    what = f"`calibrate` of {sizes[-1]} sessions with a frame each, {_ROWS} rows in each"
    seconds = [second for second, _ in of_sessions]
    listed = ", ".join(f"{size}: {second:.2g} s" for size, second in zip(sizes, seconds, strict=True))
    yield Line(f"{what}: exponent in the sessions", exponent(sizes, seconds), 1.2, note=listed)
    more = max(of_sessions[-1][1] - alone, 0.0)
    yield Line(f"{what}: memory above that of a single session", more, 476, unit="MiB", note=f"{alone:.0f} MiB")


def _table(folder: Path, sessions: int, parts: int) -> str:
    """A table with noise, at random poses; sessions that an instrument begins anew, where there are several."""
    random, count = np.random.default_rng(1), parts * _ROWS
    model = compiled((MACHINES / "triglide.yaml").read_text(encoding="utf-8"))
    poses = np.tile(model.tool.reference, (count, 1))
    poses[:, :2] = random.uniform([0.25, 0.2], [0.65, 0.34], size=(count, 2))
    drives = drive_positions(model, poses).readings
    places = predict(model, model.nominal, Rows.at(drives)).values
    session = np.repeat(np.arange(sessions), count // sessions)
    shift, turn = random.normal(size=(2, sessions, 2)) * [[[3e-4]], [[1e-3]]]
    turned = places[:, ::-1] * [-1.0, 1.0] * turn[session, :1]  # small enough to be linear
    seen = places + turned + shift[session] + _NOISE * random.normal(size=places.shape)
    lines = ["q1 [m],q2 [m],q3 [m],x [m],y [m],session"]
    rows = zip(drives.tolist(), seen.tolist(), session, strict=True)
    lines += [",".join(map(repr, [*row, *place])) + f",s{s}" for row, place, s in rows]
    target = folder / f"{sessions}.csv"
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(target)
