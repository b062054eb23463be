"""The program as a whole: cold start, identification, a million rows."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from pkmcal_cli.workflow.calibrate import run_calibration
from pkmcal_cli.workflow.calibration import CalibrationRequest

from .predictions import MACHINES
from .timing import Effort, Line, children_time, side_by_side

_SQUARE = "x=200:700:{0},y=170:380:{0}"  # mm, `--grid` of the Triglide


def _run(*arguments: str) -> None:
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True, cwd=MACHINES.parent)


def start_lines(effort: Effort) -> list[Line]:
    """Cold start of `--help` and `check` against an empty program, and against the libraries that `check` needs."""
    machine = str(MACHINES / "triglide.yaml")
    times = side_by_side(
        {
            "pass": lambda: _run("-c", "pass"),
            "libraries": lambda: _run("-c", "import numpy, pydantic, typer, rich.console, yaml"),
            "help": lambda: _run("-m", "pkmcal_cli", "--help"),
            "check": lambda: _run("-m", "pkmcal_cli", "check", machine),
        },
        effort.rounds,
        children_time,
    )
    note = f"`python -c pass` {1e3 * times.median('pass'):.0f} ms"
    return [
        Line("`pkmcal --help` : `python -c pass`", times.ratio("help", "pass"), 8, note=note),
        Line("`pkmcal check triglide.yaml` : `python -c pass`", times.ratio("check", "pass"), 45, note=note),
        Line("`pkmcal check triglide.yaml` : its libraries alone", times.ratio("check", "libraries")),
    ]


def calibration_line(effort: Effort) -> Line:
    """`calibrate` on the Scissors from files to the report, inside the process."""
    machine, measured = str(MACHINES / "scissors.yaml"), str(MACHINES / "scissors.csv")
    request = CalibrationRequest(machine=machine, measurements=(measured,), quiet=True)

    def calibrate() -> None:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            if run_calibration(request) != 0:
                raise RuntimeError("calibrate failed")

    times = side_by_side({"calibrate": calibrate}, effort.rounds)
    what = "`calibrate` on the Scissors, 80 points and 9 parameters, with held-out error"
    return Line(what, times.median("calibrate"), 0.3, unit="s")


def million_lines(effort: Effort) -> list[Line]:
    """`simulate` of a million rows on the Triglide, and of a quarter of them: time per row and peak memory."""
    side = effort.rows(500)
    quarter, _ = _simulate(side)
    whole, memory = _simulate(2 * side)
    what = f"`simulate` of {4 * side**2} rows on the Triglide"
    return [
        Line(f"{what}: time per row, against {side**2} rows", whole / quarter / 4, 1.2, note=f"{whole:.0f} s in total"),
        Line(f"{what}: peak memory", memory, 1024, unit="MiB"),
    ]


def _simulate(side: int) -> tuple[float, float]:
    """Processor time, s, and peak memory, MiB, of a grid of `side` by `side` positions."""
    with tempfile.TemporaryDirectory() as folder:
        grid, target = _SQUARE.format(side), str(Path(folder) / "out.csv")
        command = [sys.executable, "-m", "pkmcal_cli", "simulate", str(MACHINES / "triglide.yaml")]
        process = subprocess.Popen([*command, "--grid", grid, "-q", "-o", target], cwd=MACHINES.parent)
        _, status, usage = os.wait4(process.pid, 0)
        if os.waitstatus_to_exitcode(status) not in (0, 1):
            raise RuntimeError("simulate failed")
        return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024
