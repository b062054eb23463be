"""The hangprinter's real sessions calibrated without its camera, or with few of its positions, by the command."""

from __future__ import annotations

import csv
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from tests.command import column, run
from tests.support import MACHINES, overlay

SESSIONS = ("2021-12-16", "2022-04-12")
KNOWN = 41  # rows of 2022-04-12 with a camera position
DATUM = ("Ax", "Az", "Bz")
BAD_LINE = 19  # of the file of 2022-04-12
RADII = "auto,R_low,R_high"
SCALE_HELD = "auto,R_high"
"""Motors alone do not see the scale: the radius of three spools is what says it."""


def machine(values: dict[str, float]) -> str:
    """The machine with the effect of line that builds up on the spools, and parameters drawn at values in mm."""
    drawn = "".join(f"  {n}: {{nominal: {v!r}}}\n" for n, v in values.items())
    return overlay("hangprinter", f"effects: {{buildup@all: {{b: 0}}}}\ndatum: [{', '.join(DATUM)}]\n") + (
        f"parameters:\n{drawn}" if drawn else ""
    )


def table(session: str, known: tuple[int, ...]) -> str:
    """The session with camera positions in some rows only."""
    lines = (MACHINES / f"hangprinter_{session}.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines]
    for k, row in enumerate(rows[1:]):
        row[1:4] = row[1:4] if k in known else ["", "", ""]
    return "\n".join(map(",".join, rows)) + "\n"


def calibrate(folder: Path, text: str, data: str, *more: str) -> dict[str, Any]:
    """The command's result; machine.yaml and params.yaml stay in the folder."""
    (folder / "machine.yaml").write_text(text, encoding="utf-8")
    (folder / "table.csv").write_text(data, encoding="utf-8")
    to = ("-o", folder / "params.yaml", "--json", "--holdout", "none", "--force")
    done = run("calibrate", folder / "machine.yaml", folder / "table.csv", *to, *more)
    if not done.out:
        raise RuntimeError(done.err)
    result: dict[str, Any] = done.json
    return result


def found(result: dict[str, Any]) -> dict[str, tuple[float, float]]:
    """Value and standard uncertainty of what was identified, in the machine file's units."""
    return {p["name"]: (p["value"], p["std"]) for p in result["parameters"] if p["std"] is not None}


@cache
def by_camera(session: str, loss: str = "squares") -> dict[str, Any]:
    """Calibration with the camera."""
    with tempfile.TemporaryDirectory() as folder:
        return calibrate(Path(folder), machine({}), table(session, tuple(range(99))), "--select", RADII, "--loss", loss)


@cache
def alone(session: str) -> dict[str, Any]:
    """Calibration by the motors alone; what they do not see (turns and scale) is taken from the camera's."""
    camera = found(by_camera(session, "tukey"))
    given = {n: camera[n][0] for n in (*DATUM, "R_low")}
    with tempfile.TemporaryDirectory() as folder:
        return calibrate(Path(folder), machine(given), table(session, ()), "--select", SCALE_HELD)


def apart(session: str) -> dict[str, tuple[float, float, float, float, float]]:
    """Of every parameter that both find: values and standard uncertainties alone and by camera, and the difference in
    standard uncertainties of both together."""
    one, other = found(alone(session)), found(by_camera(session, "tukey"))
    both = [n for n in one if n in other and n not in DATUM]
    return {n: (*one[n], *other[n], (one[n][0] - other[n][0]) / float(np.hypot(one[n][1], other[n][1]))) for n in both}


@cache
def withheld(first: int, loss: str = "squares") -> tuple[int, float, float]:
    """2022-04-12 with every fifth position known: how many, 3D rms in mm of the others, and without the bad row."""
    session, known = SESSIONS[1], tuple(range(first, KNOWN, 5))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        calibrate(folder, machine({}), table(session, known), "--select", RADII, "--loss", loss)
        real, out = MACHINES / f"hangprinter_{session}.csv", folder / "out.csv"
        done = run("simulate", folder / "machine.yaml", real, "-p", folder / "params.yaml", "-o", out)
        assert done.code == 0, done.err
        got = np.stack([column(out, n) for n in ("x_mm", "y_mm", "z_mm")], axis=1)[:KNOWN]
    off = np.linalg.norm(got - camera_positions(), axis=1)
    rest = np.array([k for k in range(KNOWN) if k not in known])
    good = rest[rest != BAD_LINE - 2]
    return len(known), float(np.sqrt((off[rest] ** 2).mean())), float(np.sqrt((off[good] ** 2).mean()))


def camera_positions() -> Array:
    """Positions (41, 3) in mm of the session of 2022."""
    with (MACHINES / f"hangprinter_{SESSIONS[1]}.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))[1 : KNOWN + 1]
    return np.array([[float(v) for v in row[1:4]] for row in rows])
